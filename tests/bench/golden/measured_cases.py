"""Cases of the measured logs: fits, discoveries, comparisons, drives forward, a detector."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cache, partial
from pathlib import Path

import numpy as np
from measured import KINOVA_SPEEDS, data_folder, iiwa, kinova, two_encoder, ur10e, xl330
from test_measured_pushes import at_rest, calibrated, onsets, part
from test_measured_torsion import aligned
from test_simulated_lab_logs import hidden_viscous, payloads
from xl330_servo import HELD_OUT, KNOWN, LAW, TWELVE, fitted, runs

import flexspline as fx
from flexspline.logs import repaired
from golden.numbers import (
    Cases,
    Numbers,
    comparison_numbers,
    discovery_numbers,
    fit_numbers,
    forward_numbers,
    of,
    picked,
    plain,
    together,
)

__all__ = ["iiwa_as_recorded", "kinova_drive", "kinova_sensor", "measured_cases", "needs_logs",
           "ur10e_fit"]  # fmt: skip

Effects = list[str | fx.Effect]

FRICTION: Effects = ["offset", "coulomb_friction", "viscous_friction", "inertia"]
MOVES: Effects = [*FRICTION, "gravity"]
SMOOTH: Effects = ["coulomb_friction", "viscous_friction", "stribeck_friction"]
MENDED = ["flip_sign=sensor_torque", "velocity_from_position=output_velocity"]
LOAD = "reference_torque"
MEASURED = ("ur10e", "kinova", "iiwa", "two encoders", "xl330", "viscous hidden", "payload rig")
IIWA: Mapping[int, tuple[str, ...]] = {
    1: ("p15", "p3", "p45", "1"),
    2: ("p1", "p3", "p5", "p8"),
    5: ("p1", "p3", "p6", "p9"),
    7: ("p1", "p3", "p5", "p9"),
}
SECONDS = 30  # of each run of the iiwa
TORQUE, BACK_EMF = 0.0771, 0.0341  # Nm/V, Nm s/rad of the XL330, from a fit to its motion
CONTACTS = Path(__file__).parents[2] / "python" / "contacts" / "ur10e_push_pose_1.json"
QUIET = ("joint_1", "joint_2", "joint_4", "14harm50sec")  # runs of the UR10e without a push


def needs_logs(name: str) -> bool:
    """Whether a case reads the measured logs."""
    return any(joint in name for joint in MEASURED)


def measured_cases() -> Cases:
    """Return what computes the numbers of each case, by its name."""
    made = _ur10e() | _kinova() | _iiwa() | _two_encoders() | _xl330() | _lab()
    return made | {"collision/ur10e": _pushes}


def _ur10e() -> Cases:
    made: Cases = {}
    for joint in (1, 2, 4):
        name = f"ur10e joint {joint}"
        made[f"fit/{name}"] = of(partial(ur10e_fit, joint), fit_numbers)
        made[f"discover/{name}"] = of(partial(_ur10e_lacks, joint), discovery_numbers)
        made[f"compare/{name}"] = of(partial(_ur10e_gap, joint), comparison_numbers)
    for joint in (3, 6):
        name = f"fit/ur10e joint {joint} as all move"
        made[name] = of(partial(_ur10e_moving, joint), fit_numbers)
    made["simulate/ur10e joint 1"] = of(_ur10e_driven, forward_numbers)
    return made


@cache
def ur10e_fit(joint: int) -> fx.Fit:
    """A joint that moves alone."""
    return fx.fit(MOVES, ur10e(joint), "motor_current", lowpass=5.0)


def _ur10e_lacks(joint: int) -> fx.Discovery:
    return fx.discover(MOVES, ur10e(joint), target="motor_current", lowpass=5.0)


def _ur10e_gap(joint: int) -> fx.Comparison:
    return fx.compare(ur10e_fit(joint).model, ur10e(joint), lowpass=5.0)


def _ur10e_moving(joint: int) -> fx.Fit:
    return fx.fit(MOVES, ur10e(joint, "14harm50sec"), "motor_current")


def _ur10e_driven() -> fx.ForwardRun:
    """Fitted to the first half of the run; the second half driven."""
    log = ur10e(1)
    half = len(log) // 2
    first, second = log.rows(slice(0, half), note="first"), log.rows(slice(half, None), note="last")
    return fx.simulate(fx.fit(FRICTION, first, "motor_current", lowpass=5.0).model, second)


def _kinova() -> Cases:
    return {
        "fit/kinova current": of(kinova_current, fit_numbers),
        "fit/kinova motor torque, four orders": of(kinova_drive, fit_numbers),
        "fit/kinova sensor, three orders": of(kinova_sensor, fit_numbers),
        "compare/kinova current": of(
            lambda: fx.compare(kinova_current().model, _kinova_started(0)), comparison_numbers
        ),
        "discover/kinova current": of(
            lambda: fx.discover(SMOOTH, _kinova_started(2), target="motor_current"),
            discovery_numbers,
        ),
    }


def _kinova_started(first: int) -> list[fx.Log]:
    """Runs from a speed on, without the transient at their start."""
    return [repaired(kinova(speed), "drop_start=1.0") for speed in KINOVA_SPEEDS[first:]]


@cache
def kinova_current() -> fx.Fit:
    """Smooth friction alone."""
    effects: Effects = ["offset", "viscous_friction", "stribeck_friction"]
    return fx.fit(effects, _kinova_started(0), "motor_current", checks=False)


@cache
def kinova_drive() -> fx.Fit:
    """Friction and the four largest orders of the output."""
    ripple = fx.effect("output_ripple", orders=[100, 700, 1200, 1400])
    return fx.fit([*FRICTION, ripple], [kinova(v) for v in KINOVA_SPEEDS], "motor_torque")


@cache
def kinova_sensor() -> fx.Fit:
    """The sensor's own orders."""
    ripple = fx.effect("output_ripple", orders=[2, 4, 8])
    return fx.fit(["offset", ripple], [kinova(v) for v in KINOVA_SPEEDS], "sensor_torque")


