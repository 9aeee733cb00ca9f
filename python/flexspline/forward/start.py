"""Where a run starts: its first angle and velocity, and its motor's encoder."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import InputError, listed
from flexspline.logs.derive import differentiate, velocity_noise
from flexspline.logs.log import Log
from flexspline.part import Part

__all__ = ["motor_offset", "require_finite", "start_of"]

Array = NDArray[np.float64]

_NOISY = 3.0  # standard deviations of the velocity that count as rest


def start_of(log: Log, stretches: NDArray[np.intp]) -> Array:
    """Return angle and velocity at the start of each stretch, (K, 2), rad and rad/s.

    A velocity within its noise is none. Raises InputError where the angle is not measured.
    """
    if "output_position" not in log:
        raise InputError(
            f"log '{log.name}': the initial state is the first output_position, which the log "
            f"lacks; it has {listed(log.channels)}; map a column to it"
        )
    first = stretches[:, 0]
    position = log["output_position"][first]
    require_finite(log, "output_position", position, first)
    velocity, noise = _velocity(log, stretches)
    velocity[np.abs(velocity) < _NOISY * noise] = 0.0
    return np.stack((position, velocity), axis=1)


def _velocity(log: Log, stretches: NDArray[np.intp]) -> tuple[Array, float]:
    first = stretches[:, 0]
    if "output_velocity" in log:
        velocity = log["output_velocity"][first]
        require_finite(log, "output_velocity", velocity, first)
        return velocity.copy(), velocity_noise(log)
    if not np.isfinite(log["output_position"]).all() or len(log) < 3:
        return np.zeros(len(first)), 0.0
    made = differentiate(log)
    return np.asarray(made["output_velocity"])[first].copy(), velocity_noise(made)


def motor_offset(part: Part, log: Log) -> float:
    """Return θ − Ñ q, rad: the encoders' zeros differ, and ripple counts from the motor's.

    Raises InputError where the model was fitted with the motor's angle and the log lacks it.
    """
    fitted = part.record.get("channels")
    reads = any("motor_position" in effect.reads for effect in part.effects)
    measured = "motor_position" in (log.channels if fitted is None else fitted)
    if not (reads and measured):
        return 0.0
    if "motor_position" not in log or log.effective_ratio is None:
        raise InputError(
            f"log '{log.name}': the model's ripple was fitted with the channel motor_position, "
            "whose first row says where it starts; map a column to it and give gear_ratio"
        )
    offset = log["motor_position"][0] - log.effective_ratio * log["output_position"][0]
    require_finite(log, "motor_position", np.array([offset]))
    return math.remainder(float(offset), 2.0 * math.pi)


def require_finite(log: Log, name: str, data: Array, rows: NDArray[np.intp] | None = None) -> None:
    bad = np.flatnonzero(~np.isfinite(data))
    if not len(bad):
        return
    row = int(bad[0] if rows is None else rows[bad[0]])
    raise InputError(
        f"log '{log.name}': row {row} has no value of {name} "
        f"({len(bad)} such rows), so nothing can be driven through it; interpolate or cut the run"
    )
