"""Which columns are the motion of the output and of the motor.

A side that no name tells is told by how far a column turns for another; a velocity's side by whose
derivative it is.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Final, NamedTuple

import numpy as np

from flexspline.recordings.clock import nice
from flexspline.recordings.columns import Array, Column
from flexspline.recordings.physics import EXPLAINED, Ratio, ratio_of, ratio_to_integral
from flexspline.recordings.units import (
    RADIANS,
    RADIANS_PER_SECOND,
    TOLERANCE,
    UNSTATED,
    radians,
)

__all__ = ["GEARED", "WHOLE", "Chosen", "motion_columns"]

GEARED: Final = (
    5.0  # times as far as the output turns what is the motor: no strain wave gear is below
)
WHOLE: Final = 0.004  # by how much a gear ratio may be off a whole number, as a share


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
    """Find a position and its velocity among columns without names, by their numbers alone."""
    moving = [c for c in columns if c.moves]
    doubt = "told by its numbers alone; its side is not named"
    best = EXPLAINED
    for position in moving:
        for velocity in moving:
            told = _bent_alike(position, velocity, time)
            if velocity is not position and told.explained > best:
                best = told.explained
                found["output"]["position"] = Chosen(position, "the velocity's integral", doubt)
                found["output"]["velocity"] = Chosen(velocity, "the position's derivative", doubt)


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