def _iiwa() -> Cases:
    made: Cases = {}
    for joint in IIWA:
        name = f"fit/iiwa joint {joint}"
        made[name] = of(partial(_iiwa_fit, joint), fit_numbers)
        made[f"{name} as recorded"] = of(partial(iiwa_as_recorded, joint), fit_numbers)
    made["discover/iiwa joint 1"] = of(
        lambda: fx.discover(FRICTION[:3], _iiwa_runs(1), target="sensor_torque", lowpass=10.0),
        discovery_numbers,
    )
    return made


def _iiwa_runs(joint: int) -> list[fx.Log]:
    """Half a minute of each run, sign and velocity mended."""
    logs = [repaired(iiwa(joint, speed), MENDED) for speed in IIWA[joint]]
    return [log.rows(slice(200, 200 + int(SECONDS * log.rate)), note="a part") for log in logs]


def _iiwa_fit(joint: int) -> fx.Fit:
    return fx.fit(FRICTION[:3], _iiwa_runs(joint), "sensor_torque", lowpass=10.0)


@cache
def iiwa_as_recorded(joint: int) -> fx.Fit:
    """Two whole runs with nothing mended."""
    logs = [iiwa(joint, speed) for speed in IIWA[joint][:2]]
    return fx.fit(MOVES, logs, "sensor_torque")


def _two_encoders() -> Cases:
    hysteresis: Effects = ["offset", "torsional_hysteresis"]
    return {
        "fit/two encoders, joint 1": of(
            lambda: fx.fit([*hysteresis, "kinematic_error"], aligned(1), "torsion"), fit_numbers
        ),
        "fit/two encoders, joint 2": of(
            lambda: fx.fit(hysteresis, aligned(2), "torsion"), fit_numbers
        ),
        "fit/two encoders, as recorded": of(
            lambda: fx.fit(hysteresis, two_encoder(1).with_facts({"gear_ratio": 7.3}), "torsion"),
            fit_numbers,
        ),
        "discover/two encoders, joint 1": of(
            lambda: fx.discover(["offset"], aligned(1), target="torsion"), discovery_numbers
        ),
    }


