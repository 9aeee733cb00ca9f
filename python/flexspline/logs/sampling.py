"""Values of a channel at other times than its own."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import InputError
from flexspline.logs.derive import HELD
from flexspline.logs.log import Log
from flexspline.logs.segments import GAP_STEPS, median_step

__all__ = ["has_value", "increasing_time", "sampled"]


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
