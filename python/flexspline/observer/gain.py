"""What a gain of the momentum observer costs: delay against noise.

With period T, share s = 1 − e^(−K T) (exact) or K T (forward Euler):

    delay    exact  T (1/s − 1/2) → 1/K       euler  1/K − T/2
    noise    of white torque:    exact  σ √(s/2)       euler  σ √(s / (2 − s))
             of white velocity:  J σ_v (s / T) √(2 / (2 − s)), for both

Delay is that of a slowly changing external torque, on average over a period. In continuous time
the estimate is the external torque behind K / (K + s): zhang_disturbance_elimination (19).
Towards K T = 0 both torque noises are σ √(K T / 2); at K T = 1 Euler's is σ itself, at 2 infinite.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexspline.errors import InputError
from flexspline.estimators.checks import above_zero

__all__ = ["observer_delay", "observer_noise"]

Array = NDArray[np.float64]


def observer_delay(gain: ArrayLike, period: float, discretisation: str = "exact") -> Array:
    """Return the delay of the estimate for a slowly changing external torque [s].

    Parameters
    ----------
    gain : 1/s, any shape.
    period : s, between samples.
    discretisation : "exact" or "euler".

    Raises
    ------
    InputError
        Where a gain or the period is not above zero, or Euler has gain · period of 2 or more.
    """
    return period * (1.0 / _share(gain, period, discretisation) - 0.5)


def observer_noise(
    gain: ArrayLike,
    period: float,
    discretisation: str = "exact",
    *,
    torque_noise: float = 0.0,
    velocity_noise: float = 0.0,
    inertia: float = 0.0,
) -> Array:
    """Return the standard deviation of the estimate at rest [Nm].

    Parameters
    ----------
    gain : 1/s, any shape.
    period : s, between samples.
    discretisation : "exact" or "euler".
    torque_noise : Nm, standard deviation of the white noise of the input torque, at the output.
    velocity_noise : rad/s, that of the velocity.
    inertia : kg m² at the output.

    Raises
    ------
    InputError
        As `observer_delay`, or where noise or inertia is negative or not finite.
    """
    for name, value in (
        ("torque_noise", torque_noise),
        ("velocity_noise", velocity_noise),
        ("inertia", inertia),
    ):
        above_zero(value, f"observer: {name}", or_zero=True)
    share = _share(gain, period, discretisation)
    of_torque = share / 2.0 if discretisation == "exact" else share / (2.0 - share)
    of_momentum = (share / period) ** 2 * 2.0 / (2.0 - share)
    moving = inertia * velocity_noise
    return np.sqrt(of_torque * torque_noise**2 + of_momentum * moving**2)


def require_gain(gain: ArrayLike, longest_period: float, discretisation: str) -> Array:
    """Return the gains as an array, or refuse those that cannot be stable."""
    try:
        values = np.asarray(gain, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"observer: gain = {gain!r} is no number; give it in 1/s") from None
    if not (np.isfinite(values).all() and (values > 0.0).all()):
        raise InputError(
            f"observer: gain = {values.tolist()} is not allowed; give numbers above zero [1/s]"
        )
    if discretisation not in ("exact", "euler"):
        raise InputError(
            f"observer: discretisation = {discretisation!r} is unknown; give exact or euler"
        )
    worst = float(values.max()) * longest_period
    if discretisation == "euler" and worst >= 2.0:
        raise InputError(
            f"observer: gain · period = {worst:.3g} diverges by forward Euler, which needs less "
            f"than 2; give a gain below {2.0 / longest_period:.4g} 1/s or discretisation='exact'"
        )
    return values


def _share(gain: ArrayLike, period: float, discretisation: str) -> Array:
    if not (np.isfinite(period) and period > 0.0):
        raise InputError(f"observer: period = {period:g} s is not allowed; give one above zero")
    values = require_gain(gain, period, discretisation) * period
    return np.asarray(-np.expm1(-values) if discretisation == "exact" else values)
