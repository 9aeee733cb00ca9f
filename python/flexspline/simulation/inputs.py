"""What a caller of a simulation gives, checked: times, columns and names of channels."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexspline.errors import InputError, did_you_mean, listed
from flexspline.simulation.trajectory import CHANNELS

__all__ = ["column", "increasing", "wanted"]

Array = NDArray[np.float64]


def wanted(channels: Sequence[str] | None) -> list[str]:
    if channels is None:
        return list(CHANNELS)
    for name in channels:
        if name not in CHANNELS:
            raise InputError(
                f"simulation: '{name}' is no channel of a trajectory"
                f"{did_you_mean(name, CHANNELS)}; the channels are {listed(CHANNELS, 40)}"
            )
    return list(channels)


def increasing(time: ArrayLike) -> tuple[Array, float]:
    """Return the times and the longest interval between two of them."""
    times = np.ascontiguousarray(time, dtype=float)
    if times.ndim != 1 or len(times) < 2:
        raise InputError(
            f"simulation: time has shape {times.shape}; give one dimension with two rows or more"
        )
    with np.errstate(invalid="ignore"):
        intervals = times[1:] - times[:-1]
    longest = float(intervals.max())
    if not (intervals.min() > 0 and math.isfinite(longest)):
        _refuse(times, intervals)
    return times, longest


def _refuse(times: Array, intervals: Array) -> None:
    finite = np.isfinite(times)
    if not finite.all():
        bad = np.flatnonzero(~finite)
        raise InputError(f"simulation: time is not finite in row {bad[0]}; give every time in s")
    back = np.flatnonzero(~(intervals > 0))
    raise InputError(
        f"simulation: time does not increase from row {back[0]} to row {back[0] + 1}; "
        "give strictly increasing times"
    )


def column(name: str, value: ArrayLike, rows: int) -> Array:
    data = np.asarray(value, dtype=float)
    if data.ndim == 0:
        data = np.full(rows, float(data))
    if data.shape != (rows,):
        raise InputError(
            f"simulation: {name} has shape {data.shape} where time has {rows} rows; "
            "give one number for each row, or one for all"
        )
    finite = np.isfinite(data)
    if not finite.all():
        bad = np.flatnonzero(~finite)
        raise InputError(
            f"simulation: {name} is {data[bad[0]]} in row {bad[0]}; give finite numbers"
        )
    return np.ascontiguousarray(data)
