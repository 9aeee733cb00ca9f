"""What a drive cannot do: friction that drives, a loop that gives energy, a negative mass."""

from __future__ import annotations

import numpy as np

from flexspline.discovery.working import Working

__all__ = ["impossible"]

DISSIPATES = (
    "coulomb_friction",
    "stribeck_friction",
    "load_dependent_friction",
    "viscous_friction",
)
"""One coefficient that a drive has with a positive sign alone."""

SUMS = ("presliding_friction",)
"""Elements whose sum has a positive sign in a drive."""

POSITIVE_MASS = ("inertia",)


def impossible(work: Working, name: str, target: str) -> str:
    """Return why an effect cannot be what the model says of it, "" where it can.

    The drive decides signs: its torque overcomes friction and accelerates the joint. A sensor may
    see either sign, by the side of the friction on which it sits.
    """
    if target not in ("motor_torque", "motor_current"):
        return ""
    values = _values(work, name)
    if name in DISSIPATES and values[0] < 0.0:
        return "its friction would drive the joint"
    if name in SUMS and values.sum() < 0.0:
        return "its springs would drive the joint"
    if name in POSITIVE_MASS and values[0] < 0.0:
        return "its mass would be negative"
    return ""


def _values(work: Working, name: str) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    first = 0
    for effect in work.effects:
        last = first + len(effect.terms)
        if effect.name == name:
            return work.coefficients[first:last]
        first = last
    return np.zeros(1)