def _xl330() -> Cases:
    loaded: Effects = [*FRICTION[1:], "gravity", "load_dependent_friction"]
    return {
        "fit/xl330": of(
            lambda: fx.fit(
                loaded, [_pendulum(run) for run in TWELVE], "motor_torque", lowpass=5.0, fixed=KNOWN
            ),
            fit_numbers,
        ),
        "fit/xl330 by simulation": of(_xl330_motion, fit_numbers),
        "simulate/xl330 by its servo": _xl330_driven,
    }


def _pendulum(run: str) -> fx.Log:
    """A run while it is enabled, with the torque that its duty cycle makes, less the back-EMF."""
    log = repaired(xl330(run).with_facts({"gear_ratio": 1.0}), MENDED[1])
    torque = TORQUE * log["supply_voltage"] * log["duty"] - BACK_EMF * log["output_velocity"]
    log = log.with_columns({"motor_torque": torque}, note="torque from the duty cycle")
    return log.rows(log["enabled"] > 0.5, note="while it is enabled")


@cache
def _xl330_motion() -> fx.Fit:
    return fitted("load", starts=1, threads=1)


def _xl330_driven() -> Numbers:
    fit = _xl330_motion()
    law = LAW if fit.simulation is None else fit.simulation.controller
    made = fx.simulate(fit.model, runs(HELD_OUT), controller=law)
    return together(dict(zip(HELD_OUT, map(forward_numbers, made), strict=True)))


def _lab() -> Cases:
    viscous, base = ["offset", "coulomb_friction", "inertia"], FRICTION
    return {
        "fit/viscous hidden": of(
            lambda: fx.fit(FRICTION, _viscous(), "sensor_torque", known_load=LOAD), fit_numbers
        ),
        "discover/viscous hidden": of(
            lambda: fx.discover(viscous, _viscous(), target="sensor_torque", known_load=LOAD),
            discovery_numbers,
        ),
        "fit/payload rig": of(
            lambda: fx.fit(base, _payloads(), "motor_torque", known_load=LOAD), fit_numbers
        ),
        "compare/payload rig": of(
            lambda: fx.compare(
                fx.fit(base, _payloads(), "motor_torque", known_load=LOAD).model, _payloads()
            ),
            comparison_numbers,
        ),
        "discover/payload rig": of(
            lambda: fx.discover(base, _payloads(), target="motor_torque", known_load=LOAD),
            discovery_numbers,
        ),
    }


def _viscous() -> list[fx.Log]:
    return list(hidden_viscous(data_folder(), acceleration=True))


def _payloads() -> list[fx.Log]:
    return list(payloads(data_folder()))


def _pushes() -> Numbers:
    """Thresholds from logs without contact, and when a hand is felt."""
    labels = json.loads(CONTACTS.read_text())
    pushed = at_rest("push_pose_1")
    first = labels["contacts"][0]["start"] - labels["edge_uncertainty"]
    quiet = [*(at_rest(run) for run in QUIET), part(pushed, 0.0, first, "before the first push")]
    detector = calibrated(quiet)
    made: Numbers = {"hours": plain(detector.hours), "proven rate": plain(detector.proven_rate)}
    for one in detector.thresholds:
        label = f"joint {one.joint} {one.direction:+d} band {one.band}"
        made |= picked(label, one, ("value", "largest", "paper", "hours"))
    for joint, begun in enumerate(onsets(detector, pushed), start=1):
        made[f"joint {joint} contacts"] = len(begun)
        made |= {f"joint {joint} contact {k}": plain(at) for k, at in enumerate(np.array(begun))}
    return made
