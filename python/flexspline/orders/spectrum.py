"""Amplitude spectra: over the angle of a pair of parts, and over time.

Angles are not evenly spaced, and very many orders are wanted at once:

    F(k) = Σ_n  y_n · exp(-i k φ_n),      k = j / P,   j = 0 … K·P

The samples are spread on a fine even grid of angle with a short smooth kernel, one FFT
turns the grid into orders, and the kernel's own transform is divided out. The angle is
folded after P turns, which changes nothing at orders that are multiples of 1/P.
Source: [Barnett2019] (kernel "exponential of semicircle"): with
width 6 and twofold grid the error is about 1e-5 of Σ|y|.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import fft, signal
from scipy.interpolate import CubicSpline

from flexspline.errors import InputError
from flexspline.logs import Log
from flexspline.logs.read import as_logs
from flexspline.orders.parts import Pair, effective_ratio, pairs
from flexspline.orders.stretches import Stretch, Values, chosen_values, stretches
from flexspline.rendering import render

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = [
    "LONGEST",
    "OrderSpectrum",
    "TimeSpectrum",
    "fourier_sums",
    "order_spectrum",
    "step_turns",
    "time_spectrum",
]

LONGEST = 100.0  # turns looked at in one piece; two orders 0.01 apart are one
_OVERSAMPLING = 3

_WIDTH = 6
_SHAPE = 2.30 * _WIDTH
_CHUNK = 1 << 18


@dataclass(frozen=True)
class OrderSpectrum:
    """Amplitude over order.

    `order` per turn of `pair`; `amplitude` [unit], root mean square over the runs that show
    the order; `steady` [unit], amplitude of the part with the same phase in all of them; NaN
    where no run shows the order. `runs` is how many do, `resolution` the distance of orders
    that the longest stretch can tell apart.
    """

    order: NDArray[np.float64]
    amplitude: NDArray[np.float64]
    steady: NDArray[np.float64]
    runs: NDArray[np.int64]
    pair: str
    resolution: float
    channel: str
    unit: str

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the amplitude over the order."""
        drawn: Axes = render("order spectrum", "axes", self, ax)
        return drawn


