"""A joint with every estimator, and a log of it whose external torque is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flexspline import (
    Calibration,
    Collision,
    Compliance,
    Differentiator,
    Merge,
    Observer,
    ReadingChecks,
    TemperatureCompensation,
    Thermistor,
    _core,
    effect,
)
from flexspline.logs.log import Log
from flexspline.model import Model, Part

RATIO = 101.0
FACTS = {"gear_ratio": 100.0, "output_spline": "circular"}
THERMISTOR = Thermistor(3.3, 1e4, 1e4, 3950.0)
COMPENSATION = TemperatureCompensation(
    (0.01, -0.001), gradient=0.05, thermal_lag=0.7, temperature_range=(20.0, 38.0)
)
CALIBRATION = Calibration(62.738, 2.1835, voltage_range=(-1.0, 1.0))
BY_MOTOR = Observer(80.0, "motor_torque")
BY_GEAR = Observer(60.0, "compliance", rotor_inertia=1.3e-5)
MERGE = Merge(500.0, 0.01)
KALMAN = Merge(500.0, 0.01, "kalman", 20.0, (2.0, 1.0), (0.5, 3.0))
COLLISION = Collision("merged", (0.4, 1.1), (2.0, 2.2, 2.5), (2.1, 2.3, 2.6), 0.8, 0.05)

# Just outside of what the rig does; then of a device that measures angles and no velocity.
CHECKS = ReadingChecks(
    voltage_range=(-1.6, 1.6),
    thermistor_voltage_range=(0.05, 3.25),
    most_motor_torque=0.5,
    most_speed=8.0,
    most_acceleration=50.0,
    way=0.005,
    twist=0.2,
    apart=1.0,
)
ANGLE_CHECKS = replace(CHECKS, most_acceleration=None, way=None)
DIFFERENTIATOR = Differentiator(20.0)

BY_OUTPUT = {"channels": ["output_position"]}  # ripple goes by Ñ q: no motor encoder in the fit

SENSOR = Part(
    "sensor_torque",
    (
        effect("offset"),
        effect("gain_error"),
        effect("output_ripple", orders=[2, 320]),
        effect("wave_generator_ripple", orders=[(2, "wave_generator_on_flexspline")]),
        effect("temperature_drift"),
        effect("inertia"),
    ),
    np.array([0.1, 0.02, 0.05, 0.03, 0.02, -0.01, 0.04, 0.05, 0.003, 1e-4, 0.02]),
    None,
    BY_OUTPUT,
)
DRIVE = Part(
    "motor_torque",
    (
        effect("inertia"),
        effect("coulomb_friction_per_direction", direction_width=0.01),
        effect("viscous_friction"),
        effect("load_dependent_friction", direction_width=0.01),
        effect("gravity"),
    ),
    np.array([0.5, 2.0, 1.8, 1.0, 0.05, 0.6, 0.1]),
)
TORSION = Part(
    "torsion",
    (
        effect("mesh_compliance", mesh_shape=0.05),
        effect("wave_generator_compliance"),
        effect("offset"),
        effect("kinematic_error", orders=[(2, "wave_generator_on_flexspline")]),
    ),
    np.array([RATIO / 15548.0, 1e-3, 11.3, 2e-3, 1e-3]),
    "reference_torque",
    BY_OUTPUT,
)


def joint(*estimators) -> Model:
    """The joint with these estimators."""
    made = Model({"sensor": SENSOR, "drive": DRIVE, "torsion": TORSION}, FACTS)
    for estimator in estimators:
        made = made.with_estimator(estimator)
    return made


def whole_joint() -> Model:
    """The joint with one of each."""
    sensing = (THERMISTOR, COMPENSATION, CALIBRATION)
    return joint(*sensing, BY_MOTOR, Compliance(), BY_GEAR, MERGE, COLLISION)


def checked_joint() -> Model:
    """The same with its readings checked."""
    return whole_joint().with_estimator(CHECKS)


def angle_joint() -> Model:
    """The same by its angles alone, with no channel for velocity and acceleration."""
    return whole_joint().with_estimator(ANGLE_CHECKS).with_estimator(DIFFERENTIATOR)


def with_hysteresis(part: Part, path: float = 0.0) -> Part:
    """The torsion with a loop on the path of the load, or of the motor's angle (1)."""
    effects = (*part.effects, effect("torsional_hysteresis", load_width=4.0, path=path))
    values = np.append(part.coefficients, [4e-3, 2e-3, 1e-3, 5e-4])
    return replace(part, effects=effects, coefficients=values)


