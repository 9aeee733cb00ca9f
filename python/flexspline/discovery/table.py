"""Sums of products of everything that may explain the target, fold by fold: screening is algebra.

One pass filters the columns of model and candidates and adds up, for each fold, the products of
[columns, y] over σ². With G their sum and m the columns of a model,

    explained(m) = bᵀ G_mm⁻¹ b,     b = G_my        (a χ² of the columns' number where nothing is)
    G − G_·m G_mm⁻¹ G_m·                            what is left of every candidate beside m
    held out     = Σ_f |y_f − X_f β(all but f)|²    from G − G_f and G_f
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexspline import _core
from flexspline.discovery.settings import SETTINGS, TINY
from flexspline.discovery.sheet import Sheet
from flexspline.discovery.stretches import by_runs, edges_of, fold_blocks
from flexspline.discovery.whitening import Whitening
from flexspline.fit.problem import Problem

__all__ = ["Table", "by_runs", "inverse_of", "left_by", "solved", "tabulated"]

Array = NDArray[np.float64]
Columns = NDArray[np.intp]

SINGULAR = SETTINGS.singular


@dataclass(frozen=True, eq=False)
class Table:
    """Products of [columns, y] over σ², (F, C + 1, C + 1) by fold, and rows (F,) in each."""

    folds: Array
    rows: NDArray[np.int64]

    @cached_property
    def total(self) -> Array:
        """(C + 1, C + 1), over all folds."""
        return np.asarray(self.folds.sum(axis=0))

    def of(self, columns: Columns) -> Table:
        """Return the table of some columns, in this order, with y behind them."""
        chosen = np.append(columns, self.folds.shape[1] - 1)
        return Table(self.folds[:, chosen[:, None], chosen], self.rows)

    def without(self, model: Columns) -> Array:
        """Products of what the model's columns leave of all others, (C + 1, C + 1)."""
        return left_by(self.total, model)

    def held_out(self, model: Columns) -> Array:
        """Squares that are left on each fold by a fit to the others, (F,)."""
        total, left = self.total, []
        for fold in self.folds:
            beta = solved(total - fold, model)
            cross = fold[model, -1]
            inside = beta @ fold[np.ix_(model, model)] @ beta
            left.append(fold[-1, -1] - 2.0 * beta @ cross + inside)
        return np.array(left)


def solved(products: Array, model: Columns) -> Array:
    """Coefficients of least squares, (m,), of least norm where columns depend on each other."""
    inverse, scale = _inverse(products, model)
    return np.asarray(inverse @ (products[model, -1] / scale) / scale)


def inverse_of(products: Array) -> Array:
    """Covariance (C, C) of the coefficients of all columns of products [columns, y] over σ²."""
    inverse, scale = _inverse(products, np.arange(len(products) - 1))
    return np.asarray(inverse / np.outer(scale, scale))


def left_by(products: Array, model: Columns) -> Array:
    """The Schur complement: products of all columns after `model` is taken out."""
    inverse, scale = _inverse(products, model)
    across = products[model] / scale[:, None]
    return np.asarray(products - across.T @ inverse @ across)


def _inverse(products: Array, model: Columns) -> tuple[Array, Array]:
    """Pseudo-inverse (m, m) of the columns' products scaled to length one, and the lengths."""
    scale = np.sqrt(np.maximum(products[model, model], 0.0))
    scale = np.where(scale > 0.0, scale, 1.0)
    values, vectors = np.linalg.eigh(products[np.ix_(model, model)] / np.outer(scale, scale))
    seen = values > SINGULAR * max(float(values.max(initial=0.0)), TINY)
    return (vectors[:, seen] / values[seen]) @ vectors[:, seen].T, scale


def tabulated(
    problem: Problem, columns: Sheet | Sequence[tuple[Array, Array]], whitening: Whitening
) -> Table:
    """Add up the products of columns and target: of a sheet, or of (N, C) and (N,) of each run."""
    if isinstance(columns, Sheet) and columns.even(problem):
        folds = columns.products(problem, whitening)
        return Table(folds / whitening.variance, _rows_of_folds(problem, whitening))
    if isinstance(columns, Sheet):
        columns = [columns.rows(problem, number) for number in range(len(problem.runs))]
    products = []
    for number, (rows, target) in enumerate(columns):
        made, at = whitening(np.column_stack([rows, target]), problem.runs[number])
        blocks = fold_blocks(problem, number, at)
        plain = np.asfortranarray(made[:, :-1])
        high, _ = _core.accumulate_rows(plain, made[:, -1], blocks, None, False, problem.threads)
        products.append(high / whitening.variance)
    return Table(np.concatenate(products), _rows_of_folds(problem, whitening))


def _rows_of_folds(problem: Problem, whitening: Whitening) -> NDArray[np.int64]:
    kept: dict[Any, Any] = problem.kept  # models come and go, the rows stay
    key = "rows of folds", whitening.order, whitening.decimation
    own = [run.stretches for run in problem.runs]
    if key not in kept or kept[key][0] != own:
        made = []
        for number, run in enumerate(problem.runs):
            edges = edges_of(problem, number)
            counts = [whitening.counted(first, last, edges) for first, last in run.stretches]
            made.append(np.sum(counts, axis=0, dtype=np.int64))
        kept[key] = own, np.concatenate(made)
    found: NDArray[np.int64] = kept[key][1]
    return found
