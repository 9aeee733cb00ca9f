"""Which columns are the motion of output and motor, in what units and with which sign.

A side that no name tells is told by how far a column turns for another; a velocity's side by whose
derivative it is. Units that nothing states are told by the other columns: a velocity's integral is
the position, in units of both; a position wraps at its turn; an encoder has so many counts in a
turn.

The sign of what drives and of what is measured is told by friction. Friction takes work out of a
joint both ways, and gravity and inertia give back what they took. So the part of a drive's torque
that goes with the direction and the speed of the motion,

    y = a · tanh(v / v_s) + b · v + c + d · sin q + e · cos q + f · dv/dt  (+ g · another torque),

does positive work, in the first and the second half of the rows of either direction. Behind the
gear a torque pushes outward where the drive does: its part of the drive's is positive.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexspline.recordings.columns import (
    EXPLAINED,
    Array,
    Column,
    Ratio,
    Told,
    joined,
    nice,
    ratio_of,
    ratio_to_integral,
)
from flexspline.recordings.words import RATIOS, Said

__all__ = [
    "GEARED",
    "WHOLE",
    "Chosen",
    "both_ways",
    "friction_share",
    "goes_with",
    "motion_columns",
    "radians",
    "units_of_side",
    "usual_units",
    "with_resolutions",
]


GEARED: Final = (
    5.0  # times as far as the output turns what is the motor: no strain wave gear is below
)
WHOLE: Final = 0.004  # by how much a gear ratio may be off a whole number, as a share

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
OF_ANGLE: Final = {"rad": "rad/s", "deg": "deg/s", "rev": "rev/s"}
"""The unit of a velocity beside an angle's, where a recorder leaves both unsaid."""
TURN: Final = {2 * math.pi: "rad", 360.0: "deg", 1.0: "rev"}
RESOLUTIONS: Final = tuple(
    sorted(
        {*(2**bits for bits in range(8, 25)), *(500 * m for m in (1, 2, 4, 5, 8, 10, 16, 20, 40))}
    )
)
"""Counts per turn: powers of two, and lines of optical encoders and four times as many."""
COUNTED: Final = 400  # whole numbers over a range wider than a turn in degrees are counts
FAR: Final = 4 * math.pi  # rad that an output seldom turns: a wider range is one in degrees

SLOW: Final = 0.05  # of the fastest speed (99 %), the half-width of a change of direction
FEWEST: Final = 50  # rows of which a half is told
AGREED: Final = 0.5  # share of a torque's variance that the drive's must explain to tell its sign


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


def usual_units(motion: Motion, time: Array, timed: bool) -> dict[str, str]:
    """Return the unit of an angle, by side, to take where nothing states or tells it.

    A recorder that leaves units unsaid writes all angles in one. Which it is, is told by how far
    the output goes (`FAR`), or is that of the other side, where that is known, unless the motor
    would turn as no gear makes it, and another unit makes it a whole number of turns.
    """
    named = ("position", "velocity")
    sides = {
        side: [found[name].column if name in found else None for name in named]
        for side, found in motion.items()
    }
    output, motor = sides["output"][0], sides["motor"][0]
    told = {side: _told_alike(p, v, time, timed) for side, (p, v) in sides.items()}
    size = "rad" if output is None else _by_range(output)
    usual = {"output": size, "motor": "rad"}
    if output is None:
        return usual
    turns = math.nan if motor is None else abs(ratio_of(output.whole, motor.whole).factor)
    if told["output"] is None and told["motor"] is None:
        usual["motor"] = size
    elif told["output"] is None and told["motor"] is not None:
        unit, radian = told["motor"]
        usual["output"] = _geared(unit or size, lambda of: turns * radian / RADIANS[of])
    elif told["output"] is not None and told["motor"] is None:
        unit, radian = told["output"]
        usual["motor"] = _geared(unit or "rad", lambda of: turns * RADIANS[of] / radian)
    return usual


