"""The third paper's rig: its protocol, its printed numbers, and physics that no model has."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import flexspline.full_range as fr
from flexspline.errors import InputError
from flexspline.estimators import Observer
from flexspline.full_range.methods import with_velocities
from flexspline.logs.checks import check
from flexspline.logs.log import Log
from flexspline.reproduce.full_range import (
    PER_TURN,
    PUBLISHED,
    RATIO,
    Study,
    found_orders,
    pole,
    table_1,
    table_2,
    table_3,
)
from flexspline.rigs import FullRangeRig, full_range_rig
from flexspline.rigs.full_range import (
    COULOMB,
    INERTIA,
    KINEMATIC_ERROR,
    MOTION,
    RATE,
    RESTING,
    pushes,
)
from flexspline.simulation import Start

SEED = 3


@cache
def rig() -> FullRangeRig:
    return full_range_rig(SEED)


@cache
def study() -> Study:
    return Study(rig(), gp_rows=100)


def motion(log: Log) -> float:
    return float(np.mean(np.abs(with_velocities(log)["output_velocity"]) >= MOTION))


def torsion(log: Log) -> np.ndarray:
    return RATIO * log["output_position"] - log["motor_position"]


def test_the_rig_writes_angles_and_torques_at_500_hz_and_no_velocity() -> None:
    log = study().validation
    assert log.rate == pytest.approx(RATE)
    assert not {"output_velocity", "motor_velocity", "sensor_torque"} & set(log.channels)
    assert log.facts["gear_ratio"] == 100.0 and log.facts["output_spline"] == "circular"


def test_the_hand_moves_the_joint_in_about_as_many_rows_as_table_1_implies() -> None:
    shares = [motion(full_range_rig(seed).validation()) for seed in range(1, 7)]
    assert np.mean(shares) == pytest.approx(0.41, abs=0.06)
    full, moving, still = (PUBLISHED["o"][k][0] ** 2 for k in range(3))
    assert (still - full) / (still - moving) == pytest.approx(0.41, abs=0.01)


def test_the_motor_is_silent_but_for_ripple_and_an_offset() -> None:
    acting = RATIO * study().validation["motor_torque"]
    assert np.abs(np.mean(acting)) < 0.5 and np.std(acting) > 0.05
    assert np.max(np.abs(acting)) < min(COULOMB)


@pytest.mark.parametrize("seed", range(4))
def test_no_resting_push_moves_the_motor_and_every_driving_push_does(seed: int) -> None:
    made = full_range_rig(seed)
    time = np.arange(0.0, 1.5, 1.0 / RATE)
    for strength, stuck in ((RESTING[1], True), (-RESTING[1], True), (7.0, False), (-7.0, False)):
        load = -strength * np.interp(time, [0.2, 0.6], [0.0, 1.0])
        start = Start(motor_temperature=30.0, body_temperature=30.0)
        run = made.joint.simulate(
            time, load_torque=load, motor_torque=made.current_zero, start=start
        )
        assert bool(run["motor_stuck"].all()) == stuck, strength


def test_a_push_outward_twists_the_gear_to_the_negative() -> None:
    run = rig().stiffness()
    twist = torsion(run)
    load = run["reference_torque"]
    assert twist[load > 15.0].max() < twist[np.abs(load) < 1.0].min()
    assert twist[load < -15.0].min() > twist[np.abs(load) < 1.0].max()


def test_the_torsion_at_no_load_depends_on_where_the_load_came_from() -> None:
    run = rig().stiffness()
    twist, load, time = torsion(run), run["reference_torque"], run["time"]
    falls, rises = (
        np.mean(twist[(np.abs(load) < 1.0) & (time > first) & (time < last)])
        for first, last in ((25.0, 35.0), (55.0, 60.0))
    )
    assert falls < rises - 1e-3  # wound up outward before, inward before


def test_a_warmer_joint_gives_way_faster_to_the_same_hand() -> None:
    cold = rig()
    warm = replace(cold, validation_temperature=cold.validation_temperature + 15.0)
    speeds = [
        np.abs(with_velocities(r.validation(20.0))["output_velocity"]).max() for r in (cold, warm)
    ]
    assert speeds[1] > 1.03 * speeds[0]


def test_rotor_and_link_have_the_printed_inertia_together() -> None:
    for seed in range(5):
        joint = full_range_rig(seed).joint
        total = joint.output.inertia + RATIO**2 * joint.motor.inertia
        assert total == pytest.approx(INERTIA, rel=1e-12)


def test_the_ten_orders_of_table_3_turn_with_their_pairs() -> None:
    orders = [h.order * PER_TURN[h.pair] for h in KINEMATIC_ERROR]
    assert orders == [1, 2, 4, 100, 101, 200, 201, 202, 400, 404]
    assert {h.pair for h in KINEMATIC_ERROR if h.order * PER_TURN[h.pair] in (101, 202, 404)} == {
        "wave_generator_on_flexspline"
    }


def test_the_turning_run_goes_more_than_two_turns_each_way() -> None:
    angle = rig().turning()["output_position"]
    assert np.ptp(angle) > 2 * 2 * np.pi
    assert np.abs(angle[-1] - angle[0]) < 0.1 * np.ptp(angle)


def test_the_same_seed_gives_the_same_log_and_another_seed_another() -> None:
    one, same, other = (full_range_rig(s).validation(8.0) for s in (SEED, SEED, SEED + 1))
    assert np.array_equal(one["output_position"], same["output_position"])
    assert not np.array_equal(one["reference_torque"], other["reference_torque"])


def test_a_hand_ends_before_the_run_and_takes_turns() -> None:
    time = np.arange(0.0, 60.0, 1.0 / RATE)
    hand = pushes(time, np.random.default_rng(1), tremor=0.0)
    assert not hand[time > 59.5].any()
    strong, weak = np.abs(hand) > 6.0, (np.abs(hand) > 0.5) & (np.abs(hand) < 4.9)
    assert 0.2 < np.mean(strong) < 0.7 and 0.1 < np.mean(weak) < 0.7
    assert (hand[strong] > 0).any() and (hand[strong] < 0).any()


def test_the_estimates_have_the_sign_of_the_push_on_a_day_never_seen() -> None:
    log = study().validation
    found = study().trained.estimates(log)
    speed = np.abs(with_velocities(log)["output_velocity"])
    pushed = np.abs(log["reference_torque"]) > 3.5
    for name, rows in (("o", pushed & (speed > 0.2)), ("c2", pushed & (speed < MOTION))):
        assert np.mean(found[name][rows] * log["reference_torque"][rows] > 0.0) > 0.99, name


def test_the_tables_set_the_published_beside_ours() -> None:
    one, two, three = table_1(study()), table_2(study()), table_3(study())
    assert list(one.index[:5]) == ["m1", "m2", "o", "c1", "c2"]
    printed = one["full: |bias| published"]
    assert printed["sd"] == pytest.approx(0.99, abs=0.01) and printed.drop("sd").max() < 0.3
    assert two.loc["J", "ours"] == pytest.approx(INERTIA, rel=0.05)
    assert three.loc["K_m0 of c1", "ours"] == pytest.approx(15548.0, abs=0.5)
    assert len([name for name in three.index if name.endswith("amplitude")]) == 10


def test_c1_and_c2_differ_in_the_stiffness_alone() -> None:
    c1, c2 = study().c1, study().c2
    assert np.flatnonzero(c1.coefficients != c2.coefficients).tolist() == [0]
    assert fr.mesh_of(c2, RATIO).shape == fr.mesh_of(c1, RATIO).shape


def test_the_largest_order_is_200_and_its_phase_is_that_of_the_paper() -> None:
    found = found_orders(study().kinematic_error)
    largest = max(found, key=lambda key: found[key].amplitude)
    assert largest == (2, "wave_generator_on_circular_spline")
    assert found[largest].phase == pytest.approx(2.2575, abs=0.05)


def test_the_printed_gain_of_minus_8_is_refused_and_the_poles_are_where_the_guide_has_them() -> (
    None
):
    with pytest.raises(InputError):
        Observer(-8.0, input="motor_torque")
    assert 1e3 * pole(15548.0) == pytest.approx(2.07, abs=0.01)
    assert 1e3 * pole(26431.0) == pytest.approx(1.22, abs=0.01)


def test_a_run_in_which_the_output_only_twists_says_nothing_of_the_ratio() -> None:
    log = rig().stiffness()
    found = {finding.name for finding in check(log)}
    assert not {"gear_ratio", "motor_reversed", "encoder_delay"} & found
    assert np.ptp(log["output_position"]) < 0.05 < 0.5 < np.ptp(log["motor_position"])
    turned = log.with_columns({"output_position": 10.0 * log["output_position"]}, note="tenfold")
    assert check(turned).named("gear_ratio")
