"""The run to record next, and the limits that it keeps to.

Limits are given, and where none are, they are what the recorded runs did. How fast load and
temperature may change is never given: it is what was seen. A plan is a summary, a trajectory, and
the questions that it would settle.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from numbers import Real
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from flexspline.effects import CATALOGUE
from flexspline.effects.causes import GRAVITY, OUTPUT_RIPPLE
from flexspline.errors import InputError, did_you_mean, listed, shortened
from flexspline.formatting import short_names
from flexspline.lazy import render
from flexspline.logs.log import IMAGINABLE, Log

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from flexspline.least_squares.problem import Problem

__all__ = [
    "ENOUGH",
    "LEAST_KELVIN",
    "TAKEN",
    "Bounds",
    "Limits",
    "Outlook",
    "Plan",
    "bounds_of",
    "joined",
    "over",
    "parsed_limits",
    "plan_sentence",
    "short",
]


ENOUGH = 3.0  # |t| above which two causes are no aliases
TAKEN = 0.84  # of a named effect's gain: below NEARLY (`discovery/analysis.py`)
TIGHTER = 3.0  # times the standard error falls at least, for a parameter that was undetermined

ALIKE = 0.05  # t below which there is nothing to build on
OFTEN = 20  # repetitions that are worth saying

NARROW = 0.05  # of the middle's size: ends that two digits hardly tell apart

Array = NDArray[np.float64]
Range = tuple[float, float]

LONGEST = 120.0  # s, unless a longer run is asked for
SHORTEST = 4.0  # s
MOST_TURNS = 1e6  # in a run: a sum of sines is looked at 60 times for each of them
MOST_SECONDS = 1e6  # s, eleven days
STARTS = 10.0  # times in a run that the fastest speed can be reached at least
RANGES = ("position", "load", "temperature")
LEAST_KELVIN = 1.0  # below, temperature is a constant
ROOM = 10.0  # K to either side, that a workshop has without a climate chamber


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

    `load` and `temperature` are None where no effect reads them or nothing can be set; `given`:
    what the limits say of them, where the others are what the recorded runs did.
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
    given: tuple[str, ...] = ()

    @property
    def span(self) -> float:
        """Of the angle [rad]."""
        return self.position[1] - self.position[0]

    def lasting(self, seconds: float) -> Bounds:
        return replace(self, duration=seconds)

    @property
    def same_temperature(self) -> float | None:
        """The temperature [°C] of recorded runs that had one alone; None where limits say it."""
        if self.temperature is None or "temperature" in self.given:
            return None
        cold, warm = self.temperature
        return 0.5 * (cold + warm) if warm - cold < LEAST_KELVIN else None

    def doubled(self, name: str) -> Bounds:
        """Return limits of which one is twice as wide; of one temperature, what a room allows."""
        value = getattr(self, name)
        if isinstance(value, tuple):
            middle, half = 0.5 * (value[0] + value[1]), value[1] - value[0]
            if name == "temperature" and self.same_temperature is not None:
                half = ROOM
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
        given=tuple(f.name for f in fields(limits) if getattr(limits, f.name) is not None),
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
    given = np.ravel(np.asarray(value, dtype=object)).tolist()
    wanted = 2 if name in RANGES else 1
    real = all(isinstance(one, Real) and math.isfinite(one) for one in given)
    numbers = np.array(given if real else [], dtype=np.float64)
    if len(numbers) != wanted:
        what = "(lowest, highest)" if wanted == 2 else "a number"
        raise InputError(f"the limit '{name}' is {shortened(repr(value))}; give {what}")
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


@dataclass(frozen=True)
class Outlook:
    """One question, now and after the run.

    Parameters
    ----------
    names : a named effect and its rival, or a parameter alone.
    now, expected : |t| that the named effect would keep beside model and rival if it is right,
        with the recorded runs and with the planned one as well; what it does keep, and held-out
        runs, may say less. Of a parameter: its standard error, in `unit`; ∞ where nothing is
        known of it.
    taken : share of what the named effect explains that the rival would explain too, then; 0 for a
        parameter. `discover` still calls a rival that explains nearly all of it an alias, unless
        held-out runs tell the two apart.
    doubled : the limit whose doubling would help most, what it would be, and |t| (or the standard
        error) then; None where the limits suffice.
    """

    names: tuple[str, ...]
    now: float
    expected: float
    unit: str
    taken: float
    doubled: tuple[str, str, float] | None

    @property
    def parameter(self) -> bool:
        return len(self.names) == 1

    @property
    def settled(self) -> bool:
        """Whether the run would answer it."""
        if self.parameter:
            return TIGHTER * self.expected <= self.now and self.expected < float("inf")
        return self.expected >= ENOUGH


@dataclass(frozen=True, eq=False, repr=False)
class Plan:
    """Which run to record next, and why.

    Parameters
    ----------
    sentence : what to record and what it would settle; or that nothing within the limits would,
        and which limit binds.
    log : the trajectory: time, motion, and load and temperature where they are set, at 100 Hz.
        It begins and ends at rest.
    outlooks : one for each question.
    kinds : of each kind of run, the best |t| of the first question.
    bounds : what the run may do.
    """

    sentence: str
    log: Log
    outlooks: tuple[Outlook, ...]
    kinds: Mapping[str, float]
    bounds: Bounds

    @property
    def now(self) -> float:
        """Of the first question, with the recorded runs."""
        return self.outlooks[0].now

    @property
    def expected(self) -> float:
        """Of the first question, with the planned run as well."""
        return self.outlooks[0].expected

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the trajectory as CSV, whole or not at all."""
        from flexspline.logs.writing import write_log

        write_log(self.log, path)

    def plot(self) -> Figure:
        """Return a figure: angle, speed, load and temperature over time, and what is expected."""
        return render("experiment", "figure", self)

    def __str__(self) -> str:
        return self.sentence

    def __repr__(self) -> str:
        return f"<Plan of {self.log.duration:.3g} s: {self.sentence}>"

    def _repr_png_(self) -> Any:
        figure: Any = self.plot()  # a `PlainFigure`
        return figure._repr_png_()


