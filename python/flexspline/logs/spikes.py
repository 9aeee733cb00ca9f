"""Rows that stand alone: one or two that leap out of a channel, which goes on as it came.

A row x between its neighbours a and b (two rows: both of them) stands out by

    d = min(|x − a|, |x − b|),   x above both or below both,

so that a step, a ramp or a corner has none. It stands alone where d is more than

- `TOLD` times the noise of the channel, or the steps of its numbers, and
- `ALONE` times the farthest that the channel goes from row to row in the `REACH` rows on either
  side, and from a to b,

and where the channel goes as far from row to row elsewhere in fewer places than rows stand alone:
a channel that is switched is so for short times, too.

White Gaussian noise of standard deviation σ makes d > k σ in a share of the rows below exp(−k²/3):
of k = 10 in less than one of 10¹⁴, whatever the second rule says. The second rule is for what is
no such noise: noise that grows with speed, stick-slip, ripple near half the rate, impacts.
Of noise with heavy tails, Student's t of 4 degrees of freedom, 2 rows in a million stand alone.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from flexspline.logs.quantisation import quantum
from flexspline.logs.segments import GAP_STEPS, median_step

__all__ = ["CONVERTED", "SPIKED", "spikes"]

Array = NDArray[np.float64]

CONVERTED: Final[tuple[str, ...]] = (
    "motor_torque",
    "motor_current",
    "sensor_torque",
    "sensor_voltage",
    "thermistor_voltage",
    "reference_torque",
)
"""Channels that end at the range of a converter; a velocity may hold its plateau with reason."""

SPIKED: Final[tuple[str, ...]] = (*CONVERTED, "temperature", "motor_temperature")
"""Channels of which a row may be wrong alone. A position that leaps is a wrap or a slip."""

TOLD: Final = 10.0
"""Times the noise. Half of it is one row in 4000 of white noise; twice of it misses spikes of a
tenth of a noisy channel's range, that a fit hardly feels."""

ALONE: Final = 10.0
"""Times the steps beside it. What a joint does at once, a brake or an impact, dies away: by this
much within a row only where the recorder does not see it at all. Half of it takes a stop that a
recorder of 100 Hz sees in one row for a spike; twice of it wants a spike of 20 steps."""

REACH: Final = 10  # rows on either side: the least that show noise, of its 20 steps the farthest
LONGEST: Final = 2  # rows; what lasts longer is seen by a recorder


def spikes(time: Array, values: Array) -> NDArray[np.intp]:
    """Return the rows of a channel that stand alone.

    Parameters
    ----------
    time : array (N,), s
    values : array (N,), any unit; rows that are not finite are left out

    Returns
    -------
    Rows (M,), of which neither end of the run nor a gap is within `REACH`.
    """
    known = np.flatnonzero(np.isfinite(values) & np.isfinite(time))
    v, t = values[known], time[known]
    if len(v) < 2 * REACH + LONGEST + 2:
        return known[:0]
    steps, gaps = np.abs(np.diff(v)), np.abs(np.diff(t)) > GAP_STEPS * median_step(t)
    least = TOLD * max(float(np.median(steps)) / 0.6745 / np.sqrt(2.0), _grain(v))
    rows, sizes = [known[:0]], [v[:0]]
    for count in range(1, LONGEST + 1):
        first = np.arange(1 + REACH, len(v) - count - REACH)
        first = first[_out(v, first, count) > least]
        around = (first - 1 - REACH)[:, None] + np.arange(2 * REACH + count + 1)
        first = first[~gaps[around].any(axis=1)]
        before = (first - 1 - REACH)[:, None] + np.arange(REACH)
        usual = np.maximum(
            np.concatenate([steps[before], steps[before + REACH + 1 + count]], axis=1).max(axis=1),
            np.abs(v[first + count] - v[first - 1]),
        )
        alone = first[_out(v, first, count) > ALONE * usual]
        rows += [alone + k for k in range(count)]
        sizes += [_out(v, alone, count)] * count
    return known[_rarely_left(steps, np.concatenate(rows), np.concatenate(sizes))]


def _rarely_left(steps: Array, rows: NDArray[np.intp], sizes: Array) -> NDArray[np.intp]:
    """Return, in order, the rows that leap by more than the channel elsewhere does as often."""
    others = np.ones(len(steps), dtype=bool)
    others[rows] = others[rows - 1] = False
    usual = np.sort(steps[others])
    larger = len(usual) - np.searchsorted(usual, sizes)
    return np.unique(rows[larger < len(rows)])


def _out(values: Array, first: NDArray[np.intp], count: int) -> Array:
    """Return by how much so many rows, from `first`, stand out of the rows beside them."""
    inside = np.stack([values[first + k] for k in range(count)])
    a, b = values[first - 1], values[first + count]
    above = inside.min(axis=0) - np.maximum(a, b)
    below = np.minimum(a, b) - inside.max(axis=0)
    return np.asarray(np.maximum(above, below))


def _grain(values: Array) -> float:
    """Return the step of a channel's numbers, of few levels the least between them."""
    if step := quantum(values):
        return step
    levels = np.unique(values)
    return float(np.diff(levels).min()) if 1 < len(levels) <= 2 * REACH else 0.0
