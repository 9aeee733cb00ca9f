"""Units of a motion that nothing states: the other columns tell them.

A velocity's integral is the position, in units of both; a position wraps at its turn; an encoder
has so many counts in a turn.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from flexspline.recordings.clock import nice
from flexspline.recordings.columns import Array, Column, Told, joined
from flexspline.recordings.physics import Ratio, ratio_to_integral
from flexspline.recordings.said import Said

__all__ = [
    "RADIANS",
    "RADIANS_PER_SECOND",
    "TOLERANCE",
    "UNSTATED",
    "SideUnits",
    "radians",
    "units_of_side",
    "with_resolutions",
]

TOLERANCE: Final = 0.03
"""By how much a ratio of units may be off its value: two units of angle or velocity are at least a
factor of 6 apart, rad and turns, but with a gear between them they may come within 5 %: mrad/s of
an output at 100:1, and rpm of its motor."""

RADIANS: Final = {"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180, "rev": 2 * math.pi}
RADIANS_PER_SECOND: Final = {
    "rad/s": 1.0,
    "deg/s": math.pi / 180,
    "rpm": math.pi / 30,
    "rev/s": 2 * math.pi,
    "mrad/s": 1e-3,
}
UNSTATED: Final = (("rad", "deg", "rev"), ("rad/s", "deg/s", "rpm", "rev/s"))
"""Units of angles and velocities that a recorder leaves unsaid."""
TURN: Final = {2 * math.pi: "rad", 360.0: "deg", 1.0: "rev"}
RESOLUTIONS: Final = tuple(
    sorted(
        {*(2**bits for bits in range(8, 25)), *(500 * m for m in (1, 2, 4, 5, 8, 10, 16, 20, 40))}
    )
)
"""Counts per turn: powers of two, and lines of optical encoders and four times as many."""
COUNTED: Final = 400  # whole numbers over a range wider than a turn in degrees are counts
FAR: Final = 4 * math.pi  # rad that an output seldom turns: a wider range is one in degrees


@dataclass(frozen=True)
class SideUnits:
    """Units of one side's position and velocity; a rate [Hz] where only they tell it."""

    position: Told
    velocity: Told
    rate: float | None = None


def with_resolutions(columns: Sequence[Column], said: Said, time: Array) -> list[Column]:
    """Return the columns, positions in counts with their counts per turn as far as these are told.

    The file may state them, the position wrap at them, or a velocity with a unit measure them.
    """
    velocities = [
        c for c in columns if c.says.unit in RADIANS_PER_SECOND and c.moves and not c.stamps
    ]
    return [
        _with_resolution(column, said, velocities, time) if _in_counts(column) else column
        for column in columns
    ]


def _in_counts(column: Column) -> bool:
    if column.values is None or column.says.quantity != "position":
        return False
    return column.says.unit == "counts" or (column.says.unit is None and _are_counts(column))


def _are_counts(column: Column) -> bool:
    whole = column.whole
    return bool(np.ptp(whole) > COUNTED and np.all(whole == np.round(whole)))


def _with_resolution(
    column: Column, said: Said, velocities: Sequence[Column], time: Array
) -> Column:
    stated = said.resolution_of(column.says.name)
    if stated is not None:
        doubt = "" if stated.sure else "pulses of an encoder are taken for four counts each"
        return replace(column, counts=Told("rev", 1, 1 / stated.counts, "counts as stated", doubt))
    if column.turn is not None and column.turn not in TURN:
        unsure = "counts per turn are not stated"
        told = Told("rev", 1, 1 / column.turn, f"wraps at {column.turn:.0f} counts", unsure)
        return replace(column, counts=told)
    for velocity in velocities:
        pair = ratio_to_integral(time, velocity.whole, column.whole)
        if not pair.told:
            continue
        measured = abs(pair.factor) * 2 * math.pi / RADIANS_PER_SECOND[str(velocity.says.unit)]
        near = min(RESOLUTIONS, key=lambda each: abs(math.log(each / measured)))
        if abs(near / measured - 1) < TOLERANCE:
            why = f"{measured:.5g} counts per turn by the velocity"
            told = Told("rev", 1, 1 / near, why, "counts per turn are not stated")
            return replace(column, counts=told)
    none = Told(None, unsure="counts of an encoder whose counts per turn are not stated")
    return replace(column, counts=none)


def radians(column: Column) -> float | None:
    """Return how many radians one of a position's own units is, or None where it is not known."""
    told = _position_unit(column)
    return None if told.unit is None else RADIANS[told.unit] * told.scale


def _position_unit(column: Column) -> Told:
    """Return the unit of a position as it is stated, or as the turn at which it wraps tells it."""
    if column.says.unit in RADIANS:
        return Told(column.says.unit, reason="its unit is stated")
    if column.counts is not None:
        return column.counts
    if column.turn in TURN:
        return Told(TURN[column.turn], reason=f"wraps at {column.turn:.4g}")
    return Told(None)


