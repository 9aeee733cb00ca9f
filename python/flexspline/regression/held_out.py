"""What fits to all folds but one leave of that one: whole runs, or blocks of fewer than four."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from flexspline.least_squares.problem import Problem
from flexspline.regression.gram import (
    SINGULAR,
    TINY,
    Given,
    Sheet,
    Table,
    Whitening,
    edges_of,
    gain_of,
    solved,
    tabulated,
)
from flexspline.regression.working import Working, solved_at

__all__ = ["Fold", "HeldOut", "fall_of", "held_out", "plain_rows"]

Array = NDArray[np.float64]


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

    `betas`: coefficients (C,) of the columns of `sheet` without each fold. `squares`: what is left
    over σ² once filtered as the noise is, in χ².
    """

    problem: Problem
    work: Working
    sheet: Sheet
    betas: tuple[Array, ...]
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


def held_out(
    problem: Problem, work: Working, whitening: Whitening, beside: Given | None = None
) -> HeldOut:
    """Leave out one fold after the other and fit the coefficients to the rest; shapes stay.

    Columns that no other fold sees contribute nothing, and what the other folds do not tell from
    the base is the base's: a spring that slips all the time there is Coulomb friction. Many
    functions beside a model would go anywhere in places that few rows of the rest have seen: they
    are shrunk (`_ridge`).
    """
    sheet = work.sheet(bends=False, given=beside)
    table = tabulated(problem, sheet, whitening)
    every = np.arange(len(table.total) - 1)
    ridge = _ridge(table, len(work.free))
    given = {effect.name for effect in work.effects[: work.base]}
    base = sum(owner in given for owner in work.owners()[: len(work.free)])
    betas = tuple(solved(table.total - fold + ridge, every, base) for fold in table.folds)
    squares = sum(_squares(fold, beta) for fold, beta in zip(table.folds, betas, strict=True))
    return HeldOut(problem, work, sheet, betas, squares)


def _ridge(table: Table, own: int) -> Array:
    """What is added to the products, (C + 1, C + 1), for columns behind the model's own.

    Ridge regression by empirical Bayes [Hoerl1975]: of m columns that explain
    χ² together, each explains (χ² − m) / m beyond chance, and is that size times a normal number.
    """
    columns, raw = np.arange(own, len(table.total) - 1), np.diag(table.total)
    ridge = np.zeros_like(raw)
    if len(columns):
        gain, seen = gain_of(table.without(np.arange(own)), columns, raw)
        ridge[columns] = raw[columns] * seen / max(gain - seen, 1.0)
    return np.diag(ridge)


def _squares(products: Array, beta: Array) -> float:
    """What is left of the target of products [columns, y] by coefficients."""
    both = np.append(-beta, 1.0)
    return float(both @ products @ both)


def plain_rows(problem: Problem, work: Working) -> Whitening:
    """Rows as `fit` takes them, for what users see; σ² is what this model leaves."""
    rows = Whitening(np.ones(1), 1.0, problem.decimation)
    _, squares = solved_at(problem, work, rows)
    count = sum(len(at) for run in problem.runs for at in rows.taken(run))
    whole = sum(float(run.target @ run.target) for run in problem.runs)
    return replace(rows, variance=max(squares, SINGULAR**2 * whole, TINY) / max(count, 1))


def _folds(problem: Problem, work: Working, betas: Sequence[Array]) -> Iterator[Fold]:
    """Each fold with all coefficients of the model that never saw it."""
    count, solutions = len(work.free), iter(betas)
    for number in range(len(problem.runs)):
        for first, last in pairwise(edges_of(problem, number)):
            values = work.coefficients.copy()
            values[work.free] = next(solutions)[:count]
            yield Fold(number, int(first), int(last), values)


def fall_of(before: Sequence[Array], after: Sequence[Array], rows: int) -> tuple[float, float]:
    """Return how much the mean square of residuals (N,) falls, and its standard error.

    NaN where a row does not count; `rows`: of a block.

    With s the difference of both predictions and e what is left after, s² + 2 s e is the fall of a
    row. Chance is in the second term alone: its sums over blocks, longer than the memory of e, are
    independent and have no mean of their own.
    """
    total, sums, count = 0.0, list[float](), 0
    for old, new in zip(before, after, strict=True):
        both = np.isfinite(old) & np.isfinite(new)
        gain, left = old[both] - new[both], new[both]
        total += float(gain @ (gain + 2.0 * left))
        blocks = np.array_split(2.0 * gain * left, max(1, round(len(gain) / rows)))
        sums += [float(block.sum()) for block in blocks if len(block)]
        count += len(gain)
    chance = float(np.linalg.norm(sums)) if len(sums) > 1 else np.inf
    return total / max(count, 1), chance / max(count, 1)
