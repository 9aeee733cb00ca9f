"""Residuals on folds that the coefficients never saw, row by row in the target's unit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexspline.discovery.nameless import Nameless
from flexspline.discovery.predictive import prior_of
from flexspline.discovery.scores import gain_of
from flexspline.discovery.table import left_by, solved, tabulated
from flexspline.discovery.whitening import Whitening
from flexspline.discovery.working import Working
from flexspline.fit.problem import Problem

__all__ = ["HeldOut", "held_out"]

Array = NDArray[np.float64]

BESIDE = "functions without a name"


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Residuals (N,) of each run, NaN where a row does not count."""

    residuals: tuple[Array, ...]

    @property
    def joined(self) -> Array:
        """Of all rows that count, one run behind the other."""
        every = np.concatenate(self.residuals)
        return every[np.isfinite(every)]

    @property
    def rmse(self) -> float:
        """In the unit of the target."""
        return float(np.sqrt(np.mean(self.joined**2)))


def held_out(
    problem: Problem, work: Working, whitening: Whitening, beside: Sequence[Nameless] = ()
) -> HeldOut:
    """Leave out one fold after the other and fit the coefficients to the rest; shapes stay.

    What was named is drawn towards nothing as far as the evidence for it is weak: where a fold
    goes beyond the others, free coefficients run wild.

    `beside`: functions without a name that are fitted too. Columns that no other fold sees
    contribute nothing.
    """
    sheet = work.sheet(bends=False, functions=beside)
    table = tabulated(problem, sheet, whitening)
    every, total = np.arange(len(table.total) - 1), table.total
    drawn = np.diag(np.diag(total) * _drawn(work, total, len(every)))
    betas = [solved(total - fold + drawn, every) for fold in table.folds]
    return HeldOut(tuple(sheet.left_over(problem, betas)))


def _drawn(work: Working, total: Array, count: int) -> Array:
    """Prior of each column as a share of its squares, (count + 1,): none for the base's."""
    owners = [work.owners()[k] for k in range(len(work.free))]
    named = {e.name for e in work.named}
    labels = np.array(owners + [BESIDE] * (count - len(owners)))
    share = np.zeros(count + 1)
    for label in (name for name in dict.fromkeys(labels.tolist()) if name in {*named, BESIDE}):
        mine, rest = np.flatnonzero(labels == label), np.flatnonzero(labels != label)
        gain, _ = gain_of(left_by(total, rest), mine, np.diag(total))
        share[mine] = prior_of(mine, gain)
    return share
