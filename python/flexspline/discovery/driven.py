"""Base and extended model driven forward through folds that no fit saw: does the motion agree?

Each fold starts from its measured state and is driven by its inputs alone, by the coefficients of
the fit to all other folds.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexspline.discovery.analysis import Analysis
from flexspline.discovery.heldout import Fold, HeldOut
from flexspline.discovery.working import Working
from flexspline.errors import InputError
from flexspline.logs.log import Log
from flexspline.model import PART_OF, Model, Part

__all__ = ["DrivenRun", "Motion", "driven_apart"]

Array = NDArray[np.float64]

DRIVES = ("motor_torque", "motor_current")


@dataclass(frozen=True, eq=False)
class DrivenRun:
    """One fold: its log, and measured and simulated values (N,) in the channel's unit."""

    log: Log
    measured: Array
    base: Array
    final: Array


@dataclass(frozen=True, eq=False)
class Motion:
    """Forward simulation before and after; RMSE in `unit`, over all rows of all folds."""

    channel: str
    unit: str
    runs: tuple[DrivenRun, ...]

    @property
    def base_rmse(self) -> float:
        return self._rmse("base")

    @property
    def final_rmse(self) -> float:
        return self._rmse("final")

    def _rmse(self, which: str) -> float:
        left = np.concatenate([run.measured - getattr(run, which) for run in self.runs])
        return float(np.sqrt(np.nanmean(left**2)))


def driven_apart(
    made: Analysis, before: HeldOut, after: HeldOut, facts: Mapping[str, Any]
) -> Motion | None:
    """Return both models' motion through every fold, None where one of them cannot be driven."""
    problem = made.study.problem
    both = (made.base, made.final)
    alone = problem.simulated is None  # a correction is no joint that can be driven
    if problem.target not in DRIVES or problem.lowpass is not None or not alone:
        return None
    if not all("inertia" in [e.name for e in work.effects] for work in both):
        return None
    try:
        return _driven(made, before, after, dict(facts))
    except InputError:
        return None


def _driven(made: Analysis, before: HeldOut, after: HeldOut, facts: dict[str, Any]) -> Motion:
    from flexspline.forward import simulate

    problem, runs = made.study.problem, []
    for first, last in zip(before.folds, after.folds, strict=True):
        log = problem.runs[first.run].log
        log = log.rows(slice(first.first, first.last), note="one fold")
        one = simulate(_model(made, made.base, first, facts), log)
        two = simulate(_model(made, made.final, last, facts), log)
        runs.append(DrivenRun(log, one.measured, one.simulated, two.simulated))
    return Motion(one.channel, one.unit, tuple(runs))


def _model(made: Analysis, work: Working, fold: Fold, facts: dict[str, Any]) -> Model:
    """The model of the fit that never saw a fold."""
    problem = made.study.problem
    part = Part(problem.target, work.effects, fold.coefficients, problem.known_load)
    return Model({PART_OF[problem.target]: part}, facts)
