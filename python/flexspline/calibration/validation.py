"""Residuals on rows that the regression never saw.

Whole runs are left out where there are at least four and the others still hold load and
temperature, else contiguous blocks. The lag is found again for each, within a factor of four of
that of all: the sums of blocks at a grid of lags serve every fold, a parabola through the best
three says where between them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from flexspline.calibration.regression import (
    Regression,
    residuals_of,
    solution_of,
    sums_of,
)
from flexspline.calibration.runs import CalibrationRun
from flexspline.least_squares.validation import BLOCKS, FARTHEST, RUNS_NEEDED

__all__ = ["Validation", "cross_validate"]

Array = NDArray[np.float64]

GRID = 17
CARRIES = 0.5  # of the spread of load and temperature that has to stay when a run is left out


@dataclass(frozen=True)
class Validation:
    """Held-out residuals, V, an array (N,) for each run. `by`: "runs" or "blocks".

    `rmses`: (folds,), V, of each part that was left out, and `labels` what it was.
    """

    residuals: tuple[Array, ...]
    by: str
    rmses: Array
    labels: tuple[str, ...]


def cross_validate(runs: Sequence[CalibrationRun], made: Regression) -> Validation:
    """Leave out one run, or one block, after the other."""
    by_runs = len(runs) >= RUNS_NEEDED and all(_carried(runs, k) for k in range(len(runs)))
    edges = [_edges(run, len(runs), by_runs) for run in runs]
    sums = sums_of(runs, made.shape, edges)
    grid = _lag_grid(made)
    at_grid = [sums_of(runs, replace(made.shape, lag=lag), edges) for lag in grid]
    held_out = [np.full(len(run), np.nan) for run in runs]
    parts = [(k, a, b) for k, cuts in enumerate(edges) for a, b in pairwise(cuts)]
    for fold, (number, first, last) in enumerate(parts):
        others = [other for other in range(len(parts)) if other != fold]
        shape = made.shape
        if made.lag_free:
            squares = [solution_of(s, others).residual_squares for s in at_grid]
            shape = replace(shape, lag=_least(grid, np.array(squares)))
        solution = solution_of(sums if shape == made.shape else sums_of(runs, shape, edges), others)
        residual = residuals_of([runs[number]], shape, solution)[0]
        held_out[number][first:last] = residual[first:last]
    rmses = np.array([_rms(held_out[k][a:b]) for k, a, b in parts])
    labels = tuple(_label(runs[k], a, b, by_runs) for k, a, b in parts)
    return Validation(tuple(held_out), "runs" if by_runs else "blocks", rmses, labels)


def _lag_grid(made: Regression) -> Array:
    """Lags around that of all rows, s; none where it is not fitted."""
    if not made.lag_free:
        return np.empty(0)
    return np.asarray(made.shape.lag * np.exp(np.linspace(-FARTHEST, FARTHEST, GRID)))


def _least(grid: Array, squares: Array) -> float:
    """The lag of least squares: the vertex through the best point and its neighbours."""
    best = int(np.argmin(squares))
    if not 0 < best < len(grid) - 1:
        return float(grid[best])
    before, at, behind = squares[best - 1 : best + 2]
    bend = before - 2.0 * at + behind
    if not bend > 0.0:
        return float(grid[best])
    step = np.log(grid[1] / grid[0])
    return float(grid[best] * np.exp(0.5 * step * (before - behind) / bend))


def _edges(run: CalibrationRun, count: int, by_runs: bool) -> list[int]:
    parts = 1 if by_runs else max(2, round(BLOCKS / count))
    return [int(row) for row in np.linspace(0, len(run), parts + 1)]


def _carried(runs: Sequence[CalibrationRun], left_out: int) -> bool:
    """Whether the other runs hold enough of the load and of the temperatures."""
    others = [run for k, run in enumerate(runs) if k != left_out]
    return _spread(others) >= CARRIES * _spread(runs) and (
        _spread(others, warmth=True) >= CARRIES * _spread(runs, warmth=True)
    )


def _spread(runs: Sequence[CalibrationRun], *, warmth: bool = False) -> float:
    """Standard deviation of load or temperature over all rows; 0 without."""
    columns = [run.temperature if warmth else run.torque for run in runs]
    return float(np.std(np.concatenate([c if c is not None else np.zeros(1) for c in columns])))


def _label(run: CalibrationRun, first: int, last: int, by_runs: bool) -> str:
    if by_runs:
        return run.log.name
    time = run.log["time"]
    return f"{run.log.name}, {time[first]:.4g} to {time[last - 1]:.4g} s"


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
