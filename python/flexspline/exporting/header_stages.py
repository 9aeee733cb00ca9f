"""The stages of a chain as C++ constants, with their units.

Stages, and the numbers that they are set up with, are those that the core lists.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from flexspline import _core
from flexspline.errors import InputError
from flexspline.exporting.cpp_text import comment, gear_text, identifier, literal

__all__ = ["STAGES", "Choice", "Field", "Stage", "given", "stage_lines", "stages_in"]

Entry = Mapping[str, Any]

SMALLEST = float.fromhex("0x1p-126")  # the smallest float with all its digits
INDENT = "\n" + " " * 6
END = "\n" + " " * 2


@dataclass(frozen=True)
class Field:
    """A number of a stage, or a list of them (`flexspline/fields.hpp`).

    Parameters
    ----------
    name : of the member in the core.
    unit : in words.
    key : in `model.json`; two fields of one key are the two numbers of its list.
    place : 0 or 1 in that list; None where the key is the field's own.
    default : what it is where nothing is given; None for a list.
    """

    name: str
    unit: str
    key: str
    place: int | None
    default: float | None


@dataclass(frozen=True)
class Choice:
    """What a chain chooses between its stages, by a word under `key` in an entry.

    `member` of the chain and `type` of its values in C++, `prefix` of the word in a block.
    """

    key: str
    member: str
    type: str
    prefix: str


@dataclass(frozen=True)
class Stage:
    """A stage of the core's chain (`flexspline/estimators/stages.hpp`).

    Parameters
    ----------
    key : of the stage.
    within : of the entry in `model.json` that holds its numbers.
    member, type : of the chain in C++; the type says {key} for the length of that list.
    rules : key in the entry and C++ type of each rule that a program is compiled for.
    fields : its numbers, in the core's order.
    choice : what the chain chooses by its entry, or None.
    """

    key: str
    within: str
    member: str
    type: str
    rules: tuple[tuple[str, str], ...]
    fields: tuple[Field, ...]
    choice: Choice | None


def _fields(known: list[dict[str, Any]]) -> tuple[Field, ...]:
    keys = [one["key"] for one in known]
    return tuple(
        Field(
            one["name"],
            one["unit"],
            one["key"],
            keys[:number].count(one["key"]) if keys.count(one["key"]) == 2 else None,
            one.get("default"),
        )
        for number, one in enumerate(known)
    )


STAGES: Mapping[str, Stage] = {
    key: Stage(
        key,
        one["within"],
        one["member"],
        one["type"],
        tuple((rule["name"], rule["type"]) for rule in one["rules"]),
        _fields(one["fields"]),
        Choice(**one["choice"]) if one["choice"] else None,
    )
    for key, one in _core.stages().items()
}
"""By key, in the order of a chain's parameters."""


def stages_in(entries: Mapping[str, Entry]) -> Iterator[tuple[Stage, Entry | None]]:
    """Yield each stage whose entry is there, with what holds its numbers: None where it is not run.

    A loop is an entry of its own inside the compliance's; a merge runs by one of its two methods.
    """
    for stage in STAGES.values():
        entry = entries.get(stage.within)
        if entry is not None and stage.key != stage.within:
            runs = stage.key == entry.get("method", "logistic")
            entry = entry.get(stage.key, entry if runs else None)
        if stage.within in entries:
            yield stage, entry


def given(stage: Stage, entry: Entry) -> Iterator[tuple[Field, Any]]:
    """Yield each field of a stage with its value in an entry of `model.json`, None for no value."""
    for field in stage.fields:
        value = entry.get(field.key)
        yield field, value if value is None or field.place is None else value[field.place]


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
