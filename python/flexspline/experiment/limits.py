"""What the next run may do: limits that are given, and where none are, what the recorded runs did.

How fast load and temperature may change is never given: it is what was seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import InputError, did_you_mean, listed
from flexspline.logs.plausible import IMAGINABLE

if TYPE_CHECKING:
    from flexspline.least_squares.problem import Problem

__all__ = ["Bounds", "Limits", "bounds_of", "parsed_limits"]

Array = NDArray[np.float64]
Range = tuple[float, float]

LONGEST = 120.0  # s, unless a longer run is asked for
SHORTEST = 4.0  # s
MOST_TURNS = 1e6  # in a run: a sum of sines is looked at 60 times for each of them
MOST_SECONDS = 1e6  # s, eleven days
STARTS = 10.0  # times in a run that the fastest speed can be reached at least
RANGES = ("position", "load", "temperature")


@dataclass(frozen=True)
class Limits:
    """What the next run may do. None: what the recorded runs did.

    Parameters
    ----------
    position : (lowest, highest) angle of the output [rad].
    velocity, acceleration : largest size at the output [rad/s, rad/s²].
    load : (lowest, highest) load that can be set [Nm]; two equal numbers for one that cannot.
    temperature : (lowest, highest) [°C].
    duration : of the run [s], without waiting for a temperature.

    Raises
    ------
    InputError
        For a range upside down, or a size that is not above zero.
    """

    position: Range | None = None
    velocity: float | None = None
    acceleration: float | None = None
    load: Range | None = None
    temperature: Range | None = None
    duration: float | None = None

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if value is not None:
                _checked(field.name, value)


@dataclass(frozen=True)
class Bounds:
    """Limits with nothing left open.

    `load` and `temperature` are None where no effect reads them or nothing can be set.
    `load_rate` [Nm/s] and `warming` [K/s]: how fast they changed while they were recorded.
    """

    position: Range
    velocity: float
    acceleration: float
    load: Range | None
    load_rate: float
    temperature: Range | None
    warming: float
    duration: float

    @property
    def span(self) -> float:
        """Of the angle [rad]."""
        return self.position[1] - self.position[0]

    def lasting(self, seconds: float) -> Bounds:
        return replace(self, duration=seconds)

    def doubled(self, name: str) -> Bounds:
        """Return limits of which one is twice as wide."""
        value = getattr(self, name)
        if isinstance(value, tuple):
            middle, half = 0.5 * (value[0] + value[1]), value[1] - value[0]
            value = (middle - half, middle + half)
        else:
            value = 2.0 * value
        changed: dict[str, Any] = {name: value}
        return replace(self, **changed)


def bounds_of(problem: Problem, limits: Limits, reads: Sequence[str]) -> Bounds:
    """Fill in what is left open; `reads`: channels of the effects in question, "load" among them.

    A joint whose angle is not recorded rests.
    """
    moves = all("output_position" in run.log for run in problem.runs)
    velocity = limits.velocity or _size(problem, "output_velocity", 0.999)
    longest = max(run.log.duration for run in problem.runs)
    duration = limits.duration or float(np.clip(longest, SHORTEST, LONGEST))
    velocity = max(velocity, 1e-6)
    acceleration = limits.acceleration or max(
        _size(problem, "output_acceleration", 0.99), STARTS * velocity / duration
    )
    if limits.velocity or limits.acceleration or limits.duration:
        _require_drawable(velocity, acceleration, duration)
    return Bounds(
        position=limits.position or (_range(problem, "output_position") if moves else (0.0, 0.0)),
        velocity=velocity,
        acceleration=acceleration,
        load=_load(problem, limits, reads),
        load_rate=_load_rate(problem),
        temperature=_temperature(problem, limits, reads),
        warming=_warming(problem),
        duration=duration,
    )


def _require_drawable(velocity: float, acceleration: float, duration: float) -> None:
    """Refuse an acceleration that would let a run turn round more often than can be drawn."""
    turns = acceleration * duration / velocity
    if turns > MOST_TURNS:
        raise InputError(
            f"limits of {acceleration:.3g} rad/s², {velocity:.3g} rad/s and {duration:.3g} s "
            f"let a run turn round {turns:.2g} times, where {MOST_TURNS:g} can be drawn; correct "
            "the limits"
        )


def parsed_limits(given: dict[str, tuple[float, ...]]) -> Limits:
    """Limits from names and one number each, or two for a range.

    Raises
    ------
    InputError
        For a name that is no limit, or a wrong count of numbers.
    """
    known = [field.name for field in fields(Limits)]
    made: dict[str, float | Range] = {}
    for name, values in given.items():
        if name not in known:
            near = did_you_mean(name, known)
            raise InputError(f"there is no limit '{name}'{near}; give {listed(known)}")
        wanted = 2 if name in RANGES else 1
        if len(values) != wanted:
            numbers = "two numbers, lowest and highest" if wanted == 2 else "one number"
            raise InputError(f"the limit '{name}' takes {numbers}, not {len(values)}")
        made[name] = (values[0], values[1]) if wanted == 2 else values[0]
    return Limits(**made)  # type: ignore[arg-type]


def _checked(name: str, value: float | Range) -> None:
    numbers = np.ravel(np.asarray(value, dtype=np.float64))
    wanted = 2 if name in RANGES else 1
    if len(numbers) != wanted or not np.isfinite(numbers).all():
        what = "(lowest, highest)" if wanted == 2 else "a number"
        raise InputError(f"the limit '{name}' is {value}; give {what}")
    if wanted == 2 and (numbers[0] > numbers[1] or (name == "position" and not np.ptp(numbers))):
        raise InputError(f"the limit '{name}' goes from {numbers[0]:g} to {numbers[1]:g}; "
                         "give the lowest first")  # fmt: skip
    if wanted == 1 and not numbers[0] > 0.0:
        raise InputError(f"the limit '{name}' is {numbers[0]:g}; give a number above zero")
    most = MOST_SECONDS if name == "duration" else IMAGINABLE
    if np.max(np.abs(numbers)) > most or (wanted == 1 and numbers[0] < 1.0 / most):
        raise InputError(f"the limit '{name}' is {value}, which no joint can do; give a number "
                         f"within {most:g}")  # fmt: skip


def _load(problem: Problem, limits: Limits, reads: Sequence[str]) -> Range | None:
    wanted = {"load", "motor_torque"} & set(reads)
    if problem.known_load is None or not wanted:
        return None
    return limits.load or _range(problem, problem.known_load)


def _temperature(problem: Problem, limits: Limits, reads: Sequence[str]) -> Range | None:
    if "temperature" not in reads:
        return None
    return limits.temperature or _range(problem, "temperature")


def _load_rate(problem: Problem) -> float:
    name = problem.known_load
    if name is None:
        return 0.0
    rates = [np.abs(np.gradient(run.log[name], run.log["time"])) for run in problem.runs]
    return float(np.quantile(np.concatenate(rates), 0.99))


def _warming(problem: Problem) -> float:
    logs = [run.log for run in problem.runs if "temperature" in run.log]
    rates = [np.ptp(log["temperature"]) / max(log.duration, 1e-9) for log in logs]
    return float(max((rate for rate in rates if np.isfinite(rate)), default=0.0))


def _range(problem: Problem, channel: str) -> Range:
    every = _finite(problem, channel)
    return (float(every.min()), float(every.max())) if len(every) else (0.0, 0.0)


def _size(problem: Problem, channel: str, share: float) -> float:
    every = _finite(problem, channel)
    return float(np.quantile(np.abs(every), share)) if len(every) else 0.0


def _finite(problem: Problem, channel: str) -> Array:
    """All values that a channel has: one that no effect reads may lack some, (n,)."""
    parts = [run.log[channel] for run in problem.runs if channel in run.log]
    every = np.concatenate([np.empty(0), *parts])
    return np.asarray(every[np.isfinite(every)])