def blind_joint(*estimators) -> Model:
    """The joint without a sensor, with hysteresis on the path of the load."""
    made = Model({"drive": DRIVE, "torsion": with_hysteresis(TORSION)}, FACTS)
    for estimator in estimators:
        made = made.with_estimator(estimator)
    return made


def motion(rows: int = 4000) -> dict[str, np.ndarray]:
    """Several turns, in both directions, with rests; and the external torque."""
    t = np.arange(rows) * 2e-3
    return {
        "time": t,
        "output_position": 4.0 * np.sin(t) + 0.3 * np.sin(2.7 * t),
        "output_velocity": 4.0 * np.cos(t) + 0.81 * np.cos(2.7 * t),
        "output_acceleration": -4.0 * np.sin(t) - 2.187 * np.sin(2.7 * t),
        "temperature": 30.0 + 10.0 * np.sin(0.5 * t),
        "reference_torque": 3.0 * np.sin(1.3 * t) + np.sin(5.1 * t),
    }


def said(part: Part, log: Log, **options) -> np.ndarray:
    """What a part says of a log under its reference torque."""
    loaded = replace(part, known_load="reference_torque", **options)
    return Model({"part": loaded}, FACTS).predict(log).predicted


def raw_log(rows: int = 4000) -> Log:
    """A log of raw channels, made of the joint's own parts and the external torque."""
    channels = motion(rows)
    log = Log.from_arrays(facts={"name": "rig", **FACTS}, **channels)
    load = channels["reference_torque"]
    log = log.with_columns({"motor_torque": (load + said(DRIVE, log)) / RATIO}, note="motor")
    gravity = Part("motor_torque", (effect("gravity"),), DRIVE.coefficients[-2:])
    twisted = log.with_columns({"reference_torque": load + said(gravity, log)}, note="at the mesh")
    drift = _core.temperature_compensation(
        log["time"],
        log["temperature"],
        coefficients=COMPENSATION.coefficients,
        reference_temperature=COMPENSATION.reference_temperature,
        gradient=COMPENSATION.gradient,
        thermal_lag=COMPENSATION.thermal_lag,
    )
    torque = load + said(SENSOR, log)
    made = {
        "motor_position": RATIO * log["output_position"] - said(TORSION, twisted),
        "sensor_torque": torque,
        "sensor_voltage": (torque - drift - CALIBRATION.zero) / CALIBRATION.sensitivity,
        "thermistor_voltage": _core.thermistor_voltage(log["temperature"], **THERMISTOR.to_json()),
    }
    return log.with_columns(made, note="raw channels")


def without(log: Log, *names: str) -> Log:
    """The log without some channels."""
    kept = {name: log[name] for name in log.channels if name not in names}
    return Log.from_arrays(facts=dict(log.facts), **kept)


def raw_channels(rows: int) -> Log:
    """The rig's log without its sensor torque, with readings missing and a gap."""
    log = without(raw_log(rows), "sensor_torque")
    rng = np.random.default_rng(4)
    holed = {}
    for name in ("sensor_voltage", "thermistor_voltage", "motor_position", "motor_torque"):
        holed[name] = log[name].copy()
        holed[name][rng.choice(rows, rows // 100, replace=False)] = np.nan
    log = log.with_columns(holed, note="readings missing")
    return log.rows(np.r_[0 : rows // 2, rows // 2 + 50 : rows], note="a gap")
