"""Residuals on rows that the fit never saw.

Whole runs are left out where there are at least four, else contiguous blocks. What a fold's fit
would be follows from sums over the other folds, around the solution of all:

    δ = argmin Σ_other folds w (r − Z δ)²
    (Σ_other w Z Zᵀ) δ = Σ_other w Z r = −Σ_fold w Z r

with Z the tangent rows. The last step holds because Σ w Z r of all folds is zero at the solution;
with priors it is their share, which every fold has. Without shapes the fold's residual is r − Z δ.
With shapes Z is true near the solution only: where one moves further, the shapes go all, half or
none of the way that δ says, whichever suits the other folds best, and the coefficients are solved
for again there. Of generalised least squares Z and r are filtered, and folds are fitted anew.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from flexspline.effects import Effect
from flexspline.fit.estimate import Estimate, counts_of
from flexspline.fit.linear import LinearFit, fit_linear
from flexspline.fit.newton import newton
from flexspline.fit.prewhitening import filtered_pieces
from flexspline.fit.problem import Problem

__all__ = ["Validation", "cross_validate"]

Array = NDArray[np.float64]

RUNS_NEEDED = 4
BLOCKS = 8
WAYS = (0.0, 0.5, 1.0)
NEAR = 0.01  # of its value that a shape may move along the tangent alone
FARTHEST = np.log(4.0)  # that a shape may go from the solution of all, as a factor


@dataclass(frozen=True)
class Validation:
    """Held-out residuals, an array (N,) for each run; NaN on rows that do not count.

    `by`: "runs" or "blocks". `folds`: how many.
    """

    residuals: tuple[Array, ...]
    by: str
    folds: int


@dataclass(frozen=True)
class _Fold:
    """Rows [first, last) of one run."""

    run: int
    first: int
    last: int


def cross_validate(made: Estimate) -> Validation:
    """Leave out one run, or one block, after the other."""
    problem = made.tangent.problem
    by_runs = len(problem.runs) >= RUNS_NEEDED and not problem.offset_per_run
    folds = [
        _Fold(number, first, last)
        for number in range(len(problem.runs))
        for first, last in pairwise(run_edges(problem, number, by_runs))
    ]
    moves = _moves(made, folds)
    find = _moved if _nearly_linear(made, moves) else _refitted
    return Validation(find(made, folds, moves), "runs" if by_runs else "blocks", len(folds))


def _nearly_linear(made: Estimate, moves: list[Array]) -> bool:
    """Whether no fold moves a shape so far that the tangent would be wrong there."""
    values = np.array([shape.value(made.linear.effects) for shape in made.free_shapes])
    return all((np.abs(move[len(made.fitted) :]) <= NEAR * values).all() for move in moves)


def _moves(made: Estimate, folds: list[_Fold]) -> list[Array]:
    """δ of each fold, (F + S,)."""
    width = made.basis.shape[1]
    products = np.zeros((len(folds), width, width))
    correlations = np.zeros((len(folds), width))
    pieces = made.tangent.pieces()
    if made.denominator is not None:
        pieces = filtered_pieces(made.tangent, made.denominator)
    for number, rows, chunk in pieces:
        z = chunk.rows @ made.basis
        weighted = z if chunk.weights is None else z * chunk.weights[:, None]
        for fold, part in _parts(folds, number, rows):
            products[fold] += weighted[part].T @ z[part]
            correlations[fold] += weighted[part].T @ chunk.residual[part]
    known = made.prior_rows @ made.basis
    whole = products.sum(axis=0) + known.T @ known
    return [
        made.basis @ np.linalg.lstsq(whole - without, -pull, rcond=1e-13)[0]
        for without, pull in zip(products, correlations, strict=True)
    ]


def _moved(made: Estimate, folds: list[_Fold], moves: list[Array]) -> tuple[Array, ...]:
    """Held-out residuals of a linear fit, r − Z δ."""
    residuals = [np.full(len(run), np.nan) for run in made.tangent.problem.runs]
    for number, rows, chunk in made.tangent.pieces():
        for fold, part in _parts(folds, number, rows):
            held_out = chunk.residual[part] - chunk.rows[part] @ moves[fold]
            residuals[number][rows.start + part.start : rows.start + part.stop] = held_out
    return tuple(residuals)


def _refitted(made: Estimate, folds: list[_Fold], moves: list[Array]) -> tuple[Array, ...]:
    """Held-out residuals of a fit with shapes."""
    problem = made.tangent.problem
    residuals = [np.full(len(run), np.nan) for run in problem.runs]
    for fold, move in zip(folds, moves, strict=True):
        best = _fit_without(made, fold, move)
        run = problem.runs[fold.run]
        predicted = problem.predict_run(best.effects, best.coefficients, fold.run)
        rows = np.flatnonzero(counts_of(run))
        rows = rows[(rows >= fold.first) & (rows < fold.last)]
        residuals[fold.run][rows] = (run.target - predicted)[rows]
    return tuple(residuals)


def _fit_without(made: Estimate, fold: _Fold, move: Array) -> LinearFit:
    """The best fit to the other folds on the way that δ says."""
    others = _without(made.tangent.problem, fold)
    if made.denominator is not None:
        apart = newton(replace(made, tangent=replace(made.tangent, problem=others)))
        if apart is not None:
            return apart.linear
    tries = [
        fit_linear(
            others,
            _shifted(made, way * move[len(made.fitted) :]),
            made.constraints,
            start=made.linear.coefficients,
            weights=made.tangent.weights,
            noise_variance=made.noise_variance,
            exact=made.linear.exact,
        )
        for way in WAYS
    ]
    return min(tries, key=lambda fit: fit.squares)


def _shifted(made: Estimate, step: Array) -> tuple[Effect, ...]:
    """The effects with their shapes moved by `step` (S,), in proportion, within their bounds."""
    effects = made.linear.effects
    for shape, change in zip(made.free_shapes, step, strict=True):
        value = shape.value(effects)
        factor = np.exp(np.clip(change / value, -FARTHEST, FARTHEST))
        effects = shape.set(
            effects, float(np.clip(value * factor, shape.info.lower, shape.info.upper))
        )
    return effects


def _without(problem: Problem, fold: _Fold) -> Problem:
    """The problem without the rows of a fold."""
    run = problem.runs[fold.run]
    kept = [
        piece
        for first, last in run.stretches
        for piece in ((first, min(last, fold.first)), (max(first, fold.last), last))
        if piece[0] < piece[1]
    ]
    runs = list(problem.runs)
    runs[fold.run] = replace(run, stretches=tuple(kept))
    return replace(problem, runs=tuple(runs))


def run_edges(problem: Problem, number: int, by_runs: bool) -> list[int]:
    """Rows at which the folds of a run begin, and its end."""
    size = len(problem.runs[number])
    if by_runs:
        return [0, size]
    count = max(2, round(BLOCKS / len(problem.runs)))
    return [int(row) for row in np.linspace(0, size, count + 1)]


def _parts(folds: list[_Fold], number: int, rows: slice) -> list[tuple[int, slice]]:
    """Folds that a piece of a run touches, with the rows of the piece that lie in each."""
    parts = []
    for at, fold in enumerate(folds):
        begin, end = max(fold.first, rows.start), min(fold.last, rows.stop)
        if fold.run == number and begin < end:
            parts.append((at, slice(begin - rows.start, end - rows.start)))
    return parts