@dataclass(frozen=True)
class TimeSpectrum:
    """Amplitude over frequency [Hz]; `peaks` are (frequency [Hz], amplitude), largest first."""

    frequency: NDArray[np.float64]
    amplitude: NDArray[np.float64]
    peaks: tuple[tuple[float, float], ...]
    channel: str
    unit: str

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the amplitude over the frequency, its largest peaks marked."""
        drawn: Axes = render("time spectrum", "axes", self, ax)
        return drawn


def step_turns(parts: Sequence[Stretch]) -> int:
    """Return P, so that orders in steps of 1/P miss no peak of the longest stretch."""
    return int(np.ceil(_OVERSAMPLING * max(part.turns for part in parts)))


def order_spectrum(
    logs: Log | Sequence[Log],
    values: Values,
    *,
    pair: str = "output_housing",
    orders: ArrayLike | None = None,
    max_order: float | None = None,
    unit: str | None = None,
) -> OrderSpectrum:
    """Return the least-squares amplitude at every order, of one run or several together.

    Parameters
    ----------
    logs, values, unit
        As in `find_orders`.
    pair : str
        Whose turns are counted: a name of `flexspline.orders.pairs`.
    orders : array, optional
        Orders of the pair to give, shape (orders,); default an even grid up to `max_order`.
    max_order : float, optional
        Highest order of the pair; default as in `find_orders`.

    Raises
    ------
    InputError
        As `find_orders`, and for a pair or a gear ratio that the log does not know.

    Notes
    -----
    The smooth part (offset, cubic of the angle, a parabola of a changing speed) of each
    direction of each run is taken out. At each order k the amplitude is that of the fit of
    cos kq and sin kq: uneven samples, even samples and part of a turn alike [Lomb1976].
    """
    logs = as_logs(logs)
    arrays, channel, unit = chosen_values(logs, values, unit)
    turned = _named_pair(logs[0], pair)
    wanted = None if orders is None else np.asarray(orders, dtype=np.float64)
    if wanted is not None and not (wanted.ndim == 1 and len(wanted) and np.all(wanted > 0)):
        raise InputError("order_spectrum: orders must be a list of numbers above 0")
    parts = stretches(logs, arrays, LONGEST)
    turns = step_turns(parts)
    if wanted is not None:
        highest = float(wanted.max()) * turned.turns + 1 / turns
    elif max_order is not None:
        highest = max_order * turned.turns
    else:
        highest = min(50 * (effective_ratio(logs[0]) or 100.0), 1e4)
    order = np.arange(int(np.floor(highest * turns + 1e-9)) + 1) / turns
    total = _summed(parts, turns, highest, order)
    spectrum = OrderSpectrum(
        order / turned.turns,
        *total,
        pair,
        1 / max(p.turns for p in parts) / turned.turns,
        channel,
        unit,
    )
    return spectrum if wanted is None else _at(spectrum, wanted)


def time_spectrum(
    log: Log,
    values: str | ArrayLike,
    *,
    unit: str | None = None,
) -> TimeSpectrum:
    """Return the amplitude spectrum over time: a sine of amplitude A shows as A.

    Parameters
    ----------
    log : Log
        Samples that are not even are interpolated on an even grid at the log's rate.
    values : str or array, shape (rows,)
        A channel, or values with their `unit`.

    Notes
    -----
    Linear trend taken out, Hann window [Harris1978]: a sine between two frequencies shows up
    to 15 % too small; peaks are refined by the window's own shape [Grandke1983].
    """
    (data,), channel, unit = chosen_values(
        [log], values if isinstance(values, str) else [values], unit
    )
    good = np.isfinite(data)
    if np.count_nonzero(good) < 8 or not log.rate > 0:
        raise InputError(
            f"log '{log.name}': too few samples for a spectrum over time; "
            "give at least 8 with values"
        )
    time = log["time"][good]
    even = np.arange(time[0], time[-1], 1 / log.rate)
    y = signal.detrend(np.interp(even, time, data[good]))
    window = signal.windows.hann(len(y), sym=False)
    amplitude = 2 * np.abs(fft.rfft(y * window)) / window.sum()
    frequency = fft.rfftfreq(len(y), 1 / log.rate)
    return TimeSpectrum(frequency, amplitude, _time_peaks(frequency, amplitude), channel, unit)


def _time_peaks(
    frequency: NDArray[np.float64], amplitude: NDArray[np.float64]
) -> tuple[tuple[float, float], ...]:
    """Return the 20 largest peaks over eight times the median of their neighbourhood."""
    around = signal.medfilt(amplitude, 101) if len(amplitude) > 202 else np.median(amplitude)
    at, _ = signal.find_peaks(
        amplitude, height=8 * np.broadcast_to(around, amplitude.shape), distance=3
    )
    at = at[np.argsort(-amplitude[at])][:20]
    left, top, right = amplitude[at - 1], amplitude[at], amplitude[at + 1]
    beside = np.maximum(left, right) / top
    share = np.clip((2 * beside - 1) / (beside + 1), 1e-9, 0.5)
    refined = top * (1 - share**2) / np.sinc(share)
    shift = np.where(right > left, share, -share)
    return tuple(
        zip((frequency[at] + shift * frequency[1]).tolist(), refined.tolist(), strict=True)
    )


def _summed(
    parts: Sequence[Stretch], turns: int, highest: float, order: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Return amplitude, steady amplitude and number of runs over `order`."""
    power, rows = np.zeros((2, len(order)))
    phasor, runs = np.zeros(len(order), dtype=complex), np.zeros(len(order), dtype=np.int64)
    for run in sorted({part.run for part in parts}):
        shown = np.zeros(len(order), dtype=bool)
        for part in (part for part in parts if part.run == run):
            seen = (order >= part.lowest) & (order <= part.highest)
            wave, good = _least_squares(part, turns, highest)
            seen &= good
            power += np.where(seen, len(part.values) * np.abs(wave) ** 2, 0.0)
            phasor += np.where(seen, len(part.values) * wave, 0.0)
            rows += np.where(seen, len(part.values), 0.0)
            shown |= seen
        runs += shown
    known = np.where(rows > 0, rows, np.nan)
    return np.sqrt(power / known), np.abs(phasor) / known, runs


