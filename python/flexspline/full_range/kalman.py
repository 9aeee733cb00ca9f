"""The Kalman rival of (19): its variances from the training logs, by speed.

The filter is the core's (`flexspline/estimators/kalman_merge.hpp`). The noise of each estimate at
rest and in motion is the RMSE that it has there on the training logs. These errors have a memory,
while the filter takes noise for white, so how fast the torque may wander is not taken from the
torque but chosen for the least RMSE: only the ratio of wander and noise matters.

Other rivals of (19) are not taken up. It is a complementary filter already, whose share depends on
speed; an IMM, filters for rest and motion weighed by how likely each is, would tell the two apart
by the estimates, while the speed is measured and says so at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from flexspline import _core
from flexspline.estimators import Merge

__all__ = ["MergeRun", "fit_kalman", "merged_by_kalman"]

Array = NDArray[np.float64]

SHUT = 4.0  # α of the change from rest to motion, in units of 1 / motion speed: λ(0) = 0.018
LEAST_NOISE = 1e-6  # Nm
GRID = 13


@dataclass(frozen=True)
class MergeRun:
    """What a merge reads of one run, arrays (N,): s, rad/s at the output, Nm."""

    time: Array
    velocity: Array
    observer: Array
    compliance: Array
    reference: Array


def merged_by_kalman(merge: Merge, run: MergeRun) -> Array:
    """Return the merged torque of one run, (N,), Nm."""
    assert merge.walk and merge.observer_noise and merge.compliance_noise  # as Merge checks
    return np.asarray(
        _core.merge_kalman(
            run.time,
            run.velocity,
            run.observer,
            run.compliance,
            alpha=merge.alpha,
            transition_velocity=merge.transition_velocity,
            walk=merge.walk,
            observer_rest=merge.observer_noise[0],
            observer_motion=merge.observer_noise[1],
            compliance_rest=merge.compliance_noise[0],
            compliance_motion=merge.compliance_noise[1],
        )
    )


def fit_kalman(runs: Sequence[MergeRun], motion_speed: float) -> Merge:
    """Return the filter with the least RMSE over the runs.

    Parameters
    ----------
    runs : training runs with their reference.
    motion_speed : rad/s at the output, between rest and motion.
    """
    moving = np.concatenate([np.abs(run.velocity) for run in runs]) >= motion_speed

    def noise(name: str) -> tuple[float, float]:
        error = np.concatenate([getattr(run, name) - run.reference for run in runs])
        still, driven = (float(np.sqrt(np.nanmean(error[m] ** 2))) for m in (~moving, moving))
        return max(still, LEAST_NOISE), max(driven, LEAST_NOISE)

    sizes = noise("observer"), noise("compliance")

    def made(log_walk: float) -> Merge:
        return Merge(
            SHUT / motion_speed,
            motion_speed,
            method="kalman",
            walk=float(np.exp(log_walk)),
            observer_noise=sizes[0],
            compliance_noise=sizes[1],
        )

    def cost(log_walk: float) -> float:
        merge = made(log_walk)
        errors = [merged_by_kalman(merge, run) - run.reference for run in runs]
        return float(np.nanmean(np.concatenate(errors) ** 2))

    period = float(np.median(np.diff(runs[0].time)))
    middle = np.log(np.sqrt(sizes[0][1] * sizes[1][0] / period))
    grid = middle + np.linspace(-8.0, 4.0, GRID)
    best = int(np.argmin([cost(x) for x in grid]))
    around = (float(grid[max(best - 1, 0)]), float(grid[min(best + 1, GRID - 1)]))
    return made(float(minimize_scalar(cost, bounds=around, method="bounded").x))
