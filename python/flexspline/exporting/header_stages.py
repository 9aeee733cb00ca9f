"""The stages of a chain as C++ constants, with their units."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from flexspline.errors import InputError
from flexspline.estimators.fields import STAGES, Choice, Field, Stage, given, stages_in
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
    for stage, entry in stages_in(entries):
        if entry is not None:
            yield _stage(stage, entry)
        if stage.choice is not None:
            yield _chosen(stage.choice, entries[stage.within])
    yield "};"


def _stage(stage: Stage, entry: Entry) -> str:
    """A field of a C++ type, a number on a line, then its rules."""
    lines = _numbers(stage, entry)
    if stage.key == "kalman":  # holds the logistic merge, for the weight of its motion
        motion = "".join(f"{INDENT}    {line}" for line in _numbers(STAGES["logistic"], entry))
        lines.insert(0, f".motion = {{{motion}{INDENT}}},")
    if "gear" in entry:
        lines.append(f".gear = {gear_text(entry['gear'])},")
    lines += [
        f".{rule} = flexspline::{made}::{identifier(entry[rule])}," for rule, made in stage.rules
    ]
    counts = {key: len(value) for key, value in entry.items() if isinstance(value, list)}
    made = stage.type.format(**counts)
    return f"  {made} {stage.member}{{{''.join(INDENT + line for line in lines)}{END}}};"


def _chosen(choice: Choice, entry: Entry) -> str:
    word = identifier(entry[choice.key])
    return f"  static constexpr auto {choice.member} = flexspline::{choice.type}::{word};"


def _numbers(stage: Stage, entry: Entry) -> list[str]:
    """The numbers of a stage that its entry gives, in the core's order."""
    return [
        _field(stage.within, field, value)
        for field, value in given(stage, entry)
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
