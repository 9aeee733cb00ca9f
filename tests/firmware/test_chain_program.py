"""An exported chain, compiled and run reading by reading, says what `estimate` says."""

from __future__ import annotations

import subprocess
from pathlib import Path

import chain_rig
import device
import numpy as np
import pytest
from chain_rig import (
    BY_GEAR,
    BY_MOTOR,
    CALIBRATION,
    COLLISION,
    COMPENSATION,
    DIFFERENTIATOR,
    KALMAN,
    MERGE,
    THERMISTOR,
)
from numpy.typing import NDArray

import flexspline
from flexspline import Collision, Compliance, InputError, Merge, Observer, ReadingChecks, effect
from flexspline.estimation import Status
from flexspline.exporting import export
from flexspline.logs.log import Log
from flexspline.logs.segments import median_step, runs
from flexspline.model import Model, Part

Array = NDArray[np.float64]

CHANNELS = (
    "output_position",
    "motor_position",
    "output_velocity",
    "output_acceleration",
    "motor_torque",
    "sensor_voltage",
    "sensor_torque",
    "thermistor_voltage",
    "temperature",
)
RESULTS = {
    "temperature": 0,
    "sensor_torque": 1,
    "external_torque_sensor": 2,
    "external_torque_observer": 3,
    "external_torque_compliance": 4,
    "external_torque_merged": 5,
    "contact": 6,
    "external_torque_compliant_observer": 10,
}
COLLISION_BY_OBSERVER = Collision("observer", (), (2.0,), (2.0,))
ANGLE_LIMITS = ReadingChecks(most_speed=8.0, most_motor_torque=0.5)
ABSURD = {"sensor_voltage": 900.0, "thermistor_voltage": 5e3, "temperature": 5e3}
EPSILON = 2.0**-24  # half a unit in the last place of a float


def rows_of(log: Log, *, single: bool = False) -> Array:
    """Rows of `chain.cpp`; in single precision what a float device reads, angles apart."""
    time = log["time"]
    rows = np.full((len(log), 11), np.nan)
    starts = runs(time)[:, 0]
    rows[:, 0] = np.isin(np.arange(len(log)), starts)
    rows[:, 1] = np.diff(time, prepend=time[0])
    rows[starts, 1] = median_step(time)
    for place, name in enumerate(CHANNELS, start=2):
        if name in log:
            rows[:, place] = log[name]
    if single:
        rows[:, 4:] = rows[:, 4:].astype(np.float32)
        counts = np.floor(rows[:, 2:4] / (2.0 * np.pi) * 2.0**32) + 0.5
        rows[:, 2:4] = counts * (2.0 * np.pi / 2.0**32)
    return rows


def stream(program: Path, scalar: str, rows: Array) -> Array:
    """Stream rows through the program; results (N, 12)."""
    done = subprocess.run(
        [str(program), scalar], input=rows.tobytes(), capture_output=True, check=True
    )
    results = np.frombuffer(done.stdout).reshape(-1, 12)
    assert len(results) == len(rows)
    return results


