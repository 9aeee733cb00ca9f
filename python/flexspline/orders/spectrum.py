"""What is looked at for orders: stretches of logs, and their amplitude spectra.

In a stretch the joint moves one way. A ripple may change its phase with the direction (friction,
lag) and its amplitude with the speed, so every run is cut by direction; standstill and what follows
a reversal are left out. Within a stretch order k is seen between

    1.5 / turns   below it, a slow trend over part of a turn looks the same,
    0.9 π rate / |v|   near half the sampling rate; beyond it shows up at a false order (alias).

Spectra are over the angle of a pair of parts, and over time. Angles are not evenly spaced, and very
many orders are wanted at once:

    F(k) = Σ_n  y_n · exp(-i k φ_n),      k = j / P,   j = 0 … K·P

The samples are spread on a fine even grid of angle with a short smooth kernel, one FFT
turns the grid into orders, and the kernel's own transform is divided out. The angle is
folded after P turns, which changes nothing at orders that are multiples of 1/P.
Source: [Barnett2019] (kernel "exponential of semicircle"): with
width 6 and twofold grid the error is about 1e-5 of Σ|y|.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import fft, signal
from scipy.interpolate import CubicSpline

from flexspline.errors import InputError
from flexspline.lazy import render
from flexspline.logs import Log
from flexspline.logs.channels import CHANNELS
from flexspline.logs.log import require_clock
from flexspline.logs.read import as_logs
from flexspline.logs.segments import runs
from flexspline.orders.parts import Pair, effective_ratio, output_angle, pairs

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = [
    "LONGEST",
    "NYQUIST",
    "OrderSpectrum",
    "Stretch",
    "TimeSpectrum",
    "Values",
    "chosen_values",
    "fourier_sums",
    "order_spectrum",
    "step_turns",
    "stretches",
    "sweeps",
    "time_spectrum",
]


LONGEST = 100.0  # turns looked at in one piece; two orders 0.01 apart are one
_OVERSAMPLING = 3

_WIDTH = 6
_SHAPE = 2.30 * _WIDTH
_CHUNK = 1 << 18

Values = str | Sequence[ArrayLike] | Callable[[Log], ArrayLike]

_WINDOW = 0.05  # s, over which the speed is taken
_STILL = 0.3  # of the run's usual speed: slower than this counts as a reversal or standstill
_SETTLE = (0.5, 0.1)  # s left out after a start and before a stop: presliding, overshoot
_SHORTEST = 64  # rows that a stretch needs
_HOLE = 0.1
"""Of a stretch's angle, without rows. Where it is longer than all that has rows, others as high
stand beside the line of an order, within what its floor is taken from."""
_CYCLES = 1.5  # cycles in the span from which an order can be told from a trend
NYQUIST = 0.9  # of half the sampling rate


@dataclass(frozen=True, eq=False)
class Stretch:
    """One direction of one run.

    `angle` [rad at the output], `raw` values [unit of the channel], `values` without their
    smooth part and `base`, its orthonormal columns, shape (rows, columns); `speed` [rad/s,
    signed, median]; `turns` of the output that the angle spans; `lowest` and `highest` order seen;
    `time` [s] and signed `speeds` [rad/s] of the rows.
    """

    run: int
    name: str
    angle: NDArray[np.float64]
    raw: NDArray[np.float64]
    values: NDArray[np.float64]
    base: NDArray[np.float64]
    speed: float
    turns: float
    lowest: float
    highest: float
    time: NDArray[np.float64]
    speeds: NDArray[np.float64]


def chosen_values(
    logs: Sequence[Log], values: Values, unit: str | None
) -> tuple[list[NDArray[np.float64]], str, str]:
    """Return one array for each log, with the name and the unit of what they hold.

    Raises
    ------
    InputError
        For no logs, another number of arrays than of logs, or arrays of another length.
    """
    if not logs:
        raise InputError("order analysis: no log was given; give at least one")
    if isinstance(values, str):
        known = CHANNELS[values].unit if values in CHANNELS else ""
        return [log[values] for log in logs], values, unit if unit is not None else known
    given = [values(log) for log in logs] if callable(values) else list(values)
    arrays = [np.asarray(entry, dtype=np.float64) for entry in given]
    if len(arrays) != len(logs):
        raise InputError(
            f"order analysis: {len(arrays)} arrays of values for {len(logs)} logs; "
            "give one array for each log"
        )
    for log, array in zip(logs, arrays, strict=True):
        if array.shape != (len(log),):
            raise InputError(
                f"log '{log.name}': the values have shape {array.shape} and the log has "
                f"{len(log)} rows; give one value for each row"
            )
    return arrays, "values", unit or ""


def stretches(
    logs: Sequence[Log], arrays: Sequence[NDArray[np.float64]], longest: float
) -> list[Stretch]:
    """Cut runs by direction into stretches of at most `longest` turns, smooth part taken out.

    Raises
    ------
    InputError
        Where no run moves, or a log has no clock, see `require_clock`.
    """
    for log in logs:
        require_clock(log)
    found = [
        stretch
        for run, (log, values) in enumerate(zip(logs, arrays, strict=True))
        for stretch in _of_run(run, log, values, longest)
    ]
    if not found:
        raise InputError(
            "order analysis: the joint stands still in every log; orders need runs in motion"
        )
    return found


def sweeps(parts: Sequence[Stretch]) -> list[Stretch]:
    """Cut stretches where their rows are not one after the other in time: at each reversal.

    Sweeps of too few rows are left out; where there are no others, the stretches stay as they are.
    """
    made = [
        _sweep(part, slice(int(first), int(last)))
        for part in parts
        for first, last in runs(part.time)
        if last - first >= _SHORTEST
    ]
    return made or list(parts)


def _sweep(part: Stretch, rows: slice) -> Stretch:
    angle, base = part.angle[rows], _orthonormal(part.base[rows])
    turns = float(np.ptp(angle)) / (2 * np.pi)
    return replace(
        part,
        angle=angle,
        raw=part.raw[rows],
        values=part.values[rows] - base @ (base.T @ part.values[rows]),
        base=base,
        speed=float(np.median(part.speeds[rows])),
        turns=turns,
        lowest=_CYCLES / turns,
        time=part.time[rows],
        speeds=part.speeds[rows],
    )


def _of_run(run: int, log: Log, values: NDArray[np.float64], longest: float) -> Iterator[Stretch]:
    angle, time = output_angle(log), log["time"]
    good = np.isfinite(angle) & np.isfinite(values) & np.isfinite(time)
    if np.count_nonzero(good) < _SHORTEST:
        return
    angle, time, values = angle[good], time[good], values[good]
    speed = _smooth_speed(time, angle)
    usual = float(np.quantile(np.abs(speed), 0.9))
    if not usual > 0:
        return
    rate = log.rate
    for sign, word in ((1, "+"), (-1, "-")):
        way = _settled(time, speed * sign > _STILL * usual)
        if len(way) < _SHORTEST:
            continue
        start = angle[way].min()
        pieces = max(1, int(np.ceil((angle[way].max() - start) / (2 * np.pi * longest))))
        which = np.minimum((angle[way] - start) // (2 * np.pi * longest), pieces - 1)
        parts = [part for k in range(pieces) for part in _unbroken(angle, way[which == k])]
        for number, rows in enumerate(parts, 1):
            name = f"{log.name} {word}" + (f" part {number}" if len(parts) > 1 else "")
            yield _stretch(run, name, time[rows], angle[rows], values[rows], speed[rows], rate)


def _unbroken(angle: NDArray[np.float64], rows: NDArray[np.intp]) -> Iterator[NDArray[np.intp]]:
    """Yield the rows on each side of a hole in their angles; too few, or at one, are left out."""
    ranked = np.sort(angle[rows])
    steps, least = np.diff(ranked), _HOLE * (ranked[-1:] - ranked[:1])
    wide = steps > np.maximum(least, steps[steps <= least].sum())
    side = np.searchsorted(ranked[:-1][wide], angle[rows])
    for k in range(np.count_nonzero(wide) + 1):
        own = rows[side == k]
        if len(own) >= _SHORTEST and np.ptp(angle[own]) > 0.0:
            yield own


def _settled(time: NDArray[np.float64], moving: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return the moving rows away from starts and stops, all of them where few would stay."""
    change = np.diff(moving.astype(np.int8))
    starts, stops = time[1:][change > 0], time[:-1][change < 0]
    since = np.concatenate([[-np.inf], starts])[np.searchsorted(starts, time, side="right")]
    until = np.concatenate([stops, [np.inf]])[np.searchsorted(stops, time, side="left")]
    calm = moving & (time - since >= _SETTLE[0]) & (until - time >= _SETTLE[1])
    enough = np.count_nonzero(calm) > 0.5 * np.count_nonzero(moving)
    return np.flatnonzero(calm if enough else moving)


