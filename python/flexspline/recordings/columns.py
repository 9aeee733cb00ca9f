"""The columns of a recording with what their names say, and those of one joint among several."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import InputError, did_you_mean, listed
from flexspline.logs.channels import CHANNELS
from flexspline.logs.table import Table
from flexspline.logs.units import is_stamp, seconds_of_stamps
from flexspline.recordings.physics import modulus, unwrapped
from flexspline.recordings.words import Meaning, meaning

__all__ = ["Column", "Joints", "Told", "columns_of", "joined", "one_joint"]

Array = NDArray[np.float64]

JOINTS: Final = 3  # columns of one name but for a number, from which these are joints
NAMED: Final = r"(?<=\w)\[([^\[\]]*[^\W\d][^\[\]]*)\]"  # position[elbow]; not torque [Nm]
EARLY: Final = 0.5  # of the rows: what ends before has fewer samples than the others
APART: Final = 10.0
"""Times as far as the next joint, from which one alone moves: others are held, and move by what
their servos let them, which is a hundredth."""


@dataclass(frozen=True)
class Told:
    """Unit, sign and scale of a column; without a unit it cannot be told."""

    unit: str | None
    sign: int = 1
    scale: float = 1.0
    reason: str = ""
    unsure: str = ""

    def but(self, *doubts: str) -> Told:
        """Return it with more that speaks against it."""
        return replace(self, unsure=joined(self.unsure, *doubts))


def joined(*parts: str) -> str:
    """Return what is said of a column, without what is empty."""
    return "; ".join(part for part in parts if part)


@dataclass(frozen=True, eq=False)
class Column:
    """A column of a table: its number, what its name says, its values; text has none.

    `turn` is where a position wraps, in the column's own unit, and `whole` the values without;
    `counts` is the unit of a position in counts; a `short` column ends long before the others: it
    has a clock of its own, and no values here.
    """

    number: int
    says: Meaning
    values: Array | None
    stamps: bool = False
    turn: float | None = None
    counts: Told | None = None
    short: bool = False

    @property
    def whole(self) -> Array:
        """Values without the jumps of a wrap, empty cells filled on a line; of text, none."""
        if self.values is None:
            return np.zeros(0)
        whole = unwrapped(self.values, self.turn)
        there = np.isfinite(whole)
        if there.all() or not there.any():
            return whole
        rows = np.arange(len(whole))
        return np.interp(rows, rows[there], whole[there])

    @property
    def moves(self) -> bool:
        """Whether there is more than one value in it."""
        return self.values is not None and len(self.values) > 1 and bool(np.ptp(self.whole) > 0)


ALL: Final = "all"
"""What is asked for in the place of a joint, where the map is to be one of all."""


@dataclass(frozen=True)
class Joints:
    """Columns of one joint and of none, and how the joint was chosen among others.

    `places`: names of the joint's columns, by number, with ``{joint}`` in the place of its own,
    where the map is to be one of all joints.
    """

    columns: tuple[Column, ...]
    others: frozenset[int] = field(default_factory=frozenset)
    joint: str | None = None
    reason: str = ""
    unsure: bool = False
    places: Mapping[int, str] = field(default_factory=dict)


def columns_of(table: Table) -> list[Column]:
    """Return all columns of a table.

    Where most have names of channels, their units are the channels' own; else "time" is a word.
    """
    names = table.names or tuple("" for _ in table.data)
    units = table.units or tuple(None for _ in table.data)
    ours = sum(name in CHANNELS for name in names) > len(names) / 2
    made = []
    for number, (name, unit) in enumerate(zip(names, units, strict=True)):
        says = meaning(name, unit, ours=ours)
        values, stamps = _values(table.column(number))
        short = values is not None and _ends_early(values)
        values = None if short else values
        turn = (
            None if values is None or says.quantity not in (None, "position") else modulus(values)
        )
        made.append(Column(number, says, values, stamps, turn, short=short))
    return made


def _ends_early(values: Array) -> bool:
    there = np.flatnonzero(np.isfinite(values))
    return len(there) > 0 and there[-1] < EARLY * len(values)


def _values(data: NDArray[Any]) -> tuple[Array | None, bool]:
    if data.dtype.kind in "biuf":
        return data.astype(np.float64), False
    if data.dtype.kind in "mM" and len(data):
        return (data - data[0]) / np.timedelta64(1, "s"), True
    if data.dtype.kind == "c" or not len(data):
        return None, False
    if is_stamp(data[0]):
        seconds = seconds_of_stamps(data)
        return seconds, seconds is not None
    import pandas

    values = pandas.to_numeric(pandas.Series(data, dtype=object), errors="coerce").to_numpy(
        np.float64
    )
    return (values, False) if np.mean(np.isfinite(values)) > 0.5 else (None, False)


def one_joint(columns: Sequence[Column], joint: str | None, file: str, label: str) -> Joints:
    """Return the columns of one joint, chosen by the caller, by its motion or by the file's name.

    Raises
    ------
    InputError
        Where the joint that is asked for is not there.
    """
    groups, every = _groups(columns), joint == ALL
    joint = None if every else joint
    if not groups:
        if joint is not None or every:
            raise InputError(f"{label}: has columns of one joint alone; leave --joint out")
        return Joints(tuple(columns))
    names = list(dict.fromkeys(name for group in groups.values() for name in group))
    if joint is not None and joint not in names:
        raise InputError(
            f"{label}: no joint '{joint}'{did_you_mean(joint, names)}; it has {listed(names)}"
        )
    chosen, reason, unsure = (joint, "as asked for", False) if joint else _chosen(groups, file)
    others = {
        column.number
        for group in groups.values()
        for name, column in group.items()
        if name != chosen
    }
    kept = tuple(column for column in columns if column.number not in others)
    if every:
        places = {g[chosen].number: _placed(stem, chosen, g[chosen].says.name)
                  for stem, g in groups.items() if chosen in g}  # fmt: skip
        said = f"joints {listed(names)}: units, signs and channels are those of joint {chosen}"
        return Joints(kept, frozenset(others), chosen, said, True, places)
    said = f"joint {chosen} of {listed(names)}: {reason}"
    return Joints(kept, frozenset(others), chosen, said, unsure)


def _placed(stem: str, joint: str, name: str) -> str:
    """Return the name of a joint's column with a place for the joint."""
    ends = (at.start() for at in re.finditer("#", stem))
    at = next(k for k in ends if f"{stem[:k]}{joint}{stem[k + 1 :]}" == name)
    return f"{stem[:at]}{{joint}}{stem[at + 1 :]}"


