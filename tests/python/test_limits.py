"""How large a device's readings may be follows from what the model was fitted to."""

from __future__ import annotations

from dataclasses import replace

import chain_rig
import numpy as np

from flexspline import _core, effect
from flexspline.estimation.plan import (
    FACTOR,
    LEAST,
    OF_A_PART,
    WIDEST,
    joint_limits,
    part_limits,
    plan_of,
)
from flexspline.model import Part

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