def assert_same_bits(model: Model, log: Log, program: Path) -> None:
    """What the device has for good is what `estimate` has; what it misses is NaN there."""
    made = flexspline.estimate(model, log)
    found = stream(program, "double", rows_of(log))
    assert not found[:, 9].any()
    compared = 0
    for name, place in RESULTS.items():
        if name in made and name != "temperature":
            good = np.isfinite(made[name])
            assert np.array_equal(made[name][good], found[good, place]), name
            compared += int(good.sum())
    assert compared > len(log)
    missed = found[:, 8].astype(int)
    stages = {4: Status.NO_SENSOR, 8: Status.NO_OBSERVER, 16: Status.NO_COMPLIANCE}
    last = {32: Status.NO_MERGED, 64: Status.NO_CONTACT, 128: Status.NO_COMPLIANT_OBSERVER}
    last |= {256: Status.NO_VELOCITY}
    for stage, bit in {**stages, **last}.items():
        assert np.array_equal((missed & stage) != 0, made.flagged(bit)), bit
    for flag in (Status.EXTRAPOLATED, Status.SATURATED):
        assert np.array_equal((found[:, 7].astype(int) & int(flag)) != 0, made.flagged(flag)), flag
    assert np.array_equal((found[:, 7].astype(int) & 4) != 0, made.flagged(Status.OUT_OF_RANGE))
    assert np.array_equal(found[:, 11], made.status // int(Status.SENSOR_FAULT) % 128)


def broken(log: Log) -> Log:
    """The log with 300 readings missing, a short, absurd readings, an encoder step, and a gap."""
    rng = np.random.default_rng(11)
    columns = {name: log[name].copy() for name in CHANNELS}
    for name in columns.keys() - {"output_position"}:
        columns[name][rng.choice(len(log), 40, replace=False)] = np.nan
    columns["thermistor_voltage"][700:720] = 0.0
    columns["sensor_voltage"][900:920] *= -1.0
    columns["motor_torque"][950:953] = 9.0
    columns["motor_position"][2000:2010] += 0.4
    for row, name in enumerate(CHANNELS, start=1200):
        columns[name][row] = ABSURD.get(name, 1e11)
    holed = log.with_columns(columns, note="broken")
    return holed.rows(np.r_[0:1500, 1600 : len(log)], note="a gap")


CHAINS = {
    "everything": tuple(chain_rig.whole_joint().estimators.values()),
    "everything, checked": tuple(chain_rig.checked_joint().estimators.values()),
    "everything by the angles alone": tuple(chain_rig.angle_joint().estimators.values()),
    "the link behind the gear": (
        BY_MOTOR,
        Compliance(),
        BY_GEAR,
        Merge(500.0, 0.01, at_rest="compliant_observer"),
        Collision("compliant_observer", (), (2.0,), (2.0,)),
    ),
    "the link by euler, without a motor's torque": (
        Compliance(),
        Observer(60.0, "compliance", "euler"),
    ),
    "kalman": (BY_MOTOR, Compliance(0.2), KALMAN, COLLISION),
    "euler by the sensor": (
        CALIBRATION,
        Observer(100.0, discretisation="euler"),
        Collision("observer", (), (2.0,), (2.0,), hold=0.1),
    ),
    "a threshold on the sensor": (Collision("sensor", (0.5,), (1.0, 2.0), (1.5, 2.5)),),
    "a drift alone": (COMPENSATION,),
}


@pytest.mark.parametrize("case", CHAINS)
def test_the_device_computes_the_bits_of_estimate(tmp_path: Path, case: str) -> None:
    model = chain_rig.joint(*CHAINS[case])
    log = chain_rig.raw_log()
    program = device.compiled(model, tmp_path, device.compilers()[0], name="chain")
    assert_same_bits(model, log, program)
    assert_same_bits(model, broken(log), program)
    absurd = flexspline.estimate(model, broken(log)).flagged(Status.OUT_OF_RANGE)
    assert 1 <= np.count_nonzero(absurd) <= len(CHANNELS)
    assert not flexspline.estimate(model, log).flagged(Status.OUT_OF_RANGE).any()


def test_a_fit_with_filters_is_saved_loaded_estimated_and_exported_alike(tmp_path: Path) -> None:
    log = chain_rig.raw_log()
    effects = ["inertia", "coulomb_friction_per_direction", "viscous_friction", "gravity"]
    fitted = flexspline.fit(
        effects, [log], target="motor_torque", known_load="reference_torque"
    ).model
    for estimator in (BY_MOTOR, COLLISION_BY_OBSERVER, ANGLE_LIMITS, DIFFERENTIATOR):
        fitted = fitted.with_estimator(estimator)
    fitted.save(tmp_path / "model.json")
    model = Model.load(tmp_path / "model.json")
    assert dict(model.estimators) == dict(fitted.estimators)
    program = device.compiled(model, tmp_path, device.compilers()[0], name="chain")
    holed = log["output_position"].copy()
    holed[np.r_[300:310, 900:990, 1200:3000:7]] = np.nan  # 900:990 is all that the filter knows
    holed[1804] += 0.1  # rad in 2 ms
    unread = ("output_velocity", "output_acceleration", "sensor_voltage", "sensor_torque")
    bare = chain_rig.without(log, *unread)
    absurd = bare["motor_torque"].copy()
    absurd[2500] = 9e5  # Nm, for which the limit follows from the torque in the fit
    bare = bare.with_columns(
        {"output_position": holed, "motor_torque": absurd}, note="angles missing, a torque absurd"
    )
    assert_same_bits(model, bare, program)
    made = flexspline.estimate(model, bare)
    assert np.flatnonzero(made.flagged(Status.MOTOR_FAULT)).tolist() == [2500]
    assert made.flagged(Status.SPEED_FAULT).sum() == 2
    assert made.flagged(Status.NO_VELOCITY).sum() == 28 + 10 + 90 + 28 + 258 + 3


@pytest.mark.parametrize("path", [0, 1])
def test_a_part_that_remembers_is_the_same_on_the_device(tmp_path: Path, path: int) -> None:
    part = chain_rig.with_hysteresis(chain_rig.TORSION, path=float(path))
    estimators = (CALIBRATION, BY_MOTOR, Compliance(), BY_GEAR, MERGE)
    model = chain_rig.joint(*estimators).with_part(part, {})
    program = device.compiled(model, tmp_path, device.compilers()[0], name="chain")
    assert_same_bits(model, chain_rig.raw_log(), program)
    assert_same_bits(model, broken(chain_rig.raw_log()), program)


def test_a_joint_without_a_sensor_is_the_same_on_the_device(tmp_path: Path) -> None:
    model = chain_rig.blind_joint(BY_MOTOR, Compliance(), BY_GEAR, MERGE)
    program = device.compiled(model, tmp_path, device.compilers()[0], name="chain")
    for log in (chain_rig.raw_log(), broken(chain_rig.raw_log())):
        assert_same_bits(model, chain_rig.without(log, "sensor_voltage", "sensor_torque"), program)


@pytest.mark.parametrize("compiler", device.compilers())
def test_every_compiler_gives_the_same_bits(tmp_path: Path, compiler: str) -> None:
    model = chain_rig.whole_joint()
    program = device.compiled(model, tmp_path, compiler, name="chain")
    assert_same_bits(model, broken(chain_rig.raw_log()), program)


def float_bounds(log: Log) -> dict[str, float]:
    """Largest differences [Nm] of float and double fed with the same readings.

    Each operation adds half a unit in the last place of its result: sixteen of them on the largest
    term of a sum bound every stage here. A momentum's difference is divided by the period before
    the low pass, whose gain is one; its own rounding gathers over 1/(K T) steps. A mesh torque
    also has the angles' step and the rounding of the rest of the torsion, times the stiffness at
    the torque's place.
    """
    largest = {name: float(np.nanmax(np.abs(log[name]))) for name in CHANNELS}
    period = median_step(log["time"])
    share = -np.expm1(-BY_MOTOR.gain * period)
    sensor = 16 * EPSILON * (CALIBRATION.sensitivity * largest["sensor_voltage"] + 10.0)
    momentum = chain_rig.DRIVE.coefficients[0] * largest["output_velocity"]
    driven = chain_rig.RATIO * largest["motor_torque"] + 10.0
    observer = EPSILON * (4 * momentum / period + 16 * driven + 2 * driven / share) + sensor
    torque = 5.0  # Nm, more than the rig's mesh carries
    stiffness = 15548.0 * (1.0 + (0.05 * torque) ** 2)
    rest = (16 * EPSILON * 12.0 + 2.0 * np.pi * 2.0**-31) / chain_rig.RATIO
    compliance = stiffness * rest + 32 * EPSILON * torque + sensor
    weight = EPSILON * (4 + 3 * (0.28 + MERGE.alpha * MERGE.transition_velocity / 4))
    merged = max(observer, compliance) + weight * 2 * torque
    return {
        "external_torque_sensor": sensor,
        "external_torque_observer": observer,
        "external_torque_compliance": compliance,
        "external_torque_merged": merged,
    }


def test_a_float_device_stays_within_its_rounding(tmp_path: Path) -> None:
    model, log = chain_rig.whole_joint(), chain_rig.raw_log()
    program = device.compiled(model, tmp_path, device.compilers()[0], name="chain")
    rows = rows_of(log, single=True)
    single, double = stream(program, "float", rows), stream(program, "double", rows)
    assert np.array_equal(single[:, 8], double[:, 8])
    for name, bound in float_bounds(log).items():
        worst = np.abs(single[:, RESULTS[name]] - double[:, RESULTS[name]]).max()
        assert worst <= bound, f"{name}: {worst} Nm above {bound} Nm"
        assert bound < 2e-2, f"{name}: a bound of {bound} Nm says nothing"
    edges = np.count_nonzero(np.diff(double[:, 6]))  # each may move by a sample: thresholds, hold
    assert edges >= 8 and np.count_nonzero(single[:, 6] != double[:, 6]) <= edges


def test_time_that_does_not_move_on_changes_nothing(tmp_path: Path) -> None:
    model, log = chain_rig.whole_joint(), chain_rig.raw_log(800)
    program = device.compiled(model, tmp_path, device.compilers()[0], name="chain")
    rows = rows_of(log)
    stuck = np.repeat(rows, 2, axis=0)
    stuck[1::2, 1] = 0.0
    stuck[1::2, 0] = 0.0
    for scalar in ("double", "float"):
        once, twice = stream(program, scalar, rows), stream(program, scalar, stuck)
        assert np.array_equal(once, twice[::2])
        assert np.array_equal(once[:, :7], twice[1::2, :7]) and (twice[1::2, 9] == 2.0).all()


ALONE = {
    "thermistor": ({}, THERMISTOR),
    "calibration": ({}, CALIBRATION),
    "observer of a sensor": ({}, Observer(50.0)),
    "compliance": ({"torsion": chain_rig.TORSION}, Compliance()),
}


@pytest.mark.parametrize("case", ALONE)
def test_an_estimator_compiles_alone(tmp_path: Path, case: str) -> None:
    parts, estimator = ALONE[case]
    model = Model(parts, chain_rig.FACTS).with_estimator(estimator)
    device.compiled(model, tmp_path, device.compilers()[0], name="chain")


REFUSED = {
    "a gain that vanishes": ({}, (Observer(1e-40),), "observer cannot run"),
    "a calibration too steep": ({}, (flexspline.Calibration(1e39, 0.0),), "calibration cannot run"),
    "an observer without its part": ({}, (BY_MOTOR,), "observer with the input motor_torque"),
    "a merge of nothing": ({}, (MERGE,), "merge needs the estimator observer"),
    "a mesh that pushes": (
        {"torsion": Part("torsion", (effect("mesh_compliance"),), np.array([-1e-3]))},
        (Compliance(),),
        "compliance needs a mesh that gives way",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_an_estimator_that_cannot_run_is_refused_by_name(tmp_path: Path, case: str) -> None:
    parts, estimators, word = REFUSED[case]
    model = Model(parts, chain_rig.FACTS, {made.key: made for made in estimators})
    with pytest.raises(InputError, match=word) as caught:
        export(model, tmp_path / "joint.hpp")
    assert "\n" not in str(caught.value) and ";" in str(caught.value)
    assert not list(tmp_path.iterdir())


def test_the_header_says_how_it_is_used_and_every_stage_with_its_unit(tmp_path: Path) -> None:
    export(chain_rig.whole_joint(), tmp_path / "joint.hpp")
    text = (tmp_path / "joint.hpp").read_text()
    for name in ("thermistor_voltage", "sensor_voltage", "motor_torque", "output_velocity"):
        assert f"in.{name} = {name};" in text
    assert "in.motor_position" in text and "out.contact" in text
    assert ".sensitivity = S(62.738),  // Nm/V" in text
    assert all(len(line) <= 100 for line in text.splitlines())