def _stretch(
    run: int,
    name: str,
    time: NDArray[np.float64],
    angle: NDArray[np.float64],
    values: NDArray[np.float64],
    speed: NDArray[np.float64],
    rate: float,
) -> Stretch:
    turns = float(np.ptp(angle)) / (2 * np.pi)
    base = _smooth_base(angle, speed)
    rest = values - base @ (base.T @ values)
    fast = float(np.quantile(np.abs(speed), 0.95))
    return Stretch(
        run,
        name,
        angle,
        values,
        rest,
        base,
        float(np.median(speed)),
        turns,
        _CYCLES / turns,
        NYQUIST * np.pi * rate / fast,
        time,
        speed,
    )


def _smooth_speed(time: NDArray[np.float64], angle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return dq/dt [rad/s] over a window, from the position: a velocity channel may be late."""
    half = max(_WINDOW / 2, 2 * float(np.median(np.diff(time))))
    late, early = np.minimum(time + half, time[-1]), np.maximum(time - half, time[0])
    change = np.interp(late, time, angle) - np.interp(early, time, angle)
    return np.asarray(change / np.maximum(late - early, 1e-300), dtype=np.float64)


def _smooth_base(angle: NDArray[np.float64], speed: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return orthonormal columns: a cubic of the angle, and of a changing speed a parabola."""
    x = 2 * (angle - angle.min()) / np.ptp(angle) - 1
    columns = np.polynomial.legendre.legvander(x, 3)
    if np.std(speed) > 0.2 * abs(np.mean(speed)):
        v = speed / np.max(np.abs(speed))
        columns = np.column_stack([columns, v, v * v])
    return _orthonormal(columns)


def _orthonormal(columns: NDArray[np.float64]) -> NDArray[np.float64]:
    ortho, triangle = np.linalg.qr(columns)
    size = np.abs(np.diag(triangle))
    kept: NDArray[np.float64] = ortho[:, size > 1e-9 * size.max()]
    return kept


@dataclass(frozen=True, eq=False)
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


@dataclass(frozen=True, eq=False)
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
    require_clock(log)
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
