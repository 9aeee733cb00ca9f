"""The motion in a log as the checks need it: cleaned, derived from position, of bearable size.

The log itself is not touched. Rows that are not finite or not increasing in time are left out,
angles unwrapped. Of long logs eight stretches are looked at, 400 000 rows in all.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from flexspline.logs.checks.samples import unwrapped
from flexspline.logs.derive import default_bandwidth
from flexspline.logs.local_fit import LocalFit
from flexspline.logs.log import Log
from flexspline.logs.quantisation import quantum, white_noise
from flexspline.logs.segments import median_step, runs

Array = NDArray[np.float64]

STRETCHES, STRETCH_ROWS = 8, 50_000


@dataclass(frozen=True)
class Motion:
    """Velocity and acceleration of one angle, zero phase, with the channels beside it.

    All arrays have one row per row looked at; `smooth` gives other channels the same low pass.
    """

    time: Array
    position: Array
    velocity: Array
    acceleration: Array
    bandwidth: float
    ranges: NDArray[np.intp]
    rows: NDArray[np.intp]

    def smooth(self, values: Array) -> Array:
        """A channel of the log behind the low pass that the velocity has."""
        return self.low_passed(values[self.rows])

    def low_passed(self, values: Array) -> Array:
        """Columns with a row for each row of the motion, behind its low pass."""
        fit = LocalFit(self.bandwidth)
        return np.concatenate([fit.apply(self.time[a:b], values[a:b]) for a, b in self.ranges])

    def inside(self, margin: float) -> NDArray[np.bool_]:
        """Rows at least `margin` [s] away from the ends of their run, and not at its edge."""
        reach = max(margin, LocalFit(self.bandwidth).half_length)
        valid = np.zeros(len(self.time), dtype=bool)
        for a, b in self.ranges:
            t = self.time[a:b]
            valid[a:b] = (t - t[0] >= reach) & (t[-1] - t >= reach)
        return valid


@lru_cache(maxsize=2)  # several checks ask in turn; `check` forgets it behind them
def motion_of(log: Log, channel: str = "output_position") -> Motion | None:
    """Motion of a position channel; None where it has none worth the name.

    Too little motion: less than 50 quanta or 20 times the noise, or fewer than 100 rows.
    """
    if channel not in log:
        return None
    rows = _usable_rows(log)
    time, position = log["time"][rows], unwrapped(log[channel][rows])
    travel = float(np.ptp(position)) if len(position) else 0.0
    grain = max(50 * quantum(position), 20 * white_noise(position))
    if len(rows) < 100 or travel <= max(grain, 1e-12):
        return None
    ranges = runs(time)
    ranges = ranges[ranges[:, 1] - ranges[:, 0] >= 10]
    if len(ranges) == 0:
        return None
    keep = np.concatenate([np.arange(a, b) for a, b in ranges])
    ends = np.cumsum(ranges[:, 1] - ranges[:, 0])
    bounds = np.stack((np.concatenate(([0], ends[:-1])), ends), axis=1)
    return _derived(time[keep], position[keep], bounds, rows[keep])


def _derived(
    time: Array, position: Array, ranges: NDArray[np.intp], rows: NDArray[np.intp]
) -> Motion:
    bandwidth = min(default_bandwidth(time, position), 0.1 / median_step(time))
    parts = [
        [LocalFit(bandwidth, order).apply(time[a:b], position[a:b]) for a, b in ranges]
        for order in (1, 2)
    ]
    velocity, acceleration = (np.concatenate(p) for p in parts)
    return Motion(time, position, velocity, acceleration, bandwidth, ranges, rows)


def _usable_rows(log: Log) -> NDArray[np.intp]:
    """Rows that are finite in all channels and increase in time, of eight stretches if many."""
    count = len(log)
    if count > STRETCHES * STRETCH_ROWS:
        starts = np.linspace(0, count - STRETCH_ROWS, STRETCHES).astype(np.intp)
        rows = np.concatenate([np.arange(s, s + STRETCH_ROWS) for s in starts])
    else:
        rows = np.arange(count)
    for channel in log.channels:
        rows = rows[np.isfinite(log[channel][rows])]
    if rows.size == 0:
        return rows
    time = log["time"][rows]
    highest = np.concatenate(([-np.inf], np.maximum.accumulate(time)[:-1]))
    return np.asarray(rows[time > highest])
