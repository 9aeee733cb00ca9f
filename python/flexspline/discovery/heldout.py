"""Residuals on folds that the coefficients never saw, row by row in the target's unit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from flexspline.discovery.evidence import gain_of
from flexspline.discovery.nameless import Nameless
from flexspline.discovery.predictive import prior_of
from flexspline.discovery.refit import solved_at
from flexspline.discovery.settings import SETTINGS, TINY
from flexspline.discovery.sheet import Sheet
from flexspline.discovery.stretches import edges_of
from flexspline.discovery.table import inverse_of, left_by, solved, tabulated
from flexspline.discovery.whitening import Whitening
from flexspline.discovery.working import Working
from flexspline.fit.problem import Problem

__all__ = ["Fold", "HeldOut", "held_out", "plain_rows"]

Array = NDArray[np.float64]

BESIDE = "functions without a name"


@dataclass(frozen=True, eq=False)
class Fold:
    """Rows [first, last) of a run, and the coefficients (P,) of the fit that never saw them."""

    run: int
    first: int
    last: int
    coefficients: Array


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Fits to all folds but one, and what they leave of that one.

    `betas`: coefficients (C,) of the columns of `sheet` without each fold. `mean_square`: what they
    leave, of the rows that the sums hold. `spread`: mean square by which the coefficients'
    uncertainty moves the prediction; large where a fold goes where no other went. `squares`: what
    is left over σ² once filtered as the noise is, in χ².
    """

    problem: Problem
    work: Working
    sheet: Sheet
    betas: tuple[Array, ...]
    mean_square: float
    spread: float
    squares: float

    @cached_property
    def residuals(self) -> tuple[Array, ...]:
        """(N,) of each run, NaN where a row does not count."""
        return tuple(self.sheet.left_over(self.problem, self.betas))

    @cached_property
    def folds(self) -> tuple[Fold, ...]:
        """The folds, in order, each with the fit that never saw it."""
        return tuple(_folds(self.problem, self.work, self.betas))

    @property
    def rmse(self) -> float:
        """In the unit of the target, of all rows that count."""
        counted = (np.isfinite(part) for part in self.residuals)
        parts = [part if c.all() else part[c] for part, c in
                 zip(self.residuals, counted, strict=True)]  # fmt: skip
        squares = sum(float(part @ part) for part in parts)
        return float(np.sqrt(squares / sum(map(len, parts))))

    def worse_than(self, other: HeldOut, factor: float) -> bool:
        """Whether the error exceeds another's by a factor, beyond what is not known."""
        unknown = max(self.spread - other.spread, 0.0)
        return self.mean_square - unknown > factor**2 * other.mean_square


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
    others = [total - fold + drawn for fold in table.folds]
    betas = [solved(products, every) for products in others]
    plain, size = table, whitening.variance
    if whitening.order:  # the rows as they are, which only the filter hides
        size = 1.0
        plain = tabulated(problem, sheet, Whitening(np.ones(1), size, problem.decimation))
    moved = [size * np.sum(inverse_of(products) * own[:-1, :-1])
             for products, own in zip(others, plain.folds, strict=True)]  # fmt: skip
    left = [size * _squares(own, beta) for own, beta in zip(plain.folds, betas, strict=True)]
    rows = int(np.sum(plain.rows))
    return HeldOut(
        problem,
        work,
        sheet,
        tuple(betas),
        mean_square=max(float(np.sum(left)), 0.0) / rows,
        spread=float(np.sum(moved)) / rows,
        squares=sum(_squares(fold, beta) for fold, beta in zip(table.folds, betas, strict=True)),
    )


def _squares(products: Array, beta: Array) -> float:
    """What is left of the target of products [columns, y] by coefficients."""
    both = np.append(-beta, 1.0)
    return float(both @ products @ both)


def plain_rows(problem: Problem, work: Working) -> Whitening:
    """Rows as `fit` takes them, for what users see; σ² is what this model leaves.

    Its names count as given here: what physics says of their size is weighed by σ².
    """
    rows = Whitening(np.ones(1), 1.0, problem.decimation)
    _, squares = solved_at(problem, replace(work, base=len(work.effects)), rows)
    count = sum(len(at) for run in problem.runs for at in rows.taken(run))
    whole = sum(float(run.target @ run.target) for run in problem.runs)
    return replace(rows, variance=max(squares, SETTINGS.singular**2 * whole, TINY) / max(count, 1))


def _folds(problem: Problem, work: Working, betas: Sequence[Array]) -> Iterator[Fold]:
    """Each fold with all coefficients of the model that never saw it."""
    count, solutions = len(work.free), iter(betas)
    for number in range(len(problem.runs)):
        for first, last in pairwise(edges_of(problem, number)):
            values = work.coefficients.copy()
            values[work.free] = next(solutions)[:count]
            yield Fold(number, int(first), int(last), values)


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
