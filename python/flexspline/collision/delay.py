"""How late a contact is found, and which contacts are found at all.

A torque F that sets in at once reaches the observer's output as F (1 − e^(−K t)), so with the
threshold Υ

    found after     t = −ln(1 − Υ / F) / K          for F > Υ, never otherwise
    found at all    F ≥ Υ / (1 − e^(−K d))          for a contact that lasts d

to which the detector adds up to one period. Noise σ of the residual moves the threshold that has to
be passed for a detection with probability P to Υ + z(P) σ, z the normal quantile.
Source: zhang_disturbance_elimination (19), (22).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special

from flexspline.errors import InputError

__all__ = ["detection_delay", "smallest_detectable_torque"]

Array = NDArray[np.float64]


def detection_delay(
    torque: ArrayLike,
    threshold: float,
    gain: float,
    *,
    noise: float = 0.0,
    probability: float = 0.5,
) -> Array:
    """Return the time from the beginning of a contact to its detection [s]; infinite if never.

    Parameters
    ----------
    torque : Nm, size of the contact, any shape.
    threshold : Nm.
    gain : K of the observer, 1/s.
    noise : Nm, standard deviation of the residual.
    probability : that the contact is found by then.

    Raises
    ------
    InputError
        Where threshold or gain are not above zero, or the probability is not within 0 and 1.
    """
    needed = _needed(threshold, gain, noise, probability)
    with np.errstate(divide="ignore"):
        share = np.minimum(needed / np.abs(np.asarray(torque, dtype=float)), 1.0)
        return np.asarray(-np.log1p(-share) / gain)


def smallest_detectable_torque(
    duration: ArrayLike,
    threshold: float,
    gain: float,
    *,
    noise: float = 0.0,
    probability: float = 0.5,
) -> Array:
    """Return the smallest torque that is found if it lasts `duration` seconds [Nm].

    Parameters
    ----------
    duration : s, any shape.
    threshold, gain, noise, probability : as for `detection_delay`.

    Raises
    ------
    InputError
        As `detection_delay`, or where a duration is not above zero.
    """
    needed = _needed(threshold, gain, noise, probability)
    lasting = np.asarray(duration, dtype=float)
    if not (lasting > 0.0).all():
        raise InputError(
            f"detection: duration = {float(lasting.min()):g} s is not allowed; give one above zero"
        )
    return np.asarray(needed / -np.expm1(-gain * lasting))


def _needed(threshold: float, gain: float, noise: float, probability: float) -> float:
    for name, value in (("threshold", threshold), ("gain", gain)):
        if not (np.isfinite(value) and value > 0.0):
            raise InputError(f"detection: {name} = {value:g} is not allowed; give one above zero")
    if not (noise >= 0.0 and 0.0 < probability < 1.0):
        raise InputError(
            f"detection: noise = {noise:g}, probability = {probability:g}; give noise of zero or "
            "more and a probability between 0 and 1"
        )
    return max(threshold + float(special.ndtri(probability)) * noise, 0.0)
