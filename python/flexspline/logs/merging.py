"""A second recorder's log resampled to the time of the first, by an offset and drift of its clock.

An event at time t of the log is stamped by the other recorder with

    t + offset + drift · (t − t₀),        t₀ the first time of the log.

Two channels that measure the same quantity give offset and drift: first the lag at which they
correlate best (normalised over their overlap), then, in windows, the remaining delay δ from

    b(t) = α + β a(t) − δ ḃ(t)        by least squares in each window,

through which a straight line is fitted, weighted by the information of each window, until δ
converges. The errors come from the scatter of the windows about the line, so they hold for coloured
noise too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
import scipy.fft
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from flexspline.errors import InputError, listed
from flexspline.logs.derive import default_bandwidth, has_value, increasing_time, lowpass, sampled
from flexspline.logs.log import Log

__all__ = [
    "Clock",
    "Merged",
    "find_clock",
    "merge",
]

Array = NDArray[np.float64]

LEAST_CORRELATION: Final = 0.5
MOST_DRIFT: Final = 20_000.0  # ppm; what is found beyond is a match by chance
LEAST_OVERLAP: Final = 0.2  # of the shorter log, below which chance correlates
RIVAL: Final = 0.97  # of the best correlation: another lag as good as this makes it a guess
WINDOWS: Final = 16
LEAST_ROWS: Final = 20  # of a window
MOST_ROWS: Final = 1 << 20  # of the common grid; a longer log is looked at more coarsely
ROUNDS: Final = 20


class Merged(NamedTuple):
    """The log with the channels of both, and the second recorder's clock."""

    log: Log
    clock: Clock


def merge(
    log: Log,
    other: Log,
    *,
    channels: Sequence[str] | None = None,
    offset: float | None = None,
    drift: float | None = None,
    align: tuple[str, str] | None = None,
) -> Merged:
    """Put channels of a second recorder, such as a load cell, on the time of a log.

    Parameters
    ----------
    log, other : Log
        Two recordings of one run, each with its own strictly increasing time.
    channels : sequence of str, optional
        What to take from `other`; by default all that `log` does not have.
    offset : float, optional
        What the other's clock shows more than the log's at the log's first row [s].
    drift : float, optional
        How much faster the other's clock runs [ppm].
    align : (str, str), optional
        A channel of `log` and one of `other` that see the same thing: what is not given of
        offset and drift is found by them (`flexspline.logs.merging`). Without it, a drift
        that is not given is 0.

    Returns
    -------
    Merged
        (log, clock). Rows of `log` where `other` has no value are dropped; the history says
        how many, and the clock with its standard errors.

    Raises
    ------
    InputError
        Where neither offset nor align is given, a channel is missing or there twice, the
        channels of `align` hardly correlate, or the logs do not overlap.
    """
    names = _wanted(log, other, channels)
    time, theirs = increasing_time(log, "merge"), increasing_time(other, "merge")
    if align is not None:
        clock = find_clock(log, other, align, offset=offset, drift=drift)
    elif offset is not None:
        clock = Clock(offset, drift or 0.0)
    else:
        raise InputError(
            f"log '{other.name}': its clock against that of log '{log.name}' is not "
            "known; give offset, or align with two channels that see the same thing"
        )
    at = clock.at(time, float(time[0]))
    inside = has_value(theirs, at)
    if not inside.any():
        raise InputError(
            f"logs '{log.name}' and '{other.name}' do not overlap with {clock}; "
            "correct the offset or read logs of the same time"
        )
    columns = {name: sampled(name, theirs, other[name], at) for name in names}
    origin = f" ({other.source.path}, SHA-256 {other.source.sha256})" if other.source else ""
    note = (
        f"{listed(names)} merged from log '{other.name}'{origin}, whose clock has {clock}; "
        f"rows where it has no value, dropped: {np.count_nonzero(~inside)}"
    )
    return Merged(log.with_columns(columns, note=note).rows(inside, note=""), clock)


def _wanted(log: Log, other: Log, channels: Sequence[str] | None) -> list[str]:
    if channels is None:
        names = [name for name in other.channels if name not in log]
    else:
        names = list(channels)
    for name in names:
        other[name]
        if name in log:
            raise InputError(
                f"log '{log.name}': has '{name}' already, so that of log "
                f"'{other.name}' cannot be merged; leave it out of channels"
            )
    if not names:
        raise InputError(
            f"log '{other.name}': has no channel that log '{log.name}' has not; "
            "name what to merge with channels"
        )
    return names


