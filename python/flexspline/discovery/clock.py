"""The clock of a load cell: by how much a known load is recorded later than the target.

A load L that is late by d leaves, to first order,

    d · c(t),     c = −L′ ∂(y − X β)/∂L

of target y and model X β. What may be missing follows the load too, so d is estimated beside
everything that may be missing: all candidates of the search and flexible functions of every
channel [FrischWaugh1933], before any name is looked for. The delay of a recorder is the same in
all folds: their scatter is part of its error. Names that are found later make it more precise,
within that error. The slope L′ is that of the load as rows read it, smoothed, so that the cell's
noise does not attenuate d.

A sensor cannot read a torque before it is there: where its reading is ahead, the load is late.
Where it is behind, the sensor may be: that is an effect, and to be named. Between the torque of a
drive, or a torsion, and the load cell any delay is one of the recorder.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.constants import milli

from flexspline.discovery.analysis import Analysis, FirstLook
from flexspline.discovery.basis import RATE, Functions, flexible_basis
from flexspline.discovery.candidates import LAG
from flexspline.discovery.faults import DataFault
from flexspline.discovery.settings import SETTINGS
from flexspline.least_squares.late_load import slopes_by
from flexspline.logs.log import Log
from flexspline.regression.gram import (
    SINGULAR,
    TINY,
    Table,
    left_by,
    solved,
    tabulated,
)

__all__ = ["SENSOR", "Delay", "delay_behind", "delay_beside_everything", "lead_of", "load_delays"]

Array = NDArray[np.float64]

SENSOR = ("sensor_torque",)


@dataclass(frozen=True)
class Delay:
    """By how much the load is later than the target, s, and the standard error."""

    seconds: float = 0.0
    error: float = np.inf

    @property
    def significant(self) -> bool:
        return abs(self.seconds) > SETTINGS.told * self.error

    def bears_out(self, seconds: float) -> bool:
        """Whether a delay lies within the error of this one, which would tell it from none."""
        reach = SETTINGS.told * self.error
        return abs(seconds - self.seconds) <= reach < abs(seconds)


def delay_beside_everything(look: FirstLook) -> Delay:
    """Return the delay of the known load beside all that may be missing."""
    study, work = look.part, look.base.without(LAG)
    problem = study.problem
    load = problem.known_load
    static = [
        group
        for group in flexible_basis(problem, pairs=False)
        if RATE not in group.channels and not (group.past and load in group.channels)
    ]
    beside = [e for c in study.candidates(work.effects) if c.name != LAG for e in c.effects]
    given = Functions(tuple(static), slopes_by(problem, work.effects, work.coefficients))
    sheet = work.sheet(beside=list(dict.fromkeys(beside)), given=given)
    return _last_column(tabulated(problem, sheet, look.noise))


def _last_column(table: Table) -> Delay:
    """The coefficient of the last column beside all others; its error by noise or by folds."""
    model = np.arange(len(table.total) - 2)
    squares = float(left_by(table.total, model)[-2, -2])
    if squares <= SINGULAR * table.total[-2, -2]:
        return Delay()
    left = np.append(-solved(table.total, model), [0.0, 1.0])
    own = np.append(-solved(table.total[:-1, :-1], model), [1.0, 0.0])
    weight = np.maximum([own @ fold @ own for fold in table.folds], TINY)
    told = np.array([own @ fold @ left for fold in table.folds]) / weight
    late = float(np.average(told, weights=weight))
    scatter = float(np.average((told - late) ** 2, weights=weight)) / max(len(told) - 1, 1)
    return Delay(late, float(np.sqrt(max(1.0 / squares, scatter))))


def delay_behind(made: Analysis) -> Delay:
    """Return the delay of a load whose torsion the model predicts.

    A load that is late by d predicts p(t − d): what is left follows d dp/dt, beside the columns of
    the model with all its names, those that were taken back included. What no name explains may
    follow it too: beside that, a delay is told from none only at twice the error.
    """
    problem, searcher = made.study.problem, made.searcher
    taken = {step.effect.name: step.effect for step in made.steps}
    back = [taken[name] for name in made.rejected if name in taken]
    work, _ = searcher.fitted(made.final.with_effects(*back))
    slopes = tuple(
        np.gradient(work.predict(problem, number), run.log["time"])
        for number, run in enumerate(problem.runs)
    )
    sheet = work.sheet(given=Functions(column=slopes))
    late = _last_column(tabulated(problem, sheet, searcher.whitening))
    return replace(late, error=2.0 * late.error) if made.leftover.groups else late


def lead_of(made: Analysis) -> Delay:
    """Return by how much the sensor of the final model is ahead of its load; its lag stands in it.

    No delay where the model has no lag.
    """
    work = made.final
    if LAG not in [effect.name for effect in work.effects]:
        return Delay()
    dictionary = made.searcher.study.dictionary(work, made.searcher.whitening)
    lead = -float(work.values(LAG)[0])
    return Delay(lead, abs(lead) / np.sqrt(max(dictionary.gain(LAG), TINY)))


def load_delays(logs: Sequence[Log], target: str, load: str, late: float) -> tuple[DataFault, ...]:
    """Return the fault of each run whose known load is late by so much against the target, s."""
    channel, other = (load, target) if late > 0.0 or target == "torsion" else (target, load)
    why = ", which cannot read a torque before it is there" if target in SENSOR else ""
    size, early = abs(late) / milli, channel == load and late < 0.0
    return tuple(
        DataFault(
            log.name,
            "load_delay",
            channel,
            abs(late),
            "s",
            (0, len(log)),
            f"{log.name}: {channel} is {size:.3g} ms {'early' if early else 'late'} against "
            f"{other}{why}; names are looked for with {load} moved by that much. "
            f"Ask for the repair shift={channel}:{late if early else abs(late):.3g}.",
        )
        for log in logs
    )
