"""The sign of what drives and of what is measured, told by friction.

Friction takes work out of a joint both ways, and gravity and inertia give back what they took. So
the part of a drive's torque that goes with the direction and the speed of the motion,

    y = a · tanh(v / v_s) + b · v + c + d · sin q + e · cos q + f · dv/dt  (+ g · another torque),

does positive work, in the first and the second half of the rows of either direction. Behind the
gear a torque pushes outward where the drive does: its part of the drive's is positive.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from flexspline.recordings.columns import Array

__all__ = ["both_ways", "friction_share", "goes_with"]

SLOW: Final = 0.05  # of the fastest speed (99 %), the half-width of a change of direction
FEWEST: Final = 50  # rows of which a half is told
EXPLAINED: Final = (
    0.5  # share of a torque's variance that the drive's must explain to tell its sign
)


def friction_share(drive: Array, position: Array, velocity: Array) -> float:
    """Return the work of a drive against friction as a share of what it moves, from −1 to 1.

    It is 0 where the early and the late rows do not agree on its sign, or the motion goes one way.
    """
    if not both_ways(velocity):
        return 0.0
    design = _design(position, velocity)
    whole = _share(design, drive, velocity)
    early = _early(velocity)
    halves = [_share(design[part], drive[part], velocity[part]) for part in (early, ~early)]
    return whole if all(share * whole > 0 for share in halves) else 0.0


def both_ways(velocity: Array) -> bool:
    """Whether a motion goes forward and backward."""
    return len(velocity) > 0 and bool(np.min(velocity) < 0 < np.max(velocity))


def _early(velocity: Array) -> NDArray[np.bool_]:
    """The first half of the rows forward and of those backward: a half may go one way alone."""
    early = np.zeros(len(velocity), dtype=bool)
    for rows in (np.flatnonzero(velocity > 0), np.flatnonzero(velocity <= 0)):
        early[rows[: len(rows) // 2]] = True
    return early


def _share(design: Array, drive: Array, velocity: Array) -> float:
    if len(drive) < FEWEST:
        return 0.0
    solution = np.linalg.lstsq(design, drive, rcond=None)[0]
    power = (design[:, :2] @ solution[:2]) * velocity
    moved = float(np.sum(np.abs(drive * velocity)))
    return float(np.sum(power)) / moved if moved > 0 else 0.0


def _design(position: Array, velocity: Array) -> Array:
    fast = float(np.quantile(np.abs(velocity), 0.99))
    slip = velocity / max(fast, np.finfo(float).tiny)
    return np.column_stack(
        [
            np.tanh(slip / SLOW),
            slip,
            np.ones_like(slip),
            np.sin(position),
            np.cos(position),
            np.gradient(slip),
        ]
    )


def goes_with(drive: Array, torque: Array, position: Array, velocity: Array) -> int:
    """Return 1 or −1 as a torque behind the gear goes with the drive's or against it, else 0."""
    if len(drive) < FEWEST:
        return 0
    friction = _design(position, velocity)[:, :3]
    left = [y - friction @ np.linalg.lstsq(friction, y, rcond=None)[0] for y in (drive, torque)]
    power = float(np.sqrt(np.sum(left[0] ** 2) * np.sum(left[1] ** 2)))
    alike = float(left[0] @ left[1]) / power if power > 0 else 0.0
    return 0 if alike**2 < EXPLAINED else (1 if alike > 0 else -1)
