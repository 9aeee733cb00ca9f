"""The chain whose step has a price: ten harmonics, and how it grows stage by stage."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from chain_rig import (
    ANGLE_CHECKS,
    BY_MOTOR,
    BY_OUTPUT,
    CALIBRATION,
    CHECKS,
    COLLISION,
    DIFFERENTIATOR,
    FACTS,
    MERGE,
    RATIO,
    THERMISTOR,
    whole_joint,
)

from flexspline import Compliance, TemperatureCompensation, effect
from flexspline.model import Model, Part

DRIFT = TemperatureCompensation((0.01, -0.001), temperature_range=(20.0, 38.0))
FRICTION = Part(
    "motor_torque",
    (
        effect("inertia"),
        effect("coulomb_friction_per_direction", direction_width=0.01),
        effect("viscous_friction"),
    ),
    np.array([0.5, 2.0, 1.8, 1.0]),
)
MESH = Part(
    "torsion",
    (effect("mesh_compliance", mesh_shape=0.05),),
    np.array([RATIO / 15548.0]),
    "reference_torque",
    BY_OUTPUT,
)
WAVE_GENERATOR = "wave_generator_on_flexspline"
STAGES = (DRIFT, CALIBRATION, BY_MOTOR, Compliance(), MERGE)


def sensor(orders: Iterable[int], pair: str | None = None) -> Part:
    """A sensor with an offset and ripple of these orders, of the output or of a pair."""
    name = "output_ripple" if pair is None else "wave_generator_ripple"
    made = effect(name, orders=[order if pair is None else (order, pair) for order in orders])
    sizes = 0.05 / np.arange(1, len(made.terms) + 1)
    return Part("sensor_torque", (effect("offset"), made), np.r_[0.1, sizes], None, BY_OUTPUT)


def joint(part: Part, *estimators) -> Model:
    """A joint with this sensor, friction and a mesh."""
    made = Model({"sensor": part, "drive": FRICTION, "torsion": MESH}, FACTS)
    for estimator in estimators:
        made = made.with_estimator(estimator)
    return made


def ten_harmonics(*more) -> Model:
    """Temperature polynomial, calibration, ten harmonics, friction, observer, compliance, merge."""
    return joint(sensor(range(1, 11)), *STAGES, *more)


def everything() -> Model:
    """The same with thermistor, detector and reading checks."""
    return ten_harmonics(THERMISTOR, COLLISION, CHECKS)


def by_angle() -> Model:
    """The same, and velocity from the angle."""
    return ten_harmonics(THERMISTOR, COLLISION, ANGLE_CHECKS, DIFFERENTIATOR)


def growing_chain() -> dict[str, Model]:
    """A stage more in each model, then other orders, then every estimator with several parts."""
    offset = Part("sensor_torque", (effect("offset"),), np.array([0.1]))
    ten = sensor(range(1, 11))
    return {
        "calibration": joint(offset, CALIBRATION),
        "+ temperature polynomial": joint(offset, *STAGES[:2]),
        "+ ten harmonics": joint(ten, *STAGES[:2]),
        "+ friction, observer": joint(ten, *STAGES[:3]),
        "+ compliance": joint(ten, *STAGES[:4]),
        "+ merge": ten_harmonics(),
        "+ thermistor": ten_harmonics(THERMISTOR),
        "+ detector": ten_harmonics(THERMISTOR, COLLISION),
        "+ reading checks": everything(),
        "+ velocity from the angle": by_angle(),
        "merge and velocity from the angle": ten_harmonics(DIFFERENTIATOR),
        "merge; orders 2, 4, ... 20 by motor": joint(
            sensor(range(2, 21, 2), WAVE_GENERATOR), *STAGES
        ),
        "merge; ten orders far apart": joint(
            sensor((1, 2, 3, 4, 6, 8, 101, 202, 303, 320)), *STAGES
        ),
        "every estimator, 15 effects": whole_joint(),
    }
