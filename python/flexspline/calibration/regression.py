"""The regression itself, by the sums, the solver and the noise model of `flexspline.fit`.

The voltage is regressed on the reference, not the reference on the voltage as (25) has it: the
reference is the trusted one, and noise in a regressor pulls its coefficient towards zero by
noise²/(noise² + signal²), however long the log. Noise of the voltage (amplifier, ripple, converter)
then only widens the errors; k = 1/s. What noise of the reference does is small, and reported.

The thermal lag is a shape: an outer search around the linear solve, as in `fit.shapes`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from flexspline import _core
from flexspline.calibration.drift import Shape, drift_columns, rows_of, target_of
from flexspline.calibration.runs import CalibrationRun
from flexspline.calibration.structure import beside_structure, quiet
from flexspline.least_squares.noise_model import BLOCK, Chunk, noise_model
from flexspline.least_squares.sums import Solution, Sums, solve
from flexspline.least_squares.uncertainty import Uncertainty, parameter_uncertainty
from flexspline.logs.segments import median_step

__all__ = [
    "Lag",
    "Regression",
    "regress",
    "residuals_of",
    "search_lag",
    "solution_of",
    "sums_of",
]

Array = NDArray[np.float64]
Edges = list[list[int]]

GRID = 13
LAG_TOLERANCE = 1e-4  # of the logarithm of the lag
FLAT = 1e-7
NEAR_BOUND = 1e-3
BEND = 1e-3  # of the lag, relative, for the central difference
LONG = 1_000_000  # rows from which the noise model reads one chunk of several
LEAST_LAG_STEPS = 2.0


@dataclass(frozen=True)
class Lag:
    """How the search for the lag ended. `bound`: −1, 0 or 1. `flat`: the runs say nothing of it."""

    value: float
    bound: int
    flat: bool


@dataclass(frozen=True)
class Regression:
    """Coefficients (P,) in V per unit of their column, with the errors of these and of the lag.

    `solution`: of the linear part. `uncertainty`: of P coefficients and, where `lag_free`, the
    lag [s]. `residuals`: V, an array (N,) for each run.
    """

    shape: Shape
    coefficients: Array
    solution: Solution
    uncertainty: Uncertainty
    lag: Lag | None
    lag_free: bool
    residuals: tuple[Array, ...]


def regress(runs: Sequence[CalibrationRun], shape: Shape, *, find_lag: bool) -> Regression:
    """Solve, search the lag if asked to, and find the errors."""
    whole = [[0, len(run)] for run in runs]
    lag = search_lag(runs, shape, whole) if find_lag else None
    shape = shape if lag is None else replace(shape, lag=lag.value)
    solution = solution_of(sums_of(runs, shape, whole))
    residuals = residuals_of(runs, shape, solution)
    free = lag is not None and lag.bound == 0 and not lag.flat
    uncertainty = _uncertainty(runs, shape, solution, residuals, free)
    return Regression(
        shape, solution.coefficients, solution, uncertainty, lag, free, tuple(residuals)
    )


def sums_of(runs: Sequence[CalibrationRun], shape: Shape, edges: Edges) -> Sums:
    """Sums of products of [rows, target], a block between each two edges of a run."""
    highs, lows, numbers, counts = [], [], [], []
    for number, (run, cuts) in enumerate(zip(runs, edges, strict=True)):
        drift = drift_columns(run, shape)
        rows, target = rows_of(run, shape, drift), target_of(run, shape, drift)
        blocks = list(pairwise(cuts))
        high, low = _core.accumulate_rows(rows, target, blocks, None, True, 1)
        highs.append(high)
        lows.append(low)
        numbers += [number] * len(blocks)
        counts += [last - first for first, last in blocks]
    return Sums(
        np.concatenate(highs),
        np.concatenate(lows),
        np.array(counts, dtype=np.int64),
        np.array(numbers, dtype=np.int64),
    )


def solution_of(sums: Sums, blocks: Sequence[int] | None = None) -> Solution:
    """Least squares over all or some blocks."""
    return solve(*sums.total(blocks))


def search_lag(runs: Sequence[CalibrationRun], shape: Shape, edges: Edges) -> Lag:
    """Find the lag of least squares: a grid in its logarithm, then Brent's search."""
    from scipy.optimize import minimize_scalar

    low, high = np.log(_limits(runs))

    def squares(logarithm: float) -> float:
        trial = replace(shape, lag=float(np.exp(logarithm)))
        return float(solution_of(sums_of(runs, trial, edges)).residual_squares)

    grid = np.linspace(low, high, GRID)
    seen = np.array([squares(point) for point in grid])
    if seen.max() <= seen.min() * (1.0 + FLAT):
        return Lag(float(np.exp(low)), 0, True)
    best = int(np.argmin(seen))
    inside = (grid[max(best - 1, 0)], grid[min(best + 1, GRID - 1)])
    found = minimize_scalar(
        squares, bounds=inside, method="bounded", options={"xatol": LAG_TOLERANCE}
    )
    at = float(found.x if found.fun < seen[best] else grid[best])
    bound = -1 if at - low < NEAR_BOUND else 1 if high - at < NEAR_BOUND else 0
    return Lag(float(np.exp(at)), bound, False)