Group = dict[str, Column]


def _groups(columns: Sequence[Column]) -> dict[str, Group]:
    """Return columns whose names differ in a number, a bracket or one part of a path, by it."""
    found: dict[str, Group] = defaultdict(dict)
    for column in columns:
        for stem, name in _stems(column.says.name):
            found[stem].setdefault(name, column)
    motion = ("position", "velocity", "torque", "current")
    many = {
        stem: group
        for stem, group in found.items()
        if len(group) >= 2 and len({column.says.quantity for column in group.values()}) == 1
    }
    sets: dict[frozenset[str], dict[str, Group]] = defaultdict(dict)
    for stem, group in many.items():
        sets[frozenset(group)][stem] = group
    for names, groups in sets.items():
        quantities = {next(iter(group.values())).says.quantity for group in groups.values()}
        told = quantities & set(motion)
        if (len(names) >= JOINTS and told) or len(told) >= JOINTS - 1:
            return groups
    return {}


def _stems(name: str) -> list[tuple[str, str]]:
    stems = [
        (f"{name[: at.start()]}#{name[at.end() :]}", at[0]) for at in re.finditer(r"\d+", name)
    ]
    stems += [
        (f"{name[: at.start(1)]}#{name[at.end(1) :]}", at[1]) for at in re.finditer(NAMED, name)
    ]
    parts = re.split(r"([/.])", name)
    stems += [
        ("".join([*parts[:n], "#", *parts[n + 1 :]]), parts[n])
        for n in range(2, len(parts) - 2, 2)
        if parts[n] and not parts[n].isdigit()
    ]
    return stems


def _chosen(groups: dict[str, Group], file: str) -> tuple[str, str, bool]:
    """Return the joint that moves, else that of the file's name, else the one that moves most."""
    ways: dict[str, float] = {}
    for group in groups.values():
        for name, column in group.items():
            if column.says.quantity == "position" and column.says.role == "" and column.moves:
                ways[name] = max(ways.get(name, 0.0), float(np.ptp(column.whole)))
    names = list(next(iter(groups.values())))
    most = sorted(ways, key=lambda name: ways[name], reverse=True)
    if most and (len(most) == 1 or ways[most[0]] > APART * ways[most[1]]):
        return most[0], "the only one that moves", False
    named = re.search(r"(?:joint|axis|achse|gelenk|j|a)[ _-]?(\d+)", file.lower())
    if named and named[1] in names:
        return named[1], "by the name of the file; several move", True
    return (most or names)[0], "several move, and this one farthest; another by --joint", True
