"""The one smoother behind derived channels: a polynomial fitted around each row.

Around every row a polynomial in time is fitted to the rows within a half length H, weighted by a
Gaussian of width σ; its value, slope or curvature at the row is the output. For even steps this
is a finite symmetric FIR filter, the same for every row. For uneven steps every row gets its own
weights, exact for the true times. At the ends of a run the fit is one-sided.

Value by a quadratic, slope and curvature by a quartic all have the same frequency response

    G(f) = (1 + s) exp(-s),    s = (2π f σ)² / 2,    σ = 0.2337 / B

times 1, 2πjf and -(2πf)². No phase. At the bandwidth B: -3 dB (0.7071). At B/4: 0.998, at B/2:
0.970, at 2B: 0.071, at 3B: 0.0007. H = 4.5σ = 1.05 / B.
Source: [SavitzkyGolay1964] with Gaussian weights ([FanGijbels1996], local polynomials).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from flexspline import _core
from flexspline.errors import InputError, number

if TYPE_CHECKING:  # SciPy's parts take long to import: where they are used
    from scipy.sparse import csr_array

WIDTH = 0.233688
"""σ·B: (1 + s) exp(-s) = 1/√2 at s = 1.07796."""

REACH = 4.5
"""Half length of the window in σ."""

EVEN = 1e-3
"""Steps that differ by less than this share of their mean count as even."""

DEGREE = {0: 2, 1: 4, 2: 4}
"""Degree of the polynomial for value, slope and curvature: all three then pass G(f)."""

END_DEGREE = {0: 1, 1: 2, 2: 2}
"""Degree where the window is cut: biased rather than noisy."""

CHUNK = 1 << 15
"""Rows with uneven steps that are fitted at once: what fits into the cache."""

TOGETHER = 16
"""Columns with even steps that are filtered at once."""

SHORT = 100
"""Weights up to which sums are faster than an FFT: five times with 20 weights, as fast with 100."""

MOST_WEIGHTS = 4_000_000
"""Numbers that are kept for a run with uneven steps, 48 MB."""

WIDEST = 0.25
"""Bandwidth of a log, as a share of its rate, at most."""

NARROWEST = 1e-9
"""Of the rate, at least: a window of a thousand million rows weighs all rows of a log alike."""

WIDE = 40.0
"""Half lengths of more median steps than this go through a cubic spline to an even grid: its
error is below 1e-4 there, and the work does not grow with the window."""


def response(frequency: NDArray[np.float64], bandwidth: Any) -> NDArray[np.float64]:
    """Gain of a smoother with -3 dB at `bandwidth` [Hz] at frequencies [Hz]: (1 + s) exp(-s)."""
    s = 0.5 * (2.0 * np.pi * frequency * WIDTH / bandwidth) ** 2
    return np.asarray((1.0 + s) * np.exp(-s))


@dataclass(frozen=True)
class LocalFit:
    """A smoother with -3 dB at `bandwidth` [Hz]; `derivative` 0, 1 or 2."""

    bandwidth: float
    derivative: int = 0

    @property
    def half_length(self) -> float:
        """Seconds that the window reaches to each side."""
        return REACH * WIDTH / self.bandwidth

    def apply(self, time: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Filter one unbroken run.

        Parameters
        ----------
        time : array (N,), s, strictly increasing
        values : array (N,) or (N, M), any unit

        Returns
        -------
        Array of the shape of `values`, unit / s^derivative. All NaN where the run has too few rows
        to define the derivative.
        """
        if len(time) <= self.derivative:
            return np.full(values.shape, np.nan)
        columns = values.reshape(len(time), -1)
        if self._is_even(time):
            return self._even(columns, _step(time)).reshape(values.shape)
        return self._uneven(time, columns).reshape(values.shape)

    def kernel_of(self, time: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Weights (2h + 1,) of the rows around each row inside an even run; None for others."""
        return self._kernel(self._bells(_step(time))) if self._is_even(time) else None

    def _is_even(self, time: NDArray[np.float64]) -> bool:
        """Whether steps are even and the window fits into the run and holds its polynomial."""
        step = _step(time)
        reach = int(self.half_length / step)
        if 2 * reach >= len(time) or reach < DEGREE[self.derivative] // 2:
            return False
        return bool(np.max(np.abs(np.diff(time) - step), initial=0.0) <= EVEN * step)

    def _bells(self, step: float) -> NDArray[np.float64]:
        """Gaussian of the offsets within the half length, times their powers, in σ: (2h + 1, P)."""
        reach = int(self.half_length / step)
        offsets = np.arange(-reach, reach + 1) * (step * self.bandwidth / WIDTH)
        powers = offsets[:, None] ** np.arange(2 * max(DEGREE.values()) + 1)
        return np.asarray(np.exp(-0.5 * offsets**2)[:, None] * powers)

    def _kernel(self, bells: NDArray[np.float64]) -> NDArray[np.float64]:
        degree = DEGREE[self.derivative]
        moments = np.sum(bells, axis=0)
        return np.asarray(bells[:, : degree + 1] @ self._solve(moments[None], degree)[0])

    def _even(self, columns: NDArray[np.float64], step: float) -> NDArray[np.float64]:
        """One FIR kernel inside, one-sided fits at both ends."""
        bells = self._bells(step)
        kernel, reach = self._kernel(bells), len(bells) // 2
        ends = self._ends(bells)
        out = np.empty_like(columns)
        for first in range(0, columns.shape[1], TOGETHER):
            some = slice(first, first + TOGETHER)
            level = columns[0, some]
            even = columns[:, some] - level
            out[reach : len(even) - reach, some] = _slid(even, kernel)
            out[:reach, some] = _end(even, bells, ends)
            turned = _end(even[::-1], bells, ends)[::-1] * (-1) ** self.derivative
            out[len(even) - reach :, some] = turned
            if self.derivative == 0:
                out[:, some] += level
        return out

    def _ends(self, bells: NDArray[np.float64]) -> NDArray[np.float64]:
        """Polynomials (h, degree + 1) of the first rows, whose windows reach over the beginning.

        Row i lacks the weights of the offsets before -i: its moments are sums of the rest.
        """
        reach, degree = len(bells) // 2, END_DEGREE[self.derivative]
        moments = np.cumsum(bells[::-1, : 2 * degree + 1], axis=0)[reach : 2 * reach]
        return self._solve(moments, degree)

    def _solve(self, moments: NDArray[np.float64], degree: int) -> NDArray[np.float64]:
        """Polynomials (rows, degree + 1) in offset/σ: times the bell, they are the weights.

        `moments` (rows, 2 degree + 1 or more) are the sums of bell · (offset/σ)^p.
        """
        sigma = WIDTH / self.bandwidth
        gram = moments[:, np.add.outer(np.arange(degree + 1), np.arange(degree + 1))]
        pick = np.zeros((len(moments), degree + 1, 1))
        pick[:, self.derivative] = math.factorial(self.derivative) / sigma**self.derivative
        return np.asarray(np.linalg.solve(gram, pick)[..., 0])

    def _uneven(
        self, time: NDArray[np.float64], columns: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Every row with weights of its own; wide windows on an even grid through a spline."""
        from scipy.interpolate import CubicSpline

        steps = np.diff(time)
        step = float(np.median(steps)) if steps.size else 1.0
        width = int((time[-1] - time[0]) / step)
        if self.half_length > WIDE * step and width > 2 * self.half_length / step:
            grid = np.linspace(time[0], time[-1], width + 1)
            smooth = self._even(CubicSpline(time, columns)(grid), grid[1] - grid[0])
            return np.asarray(CubicSpline(grid, smooth)(time))
        out = np.empty_like(columns)
        for rows, weights in self._pieces(time):
            out[rows] = weights @ columns
        return out

    def weights(self, time: NDArray[np.float64]) -> csr_array | None:
        """Weights (N, N) of every row for every row, for one unbroken run filtered again and again.

        None where the run is better filtered anew: steps are even, or the window or run is long.
        """
        from scipy.sparse import csr_array, vstack

        steps = np.diff(time)
        step = float(np.median(steps)) if steps.size else 1.0
        mean = (time[-1] - time[0]) / max(len(time) - 1, 1)
        even = np.max(np.abs(steps - mean), initial=0.0) <= EVEN * mean
        window = 2.0 * self.half_length / step
        if even or window > 2.0 * WIDE or len(time) * window > MOST_WEIGHTS:
            return None
        pieces = list(self._pieces(time))
        order = np.argsort(np.concatenate([rows for rows, _ in pieces]))
        return csr_array(vstack([weights for _, weights in pieces], format="csr")[order])

    def _pieces(self, time: NDArray[np.float64]) -> Iterator[tuple[NDArray[np.intp], csr_array]]:
        """Rows with polynomials of one degree, and their weights (rows, N) for all."""
        first = np.searchsorted(time, time - self.half_length, side="left")
        last = np.searchsorted(time, time + self.half_length, side="right")
        degree = self._degrees(time, last - first)
        for d in np.unique(degree):
            rows = np.flatnonzero(degree == d)
            for a in range(0, len(rows), CHUNK):
                some = rows[a : a + CHUNK]
                yield some, self._fit_rows(time, some, (first[some], last[some]), int(d))

    def _degrees(self, time: NDArray[np.float64], count: NDArray[np.intp]) -> NDArray[np.intp]:
        """Degree of each row's polynomial: lower where the window is cut, and with few rows."""
        margin = self.half_length - float(np.median(np.diff(time))) if len(time) > 1 else 0.0
        cut = (time - time[0] < margin) | (time[-1] - time < margin)
        full, end = DEGREE[self.derivative], END_DEGREE[self.derivative]
        most = np.maximum(count, self.derivative + 1) - 1
        return np.asarray(np.minimum(np.where(cut, end, full), most))

    def _fit_rows(
        self,
        time: NDArray[np.float64],
        rows: NDArray[np.intp],
        window: tuple[NDArray[np.intp], NDArray[np.intp]],
        degree: int,
    ) -> csr_array:
        """Weights of a fit around some rows, each with a window of its own."""
        from scipy.sparse import csr_array

        first, last = self._widened(rows, window, degree, len(time))
        sigma = np.maximum(WIDTH / self.bandwidth, (time[last - 1] - time[first]) / (2 * REACH))
        made = _core.local_weights(time, rows, first, last, sigma, degree, self.derivative)
        return csr_array(made, shape=(len(rows), len(time)))

    def _widened(
        self,
        rows: NDArray[np.intp],
        window: tuple[NDArray[np.intp], NDArray[np.intp]],
        degree: int,
        count: int,
    ) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Windows with fewer rows than the polynomial has terms reach for their neighbours."""
        first, last = window
        poor = last - first <= degree
        start = np.clip(rows - (degree + 1) // 2, 0, max(count - degree - 1, 0))
        return np.where(poor, start, first), np.where(poor, start + degree + 1, last)


def _end(
    columns: NDArray[np.float64], bells: NDArray[np.float64], polynomials: NDArray[np.float64]
) -> NDArray[np.float64]:
    """The first rows (h, M) of an even run."""
    reach = len(bells) // 2
    padded = np.concatenate((np.zeros((reach, columns.shape[1])), columns[: 2 * reach]))
    sums = [_slid(padded, bells[:, power]) for power in range(polynomials.shape[1])]
    return np.asarray(np.einsum("prm,rp->rm", np.array(sums), polynomials))


def _slid(columns: NDArray[np.float64], weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Weighted sums (n - w + 1, M) of w neighbouring rows of (n, M)."""
    from scipy.signal import oaconvolve

    if len(weights) > SHORT:
        return np.asarray(oaconvolve(columns, weights[::-1, None], mode="valid", axes=0))
    turned = weights[::-1]
    return np.column_stack([np.convolve(column, turned, "valid") for column in columns.T])


def _step(time: NDArray[np.float64]) -> float:
    """Mean step of a run, s."""
    return float((time[-1] - time[0]) / (len(time) - 1)) if len(time) > 1 else 1.0


def require_bandwidth(bandwidth: float, rate: float, what: str) -> None:
    """Refuse a bandwidth [Hz] that a log of this rate [Hz] cannot have."""
    number(bandwidth, f"{what}: bandwidth", "Hz")
    if not NARROWEST * rate < bandwidth <= WIDEST * rate:
        least = "0" if bandwidth <= 0 else f"{NARROWEST * rate:.4g} Hz"
        above = "" if bandwidth > WIDEST * rate else f"above {least} and "
        raise InputError(
            f"{what}: a bandwidth of {bandwidth:.4g} Hz does not suit a rate of {rate:.4g} Hz; "
            f"choose one {above}up to {WIDEST * rate:.4g} Hz (a quarter of the rate)."
        )
