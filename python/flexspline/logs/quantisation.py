"""How fine a channel is: the step of its quantisation and its noise without memory."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "quantum",
    "white_noise",
]

Array = NDArray[np.float64]

ROWS = 200_000

FLOAT = 1e-9
"""Share of the range below which steps between values are rounding of their arithmetic."""

OFF = 0.05
"""Share of a step by which nearly all steps may miss a lattice of it."""

ALL_BUT = 0.02
"""Share of the steps that may miss a lattice by more."""

FROM_ROW_TO_ROW = 2.0 * ALL_BUT
"""Share of the rows on the move in which a quantum shows from row to row. At f counts per row, the
whole ones aside, the travel changes by a count and back f times per row: in min(2 f, 2 − 2 f) of
the second differences. A lattice of travel per row has as many other ones as strokes begin and end:
it lets ALL_BUT of the steps miss it, and each of these is in two second differences."""


def quantum(values: Array) -> float:
    """Step of the quantisation, in the unit of `values`; 0 where there is none to be seen.

    The levels that occur lie on a lattice; it is found from the smallest steps between them and
    must hold over the whole range. Up to 200 000 rows are looked at, in the order of time. Levels
    of a motion at constant speed lie on a lattice too, of its travel per row, up to the quantum.
    There, second differences are without the travel, and multiples of the quantum.
    """
    known = values[:ROWS][np.isfinite(values[:ROWS])]
    levels = np.unique(known)
    least = FLOAT * (float(levels[-1] - levels[0]) if levels.size else 0.0)
    step = _lattice(np.diff(levels), least)
    if step == 0.0:
        return 0.0
    travel = np.diff(known)
    moving = np.abs(travel) > least
    change = np.abs(np.diff(travel))[moving[1:] | moving[:-1]]
    fine = change < 0.5 * step
    is_quantum = np.count_nonzero(~fine) >= FROM_ROW_TO_ROW * len(change)
    return step if is_quantum else _lattice(change[fine], least)


def _lattice(steps: Array, least: float) -> float:
    """The step of which steps (n,) above `least` are multiples; 0 where there is none."""
    steps = steps[steps > least]
    if steps.size < 4:
        return 0.0
    smallest = float(np.percentile(steps, 5))
    step = float(np.mean(steps[steps < 1.5 * smallest]))
    for _ in range(3):
        count = np.round(steps / step)
        step = float(np.sum(steps) / np.sum(count)) if np.all(count > 0) else step
    off = np.abs(steps / step - np.round(steps / step))
    return step if float(np.percentile(off, 100.0 * (1.0 - ALL_BUT))) < OFF else 0.0


def white_noise(values: Array) -> float:
    """RMS of the noise without memory, robust: from fourth differences, which kill slow motion."""
    if len(values) < 16:
        return 0.0
    fourth = np.diff(values[:ROWS], n=4)
    return float(np.median(np.abs(fourth[np.isfinite(fourth)])) / 0.6745 / np.sqrt(70.0))
