"""The stages of a chain as C++ constants, with their units."""

from __future__ import annotations

import dataclasses
import math
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from flexspline.errors import InputError
from flexspline.estimators import Thermistor
from flexspline.estimators.collision import MOST_BANDS
from flexspline.header_model import literal

__all__ = ["config_lines"]

SMALLEST = float.fromhex("0x1p-126")  # the smallest float with all its digits
CHAIN = "flexspline::Chain<S>"
ABSENT = "std::nullopt"
INDENT = "\n" + " " * 16
END = "\n" + " " * 12

UNITS = {
    "supply_voltage": "V",
    "divider_resistance": "ohm",
    "nominal_resistance": "ohm",
    "beta": "K",
    "nominal_temperature": "deg C",
    "reference_temperature": "deg C",
    "coefficients": "Nm/K^k, k from 1",
    "gradient": "Nm/K",
    "thermal_lag": "s",
    "sensitivity": "Nm/V",
    "zero": "Nm",
    "gain": "1/s",
    "mesh_stiffness": "Nm/rad at the output",
    "mesh_shape": "1/Nm",
    "load_width": "Nm",
    "heights": "rad at the output, of the width, its half, quarter and eighth",
    "alpha": "s/rad",
    "transition_velocity": "rad/s",
    "walk": "Nm/sqrt(s)",
    "negative": "Nm, by bands of speed",
    "positive": "Nm, by bands of speed",
    "speed_edges": "rad/s, between the bands",
    "hold": "s",
}

Entry = Mapping[str, Any]


def config_lines(entries: Mapping[str, Entry], has_sensor: bool) -> Iterator[str]:
    """A `Chain<S>::Config` with these stages; all others do not run."""
    observer, merge = entries.get("observer", {}), entries.get("merge", {})
    collision = entries.get("collision", {})
    kalman = merge.get("method") == "kalman"
    made = {
        "thermistor": _thermistor(entries),
        "compensation": _compensation(entries),
        "sensor": str(has_sensor).lower(),
        "calibration": _calibration(entries),
        "observer": _observer("observer", entries),
        "observer_input": f"flexspline::ObserverInput::{observer.get('input', 'sensor_torque')}",
        "compliance": _compliance(entries),
        "hysteresis": _hysteresis(entries),
        "compliant_observer": _observer("compliant_observer", entries),
        "logistic": ABSENT if kalman else _logistic(entries),
        "kalman": _kalman(entries) if kalman else ABSENT,
        "at_rest": f"flexspline::AtRest::{merge.get('at_rest', 'compliance')}",
        "collision": _collision(entries),
        "watched": f"flexspline::Watched::{collision.get('input', 'observer')}",
    }
    yield "        {"
    for name, value in made.items():
        yield f"            .{name} = {value},"
    yield "        },"


def _struct(made: str, fields: Sequence[str]) -> str:
    """A value of a C++ type, a field on a line."""
    return f"{made}{{{''.join(INDENT + field for field in fields)}{END}}}"


def _thermistor(entries: Mapping[str, Entry]) -> str:
    if "thermistor" not in entries:
        return ABSENT
    names = tuple(field.name for field in dataclasses.fields(Thermistor))
    return _struct("flexspline::Thermistor<S>", _numbers("thermistor", entries, names))


def _compensation(entries: Mapping[str, Entry]) -> str:
    key = "temperature_compensation"
    if key not in entries:
        return ABSENT
    fields = [
        *_numbers(key, entries, ("reference_temperature",)),
        _array(key, "coefficients", entries[key]["coefficients"]),
        *_numbers(key, entries, ("gradient", "thermal_lag")),
        *_range(key, entries[key].get("temperature_range"), "deg C"),
    ]
    return _struct(f"typename {CHAIN}::Compensation::Config", fields)


