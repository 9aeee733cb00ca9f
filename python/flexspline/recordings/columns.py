"""The columns of a recording with what their names say, and those of one joint among several.

Numbers say that one column is another's derivative, turns N times as far, or wraps. A velocity is
compared with a position by its integral, which neither noise nor quanta of either hurt much: p = f
· ∫v dt + p₀, and f is the ratio of their units.

The time of each row is a column and its unit, or the rate at which rows follow each other.
"""

from __future__ import annotations

import math
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
from flexspline.recordings.words import Meaning, meaning

__all__ = [
    "EXPLAINED",
    "SECONDS",
    "Clock",
    "Column",
    "Joints",
    "Ratio",
    "Told",
    "clock_of",
    "columns_of",
    "joined",
    "nice",
    "one_joint",
    "ratio_of",
    "ratio_to_integral",
]


Array = NDArray[np.float64]

JOINTS: Final = 3  # columns of one name but for a number, from which these are joints
NAMED: Final = r"(?<=\w)\[([^\[\]]*[^\W\d][^\[\]]*)\]"  # position[elbow]; not torque [Nm]
EARLY: Final = 0.5  # of the rows: what ends before has fewer samples than the others
APART: Final = 10.0
"""Times as far as the next joint, from which one alone moves: others are held, and move by what
their servos let them, which is a hundredth."""

EXPLAINED: Final = 0.98
"""Share of a column's variance from which it is taken for a multiple of the other: a position and
the integral of its own velocity share 0.999 in the measured logs, those of two joints 0 to 0.9."""

TURNS: Final = (2 * math.pi, 360.0, 1.0)  # rad, deg, rev
JUMP: Final = 0.9  # of the modulus: no step of a motion is as large

SECONDS: Final = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "day": 86_400.0}

USUAL: Final = (20.0, 20_000.0)
"""Hz at which joints are recorded: where a file does not state the unit of its time, the one under
which its rate lies here. Three decades, as far as the units are apart."""

SURE: Final = (50.0, 5000.0)  # Hz, inside of which another unit would be out of the usual
EPOCH: Final = (1.2e9, 2.5e9)  # seconds since 1970: of the years 2008 to 2049
ROUND: Final = 0.005  # by how much its rate may be off a round one
EVEN: Final = 0.25  # of the median step: what an unnamed clock may be off, mostly
EXCEL: Final = (36_000.0, 60_000.0)  # days since 1900: of the years 1998 to 2064


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
    """Return what is said of a column, without what is empty or said before."""
    return "; ".join(dict.fromkeys(part for part in parts if part))


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
            what = "has columns of one joint alone"
            if not any(column.says.name for column in columns):
                what = "its columns have no names, so that none is known to be a joint's"
            raise InputError(f"{label}: {what}; leave --joint out")
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


@dataclass(frozen=True)
class Ratio:
    """A column as a multiple of another, with the share of its variance that this explains."""

    factor: float
    explained: float

    @property
    def told(self) -> bool:
        """Whether the one is the other's multiple."""
        return self.explained >= EXPLAINED


def ratio_to_integral(time: Array, velocity: Array, position: Array) -> Ratio:
    """Return f of p = f · ∫v dt + p₀: rows without a value are left out, the trapezoid goes on."""
    there = np.isfinite(time) & np.isfinite(velocity) & np.isfinite(position)
    t, v, p = time[there], velocity[there], position[there]
    if len(t) < 3:
        return Ratio(math.nan, 0.0)
    travelled = np.concatenate([[0.0], np.cumsum(np.diff(t) * (v[1:] + v[:-1]) / 2)])
    return ratio_of(travelled, p)


def ratio_of(x: Array, y: Array) -> Ratio:
    """Return f of y = f · x + y₀ by least squares."""
    there = np.isfinite(x) & np.isfinite(y)
    x, y = x[there] - np.mean(x[there]), y[there] - np.mean(y[there])
    power, own = float(x @ x), float(y @ y)
    if not (power > 0 and own > 0 and math.isfinite(power) and math.isfinite(own)):
        return Ratio(math.nan, 0.0)
    factor = float(x @ y) / power
    return Ratio(factor, factor * float(x @ y) / own)


def modulus(values: Array) -> float | None:
    """Return the turn at which a position wraps, in its own unit, or None where it does not.

    A wrap is a step of nearly the whole range. The turn is 2π, 360, 1 or a power of two (of an
    encoder's counts) that is as large as the range.
    """
    there = values[np.isfinite(values)]
    if len(there) < 3:
        return None
    span = float(np.ptp(there))
    steps = np.abs(np.diff(there))
    if span <= 0 or not np.any(steps > JUMP * span) or np.mean(steps > 0.5 * span) > 0.05:
        return None
    counts = [2.0**bits for bits in range(8, 33)]
    near = [turn for turn in (*TURNS, *counts) if JUMP * turn < span < 1.02 * turn]
    return near[0] if near else None


def unwrapped(values: Array, turn: float | None) -> Array:
    """Return a position without the jumps at its modulus, NaN where it has none."""
    if turn is None:
        return values
    there = np.isfinite(values)
    whole = values.copy()
    whole[there] = np.unwrap(values[there], period=turn)
    return whole


def _step_of(time: Array) -> float:
    """Return the median step between rows, or NaN where fewer than 90 % of the steps go forward."""
    steps = np.diff(time[np.isfinite(time)])
    if len(steps) < 2 or np.mean(steps > 0) < 0.9:
        return math.nan
    return float(np.median(steps[steps > 0]))