def units_of_side(
    side: str, position: Column | None, velocity: Column | None, time: Array, timed: bool
) -> SideUnits:
    """Return the units of a position and its velocity; `timed`: whether the time is in seconds."""
    p = Told(None) if position is None else _position_unit(position)
    v = Told(None) if velocity is None else _velocity_unit(velocity)
    if position is None or velocity is None:
        return SideUnits(_alone(p, position, side), v if v.unit else _assumed("rad/s"))
    pair = ratio_to_integral(time, velocity.whole, position.whole)
    if not pair.told:
        doubt = "its integral is not the position" if position.moves and velocity.moves else ""
        v = v if v.unit else _assumed("rad/s")
        return SideUnits(_alone(p, position, side), v.but(doubt))
    size, sign = abs(pair.factor), 1 if pair.factor > 0 else -1
    if velocity.says.unit == "erpm":
        p = _alone(p, position, side)
        return SideUnits(p, _electrical(p, size, sign))
    if not timed:
        return _with_rate(_alone(p, position, side), v if v.unit else _assumed("rad/s"), size, sign)
    return _together(p, v, side, position, pair)


def _velocity_unit(velocity: Column) -> Told:
    if velocity.says.unit in RADIANS_PER_SECOND:
        return Told(velocity.says.unit, reason="its unit is stated")
    if velocity.says.unit == "erpm":
        return Told("rpm", unsure="electrical; divide by the motor's pole pairs, by scale=")
    return Told(None)


def _together(p: Told, v: Told, side: str, position: Column, pair: Ratio) -> SideUnits:
    """Return both units, where the velocity's integral is the position times a factor."""
    size, sign = abs(pair.factor), 1 if pair.factor > 0 else -1
    turned = "" if sign > 0 else "against the position in the file"
    if p.unit is None and p.unsure:  # counts whose number in a turn nothing tells
        v = v if v.unit else _assumed("rad/s")
        return SideUnits(p, replace(v, sign=sign, reason=joined(v.reason, turned)))
    fits = [
        (a, b)
        for a in ([p.unit] if p.unit else UNSTATED[0])
        for b in ([v.unit] if v.unit else UNSTATED[1])
        if abs(math.log(size * RADIANS[a] * p.scale / RADIANS_PER_SECOND[b])) < TOLERANCE
    ]
    if not fits:
        p = p if p.unit else _assumed("rad")
        v = v if v.unit else _assumed("rad/s")
        off = size * RADIANS[str(p.unit)] * p.scale / RADIANS_PER_SECOND[str(v.unit)]
        doubt = f"the position moves {off:.4g} times as far as the velocity says"
        return SideUnits(
            p.but(doubt), replace(v, sign=sign, reason=joined(v.reason, turned)).but(doubt)
        )
    a, b = fits[0] if len(fits) == 1 else _by_size(fits, position, side)
    doubt = "" if len(fits) == 1 else f"no unit is stated; its size suggests {a} and {b}"
    why = "its integral is the position"
    return SideUnits(
        replace(p, unit=a, reason=p.reason or "the velocity's integral").but(doubt),
        replace(v, unit=b, sign=sign, reason=joined(v.reason, why, turned)).but(doubt),
    )


def _by_size(fits: list[tuple[str, str]], position: Column, side: str) -> tuple[str, str]:
    wanted = _usual(position, side)
    return next((each for each in fits if each[0] == wanted), fits[0])


def _usual(position: Column, side: str) -> str:
    return "rad" if side == "motor" or float(np.ptp(position.whole)) < FAR else "deg"


def _electrical(p: Told, size: float, sign: int) -> Told:
    """Return the unit of an electrical velocity, whose pole pairs its position tells."""
    v = Told("rpm", sign, unsure="electrical; divide by the motor's pole pairs, by scale=")
    if p.unit is None:
        return v
    pairs = RADIANS_PER_SECOND["rpm"] / (size * RADIANS[p.unit] * p.scale)
    if round(pairs) < 1 or abs(pairs - round(pairs)) > TOLERANCE * pairs:
        return v
    said = f"electrical, {round(pairs)} times as fast as the position says"
    return Told("rpm", sign, 1 / round(pairs), said, "its pole pairs follow from the angle alone")


def _with_rate(p: Told, v: Told, size: float, sign: int) -> SideUnits:
    """Return the units, and the rate under which the velocity is the position's derivative."""
    if p.unit is None:
        return SideUnits(p, v)
    step = size * RADIANS[p.unit] * p.scale / RADIANS_PER_SECOND[str(v.unit)]
    return SideUnits(p, replace(v, sign=sign), nice(1.0 / step))


def _alone(p: Told, position: Column | None, side: str) -> Told:
    """Return the unit of a position that nothing else tells."""
    if position is None or p.unit is not None or p.unsure:
        return p
    return _assumed(_usual(position, side))


def _assumed(unit: str) -> Told:
    return Told(unit, unsure=f"no unit is stated; taken for {unit}")