def _calibration(entries: Mapping[str, Entry]) -> str:
    key = "calibration"
    if key not in entries:
        return ABSENT
    known = _range(key, entries[key].get("voltage_range"), "V")
    fields = [*_numbers(key, entries, ("sensitivity", "zero")), *known]
    return _struct("flexspline::Calibration<S>", fields)


def _observer(key: str, entries: Mapping[str, Entry]) -> str:
    if key not in entries:
        return ABSENT
    rule = f".discretisation = flexspline::Discretisation::{entries[key]['discretisation']},"
    fields = [*_numbers(key, entries, ("gain",)), rule]
    return _struct(f"typename {CHAIN}::Observer::Config", fields)


def _compliance(entries: Mapping[str, Entry]) -> str:
    if "compliance" not in entries:
        return ABSENT
    names = ("mesh_stiffness", "mesh_shape", "margin")
    return _struct("flexspline::Compliance<S>", _numbers("compliance", entries, names))


def _hysteresis(entries: Mapping[str, Entry]) -> str:
    loop = entries.get("compliance", {}).get("hysteresis")
    if loop is None:
        return ABSENT
    key = "compliance"
    fields = [*_numbers(key, {key: loop}, ("load_width",)), _array(key, "heights", loop["heights"])]
    return _struct("flexspline::LoadHysteresis<S>", fields)


def _logistic(entries: Mapping[str, Entry]) -> str:
    if "merge" not in entries:
        return ABSENT
    fields = _numbers("merge", entries, ("alpha", "transition_velocity"))
    return _struct("flexspline::LogisticMerge<S>", fields)


def _kalman(entries: Mapping[str, Entry]) -> str:
    entry = entries["merge"]
    noises = {
        f"{name}_{state}": value
        for name in ("observer", "compliance")
        for state, value in zip(("rest", "motion"), entry[f"{name}_noise"], strict=True)
    }
    fields = [
        f".motion = {_logistic(entries)},",
        *_numbers("merge", entries, ("walk",)),
        *(_field("merge", name, value, "Nm") for name, value in noises.items()),
    ]
    return _struct(f"typename {CHAIN}::Kalman::Config", fields)


def _collision(entries: Mapping[str, Entry]) -> str:
    key = "collision"
    if key not in entries:
        return ABSENT
    entry = entries[key]
    edges = [*entry["speed_edges"], *[math.inf] * (MOST_BANDS - 1 - len(entry["speed_edges"]))]
    fields = [
        *(_array(key, name, entry[name]) for name in ("negative", "positive")),
        _array(key, "speed_edges", edges),
        *_numbers(key, entries, ("release", "hold")),
    ]
    return _struct(f"typename {CHAIN}::Detector::Config", fields)


def _numbers(key: str, entries: Mapping[str, Entry], names: Sequence[str]) -> list[str]:
    return [_field(key, name, entries[key][name], UNITS.get(name, "")) for name in names]


def _field(key: str, name: str, value: float, unit: str) -> str:
    return f".{name} = {_number(key, name, value)},{f'  // {unit}' if unit else ''}"


def _array(key: str, name: str, values: Sequence[float]) -> str:
    text = ", ".join(_number(key, name, value) for value in values)
    lines = textwrap.wrap(text, 48, break_long_words=False)
    return f".{name} = {{{{{(INDENT + '    ').join(lines)}}}}},  // {UNITS[name]}"


def _range(key: str, ends: Sequence[float] | None, unit: str) -> list[str]:
    if ends is None:
        return []
    pairs = zip(("low", "high"), ends, strict=True)
    return [_field(key, name, value, unit) for name, value in pairs]


def _number(key: str, name: str, value: float) -> str:
    """A literal; a value that a float cannot hold is refused by its name."""
    if value == math.inf:
        return "std::numeric_limits<S>::infinity()"
    if value != 0.0 and abs(value) < SMALLEST:
        raise InputError(
            f"the estimator {key} cannot run on a device: {name} = {value:g} vanishes in a "
            "float; fit it again"
        )
    return literal(value, f"the estimator {key} cannot run on a device: {name}")
