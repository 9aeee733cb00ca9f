"""Effects that other rooms need for what they are, each found by its traits where these tell.

Who wants all friction, all that carries load, all loops asks the traits of `CATALOGUE`. Who needs
one cause of the physics, such as the inertia of an observer or the mesh of a gear's compliance,
takes it from here, so that no other room knows an effect by its name.
"""

from __future__ import annotations

from collections.abc import Callable

from flexspline.effects import CATALOGUE, EffectInfo

__all__ = [
    "BASIC",
    "BASIC_FRICTION",
    "COGGING",
    "COULOMB",
    "COULOMB_PER_DIRECTION",
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
    "OUTPUT_RIPPLE",
    "POLYNOMIAL_FRICTION",
    "PRESLIDING",
    "SCALING_WITH_LOAD",
    "STRIBECK",
    "TEMPERATURE_DRIFT",
    "TORQUE_SCALE",
    "TORSION_LOOP",
    "VISCOUS",
    "WAVE_GENERATOR",
    "WAVE_GENERATOR_RIPPLE",
]


def _all(holds: Callable[[EffectInfo], bool]) -> tuple[str, ...]:
    return tuple(info.name for info in CATALOGUE.values() if holds(info))


def _one(holds: Callable[[EffectInfo], bool]) -> str:
    (name,) = _all(holds)
    return name


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
KINEMATIC_ERROR = _one(lambda info: info.targets == "D" and bool(info.pairs))
COULOMB_PER_DIRECTION = _one(lambda info: bool(info.combines))
PRESLIDING = _one(lambda info: info.traits.loop and info.reads == ("output_position",))
LOAD_LOOP = _one(lambda info: info.traits.loop and info.reads == ("load",))
TORQUE_SCALE = _one(lambda info: info.traits.known_load and "M" in info.targets)
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
