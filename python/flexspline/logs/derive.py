"""Derived channels: velocity and acceleration, low pass, other rates.

Those of an analysis have zero phase. They use the one smoother of `local_fit`, a finite symmetric
filter with

    G(f) = (1 + s) exp(-s),    s = 1.078 (f / B)²:    -3 dB at the bandwidth B, no phase,

so a low-passed target, low-passed rows and a derived velocity of one bandwidth fit together.
No filter reaches over a gap (a step longer than 2.5 median steps): it ends before it and starts
again behind it. Within 1.05 / B of the ends of each run the fit is one-sided: there are values,
noisier and less smooth, and the history says for how many seconds.

Those of a device are causal: velocity and acceleration from past samples, delayed.

The noise of the velocity is derived too. It makes friction terms noisy regressors: at standstill a
residual follows the *measured* velocity without any effect being missing. What it can explain is
part of the noise floor.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexspline import _core
from flexspline.errors import InputError, listed
from flexspline.logs.channels import CHANNELS
from flexspline.logs.local_fit import LocalFit, require_bandwidth
from flexspline.logs.log import Log, limits_of
from flexspline.logs.packed import memory_limit, require_memory
from flexspline.logs.quantisation import quantum, white_noise
from flexspline.logs.segments import GAP_STEPS, median_step, runs

__all__ = [
    "LowPass",
    "decimate",
    "default_bandwidth",
    "differentiate",
    "differentiate_causal",
    "has_value",
    "increasing_time",
    "lateness",
    "lowpass",
    "lowpass_log",
    "resample",
    "sampled",
    "velocity_noise",
    "with_motion",
]

Array = NDArray[np.float64]

VELOCITY_NOISE = 2 * (2 * np.pi) ** 2 * 0.48118
"""∫ (2πf)² G(f)² df over all f for B = 1 Hz: (velocity noise)² = this · noise² · B³ / rate."""

HELD = ("enabled", "commanded_position")
"""Channels of steps: resampling takes the last value and never smooths them."""

ANTI_ALIAS = 0.25
"""Bandwidth of the low pass before resampling, as a share of the new rate: 0.07 at Nyquist."""

_WINDOW = 0.1  # s, to either side: over which a joint at rest does not move
_AT_REST = 1e-3  # of the speed that 99 % of the rows stay below
_LEAST_ROWS = 50


class Smoothed(NamedTuple):
    """Low-passed values and which of their rows the filter saw from both sides."""

    values: Array
    valid: NDArray[np.bool_]
    half_length: float


def differentiate(
    log: Log,
    *,
    bandwidth: float | None = None,
    of: str = "output_position",
    channels: tuple[str, ...] = ("output_velocity", "output_acceleration"),
) -> Log:
    """Add the first and second derivative of a channel, without phase.

    Parameters
    ----------
    log : the log; time strictly increasing, the angle unwrapped
    bandwidth : Hz, where the gain on the true derivative is -3 dB; default `default_bandwidth`
    of : the channel to differentiate
    channels : where the first and (if there is a second name) the second derivative go

    Returns
    -------
    Log with the channels; rows of runs with too few rows to define a derivative are NaN, and the
    history says how many.

    Raises
    ------
    InputError : time does not increase, the channel holds NaN, or the bandwidth does not suit.
    """
    time, values = _usable(log, of)
    if not 1 <= len(channels) <= 2:
        raise InputError(f"{log.name}: give one or two channels for the derivatives of {of}.")
    chosen = default_bandwidth(time, values) if bandwidth is None else bandwidth
    found = {
        name: derivative(log, of, order, chosen) for order, name in enumerate(channels, start=1)
    }
    why = "" if bandwidth is not None else ", chosen from rate and noise"
    note = (
        f"{listed(channels)} derived from {of}: zero phase, -3 dB at {chosen:.4g} Hz{why}, "
        f"one-sided within {LocalFit(chosen).half_length:.3g} s of the ends of "
        f"{_count(len(runs(time)), 'run')}"
    )
    lost = int(np.count_nonzero(np.isnan(found[channels[-1]])))
    if lost:
        note += f"; {_count(lost, 'row')} NaN in runs too short for a derivative"
    return log.with_columns(found, note=note)


def derivative(log: Log, of: str, order: int, bandwidth: float) -> Array:
    """Return the first or second derivative (N,) of a channel, without phase, -3 dB at `bandwidth`.

    Raises
    ------
    InputError : time does not increase, the channel holds NaN, or the bandwidth does not suit.
    """
    time, values = _usable(log, of)
    require_bandwidth(bandwidth, log.rate, f"{log.name}, derivative of {of}")
    return _by_run(LocalFit(bandwidth, order), time, values)


def default_bandwidth(time: Array, values: Array) -> float:
    """Bandwidth [Hz] for a derivative of `values` that noise spoils by 1 % of its size at most.

    A tenth of the rate, lower where white noise and quantum would give more than 1 % of the RMS
    derivative, not below eight widths of the window in the record or 1 Hz.
    """
    step = median_step(time)
    highest = 0.1 / step
    lowest = min(highest, max(1.0, 8.0 / max(float(time[-1] - time[0]), step)))
    noise = max(white_noise(values), quantum(values) / np.sqrt(12))
    lag = max(1, min(len(time) - 1, round(0.25 / (lowest * step))))
    secant = (values[lag:] - values[:-lag]) / (time[lag:] - time[:-lag])
    size = float(np.sqrt(np.nanmean(secant**2)))
    if noise == 0 or size == 0:
        return highest if noise == 0 else lowest
    quiet = float(((0.01 * size) ** 2 / (VELOCITY_NOISE * noise**2 * step)) ** (1 / 3))
    return float(np.clip(quiet, lowest, highest))


def lowpass(
    values: Array, time: Array, cutoff: float, *, boundaries: NDArray[np.intp] | None = None
) -> Smoothed:
    """Low pass without phase, the same linear operator for every column.

    Parameters
    ----------
    values : array (N,) or (N, M), any unit
    time : array (N,), s, strictly increasing
    cutoff : Hz; gain 0.7071 (-3 dB) there, 0.97 at half of it, 0.07 at twice
    boundaries : array (k, 2), half-open row ranges that are filtered apart; default `runs(time)`

    Returns
    -------
    Smoothed : `values` of the same shape; `valid` (N,), false within `half_length` [s] of the
        ends of each run. Those rows are one-sided fits, still the same operator for all columns.

    Raises
    ------
    InputError : values are not finite (a filter would spread them), or the cutoff does not suit.
    """
    step = median_step(time)
    require_bandwidth(cutoff, 1 / step if step else 0.0, "low pass")
    if not np.all(np.isfinite(values)):
        row = int(np.argwhere(~np.isfinite(values))[0][0])
        raise InputError(f"low pass: row {row} is not finite; repair it with drop_invalid.")
    ranges = runs(time) if boundaries is None else boundaries
    fit = LocalFit(cutoff)
    return Smoothed(
        _by_run(fit, time, values, ranges), _inside(time, ranges, fit.half_length), fit.half_length
    )


class LowPass:
    """`lowpass` of one time axis, for columns that come again and again: weights are made once."""

    def __init__(self, time: Array, cutoff: float) -> None:
        self._time, self._fit = time, LocalFit(cutoff)
        self._runs = [(int(a), int(b)) for a, b in runs(time)]
        self._weights = [self._fit.weights(time[a:b]) for a, b in self._runs]

    def __call__(self, values: Array) -> Array:
        """Filter values (N,) or (N, M) that are finite."""
        out = np.empty(values.shape)
        for (a, b), weights in zip(self._runs, self._weights, strict=True):
            if weights is None:
                out[a:b] = self._fit.apply(self._time[a:b], values[a:b])
            else:
                out[a:b] = weights @ values[a:b]
        return out


def lowpass_log(log: Log, cutoff: float, channels: tuple[str, ...] | None = None) -> Log:
    """Low pass channels of a log: see `lowpass`. Default: all but time and held channels."""
    names = channels or tuple(c for c in log.channels if c != "time" and c not in HELD)
    done = {name: lowpass(_usable(log, name)[1], log["time"], cutoff) for name in names}
    edge = LocalFit(cutoff).half_length
    return log.with_columns(
        {name: smoothed.values for name, smoothed in done.items()},
        note=f"{listed(names)} low-passed: zero phase, -3 dB at {cutoff:.4g} Hz, one-sided within "
        f"{edge:.3g} s of the ends of {_count(len(runs(log['time'])), 'run')}",
    )


def resample(log: Log, rate: float) -> Log:
    """Put a log on even steps.

    Parameters
    ----------
    log : the log; time strictly increasing, angles unwrapped
    rate : Hz, the new rate. Where it is lower than the old one, channels are low-passed first,
        -3 dB at a quarter of the new rate; `enabled` and commands keep their last value instead.

    Returns
    -------
    Log on the times k / rate, k whole, that lie inside a run. Gaps stay gaps: nothing is put into
    them. Values between rows are interpolated linearly.
    """
    time = _usable(log, "time")[0]
    if not rate > 0:
        raise InputError(f"{log.name}: a rate of {rate!r} Hz is not possible; give one above 0.")
    ranges = runs(time)
    rows = sum(float(time[b - 1] - time[a]) * rate for a, b in ranges)
    require_memory(
        8.0 * rows * (1 + len(log.channels)),
        memory_limit(None),
        f"{log.name} at {rate:.4g} Hz",
        "give a lower rate",
    )
    grid = [
        np.arange(np.ceil(time[a] * rate - 1e-6), time[b - 1] * rate + 1e-6) / rate
        for a, b in ranges
    ]
    fresh = np.concatenate(grid)
    if fresh.size == 0:
        raise InputError(
            f"{log.name}: no run is as long as one step of {rate:.4g} Hz; give a higher rate."
        )
    slower = rate < log.rate * (1 - 1e-6)
    held = np.clip(np.searchsorted(time, fresh + 1e-9, side="right") - 1, 0, len(time) - 1)
    columns: dict[str, Array] = {"time": fresh}
    for name in (c for c in log.channels if c != "time"):
        if name in HELD:
            columns[name] = log[name][held]
            continue
        values = _usable(log, name)[1]
        smooth = lowpass(values, time, ANTI_ALIAS * rate).values if slower else values
        columns[name] = np.interp(fresh, time, smooth)
    passed = f", low-passed at {ANTI_ALIAS * rate:.4g} Hz before" if slower else ""
    note = (
        f"resampled from {log.rate:.6g} Hz to {rate:.6g} Hz{passed}: {len(log)} rows to "
        f"{len(fresh)}, {_count(len(ranges) - 1, 'gap')} kept"
    )
    return Log(columns, log.facts, (*log.history, note), log.source)


def decimate(log: Log, factor: int) -> Log:
    """Keep every `factor`-th row, low-passed before at a quarter of the new rate.

    Rows are those of the log (no interpolation), counted anew behind each gap.
    """
    if factor < 1 or factor != int(factor):
        raise InputError(f"{log.name}: decimate by {factor!r} is not possible; give 1, 2, 3, …")
    if factor == 1:
        return log
    smooth = tuple(c for c in log.channels if c != "time" and c not in HELD)
    passed = lowpass_log(log, ANTI_ALIAS * log.rate / factor, smooth)
    keep = np.concatenate([np.arange(a, b, factor) for a, b in runs(log["time"])])
    return passed.rows(keep, note=f"kept every {factor}. row: {len(log)} rows to {len(keep)}")


def _usable(log: Log, channel: str) -> tuple[Array, Array]:
    """Time and a channel, refused with one sentence where a filter would spread their faults."""
    time, values = log["time"], log[channel]
    stuck = np.flatnonzero(~(np.diff(time) > 0))
    if stuck.size:
        raise InputError(
            f"{log.name}, row {int(stuck[0]) + 1}: time does not increase; repair it "
            f"with sort_time or drop_duplicates."
        )
    low, high = limits_of(channel)
    bad = np.flatnonzero(~((values >= low) & (values <= high)))
    if bad.size:
        wrong = values[bad[0]]
        beyond = f"{wrong:.4g} {CHANNELS[channel].unit}, beyond any instrument"
        what = beyond if np.isfinite(wrong) else "not finite"
        raise InputError(
            f"{log.name}, row {int(bad[0])}: {channel} is {what}; repair it with drop_invalid."
        )
    return time, values


def _by_run(
    fit: LocalFit, time: Array, values: Array, ranges: NDArray[np.intp] | None = None
) -> Array:
    """Apply a filter to each run apart."""
    out = np.full(values.shape, np.nan)
    for a, b in runs(time) if ranges is None else ranges:
        out[a:b] = fit.apply(time[a:b], values[a:b])
    return out


def _inside(time: Array, ranges: NDArray[np.intp], margin: float) -> NDArray[np.bool_]:
    """Rows at least `margin` [s] away from both ends of their run."""
    valid = np.zeros(len(time), dtype=bool)
    for a, b in ranges:
        valid[a:b] = (time[a:b] - time[a] >= margin) & (time[b - 1] - time[a:b] >= margin)
    return valid


def _count(number: int, what: str) -> str:
    return f"{number} {what}" + ("" if number == 1 else "s")


def lateness(bandwidth: float) -> str:
    """Return how late the causal velocity and acceleration of a bandwidth [Hz] are, in words."""
    late = 1e3 / (2.0 * math.pi * bandwidth)
    return f"causal, −3 dB at {bandwidth:.4g} Hz, late by {late:.3g} and {2 * late:.3g} ms"


def differentiate_causal(
    log: Log,
    *,
    bandwidth: float,
    of: str = "output_position",
    channels: tuple[str, str] = ("output_velocity", "output_acceleration"),
) -> Log:
    """Add velocity and acceleration by the core's causal differentiator.

    It is what runs on the joint (`flexspline/estimators/differentiator.hpp`): two first-order
    stages, −3 dB at `bandwidth` each, so velocity is late by 1/(2π bandwidth), acceleration by
    twice that. Each run without a gap starts at rest. Compare with
    `differentiate`, which has no delay, to see what a device loses.

    Parameters
    ----------
    bandwidth : Hz, at most a quarter of the rate.
    of : an angle [rad] that moves less than half a turn from sample to sample; it may wrap.
    channels : where velocity [rad/s] and acceleration [rad/s²] go.

    Raises
    ------
    InputError
        Where the bandwidth does not suit the rate.
    """
    require_bandwidth(bandwidth, log.rate, f"{log.name}, derivative of {of}")
    velocity, acceleration = np.empty(len(log)), np.empty(len(log))
    for first, last in runs(log["time"]):
        rows = slice(int(first), int(last))
        velocity[rows], acceleration[rows] = _core.replay_differentiator(
            log["time"][rows], log[of][rows], bandwidth
        )
    note = f"{channels[0]} and {channels[1]} derived from {of}: {lateness(bandwidth)}"
    return log.with_columns({channels[0]: velocity, channels[1]: acceleration}, note=note)


def with_motion(log: Log) -> Log:
    """Return the log with velocity and acceleration where its position allows them."""
    names = ("output_velocity", "output_acceleration")
    missing = [name for name in names if name not in log]
    if not missing or "output_position" not in log or len(log) < 3:
        return log
    try:
        made = differentiate(log)
    except InputError:
        return log
    return log.with_columns({name: made[name] for name in missing}, note=made.history[-1])


def velocity_noise(log: Log) -> float:
    """Return the standard deviation of the velocity's noise, rad/s; 0 without a velocity.

    The largest of what the velocity itself shows (fourth differences; its quantum; its size while
    the position rests) and, where it was derived from the position, what that noise becomes.
    """
    if "output_velocity" not in log:
        return 0.0
    velocity, time = log["output_velocity"], log["time"]
    found = [white_noise(velocity), quantum(velocity) / np.sqrt(12.0)]
    if "output_position" in log and np.isfinite(log["output_position"]).all():
        position = log["output_position"]
        found.append(_at_rest(time, position, velocity))
        if any("output_velocity" in said and "derived" in said for said in log.history):
            noise = max(white_noise(position), quantum(position) / np.sqrt(12.0))
            width = default_bandwidth(time, position)
            found.append(noise * np.sqrt(VELOCITY_NOISE * width**3 * median_step(time)))
    return float(max(found))


def _at_rest(time: Array, position: Array, velocity: Array) -> float:
    """Robust size of the velocity on rows whose position moves nowhere for a while."""
    step = max(median_step(time), 1e-9)
    half = max(1, round(_WINDOW / step))
    if len(time) < 4 * half:
        return 0.0
    usual = float(np.nanpercentile(np.abs(velocity), 99))
    ahead = np.abs(position[2 * half :] - position[half:-half])
    behind = np.abs(position[half:-half] - position[: -2 * half])
    still = np.maximum(ahead, behind) <= _AT_REST * usual * half * step
    resting = velocity[half:-half][still]
    resting = resting[np.isfinite(resting)]
    return float(1.4826 * np.median(np.abs(resting))) if len(resting) >= _LEAST_ROWS else 0.0


def sampled(
    channel: str, time: NDArray[np.float64], values: NDArray[np.float64], at: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return `values`, known at `time` [s], at the times `at` [s], shape of `at`.

    Linear interpolation; what is held between rows (`HELD`, such as `enabled`) keeps its last
    value. Outside and in gaps the numbers mean nothing: see `has_value`.
    """
    if channel in HELD:
        return values[np.clip(np.searchsorted(time, at, side="right") - 1, 0, len(time) - 1)]
    return np.interp(at, time, values)


def has_value(time: NDArray[np.float64], at: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell which of the times `at` lie within `time` (increasing) and not in one of its gaps."""
    after = np.clip(np.searchsorted(time, at), 1, len(time) - 1)
    whole = time[after] - time[after - 1] <= GAP_STEPS * median_step(time)
    met = (at == time[after]) | (at == time[after - 1])
    inside: NDArray[np.bool_] = (at >= time[0]) & (at <= time[-1]) & (whole | met)
    return inside


def increasing_time(log: Log, what: str) -> NDArray[np.float64]:
    """Return the time [s] of a log.

    Raises
    ------
    InputError
        Where it does not increase, which `what` needs.
    """
    wrong = np.flatnonzero(~(np.diff(log["time"]) > 0))
    if len(wrong):
        raise InputError(
            f"log '{log.name}': time does not increase at row {wrong[0] + 1}, "
            f"which {what} needs; ask for sort_time and drop_duplicates before it"
        )
    return log["time"]
