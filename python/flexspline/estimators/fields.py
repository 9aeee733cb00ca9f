"""The stages of a chain and the numbers that they are set up with, as the core lists them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from flexspline import _core

__all__ = ["STAGES", "Choice", "Field", "Stage", "given", "stages_in"]

Entry = Mapping[str, Any]


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