def _told_alike(
    position: Column | None, velocity: Column | None, time: Array, timed: bool
) -> tuple[str, float] | None:
    """Return the unit of a side's position [and rad in it], or None where nothing tells it.

    The unit is "" of counts.
    """
    units = {
        unit: units_of_side(position, velocity, time, timed, unit).position
        for unit in ("rad", "deg")
    }
    told = units["rad"]
    if position is None or told.unit is None or told.unit != units["deg"].unit:
        return None
    return told.unit if told.scale == 1.0 else "", RADIANS[told.unit] * told.scale


def _geared(first: str, turns: Callable[[str], float]) -> str:
    """Return the first unit, or another where that alone makes the turns of a motor a gear's."""
    if GEARED <= turns(first) <= RATIOS[1]:
        return first
    fits = (
        unit
        for unit in UNSTATED[0]
        if GEARED <= turns(unit) <= RATIOS[1] and _is_whole(turns(unit))
    )
    return next(fits, first)


def _is_whole(turns: float) -> bool:
    return abs(turns - round(turns)) < WHOLE * turns


def units_of_side(
    position: Column | None, velocity: Column | None, time: Array, timed: bool, usual: str
) -> SideUnits:
    """Return the units of a position and its velocity.

    `timed`: whether the time is in seconds; `usual`: the unit of an angle that nothing tells.
    """
    p = Told(None) if position is None else _position_unit(position)
    v = Told(None) if velocity is None else _velocity_unit(velocity)
    if position is None or velocity is None:
        return SideUnits(_alone(p, position, usual), v if v.unit else _assumed(OF_ANGLE[usual]))
    pair = ratio_to_integral(time, velocity.whole, position.whole)
    if not pair.told:
        doubt = "its integral is not the position" if position.moves and velocity.moves else ""
        v = v if v.unit else _assumed(OF_ANGLE[usual])
        return SideUnits(_alone(p, position, usual), v.but(doubt))
    size, sign = abs(pair.factor), 1 if pair.factor > 0 else -1
    if velocity.says.unit == "erpm":
        p = _alone(p, position, usual)
        return SideUnits(p, _electrical(p, size, sign))
    if not timed:
        return _with_rate(
            _alone(p, position, usual), v if v.unit else _assumed(OF_ANGLE[usual]), size, sign
        )
    return _together(p, v, usual, pair)


def _velocity_unit(velocity: Column) -> Told:
    if velocity.says.unit in RADIANS_PER_SECOND:
        return Told(velocity.says.unit, reason="its unit is stated")
    if velocity.says.unit == "erpm":
        return Told("rpm", unsure="electrical; divide by the motor's pole pairs, by scale=")
    return Told(None)


def _together(p: Told, v: Told, usual: str, pair: Ratio) -> SideUnits:
    """Return both units, where the velocity's integral is the position times a factor."""
    size, sign = abs(pair.factor), 1 if pair.factor > 0 else -1
    turned = "" if sign > 0 else "against the position in the file"
    if p.unit is None and p.unsure:  # counts whose number in a turn nothing tells
        v = v if v.unit else _assumed(OF_ANGLE[usual])
        return SideUnits(p, replace(v, sign=sign, reason=joined(v.reason, turned)))
    fits = [
        (a, b)
        for a in ([p.unit] if p.unit else UNSTATED[0])
        for b in ([v.unit] if v.unit else UNSTATED[1])
        if abs(math.log(size * RADIANS[a] * p.scale / RADIANS_PER_SECOND[b])) < TOLERANCE
    ]
    if not fits:
        p = p if p.unit else _assumed("rad")
        v = v if v.unit else _assumed(OF_ANGLE[usual])
        off = size * RADIANS[str(p.unit)] * p.scale / RADIANS_PER_SECOND[str(v.unit)]
        doubt = f"the position moves {off:.4g} times as far as the velocity says"
        return SideUnits(
            p.but(doubt), replace(v, sign=sign, reason=joined(v.reason, turned)).but(doubt)
        )
    a, b = next((each for each in fits if each[0] == usual), fits[0])
    doubt = "" if len(fits) == 1 else f"no unit is stated; its size suggests {a} and {b}"
    why = "its integral is the position"
    return SideUnits(
        replace(p, unit=a, reason=p.reason or "the velocity's integral").but(doubt),
        replace(v, unit=b, sign=sign, reason=joined(v.reason, why, turned)).but(doubt),
    )


