"""What is known of the measured logs is seen in them, as in notebooks/measured_logs.ipynb."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from measured import KINOVA_SPEEDS, iiwa, kinova, two_encoder, ur10e, xl330
from numpy.typing import NDArray

import flexspline
from flexspline.least_squares.result import Fit
from flexspline.logs import Log, differentiate, repaired
from flexspline.logs.checks import check, measured_gear
from flexspline.orders import find_orders

pytestmark = pytest.mark.usefixtures("data_folder")

SMOOTH = ["coulomb_friction", "viscous_friction", "stribeck_friction"]
RIPPLE = ["cogging", "wave_generator_ripple", "output_ripple"]
MOVES = ["offset", "coulomb_friction", "viscous_friction", "inertia", "gravity"]
LISTED = {100, 200, 300, 400, 600, 700, 800, 1200, 1400, 2100, 2400, 2800, 4200}


def settled(speeds: tuple[float, ...]) -> list[Log]:
    """Kinova runs without their first second."""
    return [repaired(kinova(speed), "drop_start=1.0") for speed in speeds]


@cache
def kinova_fit(*effects: str) -> Fit:
    """One model for all Kinova runs from 0.09 rad/s up; a run is left out at a time."""
    runs = settled(KINOVA_SPEEDS[2:])
    return flexspline.fit(effects, runs, target="motor_torque", checks=False)


@cache
def held_out_moving(joint: int, *more: str) -> float:
    """RMS [A] of the UR10e on blocks that the fit never saw, where the joint moves."""
    log = ur10e(joint)
    fit = flexspline.fit([*MOVES, *more], log, target="motor_current", lowpass=5.0, checks=False)
    (run,) = fit.runs
    moving = run.counts & (np.abs(run.log["output_velocity"]) >= 0.02)
    assert fit.validated_by == "blocks"
    assert 0.9 < moving.sum() / len(log) < 0.95
    return float(np.sqrt(np.mean(run.held_out[moving] ** 2)))


def test_smooth_effects_leave_0_20_nm_of_the_kinova() -> None:
    fit = kinova_fit(*SMOOTH)
    assert fit.validated_by == "runs"
    assert fit.cv_rmse == pytest.approx(0.20, abs=0.005)


def test_the_orders_found_leave_0_155_nm_of_the_kinova_at_most() -> None:
    assert kinova_fit(*SMOOTH, *RIPPLE).cv_rmse <= 0.155


def test_orders_found_without_the_run_predict_it_as_well() -> None:
    *others, unseen = settled(KINOVA_SPEEDS[2:])
    fit = flexspline.fit([*SMOOTH, *RIPPLE], others, target="motor_torque", checks=False)
    smooth = kinova_fit(*SMOOTH)
    alone = np.sqrt(np.nanmean(fit.predict(unseen).residual ** 2))
    without = next(score for score in smooth.scores if score.label == unseen.name)
    # Over all runs 0.155 / 0.20 is asked for; 1.5 rad/s is the run with most ripple.
    assert alone < 0.85 * without.cv_rmse


def test_all_ten_kinova_runs_are_fitted_as_well_as_with_the_orders_given() -> None:
    # In the two slowest runs the joint sticks and slips: a level holds there, Coulomb does not.
    level = ["offset", "viscous_friction", "stribeck_friction"]
    runs = settled(KINOVA_SPEEDS)
    fit = flexspline.fit([*level, *RIPPLE], runs, target="motor_torque", checks=False)
    assert fit.rmse == pytest.approx(0.159, abs=0.004)
    assert fit.cv_rmse == pytest.approx(0.169, abs=0.004)


def test_the_large_orders_of_the_kinova_are_found_with_their_amplitude_and_cause() -> None:
    found = {order.per_output_turn: order for order in kinova_fit(*SMOOTH, *RIPPLE).orders}
    for order, amplitude in ((1200, 0.14), (1400, 0.13), (700, 0.10)):
        # The amplitudes of the README are those of another smooth model and of all ten runs.
        assert found[order].amplitude == pytest.approx(amplitude, rel=0.2)
        assert found[order].effect == "cogging"
    assert found[1400].label == "2 × 7 pole pairs × motor"
    assert {100, 200, 400} <= {k for k in found if found[k].effect == "wave_generator_ripple"}
    assert len(LISTED & set(found)) >= 10


def test_the_kinova_torque_sensor_has_orders_2_4_and_8_of_its_own() -> None:
    runs = settled(KINOVA_SPEEDS)
    orders = {"output_ripple": range(1, 13)}
    effects = ["offset", "viscous_friction", "output_ripple"]
    fit = flexspline.fit(effects, runs, target="sensor_torque", orders=orders, checks=False)
    amplitude = {k: amplitude_of(fit, k) for k in range(1, 13)}
    assert sorted(amplitude, key=lambda k: -amplitude[k][0])[:3] == [8, 2, 4]
    for order in (2, 4, 8):
        size, error = amplitude[order]
        assert size > 5 * error


def amplitude_of(fit: Fit, order: int) -> tuple[float, float]:
    """Amplitude of an order of `output_ripple` and the larger of its two errors [Nm]."""
    terms = [fit[f"output_ripple.{term} {order}"] for term in ("cosine", "sine")]
    return float(np.hypot(*(t.value for t in terms))), max(t.standard_error for t in terms)


def test_the_order_analysis_is_sure_of_8_and_names_2_and_4_as_likely() -> None:
    found = find_orders(settled(KINOVA_SPEEDS[2:]), "sensor_torque")
    assert 8 in found.orders_for("output_ripple")
    assert [faint.order for faint in found.faint] == [2, 4]


def test_the_kinova_sensor_reads_0_14_to_0_31_nm_below_zero() -> None:
    means = [float(log["sensor_torque"].mean()) for log in settled(KINOVA_SPEEDS)]
    assert min(means) > -0.315 and max(means) < -0.135


@pytest.mark.xfail(
    reason="0.260 A since rows that the recorder does not resolve are left out", strict=True
)
def test_ur10e_joint_2_misses_0_27_amperes_or_more_as_it_did_on_all_rows() -> None:
    assert held_out_moving(2) >= 0.27


def test_one_load_dependent_term_mends_ur10e_joint_2() -> None:
    assert held_out_moving(2) <= 0.31
    assert held_out_moving(2, "load_dependent_friction") <= 0.115


@pytest.mark.parametrize("effect", ["load_dependent_friction", "nonlinear_viscous_friction"])
def test_ur10e_joint_4_lacks_neither_load_nor_velocity_friction(effect: str) -> None:
    assert held_out_moving(4) == pytest.approx(0.017, abs=0.002)
    assert held_out_moving(4, effect) > 0.97 * held_out_moving(4)


def test_the_flipped_sign_and_late_velocity_of_the_iiwa_have_a_size() -> None:
    raw = repaired(iiwa(2, "p1"), "flip_sign=sensor_torque")
    (late,) = check(raw).named("velocity_delay")
    (sign,) = check(raw).named("torque_sign")
    assert 0.031 <= late.size <= 0.076
    assert sign.size < 0
    assert not check(repaired(raw, sign.remedy.split()[-1].rstrip("."))).named("torque_sign")


@pytest.mark.parametrize(("joint", "ratio", "order"), [(2, 160, 320), (5, 100, 200)])
def test_the_iiwa_shows_ripple_twice_per_turn_of_the_motor(
    joint: int, ratio: int, order: int
) -> None:
    log = repaired(iiwa(joint, "p1"), "velocity_from_position=output_velocity")
    unnamed = find_orders(log, "sensor_torque").found[0]
    assert abs(unnamed.per_output_turn - order) <= unnamed.resolution
    named = find_orders(log.with_facts({"gear_ratio": ratio}), "sensor_torque").found[0]
    assert (named.per_output_turn, named.label) == (order, "motor, 2 per turn")


def half_gap(log: Log, ratio: float) -> float:
    """Half of what the torsion at the output differs between the directions [rad]."""
    torsion = log["output_position"] - log["motor_position"] / ratio
    velocity = differentiate(log, channels=("output_velocity",))["output_velocity"]
    fast = np.abs(velocity) > 0.1 * np.abs(velocity).max()
    return 0.5 * (median(torsion, fast & (velocity < 0)) - median(torsion, fast & (velocity > 0)))


def median(values: NDArray[np.float64], rows: NDArray[np.bool_]) -> float:
    return float(np.median(values[rows]))


@pytest.mark.parametrize(("joint", "ratio"), [(1, 7.296), (2, 7.328)])
def test_two_encoders_show_ratio_delay_and_hysteresis(joint: int, ratio: float) -> None:
    log = two_encoder(joint)
    gear = measured_gear(log)
    assert gear is not None
    assert gear.ratio == pytest.approx(ratio, abs=2 * gear.ratio_error)
    assert 0.4e-3 < gear.delay < 0.7e-3
    # Known as ±3.5 mrad, ±2 mrad with the delay taken out; the medians depend on the rows taken.
    assert half_gap(log, gear.ratio) == pytest.approx(3.5e-3, abs=0.5e-3)
    aligned = repaired(log, f"shift=output_position:{gear.delay}")
    assert half_gap(aligned, gear.ratio) == pytest.approx(2e-3, abs=0.5e-3)


def test_every_xl330_log_follows_the_law_of_the_servo(data_folder: Path) -> None:
    paths = sorted((data_folder / "xl330_pendulum").glob("*.json"))
    assert len(paths) == 16
    for path in paths:
        log = xl330(path.stem.split("_")[1])
        # The duty is read from the servo some 2 ms after the position.
        position = np.interp(log["time"] + 0.0021, log["time"], log["output_position"])
        wanted = log["commanded_position"] - position
        law = np.clip(log.facts["kp"] * wanted * (4096 / (2 * np.pi)) / (256 * 885), -1, 1)
        off = np.abs(log["duty"] - law)[log["enabled"] > 0.5]
        # One count of the duty is 1 / 885, one of the position moves it by up to 3.1 counts.
        assert np.median(off) < 3.1 / 885 and np.sqrt(np.mean(off**2)) < 0.006, path.name
        assert not log["duty"][log["enabled"] < 0.5].any(), path.name