def _limits(runs: Sequence[CalibrationRun]) -> Array:
    """From two samples to half of the longest run, s."""
    step = max(median_step(run.log["time"]) for run in runs)
    longest = max(run.log.duration for run in runs)
    return np.array([LEAST_LAG_STEPS * step, max(0.5 * longest, 4.0 * step)])


def residuals_of(runs: Sequence[CalibrationRun], shape: Shape, solution: Solution) -> list[Array]:
    """Voltage measured less predicted, V, an array (N,) for each run."""
    found = []
    for run in runs:
        drift = drift_columns(run, shape)
        predicted = rows_of(run, shape, drift) @ solution.coefficients
        found.append(np.asarray(target_of(run, shape, drift) - predicted))
    return found


def _uncertainty(
    runs: Sequence[CalibrationRun],
    shape: Shape,
    solution: Solution,
    residuals: Sequence[Array],
    lag_free: bool,
) -> Uncertainty:
    rows = [_tangent(run, shape, solution, lag_free) for run in runs]
    basis = _basis(rows, residuals) if lag_free else solution.basis
    total = sum(len(run) for run in runs)
    still = [quiet(run) for run in runs]
    smooth = [_tangent(run, shape, solution, lag_free) for run in still]
    wide, left, beside = beside_structure(still, smooth, residuals)
    noise = noise_model(_chunks(runs, wide, left), beside.basis, every=1 + total // LONG)
    return parameter_uncertainty(_chunks(runs, rows, residuals), basis, noise)


def _chunks(
    runs: Sequence[CalibrationRun], rows: Sequence[Array], residuals: Sequence[Array]
) -> Callable[[], Iterator[Chunk]]:
    """Give rows and residuals in pieces, as the noise model reads them."""

    def give() -> Iterator[Chunk]:
        for run, columns, residual in zip(runs, rows, residuals, strict=True):
            for first in range(0, len(run), BLOCK):
                part = slice(first, first + BLOCK)
                yield Chunk(columns[part], residual[part], run.starts[part])

    return give


def _tangent(run: CalibrationRun, shape: Shape, solution: Solution, lag_free: bool) -> Array:
    """Rows with a column more where the lag is free, ∂(prediction)/∂lag."""
    rows = rows_of(run, shape)
    if not lag_free:
        return rows
    ends = []
    for factor in (1.0 - BEND, 1.0 + BEND):
        moved = replace(shape, lag=factor * shape.lag)
        drift = drift_columns(run, moved)
        predicted = rows_of(run, moved, drift) @ solution.coefficients
        ends.append(predicted - target_of(run, moved, drift))
    bend = (ends[1] - ends[0]) / (2.0 * BEND * shape.lag)
    return np.column_stack([rows, bend])


def _basis(rows: Sequence[Array], residuals: Sequence[Array]) -> Array:
    """Directions of coefficients and lag that the data determine; rows @ basis is orthonormal."""
    blocks = [
        _core.accumulate_rows(np.asfortranarray(r), v, [(0, len(r))], None, True, 1)
        for r, v in zip(rows, residuals, strict=True)
    ]
    high = np.concatenate([block[0] for block in blocks])
    low = np.concatenate([block[1] for block in blocks])
    return solve(*_core.merge(high, low, list(range(len(blocks))))).basis
