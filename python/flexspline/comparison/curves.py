"""What a covariate explains of values: a mean for each cell, or a curve through neighbouring cells.

One mean per band leaves a sawtooth of the band's width in what is left, which passes for orders of
what turns and for noise. So along each line of cells (one direction, one run) values are followed
by a cubic spline whose knots are the edges of the bands: with u in 0 … 1 across the cell of a row

    value = c_0 + c_1 u + c_2 u² + c_3 u³,   c = T b,   b of the B-splines

by least squares. All that this needs of the rows are sums of u^p and of values times u^p in each
cell. T is made once. Where a cell has no rows, the curve runs straight through it: second
differences of b cost SMOOTH of a row. Means stay where a jump lies on an edge, so that they leave
less by JUMP than a curve does.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import factorial

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline

__all__ = ["DEGREE", "JUMP", "Curves", "curves_of"]

Array = NDArray[np.float64]

DEGREE = 3
SMOOTH = 1e-6  # of the rows of a mean cell
TINY = 1e-14  # of the trace: what is not determined at all is 0
JUMP = 0.02  # of the mean square: what means have to leave less than a curve


@dataclass(frozen=True, eq=False)
class Curves:
    """Rows of a covariate, ready to be followed.

    `cells`: (N,), -1 where a row has none. `along`: (N,), 0 … 1 across its cell. `lines`: (lines,
    bins) numbers of cells. `shape`: (bins · 4, b), T.
    """

    cells: NDArray[np.integer]
    along: NDArray[np.float32]
    lines: NDArray[np.intp]
    shape: Array

    @property
    def count(self) -> int:
        """How many cells there are."""
        return self.lines.size

    def at(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> Curves:
        """Return the curves of some of the rows."""
        return replace(self, cells=self.cells[rows], along=self.along[rows])

    def sums(self, values: Array, powers: int, groups: NDArray[np.int64] | None = None) -> Array:
        """Return sums of values (N,) times u^p, (groups, cells, powers)."""
        last = self.count
        place = np.where(self.cells < 0, last, self.cells)
        size, place = (1, place) if groups is None else (
            int(groups.max()) + 1, groups * (last + 1) + place
        )  # fmt: skip
        made, weights = [], np.asarray(values, dtype=np.float64)
        for _ in range(powers):
            total = np.bincount(place, weights=weights, minlength=size * (last + 1))
            made.append(total.reshape(size, last + 1)[:, :last])
            weights = weights * self.along
        return np.stack(made, axis=-1)

    def fitted(self, ones: Array, moments: Array) -> Array:
        """Return coefficients (cells, 4) by sums of u^p (cells, 7) and of values u^p (cells, 4)."""
        made = np.zeros((self.count, DEGREE + 1))
        bins = self.lines.shape[1]
        bent = np.diff(np.eye(self.shape.shape[1]), 2, axis=0)
        hankel = np.add.outer(np.arange(DEGREE + 1), np.arange(DEGREE + 1))
        shape = self.shape.reshape(bins, DEGREE + 1, -1)
        for line in self.lines:
            rows = float(ones[line, 0].sum())
            if rows == 0.0:
                continue
            weighed = (ones[line][:, hankel] @ shape).reshape(len(self.shape), -1)
            gram = self.shape.T @ weighed + SMOOTH * rows / bins * (bent.T @ bent)
            gram += TINY * np.trace(gram) * np.eye(len(gram))
            weights = np.linalg.solve(gram, self.shape.T @ moments[line].ravel())
            made[line] = (self.shape @ weights).reshape(bins, DEGREE + 1)
        return made

    def values(self, coefficients: Array) -> Array:
        """Return each row's value, (N,), 0 without a cell, of curves (cells, 4) or (cells, 1)."""
        padded = np.vstack([coefficients, np.zeros(coefficients.shape[1])])
        made = padded[self.cells, -1]
        for power in range(coefficients.shape[1] - 2, -1, -1):
            made = made * self.along + padded[self.cells, power]
        return np.asarray(made)


def curves_of(
    cells: NDArray[np.integer], values: Array, edges: Array, lines: NDArray[np.intp]
) -> Curves:
    """Return the curves of rows with such values, (N,), in bands with such edges."""
    finite = values[np.isfinite(values)]
    ends = edges.copy()
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 1.0)
    ends[0] = ends[0] if np.isfinite(ends[0]) else min(low, ends[1])
    ends[-1] = ends[-1] if np.isfinite(ends[-1]) else max(high, ends[-2])
    bins = len(ends) - 1
    least = 1e-9 * max(abs(float(ends[0])), abs(float(ends[-1])), 1e-300)
    ends = np.maximum.accumulate(ends + least * np.arange(bins + 1))  # no band of no width
    place = np.clip(np.searchsorted(edges[1:-1], values, side="right"), 0, bins - 1)
    along = (values - ends[place]) / (ends[place + 1] - ends[place])
    along = np.where(np.isfinite(along), np.clip(along, 0.0, 1.0), 0.0)
    return Curves(cells, along.astype(np.float32), lines, _shape(ends))


def _shape(ends: Array) -> Array:
    """T: from B-splines with knots at the edges to powers of u in each band."""
    knots = np.concatenate([np.full(DEGREE, ends[0]), ends, np.full(DEGREE, ends[-1])])
    splines = BSpline(knots, np.eye(len(ends) - 1 + DEGREE), DEGREE)
    width = np.diff(ends)[:, None]
    powers = [splines(ends[:-1], nu) * width**nu / factorial(nu) for nu in range(DEGREE + 1)]
    return np.stack(powers, axis=1).reshape(len(width) * (DEGREE + 1), -1)