def _least_squares(
    part: Stretch, turns: int, highest: float
) -> tuple[NDArray[np.complex128], NDArray[np.bool_]]:
    """Return a - ib of the fit a cos kq + b sin kq, and where cosine and sine are separate."""
    sums = fourier_sums(part.angle, part.values, turns, highest)
    double = fourier_sums(part.angle, np.ones(len(part.angle)), turns, 2 * highest)[::2]
    double = double[: len(sums)] / len(part.angle)
    room = 1.0 - np.abs(double) ** 2
    wave = 2 / len(part.angle) * (sums - double * np.conj(sums)) / np.maximum(room, 0.05)
    return wave, room > 0.05


def _at(spectrum: OrderSpectrum, wanted: NDArray[np.float64]) -> OrderSpectrum:
    """Return the spectrum at the orders of its grid nearest to `wanted`."""
    step = spectrum.order[1] - spectrum.order[0]
    at = np.clip(np.round(wanted / step).astype(np.int64), 0, len(spectrum.order) - 1)
    return replace(
        spectrum,
        order=wanted,
        amplitude=spectrum.amplitude[at],
        steady=spectrum.steady[at],
        runs=spectrum.runs[at],
    )


def _named_pair(log: Log, name: str) -> Pair:
    table = {entry.name: entry for entry in pairs(log)}
    if name not in table:
        raise InputError(
            f"log '{log.name}': no pair of parts '{name}'; it knows "
            f"{', '.join(table)} (the wave generator's need output_spline)"
        )
    if not table[name].turns > 0:
        raise InputError(
            f"log '{log.name}': orders of the pair '{name}' need the gear ratio; "
            "give gear_ratio when reading the log"
        )
    return table[name]


def fourier_sums(
    angle: NDArray[np.float64], values: NDArray[np.float64], turns: int, highest: float
) -> NDArray[np.complex128]:
    """Return F at the orders 0, 1/turns, …, up to `highest`.

    Parameters
    ----------
    angle : array, shape (rows,)
        Angle [rad], in any order, over any number of turns.
    values : array, shape (rows,)
        What is transformed, in any unit.
    turns : int
        P: the step of order is 1/P.
    highest : float
        K, the last order.

    Returns
    -------
    array of complex, shape (floor(highest · turns) + 1,)
        In the unit of `values`.
    """
    last = int(np.floor(highest * turns + 1e-9))
    size = int(fft.next_fast_len(max(4 * last + 4, 4 * _WIDTH), real=True))
    grid = np.zeros(size)
    for first in range(0, len(angle), _CHUNK):
        part = slice(first, first + _CHUNK)
        place = np.mod(angle[part] / (2 * np.pi * turns), 1.0) * size
        left = np.ceil(place - _WIDTH / 2).astype(np.int64)
        for step in range(_WIDTH):
            cell = left + step
            weight = _kernel((cell - place) / (_WIDTH / 2)) * values[part]
            cell %= size
            low = int(cell.min())
            summed = np.bincount(cell - low, weights=weight)
            grid[low : low + len(summed)] += summed
    spectrum: NDArray[np.complex128] = fft.rfft(grid)[: last + 1]
    return spectrum / _kernel_transform(last, size)


def _kernel(x: NDArray[np.float64]) -> NDArray[np.float64]:
    inside = np.clip(1.0 - x * x, 0.0, None)
    value: NDArray[np.float64] = np.exp(_SHAPE * (np.sqrt(inside) - 1.0))
    return value


@lru_cache(maxsize=4)
def _kernel_transform(last: int, size: int) -> NDArray[np.float64]:
    """Return ∫ kernel(2x/W) · exp(-2πi f x) dx for f = 0 … last/size cycles per grid cell."""
    node, weight = np.polynomial.legendre.leggauss(40)
    half = _WIDTH / 2
    knots = np.linspace(0.0, 0.26, 513)
    value = half * np.cos(2 * np.pi * half * knots[:, None] * node) @ (weight * _kernel(node))
    smooth: NDArray[np.float64] = CubicSpline(knots, value)(np.arange(last + 1) / size)
    return smooth
