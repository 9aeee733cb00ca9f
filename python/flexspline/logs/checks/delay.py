"""By how much a channel is late behind what it is made of.

    y(t) = X(t - D) c        D minimises the sum of squares, c solved for each D

D comes from a scan in coarse steps over some of the rows, from its best step downhill over all of
them, and a bounded search around the lowest. Its error comes
from sixteen blocks of time: the correction that each block alone asks for, weighted by how much it
knows, so that noise with a memory does not make it too small.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar

Array = NDArray[np.float64]

MOST_ROWS = 6_000
SCANNED = 3  # every so many rows of these, for the scan
BLOCKS = 16


@dataclass(frozen=True)
class Delay:
    """A delay [s] with its standard error, and how well X explains y with it and without."""

    seconds: float
    error: float
    coefficients: Array
    explained: float
    explained_without: float


def find_delay(
    time: Array, target: Array, columns: Array, valid: NDArray[np.bool_], within: float, step: float
) -> Delay | None:
    """Delay of `target` behind the linear combination of `columns` that explains it best.

    Parameters
    ----------
    time : array (N,), s
    target : array (N,), any unit
    columns : array (N, M), any units; a column of ones is added
    valid : rows (N,) of the target to look at, at least `within` away from gaps
    within : s, delays from -within to +within are tried
    step : s, of the scan
    """
    rows = np.flatnonzero(valid)
    if rows.size < 200:
        return None
    rows = rows[:: max(1, rows.size // MOST_ROWS)]
    y, at = target[rows], time[rows]
    scale = np.sqrt(np.mean(columns[rows] ** 2, axis=0))
    used = columns[:, scale > 0] / scale[scale > 0]
    curve = CubicSpline(time, used)
    power = float(np.sum((y - y.mean()) ** 2))
    if power == 0:
        return None

    def design_at(delay: float, every: int = 1) -> Array:
        return np.asarray(np.column_stack((curve(at[::every] - delay), np.ones(len(at[::every])))))

    def loss(delay: float, every: int = 1) -> float:
        """Squares left, by the normal equations: many delays are tried."""
        design, some = design_at(delay, every), y[::every]
        solved = np.linalg.lstsq(design.T @ design, design.T @ some, rcond=1e-12)[0]
        return float(np.sum((some - design @ solved) ** 2)) / power

    def solve(delay: float) -> tuple[Array, Array, Array]:
        design = design_at(delay)
        solved = np.linalg.lstsq(design, y, rcond=1e-9)[0]
        return np.asarray(solved), y - design @ solved, design

    count = max(1, int(np.ceil(within / step)))
    grid = np.linspace(-within, within, 2 * count + 1)
    best = _lowest(loss, grid, [loss(d, SCANNED) for d in grid])
    bounds = (max(best - step, -within), min(best + step, within))
    best = float(minimize_scalar(loss, bounds=bounds, method="bounded").x)
    solved, left, design = solve(best)
    tick = 0.1 * step
    slope = (solve(best + tick)[2] - design) @ solved / tick
    error = block_error(left, slope, design)
    coefficients = np.zeros(columns.shape[1])
    coefficients[scale > 0] = solved[:-1] / scale[scale > 0]
    return Delay(best, error, coefficients, 1 - loss(best), 1 - loss(0.0))


def _lowest(loss: Callable[[float], float], grid: Array, scanned: Sequence[float]) -> float:
    """Point of the grid that is lower than both beside it, downhill from the best of a scan."""
    known: dict[int, float] = {}
    here, best = int(np.argmin(scanned)), -1
    while here != best:
        best = here
        beside = range(max(best - 1, 0), min(best + 2, len(grid)))
        known |= {k: loss(float(grid[k])) for k in beside if k not in known}
        here = min(known, key=lambda k: known[k])
    return float(grid[best])


def block_error(left: Array, slope: Array, design: Array) -> float:
    """Standard error of the delay from blocks of time."""
    slope = slope - design @ np.linalg.lstsq(design, slope, rcond=1e-9)[0]
    edges = np.linspace(0, len(left), BLOCKS + 1).astype(int)[:-1]
    pull, weight = np.add.reduceat(slope * left, edges), float(np.sum(slope**2))
    return float(np.sqrt(np.sum(pull**2)) / weight) if weight > 0 else float("inf")
