"""The external torque of an arm that senses its joints: what is left of each sensor.

    τ_s = τ_rb + τ_intr + τ_ext,    τ_rb = M q̈ + C q̇ + g,    τ_ext = Jᵀ W

No dynamics of an estimate, no delay, but the acceleration, which `observe` does without. What is
left goes to `wrench_at_end_effector` with its covariance. M, C and g are of what lies outboard of
the sensors; they count as exact. Source: turlapati_intrinsic_dynamics (1), (2).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexspline.errors import InputError
from flexspline.estimators.checks import above_zero, numbers
from flexspline.observer.dynamics import Dynamics, evaluated, require_dynamics
from flexspline.observer.observing import arrays_of
from flexspline.observer.parts import friction_torque, parts_of
from flexspline.part import Part

__all__ = ["Remainder", "subtract"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Remainder:
    """What rigid body and intrinsic torque leave of the sensors.

    Parameters
    ----------
    time : (N,) s.
    external : (N, n) Nm, outward positive; NaN in rows that are not finite.
    rigid, intrinsic : (N, n) Nm, what was taken off.
    covariance : (n, n) Nm², of the external torques: that of the sensors and of the parts.
    """

    time: Array
    external: Array
    rigid: Array
    intrinsic: Array
    covariance: Array

    @property
    def deviation(self) -> Array:
        """Standard deviations (n,), Nm."""
        return np.sqrt(np.diagonal(self.covariance))


def subtract(
    time: ArrayLike,
    position: ArrayLike,
    velocity: ArrayLike,
    acceleration: ArrayLike,
    torque: ArrayLike,
    *,
    dynamics: Dynamics,
    noise: ArrayLike,
    intrinsic: Part | Sequence[Part | None] | ArrayLike | None = None,
    intrinsic_error: ArrayLike = 0.0,
) -> Remainder:
    """Return the external torque of every joint from its sensor.

    Parameters
    ----------
    time : (N,) s, increasing.
    position, velocity, acceleration : (N, n) rad, rad/s, rad/s² at the outputs.
    torque : (N, n) Nm, the sensors.
    dynamics : callable (q, q̇) → M, C, g (`Dynamics`; of a URDF by `dynamics_from_urdf`).
    noise : Nm, standard deviation of a sensor's noise; one number or one for each joint.
    intrinsic : fitted sensor parts, one for each joint (None for a joint without), or an array
        (N, n), Nm.
    intrinsic_error : Nm, standard deviation of what the parts predict, such as the RMSE of the fit
        on rows that it never saw; one number or one for each joint.

    Raises
    ------
    InputError
        For shapes that do not agree, rows of which none is finite, impossible dynamics
        (`require_dynamics`), or noise that is not above zero.
    """
    times, (angle, speed, rate, sensed) = arrays_of(time, position, velocity, acceleration, torque)
    count = angle.shape[1]
    parts = parts_of(intrinsic, count)
    good = np.isfinite(np.hstack([angle, speed, rate])).all(axis=1)
    require_dynamics(dynamics, angle[good], speed[good])
    mass, coriolis, gravity = evaluated(dynamics, angle[good], speed[good])
    rigid = np.full_like(angle, np.nan)
    rigid[good] = np.einsum("kij,kj->ki", mass, rate[good]) + gravity
    rigid[good] += np.einsum("kij,kj->ki", coriolis, speed[good])
    own = friction_torque(intrinsic, parts, times, (angle, speed, rate))
    spread = _each(noise, "noise", count) ** 2
    spread = spread + _each(intrinsic_error, "intrinsic_error", count) ** 2
    if not (spread > 0.0).all():
        raise InputError("subtract: noise = 0 makes no covariance; give that of the sensors in Nm")
    return Remainder(times, sensed - rigid - own, rigid, own, np.diag(spread))


def _each(given: ArrayLike, name: str, count: int) -> Array:
    """One number of zero or more for each joint, (n,)."""
    values = numbers(np.atleast_1d(np.asarray(given)).tolist(), f"subtract: {name}", "Nm")
    for value in values:
        above_zero(value, f"subtract: {name}", "Nm", or_zero=True)
    if len(values) not in (1, count):
        raise InputError(f"subtract: {len(values)} of {name} for {count} joints; give one or each")
    return np.broadcast_to(np.array(values), (count,))
