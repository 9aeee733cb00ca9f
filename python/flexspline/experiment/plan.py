"""The run to record next: a sentence, a trajectory, and what it would settle."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from flexspline.experiment.limits import Bounds
from flexspline.logs.log import Log
from flexspline.rendering import render

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["ENOUGH", "TAKEN", "Outlook", "Plan"]

ENOUGH = 3.0  # |t| above which two causes are no aliases
TAKEN = 0.84  # of a named effect's gain: below NEARLY (`discovery/analysis.py`)
TIGHTER = 3.0  # times the standard error falls at least, for a parameter that was undetermined


@dataclass(frozen=True)
class Outlook:
    """One question, now and after the run.

    Parameters
    ----------
    names : a named effect and its rival, or a parameter alone.
    now, expected : |t| that the named effect would keep beside model and rival if it is right,
        with the recorded runs and with the planned one as well; what it does keep, and left-out
        runs, may say less. Of a parameter: its standard error, in `unit`; ∞ where nothing is
        known of it.
    taken : share of what the named effect explains that the rival would explain too, then; 0 for a
        parameter. `discover` still calls a rival that explains nearly all of it an alias, unless
        left-out runs tell the two apart.
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
        from flexspline.logs.read import write_log

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
