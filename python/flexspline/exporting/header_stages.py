"""The stages of a chain as C++ constants, with their units."""

from __future__ import annotations

import dataclasses
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from flexspline.errors import InputError
from flexspline.estimators import Thermistor
from flexspline.exporting.cpp_text import comment, gear_text, identifier, literal

__all__ = ["stage_lines"]

SMALLEST = float.fromhex("0x1p-126")  # the smallest float with all its digits
INDENT = "\n" + " " * 6
END = "\n" + " " * 2

UNITS = {
    "least_voltage": "V of the bridge",
    "most_voltage": "V of the bridge",
    "least_thermistor_voltage": "V",
    "most_thermistor_voltage": "V",
    "least_temperature": "deg C",
    "most_temperature": "deg C",
    "most_sensor_torque": "Nm",
    "most_motor_torque": "Nm at the motor's shaft",
    "most_speed": "rad/s",
    "most_acceleration": "rad/s^2",
    "way": "rad at the output",
    "twist": "rad at the motor",
    "forget": "1/s",
    "apart": "Nm",
    "bandwidth": "Hz, -3 dB",
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

# Of the checks, in the order of the core's fields.
LIMITS = (
    "most_sensor_torque",
    "most_motor_torque",
    "most_speed",
    "most_acceleration",
    "way",
    "twist",
    "forget",
    "apart",
)

Entry = Mapping[str, Any]


def stage_lines(name: str, entries: Mapping[str, Entry], has_sensor: bool) -> Iterator[str]:
    """A struct of these stages as its fields; all others are absent and cost nothing."""
    yield "template <typename S>"
    yield f"struct {name} : flexspline::NoStages<S> {{"
    if has_sensor:
        yield "  static constexpr bool sensor = true;"
    for key, made in MADE.items():
        if key in entries:
            yield from made(entries)
    yield "};"


def _stage(made: str, field: str, numbers: Sequence[str]) -> str:
    """A field of a C++ type, a number on a line."""
    return f"  {made} {field}{{{''.join(INDENT + number for number in numbers)}{END}}};"


def _rule(field: str, made: str, value: str) -> str:
    return f"  static constexpr auto {field} = flexspline::{made}::{identifier(value)};"


def _checks(entries: Mapping[str, Entry]) -> Iterator[str]:
    key = "reading_checks"
    entry = entries[key]
    numbers = [
        _field(key, f"{side}_{name}", value, UNITS[f"{side}_{name}"])
        for name in ("voltage", "thermistor_voltage", "temperature")
        for side, value in zip(("least", "most"), entry.get(f"{name}_range", ()), strict=False)
    ]
    numbers += _numbers(key, entries, [name for name in LIMITS if name in entry])
    if "gear" in entry:
        numbers.append(f".gear = {gear_text(entry['gear'])},")
    yield _stage("typename flexspline::ReadingChecks<S>::Config", "checks", numbers)


def _differentiator(entries: Mapping[str, Entry]) -> Iterator[str]:
    key = "differentiator"
    rule = f".makes = flexspline::Derivatives::{identifier(entries[key]['makes'])},"
    numbers = [*_numbers(key, entries, ("bandwidth",)), rule]
    yield _stage("typename flexspline::Differentiator<S>::Config", key, numbers)


def _thermistor(entries: Mapping[str, Entry]) -> Iterator[str]:
    names = tuple(field.name for field in dataclasses.fields(Thermistor))
    numbers = _numbers("thermistor", entries, names)
    yield _stage("flexspline::Thermistor<S>", "thermistor", numbers)


def _compensation(entries: Mapping[str, Entry]) -> Iterator[str]:
    key = "temperature_compensation"
    coefficients = entries[key]["coefficients"]
    numbers = [
        *_numbers(key, entries, ("reference_temperature",)),
        _array(key, "coefficients", coefficients),
        *_numbers(key, entries, ("gradient", "thermal_lag")),
        *_range(key, entries[key].get("temperature_range"), "deg C"),
    ]
    made = f"typename flexspline::TemperatureCompensation<S, {len(coefficients)}>::Config"
    yield _stage(made, "compensation", numbers)


def _calibration(entries: Mapping[str, Entry]) -> Iterator[str]:
    key = "calibration"
    known = _range(key, entries[key].get("voltage_range"), "V")
    numbers = [*_numbers(key, entries, ("sensitivity", "zero")), *known]
    yield _stage("flexspline::Calibration<S>", "calibration", numbers)


def _any_observer(key: str, entries: Mapping[str, Entry]) -> str:
    how = identifier(entries[key]["discretisation"])
    rule = f".discretisation = flexspline::Discretisation::{how},"
    numbers = [*_numbers(key, entries, ("gain",)), rule]
    return _stage("typename flexspline::MomentumObserver<S>::Config", key, numbers)


def _observer(entries: Mapping[str, Entry]) -> Iterator[str]:
    yield _any_observer("observer", entries)
    yield _rule("observer_input", "ObserverInput", entries["observer"]["input"])


def _compliant_observer(entries: Mapping[str, Entry]) -> Iterator[str]:
    yield _any_observer("compliant_observer", entries)


def _compliance(entries: Mapping[str, Entry]) -> Iterator[str]:
    key = "compliance"
    names = ("mesh_stiffness", "mesh_shape", "margin")
    yield _stage("flexspline::Compliance<S>", key, _numbers(key, entries, names))
    loop = entries[key].get("hysteresis")
    if loop is not None:
        width = _numbers(key, {key: loop}, ("load_width",))
        numbers = [*width, _array(key, "heights", loop["heights"])]
        yield _stage("flexspline::LoadHysteresis<S>", "hysteresis", numbers)


def _merge(entries: Mapping[str, Entry]) -> Iterator[str]:
    entry = entries["merge"]
    numbers = _numbers("merge", entries, ("alpha", "transition_velocity"))
    if entry.get("method") == "kalman":
        noises = {
            f"{name}_{state}": value
            for name in ("observer", "compliance")
            for state, value in zip(("rest", "motion"), entry[f"{name}_noise"], strict=True)
        }
        numbers = [
            f".motion = {{{''.join(INDENT + '    ' + number for number in numbers)}{INDENT}}},",
            *_numbers("merge", entries, ("walk",)),
            *(_field("merge", name, value, "Nm") for name, value in noises.items()),
        ]
        yield _stage("typename flexspline::KalmanMerge<S>::Config", "kalman", numbers)
    else:
        yield _stage("flexspline::LogisticMerge<S>", "logistic", numbers)
    yield _rule("at_rest", "AtRest", entry.get("at_rest", "compliance"))


def _collision(entries: Mapping[str, Entry]) -> Iterator[str]:
    key = "collision"
    entry = entries[key]
    edges = entry["speed_edges"]
    numbers = [
        *(_array(key, name, entry[name]) for name in ("negative", "positive")),
        *([_array(key, "speed_edges", edges)] if edges else []),
        *_numbers(key, entries, ("release", "hold")),
    ]
    made = f"typename flexspline::CollisionDetector<S, {len(edges) + 1}>::Config"
    yield _stage(made, key, numbers)
    yield _rule("watched", "Watched", entry["input"])


MADE: Mapping[str, Callable[[Mapping[str, Entry]], Iterator[str]]] = {
    "reading_checks": _checks,
    "differentiator": _differentiator,
    "thermistor": _thermistor,
    "temperature_compensation": _compensation,
    "calibration": _calibration,
    "observer": _observer,
    "compliance": _compliance,
    "compliant_observer": _compliant_observer,
    "merge": _merge,
    "collision": _collision,
}


def _numbers(key: str, entries: Mapping[str, Entry], names: Sequence[str]) -> list[str]:
    return [_field(key, name, entries[key][name], UNITS.get(name, "")) for name in names]


def _field(key: str, name: str, value: float, unit: str) -> str:
    return f".{name} = {_number(key, name, value)},{f'  // {comment(unit)}' if unit else ''}"


def _array(key: str, name: str, values: Sequence[float]) -> str:
    text = ", ".join(_number(key, name, value) for value in values)
    lines = textwrap.wrap(text, 48, break_long_words=False)
    return f".{name} = {{{{{(INDENT + '    ').join(lines)}}}}},  // {comment(UNITS[name])}"


def _range(key: str, ends: Sequence[float] | None, unit: str) -> list[str]:
    if ends is None:
        return []
    pairs = zip(("low", "high"), ends, strict=True)
    return [_field(key, name, value, unit) for name, value in pairs]


def _number(key: str, name: str, value: float) -> str:
    """A literal; a value that a float cannot hold is refused by its name."""
    if value != 0.0 and abs(value) < SMALLEST:
        raise InputError(
            f"the estimator {key} cannot run on a device: {name} = {value:g} vanishes in a "
            "float; fit it again"
        )
    return literal(value, f"the estimator {key} cannot run on a device: {name}")
