"""The stages of a chain as C++ constants, with their units."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from flexspline.errors import InputError
from flexspline.estimators.fields import Field, given
from flexspline.exporting.cpp_text import comment, gear_text, identifier, literal

__all__ = ["stage_lines"]

SMALLEST = float.fromhex("0x1p-126")  # the smallest float with all its digits
INDENT = "\n" + " " * 6
END = "\n" + " " * 2

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
    entry = entries["reading_checks"]
    numbers = _numbers("reading_checks", entry)
    if "gear" in entry:
        numbers.append(f".gear = {gear_text(entry['gear'])},")
    yield _stage("typename flexspline::ReadingChecks<S>::Config", "checks", numbers)


def _differentiator(entries: Mapping[str, Entry]) -> Iterator[str]:
    key = "differentiator"
    rule = f".makes = flexspline::Derivatives::{identifier(entries[key]['makes'])},"
    numbers = [*_numbers(key, entries[key]), rule]
    yield _stage("typename flexspline::Differentiator<S>::Config", key, numbers)


def _thermistor(entries: Mapping[str, Entry]) -> Iterator[str]:
    numbers = _numbers("thermistor", entries["thermistor"])
    yield _stage("flexspline::Thermistor<S>", "thermistor", numbers)


def _compensation(entries: Mapping[str, Entry]) -> Iterator[str]:
    key = "temperature_compensation"
    degree = len(entries[key]["coefficients"])
    made = f"typename flexspline::TemperatureCompensation<S, {degree}>::Config"
    yield _stage(made, "compensation", _numbers(key, entries[key]))


def _calibration(entries: Mapping[str, Entry]) -> Iterator[str]:
    numbers = _numbers("calibration", entries["calibration"])
    yield _stage("flexspline::Calibration<S>", "calibration", numbers)


def _any_observer(key: str, entries: Mapping[str, Entry]) -> str:
    how = identifier(entries[key]["discretisation"])
    rule = f".discretisation = flexspline::Discretisation::{how},"
    numbers = [*_numbers(key, entries[key], "observer"), rule]
    return _stage("typename flexspline::MomentumObserver<S>::Config", key, numbers)


def _observer(entries: Mapping[str, Entry]) -> Iterator[str]:
    yield _any_observer("observer", entries)
    yield _rule("observer_input", "ObserverInput", entries["observer"]["input"])


def _compliant_observer(entries: Mapping[str, Entry]) -> Iterator[str]:
    yield _any_observer("compliant_observer", entries)


def _compliance(entries: Mapping[str, Entry]) -> Iterator[str]:
    key = "compliance"
    yield _stage("flexspline::Compliance<S>", key, _numbers(key, entries[key]))
    loop = entries[key].get("hysteresis")
    if loop is not None:
        numbers = _numbers(key, loop, "hysteresis")
        yield _stage("flexspline::LoadHysteresis<S>", "hysteresis", numbers)


def _merge(entries: Mapping[str, Entry]) -> Iterator[str]:
    entry = entries["merge"]
    numbers = _numbers("merge", entry, "logistic")
    if entry.get("method") == "kalman":
        numbers = [
            f".motion = {{{''.join(INDENT + '    ' + number for number in numbers)}{INDENT}}},",
            *_numbers("merge", entry, "kalman"),
        ]
        yield _stage("typename flexspline::KalmanMerge<S>::Config", "kalman", numbers)
    else:
        yield _stage("flexspline::LogisticMerge<S>", "logistic", numbers)
    yield _rule("at_rest", "AtRest", entry.get("at_rest", "compliance"))


def _collision(entries: Mapping[str, Entry]) -> Iterator[str]:
    key = "collision"
    bands = len(entries[key]["speed_edges"]) + 1
    made = f"typename flexspline::CollisionDetector<S, {bands}>::Config"
    yield _stage(made, key, _numbers(key, entries[key]))
    yield _rule("watched", "Watched", entries[key]["input"])


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


def _numbers(key: str, entry: Entry, stage: str | None = None) -> list[str]:
    """The numbers of a stage that an estimator's entry gives, in the core's order."""
    return [
        _field(key, field, value)
        for field, value in given(stage or key, entry)
        if value is not None and value != []
    ]


def _field(key: str, field: Field, value: float | Sequence[float]) -> str:
    unit = f"  // {comment(field.unit)}" if field.unit else ""
    if isinstance(value, Sequence):
        text = ", ".join(_number(key, field.name, one) for one in value)
        lines = textwrap.wrap(text, 48, break_long_words=False)
        return f".{field.name} = {{{{{(INDENT + '    ').join(lines)}}}}},{unit}"
    return f".{field.name} = {_number(key, field.name, value)},{unit}"


def _number(key: str, name: str, value: float) -> str:
    """A literal; a value that a float cannot hold is refused by its name."""
    if value != 0.0 and abs(value) < SMALLEST:
        raise InputError(
            f"the estimator {key} cannot run on a device: {name} = {value:g} vanishes in a "
            "float; fit it again"
        )
    return literal(value, f"the estimator {key} cannot run on a device: {name}")
