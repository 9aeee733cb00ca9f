"""What a channel was some time ago: a cause with memory that no present value shows.

Any linear cause with memory is a sum of first-order lags of its channel x with time constants T,

    T dz/dt + z = x,     z = x at the start

Some T, in geometric steps from two samples to half of the longest run, stand for all: heat that
flows, a filter, a sensor that creeps. They tell an unknown cause with memory from slow noise.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from flexspline.discovery.settings import SETTINGS
from flexspline.logs.segments import median_step, runs

__all__ = ["MOST_ROWS", "names_of_past", "past_of"]

Array = NDArray[np.float64]

MOST_ROWS = round(SETTINGS.rows / SETTINGS.negligible)
"""Of a run: beyond, its past is not looked at, to save memory."""
BEHIND = " behind lag "


def past_of(
    time: Array, values: Mapping[str, Array], names: list[str], longest: float
) -> dict[str, Array]:
    """Return some channels of a run behind each lag, (N,) each; `longest` of all runs, s."""
    step = median_step(time)
    made = {}
    for name in (name for name in names if name in values):
        lags = np.geomspace(2.0 * step, 0.5 * longest, SETTINGS.points)
        for late, lag in zip(names_of_past(name), lags, strict=True):
            parts = [_lagged(values[name][a:b], step / lag) for a, b in runs(time)]
            made[late] = np.concatenate(parts)
    return made


def names_of_past(name: str) -> list[str]:
    """Names of a channel behind each lag."""
    return [f"{name}{BEHIND}{number + 1}" for number in range(SETTINGS.points)]


def _lagged(values: Array, share: float) -> Array:
    """Values behind a lag of 1 / share steps, settled at the first."""
    kept = np.exp(-share)
    made, _ = lfilter([1.0 - kept], [1.0, -kept], values, zi=[kept * values[0]])
    return np.asarray(made)
