"""How fine a channel is: the step of its quantisation and its noise without memory."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "quantum",
    "white_noise",
]

Array = NDArray[np.float64]


def quantum(values: Array) -> float:
    """Step of the quantisation, in the unit of `values`; 0 where there is none to be seen.

    The levels that occur lie on a lattice; it is found from the smallest steps between them and
    must hold over the whole range. Up to 200 000 rows are looked at.
    """
    levels = np.unique(values[:200_000][np.isfinite(values[:200_000])])
    steps = np.diff(levels)
    steps = steps[steps > 1e-9 * (float(levels[-1] - levels[0]) if levels.size else 0.0)]
    if steps.size < 4:
        return 0.0
    smallest = float(np.percentile(steps, 5))
    step = float(np.mean(steps[steps < 1.5 * smallest]))
    for _ in range(3):
        count = np.round(steps / step)
        step = float(np.sum(steps) / np.sum(count)) if np.all(count > 0) else step
    off = np.abs(steps / step - np.round(steps / step))
    return step if float(np.percentile(off, 98)) < 0.05 else 0.0


def white_noise(values: Array) -> float:
    """RMS of the noise without memory, robust: from fourth differences, which kill slow motion."""
    if len(values) < 16:
        return 0.0
    fourth = np.diff(values[:200_000], n=4)
    return float(np.median(np.abs(fourth[np.isfinite(fourth)])) / 0.6745 / np.sqrt(70.0))
