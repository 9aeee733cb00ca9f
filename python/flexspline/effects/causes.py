"""Single causes: effects that other rooms need for what they are, and what follows from them.

Who wants all friction, all that carries load, all loops asks the traits of `CATALOGUE`. Who needs
one cause of the physics, such as the inertia of an observer or the mesh of a gear's compliance,
takes it from here, found by its traits where these tell, so that no other room knows an effect by
its name.

`DERIVED` has the quantities that engineers speak of in place of an effect's own parameters: a
torsion is linear in compliances, in rad/Nm; a data sheet and full_range_torque_estimation (15),
Table III, have stiffnesses.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from flexspline.effects import CATALOGUE, EffectInfo

__all__ = [
    "BASIC",
    "BASIC_FRICTION",
    "COGGING",
    "COULOMB",
    "COULOMB_PER_DIRECTION",
    "CROSSTALK",
    "DERIVED",
    "FRICTION_BY_DIRECTION",
    "GRAVITY",
    "INERTIA",
    "KINEMATIC_ERROR",
    "LAG",
    "LOAD_LOOP",
    "MESH",
    "MODULATED_RIPPLE",
    "MOTOR_RIPPLES",
    "OFFSET",
    "ONE_SINE",
    "OUTPUT_RIPPLE",
    "POLYNOMIAL_FRICTION",
    "PRESLIDING",
    "SCALING_WITH_LOAD",
    "SPRINGS",
    "STRIBECK",
    "TEMPERATURE_DRIFT",
    "TORQUE_SCALE",
    "TORSION_LOOP",
    "VISCOUS",
    "WAVE_GENERATOR",
    "WAVE_GENERATOR_RIPPLE",
    "Formula",
]


def _all(holds: Callable[[EffectInfo], bool]) -> tuple[str, ...]:
    return tuple(info.name for info in CATALOGUE.values() if holds(info))


def _one(holds: Callable[[EffectInfo], bool]) -> str:
    found = _all(holds)
    if len(found) != 1:
        raise RuntimeError(f"one effect is to have these traits, not {found}; say which, by name")
    return found[0]


OFFSET = _one(lambda info: info.traits.constant)
INERTIA = _one(lambda info: info.traits.inertial)
GRAVITY = _one(lambda info: info.carries_load and not info.traits.inertial)
LAG = _one(lambda info: info.remembers and {"load", "period"} <= {*info.reads})
MODULATED_RIPPLE = _one(lambda info: info.modulated)
MOTOR_RIPPLES = _all(
    lambda info: info.reads == ("motor_position",) and bool(info.pairs) and not info.modulated
)
"""What turns with the motor and is no kinematic error: `MODULATED_RIPPLE` follows their orders."""
OUTPUT_RIPPLE = _one(lambda info: info.reads == ("output_position",) and bool(info.pairs))
ONE_SINE = (1, "output_on_housing")
"""The order of `OUTPUT_RIPPLE` that is the same function of the angle as `GRAVITY`."""
KINEMATIC_ERROR = _one(lambda info: info.targets == "D" and bool(info.pairs))
COULOMB_PER_DIRECTION = _one(lambda info: bool(info.combines))
PRESLIDING = _one(lambda info: info.traits.loop and info.reads == ("output_position",))
LOAD_LOOP = _one(lambda info: info.traits.loop and info.reads == ("load",))
LOAD_SCALES = _all(lambda info: info.traits.known_load)
"""In proportion to a known load: of a target at most one."""
TORQUE_SCALE = _one(lambda info: info.traits.known_load and "M" in info.targets)
CROSSTALK = _one(lambda info: info.reads == ("motor_torque",) and info.targets == "S")
TORSION_LOOP = _one(lambda info: info.traits.loop and bool(info.paths))

COULOMB, VISCOUS, STRIBECK = "coulomb_friction", "viscous_friction", "stribeck_friction"
POLYNOMIAL_FRICTION = "nonlinear_viscous_friction"
FRICTION_BY_DIRECTION = "direction_dependent_friction"
MESH, WAVE_GENERATOR = "mesh_compliance", "wave_generator_compliance"
COGGING, WAVE_GENERATOR_RIPPLE = "cogging", "wave_generator_ripple"
TEMPERATURE_DRIFT = "temperature_drift"

BASIC = _all(lambda info: info.traits.basic)
"""A plain model of a drive."""
BASIC_FRICTION = _all(lambda info: info.traits.basic and info.traits.dissipative)
SCALING_WITH_LOAD = _all(
    lambda info: "M" in info.targets and "load" in info.reads and not info.remembers
)
"""What a known load adds to a plain model of a drive: friction by it, and its scale."""

SPRINGS = np.array([1.0, 2.0, 4.0, 8.0])  # of a loop: they slip at w, w/2, w/4, w/8


@dataclass(frozen=True)
class Formula:
    """A quantity of one effect: `value` of its terms and shapes by name, and Ñ as "ratio"."""

    name: str
    unit: str
    value: Callable[[Mapping[str, float]], float]


DERIVED: Mapping[str, tuple[Formula, ...]] = {
    MESH: (
        Formula("mesh stiffness K_m0", "Nm/rad", lambda p: p["ratio"] / p["compliance"]),
        Formula(
            "largest mesh torsion, at the output",
            "rad",
            lambda p: np.pi * p["compliance"] / (2 * p["mesh_shape"] * p["ratio"]),
        ),
    ),
    WAVE_GENERATOR: (
        Formula("wave generator stiffness K_w0", "Nm/rad", lambda p: 1.0 / p["compliance"]),
        Formula(
            "lost motion each way, at the motor",
            "rad",
            lambda p: p["compliance"] / p["wave_generator_shape"],
        ),
    ),
    TORSION_LOOP: (
        Formula(
            "half the loop of the hysteresis, at the motor",
            "rad",
            lambda p: p["wide"] + p["half"] + p["quarter"] + p["eighth"],
        ),
        Formula(
            "half the loop of the hysteresis, at the output",
            "rad",
            lambda p: (p["wide"] + p["half"] + p["quarter"] + p["eighth"]) / p["ratio"],
        ),
    ),
    "backlash": (
        Formula("dead zone of the backlash, at the motor", "rad", lambda p: 2.0 * p["half_gap"]),
        Formula(
            "dead zone of the backlash, at the output",
            "rad",
            lambda p: 2.0 * p["half_gap"] / p["ratio"],
        ),
    ),
    PRESLIDING: (
        Formula(
            "level of the presliding friction once it slips",
            "Nm",
            lambda p: p["wide"] + p["half"] + p["quarter"] + p["eighth"],
        ),
    ),
    LOAD_LOOP: (
        Formula(
            "half the loop of the sensor's hysteresis",
            "Nm",
            lambda p: p["wide"] + p["half"] + p["quarter"] + p["eighth"],
        ),
    ),
    MODULATED_RIPPLE: (
        Formula(
            "resonance frequency",
            "Hz",
            lambda p: p["ratio"] * p["resonance_velocity"] / (2 * np.pi),
        ),
    ),
    LAG: (
        Formula(
            "smoothing over lateness (a lag has 1, a delay 0.5)",
            "1",
            lambda p: p["smoothing_time"] / p["lateness"],
        ),
    ),
}
