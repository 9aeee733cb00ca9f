"""Cases of estimators: the chain over logs, calibrations, observers, the full range, a plan."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial

import calibration_logs as bench
import chain_rig as rig
import comparison_logs
import confounded_logs
import full_range_logs as hand
import measured
import numpy as np
import report_fits
from certify_everything import IIWA
from two_link import motion, two_link

import flexspline as fx
from flexspline.full_range import train
from flexspline.observer import observe
from golden.measured_cases import iiwa_as_recorded, kinova_drive, kinova_sensor
from golden.numbers import (
    Cases,
    Numbers,
    calibration_numbers,
    column_numbers,
    comparison_numbers,
    estimate_numbers,
    fit_numbers,
    of,
    picked,
    together,
)

__all__ = ["estimated_cases", "iiwa_watched", "kinova_watched", "raw"]

ROWS = 4000
GAIN = 50.0  # 1/s, of the arm's observer
WEIGHT = "a weight of its own"


def estimated_cases() -> Cases:
    """Return what computes the numbers of each case, by its name."""
    return _chains() | _calibrations() | _fits() | {
        "estimate/arm of two links": _arm,
        "estimate/full range by hand": _full_range,
        "plan/a weight that nobody can tell": _planned,
    }  # fmt: skip


def _chains() -> Cases:
    models = {
        "whole joint": rig.whole_joint,
        "checked joint": rig.checked_joint,
        "joint by its angles": rig.angle_joint,
        "joint without a sensor": lambda: rig.blind_joint(
            rig.BY_MOTOR, fx.Compliance(), rig.KALMAN
        ),
    }
    made: Cases = {
        f"estimate/{name}": of(partial(_of_rig, model), estimate_numbers)
        for name, model in models.items()
    }
    made["estimate/kinova"] = of(
        lambda: fx.estimate(kinova_watched(), measured.kinova(0.3)), estimate_numbers
    )
    for joint in (2, 7):
        made[f"estimate/iiwa joint {joint}"] = of(partial(_iiwa, joint), estimate_numbers)
    return made


def _of_rig(model: Callable[[], fx.Model]) -> fx.Estimate:
    return fx.estimate(model(), raw())


@cache
def raw() -> fx.Log:
    """Raw channels of the rig, with readings missing and a gap."""
    return rig.raw_channels(ROWS)


@cache
def kinova_watched() -> fx.Model:
    """Motor and sensor of the Kinova, an observer and a detector."""
    return _watched(kinova_sensor().model, kinova_drive().model, by="motor_torque")


@cache
def iiwa_watched(joint: int) -> fx.Model:
    """The torque sensor of an iiwa's joint, an observer behind it and a detector."""
    return _watched(iiwa_as_recorded(joint).model, by="sensor_torque")


def _watched(*models: fx.Model, by: str) -> fx.Model:
    parts = {name: part for model in models for name, part in model.parts.items()}
    limits = ((0.5,), (1.0, 2.0), (1.0, 2.0), 0.8, 0.05)
    observed = fx.Model(parts, models[0].facts).with_estimator(fx.Observer(20.0, by))
    return observed.with_estimator(fx.Collision("observer", *limits))


def _iiwa(joint: int) -> fx.Estimate:
    return fx.estimate(iiwa_watched(joint), measured.iiwa(joint, IIWA[joint][-1]))


def _calibrations() -> Cases:
    return {
        "calibrate/bench with hysteresis": of(
            lambda: fx.calibrate([bench.load_run(), bench.drift_run(cooling=True)]),
            calibration_numbers,
        ),
        "calibrate/protocol of zhang": of(_zhang, calibration_numbers),
        "calibrate/body that lags": of(_lagging, calibration_numbers),
    }


def _zhang() -> fx.CalibrationResult:
    load = bench.load_run(bench.QUIET, one_way=True, temperature=20.0)
    runs = [load, bench.drift_run(bench.QUIET)]
    return fx.calibrate(runs, reference_temperature=20.0, full_scale=bench.FULL_SCALE)


def _lagging() -> fx.CalibrationResult:
    slow = bench.Bench(lag=40.0, gradient=0.05)
    return fx.calibrate([bench.load_run(slow), bench.drift_run(slow, cooling=True)])


def _fits() -> Cases:
    made: Cases = {
        "fit/simulated, plain": of(report_fits.plain_fit, fit_numbers),
        "fit/simulated, confounded": of(report_fits.confounded_fit, fit_numbers),
        "fit/simulated, constrained": of(report_fits.constrained_fit, fit_numbers),
        "fit/simulated, useless": of(report_fits.useless_fit, fit_numbers),
        "fit/simulated, robust, an offset for each run": of(_robust, fit_numbers),
    }
    for hidden in ("slow", "ripple", "loaded"):
        name = f"compare/simulated, {hidden}"
        made[name] = of(partial(comparison_logs.comparison, hidden), comparison_numbers)
    return made


def _robust() -> fx.Fit:
    logs = [report_fits.run(number) for number in range(3)]
    effects = ["offset", "coulomb_friction", "viscous_friction"]
    options = fx.FitOptions(robust="huber", offset_per_run=True)
    return fx.fit(effects, logs, "sensor_torque", options=options)


def _arm() -> Numbers:
    """A moving arm of two links that is pushed at both joints."""
    time, angle, speed, acceleration = motion(10.0, 1000.0)
    mass, coriolis, gravity = two_link(angle, speed)
    torque = np.einsum("kij,kj->ki", mass, acceleration) + gravity
    torque += np.einsum("kij,kj->ki", coriolis, speed)
    torque += np.stack([2.0 * (time > 5.0), -1.0 * (time > 7.0)], axis=1)
    found = observe(time, angle, speed, torque, gain=GAIN, dynamics=two_link).external
    return together({f"joint {k + 1}": column_numbers("external", found[:, k]) for k in (0, 1)})


def _full_range() -> Numbers:
    """A joint driven by hand: the merge trained on two runs, and what it makes of a third."""
    logs = [hand.rig(seed).log for seed in (0, 1)]
    methods = ("sd", "kalman")
    made = train(hand.model(), logs, methods=methods, rotor_inertia=hand.ROTOR_INERTIA)
    numbers: Numbers = {}
    for name, values in made.estimates(hand.rig(7).log).items():
        numbers |= column_numbers(name, values)
    return numbers


def _planned() -> Numbers:
    """The run that would tell gravity from a ripple of the output."""
    own = confounded_logs.RIGS[WEIGHT]
    logs = [own.recorded(number) for number in range(1, 5)]
    known = [*own.base, own.hidden]
    fit = fx.fit(known, logs, "sensor_torque", known_load=confounded_logs.LOAD, checks=False)
    rival = fx.effect(own.rival, orders=[1])
    plan = fx.next_experiment(fit, (fx.effect(own.hidden), rival), logs)
    if plan is None:
        return {"plan": "none"}
    numbers: Numbers = {}
    for look in plan.outlooks:
        numbers |= picked(", ".join(look.names), look, ("now", "expected", "taken"))
    return numbers | column_numbers("planned position", plan.log["output_position"])