def _by_range(position: Column) -> str:
    return "rad" if float(np.ptp(position.whole)) < FAR else "deg"


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


def _alone(p: Told, position: Column | None, usual: str) -> Told:
    """Return the unit of a position that nothing else tells."""
    if position is None or p.unit is not None or p.unsure:
        return p
    return _assumed(usual)


def _assumed(unit: str) -> Told:
    return Told(unit, unsure=f"no unit is stated; taken for {unit}")


def friction_share(drive: Array, position: Array, velocity: Array) -> float:
    """Return the work of a drive against friction as a share of what it moves, from −1 to 1.

    It is 0 where the early and the late rows do not agree on its sign, or the motion goes one way.
    """
    if not both_ways(velocity):
        return 0.0
    design = _design(position, velocity)
    whole = _share(design, drive, velocity)
    early = _early(velocity)
    halves = [_share(design[part], drive[part], velocity[part]) for part in (early, ~early)]
    return whole if all(share * whole > 0 for share in halves) else 0.0


def both_ways(velocity: Array) -> bool:
    """Whether a motion goes forward and backward."""
    return len(velocity) > 0 and bool(np.min(velocity) < 0 < np.max(velocity))


def _early(velocity: Array) -> NDArray[np.bool_]:
    """The first half of the rows forward and of those backward: a half may go one way alone."""
    early = np.zeros(len(velocity), dtype=bool)
    for rows in (np.flatnonzero(velocity > 0), np.flatnonzero(velocity <= 0)):
        early[rows[: len(rows) // 2]] = True
    return early


def _share(design: Array, drive: Array, velocity: Array) -> float:
    if len(drive) < FEWEST:
        return 0.0
    solution = np.linalg.lstsq(design, drive, rcond=None)[0]
    power = (design[:, :2] @ solution[:2]) * velocity
    moved = float(np.sum(np.abs(drive * velocity)))
    return float(np.sum(power)) / moved if moved > 0 else 0.0


def _design(position: Array, velocity: Array) -> Array:
    fast = float(np.quantile(np.abs(velocity), 0.99))
    slip = velocity / max(fast, np.finfo(float).tiny)
    return np.column_stack(
        [
            np.tanh(slip / SLOW),
            slip,
            np.ones_like(slip),
            np.sin(position),
            np.cos(position),
            np.gradient(slip),
        ]
    )


def goes_with(drive: Array, torque: Array, position: Array, velocity: Array) -> int:
    """Return 1 or −1 as a torque behind the gear goes with the drive's or against it, else 0."""
    if len(drive) < FEWEST:
        return 0
    friction = _design(position, velocity)[:, :3]
    left = [y - friction @ np.linalg.lstsq(friction, y, rcond=None)[0] for y in (drive, torque)]
    power = float(np.sqrt(np.sum(left[0] ** 2) * np.sum(left[1] ** 2)))
    alike = float(left[0] @ left[1]) / power if power > 0 else 0.0
    return 0 if alike**2 < AGREED else (1 if alike > 0 else -1)


class Chosen(NamedTuple):
    """A column of a motion, why it is, and what speaks against it."""

    column: Column
    reason: str
    unsure: str = ""


Motion = dict[str, dict[str, Chosen]]


def motion_columns(
    columns: Sequence[Column], taken: Iterable[int], time: Array, *, timed: bool
) -> Motion:
    """Return position, velocity and acceleration of each side, as far as they are there.

    `timed` says that the time is in seconds, and not the numbers of the rows.
    """
    free = [
        column
        for column in columns
        if column.number not in set(taken)
        and column.values is not None
        and column.says.role in ("", "sensor")
    ]
    found: Motion = {"output": {}, "motor": {}}
    velocities = [c for c in free if c.says.quantity == "velocity"]
    positions = [c for c in free if c.says.quantity == "position"]
    _positions(found, positions, velocities if timed else [], time)
    _velocities(found, velocities, time, timed)
    for column in free:
        if column.says.quantity == "acceleration" and column.says.side != "motor":
            doubt = "" if column.says.side else "its side is not named"
            found["output"].setdefault("acceleration", Chosen(column, "its name", doubt))
    if not any(found.values()):
        _by_numbers(found, [c for c in free if c.says.quantity is None], time)
    return found


def _positions(found: Motion, columns: list[Column], velocities: list[Column], time: Array) -> None:
    for side in found:
        named = sorted((c for c in columns if c.says.side == side), key=lambda c: not c.moves)
        if named:
            found[side]["position"] = Chosen(named[0], "its name")
    unsided = [c for c in columns if c.says.side is None]
    unsided = [c for c in unsided if c.moves] or unsided
    if not any(found.values()) and len(unsided) > 1:
        _two_sides(found, unsided)
    if (
        not any(found.values())
        and len(unsided) == 1
        and _turns_with_motor(unsided[0], velocities, time)
    ):
        found["motor"]["position"] = Chosen(unsided[0], "the motor's velocity is its derivative")
        return
    for column in unsided:
        _beside(found, column)


def _turns_with_motor(position: Column, velocities: list[Column], time: Array) -> bool:
    """Whether a position is that of a motor whose velocity has a name, and no output's has."""
    if any(c.says.side == "output" for c in velocities):
        return False
    motors = [c for c in velocities if c.says.side == "motor"]
    return any(_is_derivative(velocity, position, time) for velocity in motors)


def _two_sides(found: Motion, unsided: list[Column]) -> None:
    """Take for motor and output two columns of which one turns with the other, and much farther."""
    for one in unsided:
        for other in unsided:
            told = _turns(one, other)
            if told.told and abs(told.factor) >= GEARED:
                said = f"turns {abs(told.factor):.4g} times as far as the output"
                found["output"]["position"] = Chosen(one, "turns with the motor, and less far")
                found["motor"]["position"] = Chosen(other, said)
                return


def _beside(found: Motion, column: Column) -> None:
    """Add a position whose side is not named, where one is missing."""
    output, motor = found["output"].get("position"), found["motor"].get("position")
    if output is None and motor is None:
        found["output"]["position"] = Chosen(column, "the only position", "its side is not named")
    elif motor is None and output is not None and output.column is not column:
        told = _turns(output.column, column)
        if told.told and abs(told.factor) >= GEARED:
            said = f"turns {abs(told.factor):.4g} times as far as the output"
            found["motor"]["position"] = Chosen(column, said)
    elif output is None and motor is not None and motor.column is not column:
        told = _turns(column, motor.column)
        geared = told.told and abs(told.factor) >= GEARED
        doubt = "its side is not named, and the motor does not turn with it"
        found["output"]["position"] = Chosen(
            column,
            "turns with the motor, and less far" if geared else "the other position",
            "" if geared else doubt,
        )


def _turns(output: Column, motor: Column) -> Ratio:
    """Return how far a column turns for another one, in one unit where both are known."""
    told = ratio_of(output.whole, motor.whole)
    units = radians(output), radians(motor)
    if units[0] is not None and units[1] is not None:
        return Ratio(told.factor * units[1] / units[0], told.explained)
    return told


def _velocities(found: Motion, columns: list[Column], time: Array, timed: bool) -> None:
    for side in found:
        named = [c for c in columns if c.says.side == side]
        if named:
            found[side]["velocity"] = Chosen(named[0], "its name")
    for column in columns:
        sides = [side for side in found if "velocity" not in found[side]]
        if column.says.side is None and sides:
            side, chosen = _side_of_velocity(found, sides, column, time, timed)
            found[side]["velocity"] = chosen


def _side_of_velocity(
    found: Motion, sides: list[str], column: Column, time: Array, timed: bool
) -> tuple[str, Chosen]:
    """Return the side whose position's derivative a velocity is, or that it turns N times with."""
    with_position = [side for side in sides if "position" in found[side]]
    for side in with_position:
        position = found[side]["position"]
        if _is_derivative(column, position.column, time, timed):
            doubt = "" if position.unsure == "" else "its side is that of the position"
            return side, Chosen(column, f"its integral is the {side}'s position", doubt)
    output = found["output"].get("position")
    if timed and output is not None and "motor" in sides:
        turns = _turns_for(column, output.column, time)
        if turns is not None and turns >= GEARED and abs(turns - round(turns)) < WHOLE * turns:
            said = f"its integral turns {turns:.5g} times as far as the output"
            return "motor", Chosen(column, said)
    doubt = "its side is not named, and its integral is no position's"
    return (with_position or sides)[0], Chosen(column, "its name", doubt)


def _turns_for(velocity: Column, position: Column, time: Array) -> float | None:
    """Return how far a velocity goes for a position, where the units of both are stated."""
    unit, turn = RADIANS_PER_SECOND.get(str(velocity.says.unit)), radians(position)
    told = ratio_to_integral(time, velocity.whole, position.whole)
    if unit is None or turn is None or not told.told:
        return None
    return unit / (abs(told.factor) * turn)


def _is_derivative(velocity: Column, position: Column, time: Array, timed: bool = True) -> bool:
    told = ratio_to_integral(time, velocity.whole, position.whole)
    if not timed:
        return told.told
    return told.told and (velocity.says.unit == "erpm" or _fits(velocity, position, told.factor))


def _fits(velocity: Column, position: Column, factor: float) -> bool:
    """Whether there are units of position and velocity under which a ratio is an integral's."""
    turn, unit = radians(position), RADIANS_PER_SECOND.get(str(velocity.says.unit))
    return any(
        abs(math.log(abs(factor) * p / v)) < TOLERANCE
        for p in ([turn] if turn is not None else [RADIANS[name] for name in UNSTATED[0]])
        for v in ([unit] if unit is not None else [RADIANS_PER_SECOND[n] for n in UNSTATED[1]])
    )


def _by_numbers(found: Motion, columns: list[Column], time: Array) -> None:
    """Find a position and its velocity among columns without names, by their numbers alone.

    What is itself another column's derivative is rather a velocity than a position.
    """
    moving = [c for c in columns if c.moves]
    doubt = "told by its numbers alone; its side is not named"
    told = {
        (position, velocity): _bent_alike(moving[position], moving[velocity], time).explained
        for position in range(len(moving))
        for velocity in range(len(moving))
        if velocity != position
    }
    pairs = {pair: explained for pair, explained in told.items() if explained > EXPLAINED}
    derivatives = {velocity for _, velocity in pairs}
    first = [pair for pair in pairs if pair[0] not in derivatives] or [*pairs]
    if first:
        position, velocity = max(first, key=lambda pair: pairs[pair])
        found["output"]["position"] = Chosen(moving[position], "the velocity's integral", doubt)
        found["output"]["velocity"] = Chosen(moving[velocity], "the position's derivative", doubt)


def _bent_alike(position: Column, velocity: Column, time: Array) -> Ratio:
    """Return the ratio to the integral of what is no straight line, as everything's integral is.

    Nothing is told where no units, or no round rate of rows without time stamps, fit the ratio.
    """
    line = np.polynomial.polynomial.polyfit(time - time[0], position.whole, 1)
    bent = position.whole - line[0] - line[1] * (time - time[0])
    told = ratio_to_integral(time, velocity.whole - np.mean(velocity.whole), bent)
    if not told.told:
        return Ratio(told.factor, 0.0)
    counted = bool(np.all(np.diff(time[:3]) == 1.0))
    fits = nice(1 / abs(told.factor)) if counted else _fits(velocity, position, told.factor)
    return told if fits else Ratio(told.factor, 0.0)
