"""Column maps of a robot: a column of each joint, with a place for its name.

A source such as ``q_{joint}`` or ``q[:, {joint}]`` stands for a column of every joint, with the
name of the joint in the place. A joint that is called by a number may be counted otherwise by the
file: ``q[:, {joint-1}]``. A source that is nothing but the place is the column of that number, from
0: ``{joint+6}`` of joint 1 is column 7 of a file without names.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

from flexspline.errors import InputError, listed
from flexspline.logs.columns import ColumnSource, ColumnSpec

__all__ = [
    "columns_of_joint",
    "goes_by_number",
    "has_places",
    "joints_among",
    "joints_in",
    "placed_joint",
]

PLACE: Final = re.compile(r"\{joint(?:\s*([+-])\s*(\d+))?\}")

Columns = Mapping[str, ColumnSpec]


def has_places(columns: Columns | None) -> bool:
    """Whether a map stands for several joints."""
    return any(PLACE.search(text) for text in _texts(columns))


def goes_by_number(columns: Columns | None) -> bool:
    """Whether all places of a map are the numbers of columns, which tell no joints."""
    return all(PLACE.fullmatch(text) for text in _texts(columns) if PLACE.search(text))


def columns_of_joint(columns: Columns | None, joint: str, label: str) -> dict[str, ColumnSpec]:
    """Return the map of one joint.

    Raises
    ------
    InputError
        Where no column has a place for the joint, or a place counts a joint that is no number.
    """
    if not has_places(columns):
        raise InputError(
            f"{label}: joint {joint} is asked for, and no column of the map has a place for it; "
            "write sources such as 'q_{joint}', or let flexspline init --joint all write them"
        )
    return {
        name: _with_text(spec, placed_joint(_text(spec), joint, label))
        for name, spec in (columns or {}).items()
    }


def placed_joint(text: str, joint: str, label: str) -> str | int:
    """Return a source with a joint in its places; a number where it is nothing but a place.

    Raises
    ------
    InputError
        Where a place counts, and the joint is no number.
    """

    def name(place: re.Match[str]) -> str:
        if place[1] is None:
            return joint
        if not joint.isdecimal():
            raise InputError(
                f"{label}: '{text}' counts joints, and joint '{joint}' is no number; write "
                "{joint} alone"
            )
        return str(int(joint) + int(place[1] + place[2]))

    made = PLACE.sub(name, text)
    return int(made) if PLACE.fullmatch(text) and made.isdecimal() else made


def joints_among(names: Sequence[str], columns: Columns | None, label: str) -> tuple[str, ...]:
    """Return the joints of which a file has every column that the map has a place in.

    Parameters
    ----------
    names : of the columns of the file, in whose order the joints are.
    columns : a map with places.

    Raises
    ------
    InputError
        Where the map has no places or goes by numbers alone, and where there is no such joint.
    """
    texts = [text for text in _texts(columns) if PLACE.search(text)]
    named = [text for text in texts if not PLACE.fullmatch(text)]
    if not named:
        why = "goes by the numbers of columns" if texts else "has no place {joint}"
        raise InputError(
            f"{label}: which joints there are is not told, for the map {why}; name them, such as "
            "--joint 1,2,3, or give each a section [joints.1] in the map"
        )
    found = [joints_in(names, text) for text in named]
    every = tuple(joint for joint in found[0] if all(joint in others for others in found))
    if not every:
        raise InputError(
            f"{label}: no joint has all of the columns {listed(named)}; the file has "
            f"{listed(names)}"
        )
    return every


def joints_in(names: Sequence[str], text: str) -> list[str]:
    """Names of joints that, in the place of a source, make the name of a column."""
    place = PLACE.search(text)
    if place is None:
        return []
    pattern = re.escape(text[: place.start()]) + r"(\w+?)" + re.escape(text[place.end() :])
    found = [match[1] for name in names if (match := re.fullmatch(pattern, name))]
    if place[1] is None:
        return found
    step = int(place[1] + place[2])
    return [str(int(number) - step) for number in found if number.isdecimal()]


def _text(spec: Any) -> str:
    """Return the source of a column as text."""
    if isinstance(spec, Mapping):
        return str(spec.get("source", ""))
    if isinstance(spec, ColumnSource):
        return str(spec.source)
    return str(spec[0] if isinstance(spec, (tuple, list)) and spec else spec)


def _texts(columns: Columns | None) -> list[str]:
    return [_text(spec) for spec in (columns or {}).values()]


def _with_text(spec: ColumnSpec, source: str | int) -> ColumnSpec:
    """Return a column with another source; as it is where that is the same."""
    if str(source) == _text(spec):
        return spec
    if isinstance(spec, Mapping):
        return {**spec, "source": source}
    if isinstance(spec, ColumnSource):
        return replace(spec, source=source)
    return (source, spec[1]) if isinstance(spec, tuple) else source
