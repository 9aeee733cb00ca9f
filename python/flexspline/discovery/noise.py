"""The noise that evidence is measured by, in two steps.

A hidden effect that is slow looks like slow noise to a model of the base's residual, and would be
filtered away with it. So the first noise is that of a residual from which everything known was
taken out, and too white; the second is the restricted likelihood's (`fit/noise_model.py`) beside
whatever a lax search with the first has found, among names and among functions without one.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flexspline.discovery.nameless import Nameless, columns_of
from flexspline.discovery.table import solved, tabulated
from flexspline.discovery.whitening import Whitening, rough_whitening
from flexspline.discovery.working import Working
from flexspline.fit.noise_model import Chunk, noise_model
from flexspline.fit.problem import Problem
from flexspline.fit.tangent import Tangent

__all__ = ["first_whitening", "restricted_whitening"]

Array = NDArray[np.float64]

LONG = 1_000_000  # rows from which one piece of several is read
LARGEST_ORDER = 16


def first_whitening(problem: Problem, columns: Sequence[tuple[Array, Array]]) -> Whitening:
    """Noise of what all columns (N, C) leave of the target (N,), given for each run."""
    plain = Whitening(np.ones(1), 1.0, problem.decimation)
    total = tabulated(problem, columns, plain).total
    beta = solved(total, np.arange(len(total) - 1))
    residuals = [target - rows @ beta for rows, target in columns]
    return rough_whitening(residuals, problem.runs, problem.decimation)


def restricted_whitening(
    problem: Problem, work: Working, beside: Sequence[Nameless] = ()
) -> Whitening:
    """Noise beside a model and functions without a name, what both swallow of it accounted for."""
    tangent = Tangent(problem, work.effects, work.coefficients, work.free, work.searched, None)
    columns = [columns_of(beside, problem, number) for number in range(len(problem.runs))]

    def chunks() -> Iterator[Chunk]:
        for number, rows, chunk in tangent.pieces():
            yield replace(chunk, rows=np.column_stack([chunk.rows, columns[number][rows]]))

    rows = sum(run.counted for run in problem.runs)
    noise = noise_model(
        chunks,
        _basis(chunks()),
        max_order=LARGEST_ORDER,
        every=max(1, rows // LONG),
        decimation=problem.decimation,
    )
    return Whitening(noise.denominator, noise.innovation_variance, problem.decimation)


def _basis(chunks: Iterable[Chunk]) -> Array:
    """Directions that the rows determine, (F + S, K), with rows @ basis orthonormal."""
    products = np.asarray(sum(chunk.rows.T @ chunk.rows for chunk in chunks))
    scale = np.sqrt(np.maximum(np.diag(products), 1e-300))
    values, vectors = np.linalg.eigh(products / np.outer(scale, scale))
    seen = values > 1e-10 * values[-1]
    return np.asarray(vectors[:, seen] / np.sqrt(values[seen]) / scale[:, None])
