"""Residuals on rows that the fit never saw.

Whole runs are left out where there are at least four, else contiguous blocks. What a fold's fit
would be follows from sums over the other folds, around the solution of all:

    δ = argmin Σ_other folds w (r − Z δ)²,    residual of the fold = r − Z δ
    (Σ_other w Z Zᵀ) δ = Σ_other w Z r = −Σ_fold w Z r

with Z the tangent rows, so shapes are refitted too (to first order). The last step holds because
Σ w Z r of all folds is zero at the solution; with priors it is their share, which every fold has.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from flexspline.fit.problem import Problem
from flexspline.fit.tangent import Tangent

__all__ = ["Validation", "cross_validate"]

Array = NDArray[np.float64]

RUNS_NEEDED = 4
BLOCKS = 8


@dataclass(frozen=True)
class Validation:
    """Held-out residuals, an array (N,) for each run; NaN on rows that do not count.

    `by`: "runs" or "blocks". `folds`: how many.
    """

    residuals: tuple[Array, ...]
    by: str
    folds: int


def cross_validate(problem: Problem, tangent: Tangent, basis: Array, penalty: Array) -> Validation:
    """Leave out one run, or one block, after the other.

    Parameters
    ----------
    basis : (F + S, K), combinations of parameters that the data determine.
    penalty : (m, F + S), rows that priors add to every fold.
    """
    by_runs = len(problem.runs) >= RUNS_NEEDED and not problem.offset_per_run
    edges = [run_edges(problem, number, by_runs) for number in range(len(problem.runs))]
    offsets = np.cumsum([0] + [len(e) - 1 for e in edges])
    folds = int(offsets[-1])
    width = basis.shape[1]
    products, correlations = np.zeros((folds, width, width)), np.zeros((folds, width))
    for number, rows, chunk in tangent.pieces():
        z = chunk.rows @ basis
        weighted = z if chunk.weights is None else z * chunk.weights[:, None]
        for fold, part in _parts(edges[number], rows, int(offsets[number])):
            products[fold] += weighted[part].T @ z[part]
            correlations[fold] += weighted[part].T @ chunk.residual[part]
    known = penalty @ basis
    whole = products.sum(axis=0) + known.T @ known
    moves = [
        basis @ np.linalg.lstsq(whole - without, -pull, rcond=1e-13)[0]
        for without, pull in zip(products, correlations, strict=True)
    ]
    residuals = [np.full(len(run), np.nan) for run in problem.runs]
    for number, rows, chunk in tangent.pieces():
        for fold, part in _parts(edges[number], rows, int(offsets[number])):
            held_out = chunk.residual[part] - chunk.rows[part] @ moves[fold]
            residuals[number][rows.start + part.start : rows.start + part.stop] = held_out
    return Validation(tuple(residuals), "runs" if by_runs else "blocks", folds)


def run_edges(problem: Problem, number: int, by_runs: bool) -> list[int]:
    """Rows at which the folds of a run begin, and its end."""
    size = len(problem.runs[number])
    if by_runs:
        return [0, size]
    count = max(2, round(BLOCKS / len(problem.runs)))
    return [int(row) for row in np.linspace(0, size, count + 1)]


def _parts(edges: list[int], rows: slice, offset: int) -> list[tuple[int, slice]]:
    """Folds that a piece of a run touches, with the rows of the piece that lie in each."""
    parts = []
    for fold, (first, last) in enumerate(pairwise(edges)):
        begin, end = max(first, rows.start), min(last, rows.stop)
        if begin < end:
            parts.append((offset + fold, slice(begin - rows.start, end - rows.start)))
    return parts
