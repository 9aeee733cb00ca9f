"""Rows and target as the noise sees them: filtered so that what is left is white.

With autoregressive noise, e_t = Σ φ_k e_{t−k} + w_t, least squares on rows and target filtered by
A = 1 − Σ φ_k z^−k weighs evidence as it is: sums of squares over the innovation variance σ² are
χ², and slow noise is not counted once for each sample (Cochrane & Orcutt 1949).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz
from scipy.ndimage import correlate1d

from flexspline.discovery.settings import SETTINGS, TINY
from flexspline.fit.problem import Run

__all__ = ["Whitening", "rough_whitening"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Whitening:
    """A = [1, −φ_1, …], the innovation variance σ², and one row of how many is news."""

    denominator: Array
    variance: float
    decimation: int

    @property
    def order(self) -> int:
        return len(self.denominator) - 1

    def long_enough(self, rows: int) -> bool:
        """Whether a stretch of so many rows leaves more than what starts the filter."""
        return -(-rows // self.decimation) > 2 * self.order + 2

    def counted(self, first: int, last: int, edges: Sequence[int]) -> NDArray[np.int64]:
        """Filtered rows of a stretch [first, last) in each fold between `edges`, (F,)."""
        start = first + self.order * self.decimation
        before = [max(0, -(-(min(e, last) - start) // self.decimation)) for e in edges]
        rows = np.diff(before) if self.long_enough(last - first) else np.zeros(len(edges) - 1)
        return np.asarray(rows, dtype=np.int64)

    def taken(self, run: Run) -> list[NDArray[np.intp]]:
        """Rows of each stretch that are filtered; those that only start the filter included."""
        pieces = [np.arange(first, last, self.decimation) for first, last in run.stretches]
        return [rows for rows in pieces if len(rows) and self.long_enough(rows[-1] + 1 - rows[0])]

    def __call__(self, columns: Array, run: Run) -> tuple[Array, NDArray[np.intp]]:
        """Filter columns (N, C) of a run; return what is left and the rows it belongs to."""
        pieces = self.taken(run)
        at = [np.empty(0, dtype=np.intp), *(rows[self.order :] for rows in pieces)]
        made = np.empty((sum(map(len, at)), columns.shape[1]), order="F")
        last = 0
        for rows in pieces:
            first, last = last, last + len(rows) - self.order
            taken = slice(rows[0], rows[-1] + 1, self.decimation)
            self.filter(columns[taken], made[first:last])
        return made, np.concatenate(at)

    def filter(self, columns: Array, out: Array) -> None:
        """Filter columns (N, C) of consecutive rows into `out`, (N − order, C).

        Both are fastest where a column's rows lie side by side in memory.
        """
        late = len(self.denominator) // 2
        made = correlate1d(columns.T, self.denominator[::-1], axis=1, mode="constant")
        out.T[:] = made[:, late : late + len(out)]


def rough_whitening(residuals: Sequence[Array], runs: Sequence[Run], decimation: int) -> Whitening:
    """Fit the noise to residuals, (N,) for each run, by Yule and Walker; order by AICc.

    A first guess, from a residual that everything was taken out of.
    """
    lags, rows = np.zeros(SETTINGS.lags + 1), 0
    plain = Whitening(np.ones(1), 1.0, decimation)
    for residual, run in zip(residuals, runs, strict=True):
        for at in plain.taken(run):
            part = residual[at]
            lags += [float(part[k:] @ part[: max(len(part) - k, 0)]) for k in range(len(lags))]
            rows += len(part)
    lags = lags / max(rows, 1)
    lags[0] = max(lags[0] * (1.0 + SETTINGS.singular), TINY)
    best = (np.inf, np.ones(1), lags[0])
    for order in range(SETTINGS.lags + 1):
        phi = solve_toeplitz(lags[:order], lags[1 : order + 1]) if order else np.empty(0)
        variance = max(float(lags[0] - phi @ lags[1 : order + 1]), SETTINGS.singular * lags[0])
        score = rows * np.log(variance) + 2.0 * (order + 1) * rows / max(rows - order - 2, 1)
        if score < best[0]:
            best = (score, np.append(1.0, -phi), variance)
    return Whitening(best[1], float(best[2]), decimation)
