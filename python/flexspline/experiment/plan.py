"""The run to record next: a summary, a trajectory, and the questions that it would settle."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from flexspline.effects import CATALOGUE
from flexspline.effects.causes import GRAVITY
from flexspline.experiment.limits import Bounds
from flexspline.formatting import short_names
from flexspline.logs.log import Log
from flexspline.rendering import render

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = [
    "ENOUGH",
    "TAKEN",
    "Outlook",
    "Plan",
    "joined",
    "over",
    "plan_sentence",
    "short",
]

ENOUGH = 3.0  # |t| above which two causes are no aliases
TAKEN = 0.84  # of a named effect's gain: below NEARLY (`discovery/analysis.py`)
TIGHTER = 3.0  # times the standard error falls at least, for a parameter that was undetermined

ALIKE = 0.05  # t below which there is nothing to build on
OFTEN = 20  # repetitions that are worth saying

NARROW = 0.05  # of the middle's size: ends that two digits hardly tell apart


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
        return f"now {_t(one.now)} if {one.names[0]} is right, which these runs do not bear out"
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
    return f"; the {name} binds: up to {value}, {sign}{short(reached)} could be reached"


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
