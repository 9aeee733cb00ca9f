"""How large a device's readings may be follows from what the model was fitted to."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import chain_rig
import numpy as np
import pytest

import flexspline
from flexspline import _core, effect
from flexspline.estimation import Status
from flexspline.estimation.plan import (
    FACTOR,
    LEAST,
    OF_A_PART,
    WIDEST,
    joint_limits,
    part_limits,
    plan_of,
)
from flexspline.exporting import export
from flexspline.logs.log import Log
from flexspline.model import Model, Part

EFFECTS = (effect("viscous_friction"), effect("load_dependent_friction"), effect("inertia"))


def part(**validity: list[float]) -> Part:
    terms = sum(len(each.terms) for each in EFFECTS)
    return Part("sensor_torque", EFFECTS, np.full(terms, 0.1), None, {"validity": validity})


def test_a_limit_is_a_hundred_times_the_fit_either_way() -> None:
    found = part_limits(part(output_velocity=[-0.5, 2.0], known_load=[-40.0, 12.0]))
    assert found == {
        "output_velocity": FACTOR * 2.0,
        "output_acceleration": WIDEST["output_acceleration"],
        "load": FACTOR * 40.0,
    }


def test_a_fit_at_rest_or_without_load_does_not_blind_a_device() -> None:
    still = part_limits(part(output_velocity=[-1e-5, 1e-5], known_load=[0.0, 0.0]))
    assert still["output_velocity"] == LEAST["output_velocity"]
    assert still["load"] == WIDEST["sensor_torque"]


def test_no_limit_is_above_what_any_joint_has() -> None:
    assert part_limits(part(output_velocity=[0.0, 1e9]))["output_velocity"] == 1e4


def test_a_joint_limits_what_it_reads_and_nothing_else() -> None:
    plan = plan_of(chain_rig.whole_joint())
    found = joint_limits(plan)
    assert list(found) == list(WIDEST)
    assert {name for name, most in found.items() if most is not None} == {
        "output_velocity",
        "output_acceleration",
        "motor_torque",
        "sensor_voltage",
        "thermistor_voltage",
    }
    low, high = chain_rig.CALIBRATION.voltage_range
    assert found["sensor_voltage"] == FACTOR * max(abs(low), abs(high))
    assert found["thermistor_voltage"] == WIDEST["thermistor_voltage"]
    made = joint_limits(plan_of(chain_rig.angle_joint()))
    assert made["output_velocity"] is None and made["output_acceleration"] is None


def test_a_joint_takes_the_widest_of_its_parts() -> None:
    slow, fast = [-1.0, 1.0], [-6.0, 2.0]
    model = chain_rig.whole_joint()
    for name, ends in (("sensor", slow), ("drive", fast)):
        known = model.parts[name]
        record = {**known.record, "validity": {"output_velocity": ends}}
        model = model.with_part(replace(known, record=record), {})
    assert joint_limits(plan_of(model))["output_velocity"] == 600.0


def test_every_number_of_a_model_has_a_limit() -> None:
    assert set(OF_A_PART) == {*_core.numbers, "load"} - {"period"}


LOAD = "reference_torque"
OF_THE_DRIVE = ("inertia", "coulomb_friction_per_direction", "viscous_friction", "gravity")


@cache
def both_torques() -> Model:
    """Both parts fitted to the rig's run, with an observer by the motor beside the sensor."""
    log = chain_rig.raw_log()
    made = flexspline.fit([*OF_THE_DRIVE], log, "motor_torque", known_load=LOAD).model
    made = flexspline.fit(
        ["offset", "gain_error"], log, "sensor_torque", known_load=LOAD, into=made
    ).model
    return made.with_estimator(chain_rig.BY_MOTOR)


def with_targets(model: Model, **ranges: list[float]) -> Model:
    """The model whose parts say that their targets had these ranges."""
    for name, ends in ranges.items():
        known = model.parts[name]
        part = replace(known, record={**known.record, "target_range": ends})
        model = model.with_part(part, {})
    return model


def largest(log: Log, channel: str) -> float:
    return float(np.abs(log[channel]).max())


