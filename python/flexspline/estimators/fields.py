"""The numbers that a stage of the core is set up with, as the core lists them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from flexspline import _core

__all__ = ["FIELDS", "Field", "given"]


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


def _listed(known: list[dict[str, Any]]) -> tuple[Field, ...]:
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


FIELDS: Mapping[str, tuple[Field, ...]] = {
    stage: _listed(known) for stage, known in _core.stage_fields().items()
}


def given(stage: str, entry: Mapping[str, Any]) -> Iterator[tuple[Field, Any]]:
    """Yield each field of a stage with its value in an entry of `model.json`, None for no value."""
    for field in FIELDS[stage]:
        value = entry.get(field.key)
        yield field, value if value is None or field.place is None else value[field.place]