@dataclass(frozen=True)
class Clock:
    """Offset [s] and drift [ppm] of a clock, their standard errors (0 where given).

    `correlation` is that of the two channels' slopes with the clock taken out (slow channels
    correlate by chance, their slopes hardly do); NaN where nothing was compared.
    """

    offset: float
    drift: float
    offset_error: float = 0.0
    drift_error: float = 0.0
    correlation: float = float("nan")

    def at(self, time: Array, start: float) -> Array:
        """Return what this clock shows at `time` [s] of the log, whose first time is `start`."""
        shown: Array = time + self.offset + 1e-6 * self.drift * (time - start)
        return shown

    def __str__(self) -> str:
        said = (
            f"offset {_with_error(self.offset, self.offset_error)} s, "
            f"drift {_with_error(self.drift, self.drift_error)} ppm"
        )
        return said if np.isnan(self.correlation) else f"{said}, correlation {self.correlation:.3f}"


def _with_error(value: float, error: float) -> str:
    """Return both, rounded to two digits of the error; one alone where it was given."""
    if not error > 0:
        return f"{value:.9g} (given)"
    digits = max(0, 1 - int(np.floor(np.log10(error))))
    return f"{value:.{digits}f} ± {error:.{digits}f}"


def find_clock(
    log: Log,
    other: Log,
    align: tuple[str, str],
    *,
    offset: float | None = None,
    drift: float | None = None,
) -> Clock:
    """Return the clock of `other` against that of `log`.

    Parameters
    ----------
    log, other : Log
        Two recordings of one run, each with its own time, both strictly increasing.
    align : (str, str)
        A channel of `log` and one of `other` that see the same thing, up to gain and offset.
    offset, drift : float, optional
        Kept where given [s], [ppm].

    Raises
    ------
    InputError
        Where the channels hardly correlate, correlate at several lags alike, have opposite
        signs, or overlap too little.
    """
    pair = f"'{align[0]}' of log '{log.name}' and '{align[1]}' of log '{other.name}'"
    first, second = _finite(log, align[0]), _finite(other, align[1])
    longest = max(float(time[-1] - time[0]) for time, _ in (first, second))
    rate = min(log.rate, other.rate, MOST_ROWS / longest)
    width = min(default_bandwidth(*first), default_bandwidth(*second), 0.1 * rate)
    a, b = _even(*first, rate, width), _even(*second, rate, width)
    free = (offset is None, drift is None)
    if offset is None:
        offset = float(b[0][0] - a[0][0]) + _best_lag(a[1], b[1], pair, rate) / rate
    return _refined(a, b, float(log["time"][0]), Clock(offset, drift or 0.0), free, pair)


def _finite(log: Log, channel: str) -> tuple[Array, Array]:
    time, values = increasing_time(log, "aligning clocks"), log[channel]
    good = np.isfinite(values)
    if np.count_nonzero(good) < WINDOWS * LEAST_ROWS or np.ptp(values[good]) == 0:
        raise InputError(
            f"log '{log.name}': '{channel}' is constant or too short to align clocks "
            f"by; name another channel or give offset and drift"
        )
    return time[good], values[good]


def _even(time: Array, values: Array, rate: float, width: float) -> tuple[Array, Array]:
    """Return low-passed values on even steps, without their mean."""
    grid = time[0] + np.arange(int((time[-1] - time[0]) * rate) + 1) / rate
    even = np.interp(grid, time, lowpass(values, time, width).values)
    return grid, even - even.mean()


def _best_lag(a: Array, b: Array, pair: str, rate: float) -> int:
    """Return the lag k at which b[i + k] correlates best with a[i], over their overlap."""
    least = max(int(LEAST_OVERLAP * min(len(a), len(b))), LEAST_ROWS)
    lags, correlation, overlap = _correlation(a, b)
    correlation = np.where(overlap >= least, correlation, 0.0)
    best = int(np.argmax(correlation * np.sqrt(overlap)))
    peak = float(correlation[best])
    lowest = float(correlation.min())
    if -lowest > max(peak, LEAST_CORRELATION) / RIVAL:
        raise InputError(
            f"{pair} correlate with opposite signs ({lowest:.2f}); ask for flip_sign on one of them"
        )
    if peak < LEAST_CORRELATION:
        raise InputError(
            f"{pair} hardly correlate ({peak:.2f} at best, {LEAST_CORRELATION} is "
            "needed); name channels that see the same thing, or give offset and drift"
        )
    _require_no_rival(correlation, overlap, best, pair, rate)
    return int(lags[best])


def _require_no_rival(
    correlation: Array, overlap: Array, best: int, pair: str, rate: float
) -> None:
    """Refuse where another peak, of at least half the overlap, is as good as the best one."""
    valley = np.flatnonzero(correlation < 0.5 * correlation[best])
    left = valley[valley < best].max(initial=0)
    right = valley[valley > best].min(initial=len(correlation))
    rivals = np.where(overlap < overlap[best] / 2, 0.0, correlation)
    rivals[left:right] = 0.0
    twin = int(np.argmax(rivals))
    if rivals[twin] > RIVAL * correlation[best]:
        raise InputError(
            f"{pair} match as well {abs(twin - best) / rate:.3g} s apart, for the "
            "motion repeats itself; give the offset"
        )


