"""How far back the last change of direction lies, in time and in angle.

A row counts as moving where |v| exceeds a threshold; a stop keeps the direction of before. The
reversal is the first row that moves the other way. Before the first one nothing is known (NaN).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexspline.logs.segments import runs

__all__ = ["SinceReversal", "since_reversal"]

Array = NDArray[np.float64]


class SinceReversal(NamedTuple):
    """Arrays (N,): seconds, angle [rad at the output], and the direction kept, -1, 0 or 1."""

    seconds: Array
    angle: Array
    direction: NDArray[np.int8]


def since_reversal(time: Array, position: Array, velocity: Array, still: float) -> SinceReversal:
    """Return the distance of every row from the last reversal.

    Parameters
    ----------
    time, position, velocity : (N,), s, rad, rad/s at the output; starts again behind a gap.
    still : rad/s, up to which the joint has no direction.
    """
    seconds, angle = np.full((2, len(time)), np.nan)
    direction = np.zeros(len(time), dtype=np.int8)
    for a, b in runs(time):
        kept = _kept(np.sign(velocity[a:b]) * (np.abs(velocity[a:b]) > still))
        direction[a:b] = kept
        turned = np.flatnonzero((kept[1:] != kept[:-1]) & (kept[:-1] != 0)) + 1
        if not len(turned):
            continue
        rows = np.arange(turned[0], b - a)
        last = a + turned[np.searchsorted(turned, rows, side="right") - 1]
        seconds[a + rows] = time[a + rows] - time[last]
        angle[a + rows] = np.abs(position[a + rows] - position[last])
    return SinceReversal(seconds, angle, direction)


def _kept(sign: Array) -> NDArray[np.int8]:
    """Signs with each 0 replaced by the last one that is none."""
    at = np.maximum.accumulate(np.where(sign != 0.0, np.arange(len(sign)), 0))
    return np.asarray(sign[at], dtype=np.int8)
