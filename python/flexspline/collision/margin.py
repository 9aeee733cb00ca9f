"""The margin on the largest value of free motion that short logs need."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexspline.collision.contact_free import residuals_of
from flexspline.collision.residual import Residual
from flexspline.errors import InputError

__all__ = ["PAPER_MARGIN", "left_out_margin"]

PAPER_MARGIN = 0.03 / 0.0255
"""zhang_disturbance_elimination §4.4: 0.0255 Nm in free motion, 0.03 Nm as the threshold."""


def left_out_margin(runs: Sequence[Residual], *, symmetric: bool = False) -> float:
    """Return the margin on the largest value of all other runs that no run left out exceeds.

    What the paper's 1.18 would have to be for these logs: with little data, far more. At least
    1.18. One number for all joints and directions, speed bands aside.

    Parameters
    ----------
    runs : contact-free, two or more, of the same joints.
    symmetric : whether both directions have one threshold.

    Raises
    ------
    InputError
        Where there are fewer than two runs, or a joint's residual is zero throughout.
    """
    watched = residuals_of(runs, None, "observer")
    if len(watched) < 2:
        raise InputError("detector: to leave one run out takes two or more; give more runs")
    both = np.array([[np.nanmax(each.values, 0), np.nanmax(-each.values, 0)] for each in watched])
    if symmetric:
        both = both.max(axis=1, keepdims=True)
    ratios = [both[k] / np.delete(both, k, axis=0).max(axis=0) for k in range(len(watched))]
    worst = float(np.max(ratios))
    if not np.isfinite(worst):
        raise InputError("detector: a joint's residual is zero throughout; check its channel")
    return max(worst, PAPER_MARGIN)
