"""The motion of a run, and how noisy its velocity is.

Velocity noise makes friction terms noisy regressors: at standstill a residual follows the
*measured* velocity without any effect being missing. What it can explain is part of the floor.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexspline.logs.derive import VELOCITY_NOISE, default_bandwidth, differentiate
from flexspline.logs.grain import quantum, white_noise
from flexspline.logs.log import Log
from flexspline.logs.segments import median_step

__all__ = ["velocity_noise", "with_motion"]

Array = NDArray[np.float64]

_WINDOW = 0.1  # s, to either side: over which a joint at rest does not move
_AT_REST = 1e-3  # of the speed that 99 % of the rows stay below
_LEAST_ROWS = 50


def with_motion(log: Log) -> Log:
    """Return the log with velocity and acceleration where its position allows them."""
    names = ("output_velocity", "output_acceleration")
    missing = [name for name in names if name not in log]
    if not missing or "output_position" not in log or len(log) < 3:
        return log
    if not (np.isfinite(log["output_position"]).all() and (np.diff(log["time"]) > 0).all()):
        return log
    made = differentiate(log)
    return log.with_columns({name: made[name] for name in missing}, note=made.history[-1])


def velocity_noise(log: Log) -> float:
    """Return the standard deviation of the velocity's noise, rad/s; 0 without a velocity.

    The largest of what the velocity itself shows (fourth differences; its quantum; its size while
    the position rests) and, where it was derived from the position, what that noise becomes.
    """
    if "output_velocity" not in log:
        return 0.0
    velocity, time = log["output_velocity"], log["time"]
    found = [white_noise(velocity), quantum(velocity) / np.sqrt(12.0)]
    if "output_position" in log and np.isfinite(log["output_position"]).all():
        position = log["output_position"]
        found.append(_at_rest(time, position, velocity))
        if any("output_velocity" in said and "derived" in said for said in log.history):
            noise = max(white_noise(position), quantum(position) / np.sqrt(12.0))
            width = default_bandwidth(time, position)
            found.append(noise * np.sqrt(VELOCITY_NOISE * width**3 * median_step(time)))
    return float(max(found))


def _at_rest(time: Array, position: Array, velocity: Array) -> float:
    """Robust size of the velocity on rows whose position moves nowhere for a while."""
    step = max(median_step(time), 1e-9)
    half = max(1, round(_WINDOW / step))
    if len(time) < 4 * half:
        return 0.0
    usual = float(np.nanpercentile(np.abs(velocity), 99))
    ahead = np.abs(position[2 * half :] - position[half:-half])
    behind = np.abs(position[half:-half] - position[: -2 * half])
    still = np.maximum(ahead, behind) <= _AT_REST * usual * half * step
    resting = velocity[half:-half][still]
    resting = resting[np.isfinite(resting)]
    return float(1.4826 * np.median(np.abs(resting))) if len(resting) >= _LEAST_ROWS else 0.0