@dataclass(frozen=True)
class Clock:
    """A column of time stamps with its unit, or a rate [Hz]; how it is known, and how surely."""

    column: Column | None = None
    unit: str | None = None
    rate: float | None = None
    reason: str = ""
    unsure: str = ""

    @property
    def step(self) -> float:
        """Seconds from row to row, or NaN where they are not known."""
        if self.rate is not None:
            return 1.0 / self.rate
        if self.column is None or self.column.values is None:
            return math.nan
        seconds = 1.0 if self.column.stamps else SECONDS[self.unit or "s"]
        return _step_of(self.column.values) * seconds


def clock_of(columns: Sequence[Column], preamble: Sequence[str]) -> Clock:
    """Return the clock of a recording, from its columns or from what its preamble says."""
    forward = [c for c in columns if c.values is not None and _step_of(c.values) > 0]
    named = [c for c in forward if c.says.quantity == "time" and c.says.role != "other"]
    stamped = [c for c in forward if c.stamps]
    step = _step_said(preamble)
    sure = [c for c in named if c.says.unit in SECONDS and not c.stamps]
    likeliest = next(iter((*sure, *stamped, *named)), None)
    if likeliest is not None:
        return _of_column(likeliest, step)
    if step is not None:
        return Clock(rate=1.0 / step, reason=f"the preamble says {1.0 / step:g} Hz")
    unnamed = [c for c in forward if c.says.quantity is None and _even(c)]
    if unnamed and unnamed[0].number <= 1:
        found = _of_column(unnamed[0], None)
        if nice(1.0 / found.step, ROUND) is None:
            return Clock()
        return replace(found, unsure=found.unsure or "its name says no time, but it grows evenly")
    return Clock()


def _even(column: Column) -> bool:
    assert column.values is not None
    step = _step_of(column.values)
    return bool(np.mean(np.abs(np.diff(column.values) / step - 1.0) < EVEN) > 0.8)


def _of_column(column: Column, step: float | None) -> Clock:
    assert column.values is not None
    if back := int(np.sum(np.diff(column.values) < 0)):
        return replace(_forward(column, step), unsure=f"it goes back {back} times: it may wrap")
    return _forward(column, step)


def _forward(column: Column, step: float | None) -> Clock:
    assert column.values is not None
    if column.stamps:
        return Clock(column, None, reason="dates and times of day, counted from the first")
    if column.says.unit in SECONDS:
        return Clock(column, column.says.unit, reason="its unit is stated")
    own, first = _step_of(column.values), abs(float(column.values[0]))
    if step is not None:
        unit = min(SECONDS, key=lambda name: abs(math.log(SECONDS[name] * own / step)))
        return Clock(column, unit, reason=f"the preamble says {1.0 / step:g} Hz")
    for unit in ("s", "ms", "us", "ns"):
        if EPOCH[0] < first * SECONDS[unit] < EPOCH[1]:
            return Clock(column, unit, reason=f"{unit} since 1970")
    if EXCEL[0] < first < EXCEL[1] and own < 1e-4:
        return Clock(column, "day", reason="days of a spreadsheet")
    usual = [u for u in ("s", "ms", "us", "ns") if USUAL[0] <= 1 / (own * SECONDS[u]) < USUAL[1]]
    unit = usual[0] if usual else "s"
    rate = 1.0 / (own * SECONDS[unit])
    unsure = (
        "" if SURE[0] <= rate <= SURE[1] else f"no unit is stated; in {unit} it is {rate:.4g} Hz"
    )
    return Clock(column, unit, reason=f"steps of {own:.6g}: in {unit} {rate:.4g} Hz", unsure=unsure)


NUMBER: Final = r"([-+]?\d+(?:[.,]\d+)?(?:[eE][-+]?\d+)?)"
STEP: Final = re.compile(
    r"(?:sampl\w*|cycle|abtast\w*|tast\w*|scan|time|delta)[\s_-]*"
    r"(?:time|period|intervall?|zeit|periode|step|x|schritt|increment|resolution)"
    rf"[\s\[(:;=,\t_]*(µs|us|ms|s|sec|ns)?[\s\])\"':;=,\t]*{NUMBER}\s*(µs|us|ms|ns|s\b)?",
    re.IGNORECASE,
)
RATE: Final = re.compile(
    r"(?:(?:sampl\w*|abtast\w*|scan|mess|record\w*|data)[\s_-]*)?(?:rate|frequen[cz]y?|freq)\b"
    rf"[\s\[(:;=,\t_]*(k?hz|s/s)?[\s\])\"':;=,\t]*{NUMBER}\s*(k?hz|s/s|1/s)?",
    re.IGNORECASE,
)


def _step_said(preamble: Sequence[str]) -> float | None:
    """Return the seconds from row to row that lines above the table state."""
    for line in preamble:
        if found := STEP.search(line):
            unit = (found[1] or found[3] or "s").lower().replace("µ", "u").replace("sec", "s")
            value = _number(found[2]) * SECONDS.get(unit, 1.0)
        elif found := RATE.search(line):
            kilo = 1000.0 if (found[1] or found[3] or "").lower().startswith("k") else 1.0
            value = 1.0 / (kilo * _number(found[2])) if _number(found[2]) > 0 else 0.0
        else:
            continue
        if 1.0 / USUAL[1] / 10 < value < 10.0 / USUAL[0]:
            return value
    return None


def _number(text: str) -> float:
    return float(text.replace(",", "."))


def nice(rate: float, within: float = 0.02) -> float | None:
    """Return the round rate [Hz] nearest to one that was measured, or None where none is near."""
    rounds = [m * 10.0**e for e in range(1, 5) for m in (1, 1.2, 1.25, 2, 2.4, 2.5, 3, 4, 5, 6, 8)]
    near = min(rounds, key=lambda each: abs(math.log(each / rate))) if rate > 0 else 0.0
    return near if near and abs(near / rate - 1) < within else None
