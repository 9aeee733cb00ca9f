"""Residuals on folds that the coefficients never saw, row by row in the target's unit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from flexspline.discovery.nameless import Nameless, columns_of
from flexspline.discovery.predictive import prior_of
from flexspline.discovery.scores import gain_of
from flexspline.discovery.table import by_runs, left_by, solved, tabulated
from flexspline.discovery.whitening import Whitening
from flexspline.discovery.working import Working
from flexspline.fit.problem import Problem
from flexspline.fit.validation import run_edges

BESIDE = "functions without a name"

__all__ = ["HeldOut", "held_out"]

Array = NDArray[np.float64]


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
    columns = []
    for number in range(len(problem.runs)):
        rows, target = work.rows(problem, number, bends=False)
        columns.append((np.column_stack([rows, columns_of(beside, problem, number)]), target))
    table = tabulated(problem, columns, whitening)
    every, total = np.arange(len(table.total) - 1), table.total
    drawn = np.diag(total) * _drawn(work, total, len(every))
    fold, made = 0, []
    for number, (rows, target) in enumerate(columns):
        left = np.full(len(target), np.nan)
        counts = _counts(problem, number)
        for first, last in pairwise(run_edges(problem, number, by_runs(problem))):
            beta = solved(total - table.folds[fold] + np.diag(drawn), every)
            left[first:last] = target[first:last] - rows[first:last] @ beta
            fold += 1
        made.append(np.where(counts, left, np.nan))
    return HeldOut(tuple(made))


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


def _counts(problem: Problem, number: int) -> NDArray[np.bool_]:
    run = problem.runs[number]
    mask = np.zeros(len(run), dtype=bool)
    for first, last in run.stretches:
        mask[first:last] = True
    return mask