def _correlation(a: Array, b: Array) -> tuple[NDArray[np.intp], Array, Array]:
    """Return lags k, the correlation of a[i] and b[i + k] over their overlap, and its length."""
    n, m = len(a), len(b)
    size = scipy.fft.next_fast_len(n + m)
    spectra = [scipy.fft.rfft(x, size) for x in (a, a * a, np.ones(n), b, b * b, np.ones(m))]
    lags = np.arange(-n + 1, m)

    def cross(i: int, j: int) -> Array:
        both: Array = scipy.fft.irfft(np.conj(spectra[i]) * spectra[j], size)[lags]
        return both

    overlap = np.rint(cross(2, 5))
    sum_a, sum_b = cross(0, 5), cross(2, 3)
    count = np.maximum(overlap, 1.0)
    vary = (cross(1, 5) - sum_a**2 / count) * (cross(2, 4) - sum_b**2 / count)
    floor = 1e-12 * float(a @ a) * float(b @ b)
    together = cross(0, 3) - sum_a * sum_b / count
    return lags, np.where(vary > floor, together / np.sqrt(np.maximum(vary, floor)), 0.0), overlap


def _refined(
    a: tuple[Array, Array],
    b: tuple[Array, Array],
    start: float,
    clock: Clock,
    free: tuple[bool, bool],
    pair: str,
) -> Clock:
    """Return the clock from the delays left in windows, until none is left."""
    curve, slope = CubicSpline(*b), CubicSpline(*a).derivative()
    for _ in range(ROUNDS):
        at = clock.at(a[0], start)
        both = (at >= b[0][0]) & (at <= b[0][-1])
        rows = np.count_nonzero(both)
        if rows < max(WINDOWS * LEAST_ROWS, LEAST_OVERLAP * min(len(a[0]), len(b[0]))):
            raise InputError(
                f"{pair} overlap by {rows} rows only; give the right offset, "
                "or logs of the same time"
            )
        time, at = a[0][both], at[both]
        step, error = _line(time - start, a[1][both], curve(at), curve(at, 1), free)
        clock = Clock(
            clock.offset + float(step[0]),
            clock.drift + 1e6 * float(step[1]),
            float(error[0]),
            1e6 * float(error[1]),
            float(np.corrcoef(slope(time), curve(at, 1))[0, 1]),
        )
        if np.all(np.abs(step) <= 1e-3 * error):
            break
    if not clock.correlation >= LEAST_CORRELATION or (free[1] and abs(clock.drift) > MOST_DRIFT):
        raise InputError(
            f"{pair} hardly change together (correlation {clock.correlation:.2f} at a drift of "
            f"{clock.drift:.0f} ppm); name channels that see the same thing, or give offset and "
            "drift"
        )
    return clock


def _line(
    time: Array, a: Array, b: Array, slope: Array, free: tuple[bool, bool]
) -> tuple[Array, Array]:
    """Return (offset [s], drift [s/s]) that is left between a and b, and their errors."""
    windows = np.array_split(np.arange(len(time)), WINDOWS)
    delays = np.array([_delay(a[w], b[w], slope[w]) for w in windows])
    middle = np.array([time[w].mean() for w in windows])
    known = np.flatnonzero(free)
    weight = np.sqrt(delays[:, 1])
    design = np.stack([np.ones(WINDOWS), middle], axis=1)[:, known] * weight[:, np.newaxis]
    line, error = np.zeros(2), np.zeros(2)
    if len(known):
        inverse = np.linalg.pinv(design.T @ design)
        line[known] = inverse @ (design.T @ (weight * delays[:, 0]))
        left = weight * delays[:, 0] - design @ line[known]
        error[known] = np.sqrt(np.diag(inverse) * (left @ left) / (WINDOWS - len(known)))
    return line, error


def _delay(a: Array, b: Array, slope: Array) -> tuple[float, float]:
    """Return the delay δ [s] that is left in one window, and its information 1/σ² [1/s²]."""
    others = np.stack([np.ones_like(a), a], axis=1)
    clear = slope - others @ np.linalg.lstsq(others, slope, rcond=None)[0]
    wanted = b - others @ np.linalg.lstsq(others, b, rcond=None)[0]
    power = float(clear @ clear)
    if power == 0.0:
        return 0.0, 0.0
    delay = -float(clear @ wanted) / power
    left = wanted + delay * clear
    noise = max(float(left @ left) / len(a), 1e-24 * float(b @ b) / len(a), 1e-300)
    return delay, power / noise