def test_a_torque_that_the_chain_reads_is_limited_by_what_its_part_was_fitted_to() -> None:
    joint = chain_rig.joint(chain_rig.BY_MOTOR)
    fitted = with_targets(joint, drive=[-0.3, 0.2], sensor=[-11.0, 25.0])
    found = joint_limits(plan_of(fitted))
    assert found["motor_torque"] == FACTOR * 0.3
    assert found["sensor_torque"] == FACTOR * 25.0
    still = joint_limits(plan_of(with_targets(joint, drive=[0.0, 1e-3], sensor=[-0.1, 0.1])))
    assert still["motor_torque"] == LEAST["motor_torque"]
    assert still["sensor_torque"] == LEAST["sensor_torque"]


def test_a_torque_of_a_model_that_knows_no_range_has_the_limit_of_the_core() -> None:
    found = joint_limits(plan_of(chain_rig.joint(chain_rig.BY_MOTOR)))
    assert found["motor_torque"] == WIDEST["motor_torque"]
    assert found["sensor_torque"] == WIDEST["sensor_torque"]


def test_a_fit_records_what_a_device_reads_of_its_target_and_the_file_keeps_it(
    tmp_path: Path,
) -> None:
    log = chain_rig.raw_log()
    both_torques().save(tmp_path / "model.json")
    model = Model.load(tmp_path / "model.json")
    for part in model.parts.values():
        read = log[part.target]  # of the motor at its shaft, no load taken off
        assert part.record["target_range"] == [read.min(), read.max()]
        assert part.target not in part.record["validity"]
    limits = joint_limits(plan_of(model))
    assert limits["motor_torque"] == max(FACTOR * largest(log, "motor_torque"), 10.0)
    assert limits["sensor_torque"] == max(FACTOR * largest(log, "sensor_torque"), 1000.0)


def test_the_range_of_a_current_is_in_amperes_and_a_torsion_has_none() -> None:
    log = chain_rig.raw_log()
    current = log.with_columns({"motor_current": 8.0 * log["motor_torque"]}, note="at 0.125 Nm/A")
    record = flexspline.fit([*OF_THE_DRIVE], current, "motor_current").part.record
    assert record["target_range"] == [
        current["motor_current"].min(),
        current["motor_current"].max(),
    ]
    effects = ["offset", "mesh_compliance", "wave_generator_compliance"]
    assert (
        "target_range" not in flexspline.fit(effects, log, "torsion", known_load=LOAD).part.record
    )


@pytest.mark.parametrize(
    ("channel", "made", "fault"),
    [
        ("motor_torque", "external_torque_observer", Status.MOTOR_FAULT),
        ("sensor_torque", "external_torque_sensor", Status.SENSOR_FAULT),
    ],
)
def test_one_absurd_torque_is_flagged_and_leaves_no_trace(
    channel: str, made: str, fault: Status
) -> None:
    log, row = chain_rig.raw_log(), 1000
    values = {what: log[channel].copy() for what in ("absurd", "missing")}
    values["absurd"][row], values["missing"][row] = 9e5, np.nan
    absurd, missing = (
        flexspline.estimate(both_torques(), log.with_columns({channel: one}, note=what))
        for what, one in values.items()
    )
    assert np.array_equal(absurd[made], missing[made], equal_nan=True)
    assert np.nanmax(np.abs(absurd[made])) < 3.0 * largest(log, LOAD)
    assert np.flatnonzero(absurd.flagged(Status.OUT_OF_RANGE)).tolist() == [row]
    assert np.flatnonzero(absurd.flagged(fault)).tolist() == [row]


def test_an_exported_header_has_the_limits_of_both_torques(tmp_path: Path) -> None:
    export(both_torques(), tmp_path / "joint.hpp")
    text = (tmp_path / "joint.hpp").read_text(encoding="utf-8")
    limits = joint_limits(plan_of(both_torques()))
    for name in ("motor_torque", "sensor_torque"):
        (found,) = re.findall(rf"\.{name} = S\(([^)]*)\)", text)
        assert float(found) == limits[name] < 1e-2 * WIDEST[name]
