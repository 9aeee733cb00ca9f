"""What a drive cannot do: friction that drives, a loop that gives energy, a negative mass.

Nor is every curve that a form can bend to the effect of its name. Springs of alternating sign are
no presliding but a fit to the noise around a reversal; friction that fades before the direction of
motion has changed is the width of that change said twice; and one that has not faded at the
largest speed bends the whole curve, for which viscous friction has a name.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexspline.discovery.working import Working
from flexspline.fit.names import Bounds
from flexspline.fit.problem import Problem

__all__ = ["driving_spring", "impossible", "spring_bounds"]

Array = NDArray[np.float64]

DISSIPATES = (
    "coulomb_friction",
    "stribeck_friction",
    "load_dependent_friction",
    "viscous_friction",
)
"""One coefficient that a drive has with a positive sign alone."""

STRIBECK = "stribeck_friction"
FADED = 0.7  # of the largest speed, by which the extra friction of a start is down to 1/e

SPRINGS = "presliding_friction"
"""Its elements all have one sign, and the positive one in a drive."""

DRIVES = ("motor_torque", "motor_current")
POSITIVE_MASS = ("inertia",)


def impossible(work: Working, name: str, problem: Problem) -> str:
    """Return why an effect cannot be what the model says of it, "" where it can.

    The drive decides signs: its torque overcomes friction and accelerates the joint. A sensor may
    see either sign, by the side of the friction on which it sits.
    """
    if name == STRIBECK and (why := _not_fading(work, problem)):
        return why
    values = _values(work, name)
    if problem.target not in DRIVES:
        return ""
    if name in DISSIPATES and values[0] < 0.0:
        return "its friction would drive the joint"
    if name == SPRINGS and values.sum() < 0.0:
        return "its springs would drive the joint"
    if name in POSITIVE_MASS and values[0] < 0.0:
        return "its mass would be negative"
    return ""


def _not_fading(work: Working, problem: Problem) -> str:
    """Why friction does not fade from rest as a start's does, "" where it does."""
    fastest = max(float(np.abs(run.log["output_velocity"]).max()) for run in problem.runs)
    (shapes,) = (e.shapes for e in work.effects if e.name == STRIBECK)
    if shapes["stribeck_velocity"] < shapes["direction_width"]:
        return "it would fade before the direction of motion has changed"
    if shapes["stribeck_velocity"] > FADED * fastest:
        return "it would not fade within the speeds of these runs"
    return ""


def driving_spring(work: Working, target: str) -> str:
    """Return the presliding spring whose sign is most against the others', "" where none is.

    The last free one stays, whatever its sign.
    """
    values, names = _values(work, SPRINGS), _springs(work)
    free = [k for k, name in enumerate(names) if name not in work.fixed]
    if len(free) < 2:
        return ""
    against = -_side(values, target) * values
    worst = max(free, key=lambda k: against[k])
    return names[worst] if against[worst] > 0.0 else ""


def spring_bounds(work: Working, target: str) -> dict[str, Bounds]:
    """Return the bounds by which a fit keeps presliding springs of one sign, by name."""
    side = _side(_values(work, SPRINGS), target)
    own: Bounds = (0.0, None) if side > 0.0 else (None, 0.0)
    return dict.fromkeys(_springs(work), own)


def _side(values: Array, target: str) -> float:
    """Sign of friction: a sensor sees it from either side."""
    return 1.0 if target in DRIVES or values.sum() >= 0.0 else -1.0


def _springs(work: Working) -> list[str]:
    return [f"{e.name}.{t.name}" for e in work.effects if e.name == SPRINGS for t in e.terms]


def _values(work: Working, name: str) -> Array:
    first = 0
    for effect in work.effects:
        last = first + len(effect.terms)
        if effect.name == name:
            return work.coefficients[first:last]
        first = last
    return np.zeros(1)
