"""The forms in which an effect of the catalogue stands beside a hidden one when that is sized."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product

import numpy as np

from flexspline.effects import CATALOGUE, Effect, effect
from hidden.rig import Joint

__all__ = ["SAME_THING", "forms_of"]

SHAPES: Mapping[str, tuple[float, float, int]] = {
    "stribeck_velocity": (0.02, 1.5, 7),
    "presliding_width": (0.003, 0.3, 6),
    "resonance_velocity": (0.3, 2.4, 9),
    "damping_ratio": (0.1, 0.6, 3),
    "thermal_lag": (0.3, 30.0, 9),
    "load_width": (0.3, 20.0, 6),
    "smoothing_time": (0.005, 0.3, 5),
    "wave_generator_shape": (0.3, 50.0, 6),
    "contact_torque": (0.1, 6.0, 6),
}
"""Lowest, highest, and how many between, in geometric steps."""

SAME_THING: Mapping[str, tuple[str, ...]] = {
    "gravity": ("output_ripple",),
    "output_ripple": ("gravity",),
    "coulomb_friction": ("coulomb_friction_per_direction",),
    "offset": ("coulomb_friction_per_direction",),
    "wave_generator_ripple": ("speed_dependent_ripple",),
    "cogging": ("speed_dependent_ripple",),
}
"""Two names for the same columns, or one that only follows the other: no rivals."""

LOW = (1, 2, 3, 4)


def forms_of(name: str, joint: Joint) -> list[Effect]:
    """Return an effect in several shapes, a ripple with all its low orders."""
    info = CATALOGUE[name]
    fixed = {"direction_width": joint.width, "mesh_shape": joint.mesh_shape}
    own = {s.name: fixed[s.name] for s in info.shapes if s.name in fixed}
    free = [s.name for s in info.shapes if s.name in SHAPES]
    made = effect(name, orders=_orders(name, joint), **own)
    grids = [np.geomspace(*SHAPES[shape]) for shape in free]
    return [made.with_shapes(**dict(zip(free, map(float, values), strict=True)))
            for values in product(*grids)]  # fmt: skip


def _orders(name: str, joint: Joint) -> list[tuple[int, str]]:
    """The orders that belong to a ripple effect."""
    other = "circular_spline" if joint.output_spline == "circular" else "flexspline"
    motor = [(k, "motor_on_stator") for k in LOW]
    beside = [(k, f"wave_generator_on_{other}") for k in LOW]
    output = [(k, "output_on_housing") for k in LOW]
    return {
        "output_ripple": output[1:],
        "wave_generator_ripple": motor + beside,
        "speed_dependent_ripple": [(2, "wave_generator_on_flexspline")],
        "cogging": [(k * joint.pole_pairs, "motor_on_stator") for k in (1, 2, 4)],
        "kinematic_error": output + motor + beside,
    }.get(name, [])
