"""Runs cut into short pieces, each begun anew from the measured state.

What a wrong parameter does to a motion grows with time, and with it the number of valleys between
which a descent can get lost: over a piece the miss is nearly linear in the parameters. Where the
pieces are missed least is a better place to start from than the regression.
Source: [Bock1983], multiple shooting, without the conditions that join the pieces.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from flexspline.forward.drive import DriveInputs
from flexspline.output_error.cost import Cost

__all__ = ["SECONDS", "by_pieces"]

Array = NDArray[np.float64]

SECONDS = 0.5


def by_pieces(cost: Cost, velocities: Sequence[Array]) -> Cost:
    """Return the cost of runs that begin anew every `SECONDS`.

    Parameters
    ----------
    velocities : measured, rad/s, (N,) for each run.
    """
    runs = [_cut(run, v) for run, v in zip(cost.runs, velocities, strict=True)]
    return replace(cost, runs=runs)


def _cut(run: DriveInputs, velocity: Array) -> DriveInputs:
    pieces = []
    for first, last in run.stretches.tolist():
        count = max(1, round((run.time[last - 1] - run.time[first]) / SECONDS))
        edges = np.linspace(first, last, count + 1).astype(int).tolist()
        pieces += [pair for pair in pairwise(edges) if pair[1] - pair[0] >= 2]
    begin = np.array([first for first, _ in pieces])
    start = np.stack((run.measured[begin], velocity[begin]), axis=1)
    if not np.isfinite(start).all():
        return run
    return replace(run, stretches=np.array(pieces), start=start)