def plan_sentence(
    seconds: float, words: str, outlooks: Sequence[Outlook], times: int, own_load: bool
) -> str:
    """Return what to record, what it settles, and what it does not.

    `own_load`: whether the load is what inertia and gravity of the joint make.
    """
    settled = [o for o in outlooks if o.settled]
    open_ = [o for o in outlooks if not o.settled]
    run = f"{short(seconds)} s of {words}"
    run = f"{times} times {run}" if times > 1 else run
    said = []
    if settled:
        told = joined(_settled(o) for o in settled)
        said.append(f"Record {run}: with it {told}.")
    said += [_near(o, own_load) for o in settled if o.taken >= TAKEN]
    said += [_open(o, None if settled else run) for o in open_]
    return short_names(" ".join(said))


def _settled(one: Outlook) -> str:
    if one.parameter:
        return f"{one.names[0]} would be known to ± {short(one.expected)} {one.unit} ({_now(one)})"
    return (
        f"{one.names[0]} and {one.names[1]} would stand apart at t = {_t(one.expected)} "
        f"({_now(one)})"
    )


def _near(one: Outlook, own_load: bool) -> str:
    named, rival = one.names
    said = f"Even then {rival} would explain {100.0 * one.taken:.0f} % of what {named} explains"
    readers = {name for name, info in CATALOGUE.items() if "load" in info.reads}
    if own_load and readers & {*one.names}:
        return f"{said}: a payload of known torque (reference_torque) would tell more."
    return f"{said}: wider limits would tell more."


def _now(one: Outlook) -> str:
    if not one.parameter:
        if one.now < ENOUGH:
            return f"now {_t(one.now)}"
        return f"now {_t(one.now)}, were {one.names[0]} right and every form exact"
    return f"now ± {short(one.now)}" if one.now < float("inf") else "now nothing is known of it"


def _open(one: Outlook, run: str | None) -> str:
    best = f"the best, {run}, reaches" if run else "this one reaches"
    if one.parameter and not one.expected < one.now:
        better = f"makes {one.names[0]} known better"
        does = better if one.now < float("inf") else f"determines {one.names[0]}"
        return f"No run within these limits {does} ({_now(one)}){_doubled(one, '± ')}."
    if one.parameter:
        reached = f"± {short(one.expected)} {one.unit} ({_now(one)})"
        said = f"No run within these limits determines {one.names[0]}: {best} {reached}"
        return f"{said}{_doubled(one, '± ')}."
    who = f"{one.names[0]} and {one.names[1]}"
    if one.doubled is None and one.expected < ALIKE:
        if {*one.names} == {GRAVITY, OUTPUT_RIPPLE}:
            same = f"order 1 of {OUTPUT_RIPPLE} and {GRAVITY} are the same function of the angle"
            said = f"No motion tells {who} apart, within any limits: {same}.{_mounting(one)}"
            return f"{said} Another payload changes {GRAVITY} alone."
        said = f"No motion within these limits or twice as wide ones tells {who} apart (t = 0)"
        return f"{said}: all that can be commanded acts on both alike.{_mounting(one)}"
    reached = f"t = {_t(one.expected)} ({_now(one)})"
    said = f"No run within these limits tells {who} apart: {best} {reached}"
    return f"{said}{_often(one)}{_doubled(one, 't = ')}.{_mounting(one)}"


def _often(one: Outlook) -> str:
    gained = one.expected**2 - one.now**2
    times = int((ENOUGH**2 - one.now**2) / max(gained, 1e-9)) + 1
    return f", recorded {times} times t = {ENOUGH:g}" if 1 < times <= OFTEN else ""


def _doubled(one: Outlook, sign: str) -> str:
    if one.doubled is None:
        return "; nor would twice as wide limits help"
    name, value, reached = one.doubled
    to = "from" if name in RANGES else "up to"
    return f"; the {name} binds: {to} {value}, {sign}{short(reached)} could be reached"


def _mounting(one: Outlook) -> str:
    if GRAVITY not in one.names:
        return ""
    (other,) = (name for name in one.names if name != GRAVITY)
    return (
        " Turn the joint's axis upright and record this run there: gravity then disappears, "
        f"{other} stays."
    )


def _t(value: float) -> str:
    return f"{value:.0f}" if value >= 9.95 else f"{value:.1f}"


def short(value: float) -> str:
    """Return a number with two digits: 0.051, 1.2, 38."""
    rounded = float(f"{float(value):.2g}")
    return f"{rounded + 0.0:g}".replace("-", "−")


def joined(words: Iterable[str]) -> str:
    """Return "a, b and c", each once."""
    every = list(dict.fromkeys(words))
    return " and ".join(p for p in (", ".join(every[:-1]), every[-1]) if p)


def over(low: float, high: float) -> str:
    """Return where angles lie: over ±1.2 rad, from 0.3 to 1.5 rad, or within ±0.004 rad of 4.8."""
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    if half < NARROW * abs(middle):
        return f"within ±{short(half)} rad of {short(middle)} rad"
    if short(-low) == short(high):
        return f"over ±{short(high)} rad"
    return f"from {short(low)} to {short(high)} rad"
