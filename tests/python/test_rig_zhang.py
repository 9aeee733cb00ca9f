"""The first paper's rig: its protocols, its printed numbers, and what its physics must keep."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flexspline import _core
from flexspline.reproduce.zhang import (
    THRESHOLD,
    Arm,
    Study,
    amplitude,
    dead_beat,
    drift_methods,
    low_pass_error,
    peak_between,
    sum_over_one,
)
from flexspline.rigs import ZhangRig, zhang_rig
from flexspline.rigs.zhang import LATE, RATE, REST, SPEED
from flexspline.rigs.zhang_sensor import (
    DRIFT,
    FULL_SCALE,
    HYSTERESIS,
    LEVELS,
    NON_LINEARITY,
    SENSITIVITY,
    THERMISTOR,
    drift_voltage,
)
from flexspline.simulation import Noise


@pytest.fixture(scope="module")
def rig() -> ZhangRig:
    return zhang_rig(3)


@pytest.fixture(scope="module")
def study(rig: ZhangRig) -> Study:
    return Study(rig)


def test_the_ripple_of_the_common_placement_is_the_bridges_behind_two_conversions(
    rig: ZhangRig, study: Study
) -> None:
    """Two boxcars of m rows each pass (sin(m x) / (m sin x))², x = π f / 500 Hz.

    0.5 %: speed and load are not quite steady, and the converter rounds to 5 mNm.
    """
    common, _ = study.placements
    for order in (1, 2):
        hertz = order * 101 * SPEED / (2 * np.pi)
        x = np.pi * hertz / 500.0
        passed = (np.sin(5 * x) / (5 * np.sin(x))) ** 2
        seen = SENSITIVITY * amplitude(common, order)
        assert seen == pytest.approx(passed * rig.sensor.common.ripple()[order], rel=5e-3)


def test_peaks_stand_once_and_twice_per_turn_of_the_wave_generator_on_the_flexspline(
    study: Study,
) -> None:
    """35.16 °/s · 101/360; half a padded bin of a 20 s record with 16 times its length."""
    common, _ = study.placements
    for order, low, high in ((1, 8.0, 12.0), (2, 17.0, 23.0)):
        expected = order * 35.16 * 101 / 360
        assert peak_between(common, low, high) == pytest.approx(expected, abs=0.004)


def test_eight_gauges_take_away_orders_one_and_two_but_not_four(rig: ZhangRig) -> None:
    left, common = rig.sensor.cancelling.ripple(), rig.sensor.common.ripple()
    assert left[1] < 0.05 * common[1] and left[2] < 0.05 * common[2]
    assert left[4] > 0.8 * common[4]


def test_gauges_at_two_places_leave_the_first_order(study: Study) -> None:
    """|1 + e^(−jπ/2)|/2 = 0.71; errors of bonding and spokes are some per cent."""
    ratio = study.four_gauges.ripple()[1] / study.rig.sensor.common.ripple()[1]
    assert ratio == pytest.approx(np.sqrt(0.5), abs=0.05)


@pytest.mark.parametrize("seed", [3, 4, 5])
def test_a_sensor_heated_evenly_drifts_by_24_and_reads_25(seed: int) -> None:
    sensor = zhang_rig(seed).sensor
    still, circuit = sensor.cancelling.with_waves(), sensor.electronics
    warm = np.linspace(20.0, 45.0, 11)
    volts = circuit.gain * still.voltage(0.0, 0.0, warm) + circuit.offset
    np.testing.assert_allclose(volts, drift_voltage(warm), rtol=0, atol=1e-9)
    assert 1.0 / (circuit.gain * still.sensitivity) == pytest.approx(SENSITIVITY, rel=1e-9)


@pytest.mark.parametrize("seed", [3, 4, 5])
def test_the_body_deviates_as_printed_and_not_at_all_without_load(seed: int) -> None:
    deviation = zhang_rig(seed).sensor.deviation
    levels = FULL_SCALE * LEVELS
    rising = deviation.rising(levels)
    slope, _ = np.polyfit(levels, rising, 1)
    assert abs(slope) < 1e-12 and abs(rising.mean()) < 1e-12
    assert np.abs(rising).max() == pytest.approx(NON_LINEARITY, rel=1e-9)
    assert abs(rising[0]) < 1e-12
    cycle = np.concatenate([levels, levels[::-1]])
    run = deviation.of(cycle)
    np.testing.assert_allclose(run[:15], rising, rtol=0, atol=1e-12)
    assert np.max(run[:14:-1] - run[:15]) == pytest.approx(HYSTERESIS, rel=1e-9)


def test_the_converter_is_late_by_two_conversions_and_its_low_pass(rig: ZhangRig) -> None:
    """A ramp comes out later by `LATE`: 5 ms of 1 V/s at the converter, far above its step."""
    sensor = replace(rig.sensor, drive_noise=Noise(1e-12))
    time = np.arange(1000) / 500.0
    ramp = time / sensor.electronics.gain
    read = sensor.read(sensor.cancelling, time, ramp, 5, np.random.default_rng(1))
    late = time[::5] - (read - sensor.electronics.offset)
    assert late[20:].mean() == pytest.approx(LATE, abs=1e-4)


def test_the_oven_only_rises_and_settles_at_six_temperatures(rig: ZhangRig) -> None:
    log = rig.bench.oven()
    warm = _core.thermistor_temperature(log["thermistor_voltage"], **THERMISTOR)
    settled = warm[1100::1200]
    assert len(settled) == 6
    # 1 % of resistance and of B shift the thermistor by up to 0.4 K; the body is within 0.3 K
    np.testing.assert_allclose(settled, [20, 25, 30, 35, 40, 45], rtol=0, atol=0.8)
    assert (np.diff(settled) > 4.0).all()
    assert "reference_torque" not in log


def test_the_brake_goes_up_in_steps_of_five_at_two_degrees_a_second(rig: ZhangRig) -> None:
    one_way, both = rig.bench.calibration(), rig.bench.calibration(unloading=True)
    for log, levels in ((one_way, 15), (both, 29)):
        assert log.duration == pytest.approx(12.0 * levels, abs=0.2)
        assert np.degrees(np.diff(log["output_position"])) == pytest.approx(0.2, abs=1e-9)
    at_ends = one_way["reference_torque"][110::120]
    # levels within 0.3 Nm, reference gain 0.25 %, zero 0.05 Nm, wander 0.2 % (3 σ), noise 20 mNm
    np.testing.assert_allclose(at_ends, 5.0 * np.arange(15), rtol=0.0085, atol=0.45)


def test_hysteresis_shows_with_the_way_back_and_cannot_without(study: Study) -> None:
    assert study.loading.figure("hysteresis").percent is None
    assert study.unloading.figure("hysteresis").percent == pytest.approx(0.903, abs=0.15)


def test_drift_falls_by_what_24_says_and_its_polynomial_comes_back(study: Study) -> None:
    """(24): −0.33 Nm; the thermistor lags and the flanks part, so ours is within 0.06 Nm of it."""
    fallen = SENSITIVITY * float(drift_voltage(45.0) - drift_voltage(20.0))
    assert study.risen == pytest.approx(fallen, abs=0.06)
    for parameter, true in zip(study.drift.drift_polynomial, DRIFT, strict=True):
        assert abs(parameter.value - true) < 5.0 * parameter.standard_error
    assert np.abs(study.after).max() < 0.5 * np.abs(study.before).max()


def test_the_arm_swings_both_ways_at_thirty_to_sixty_degrees_a_second(rig: ZhangRig) -> None:
    log = rig.swings(30.0)
    assert log.rate == pytest.approx(RATE, rel=1e-3)
    speed = np.degrees(np.gradient(log["output_position"], log["time"]))
    assert np.abs(speed[log["time"] < REST - 0.05]).max() < 1.0
    steady = np.abs(speed) > 25.0
    assert (speed[steady] > 0).any() and (speed[steady] < 0).any()
    assert np.quantile(np.abs(speed), 0.99) < 66.0  # ripple of the gear on top of 60
    assert np.abs(log["output_position"]).max() < 1.2


def test_a_stop_changes_nothing_before_its_alarm_and_spares_the_obstacle(
    rig: ZhangRig, study: Study
) -> None:
    hit = Arm(rig, study.model).hit(45.0, 1)
    before = hit.free.trajectory.time <= hit.flag
    for channel in ("output_position", "transmitted_torque", "contact_torque"):
        free, stopped = hit.free.trajectory[channel], hit.stopped.trajectory[channel]
        assert np.array_equal(free[before], stopped[before])
    assert hit.stopped.peak < hit.free.peak
    assert 0.0 <= hit.delay < 0.1
    assert hit.residual[hit.free.log["time"] == hit.flag][0] > THRESHOLD


def test_a_collision_backward_pushes_backward(rig: ZhangRig) -> None:
    free = rig.collide(45.0, -1)
    assert free.trajectory["contact_torque"].min() < -1.0
    assert free.trajectory["contact_torque"].max() <= 0.0


def test_the_same_seed_gives_the_same_logs_and_another_seed_others() -> None:
    one, same, other = (zhang_rig(s).bench.warm_up(60.0)["sensor_voltage"] for s in (3, 3, 4))
    assert np.array_equal(one, same)
    assert not np.array_equal(one, other)


def test_the_exact_observer_is_the_low_pass_of_19() -> None:
    """(19) at 100 Hz: rounding only, some hundred epsilons of momentum and sums."""
    assert low_pass_error() < 1e-12


def test_forward_euler_stops_settling_at_two_and_the_core_refuses_it_from_there() -> None:
    assert dead_beat() == pytest.approx(2.0, abs=1e-9)
    time = np.arange(5) / RATE
    still = np.zeros(5)
    _core.observe_momentum(time, still, still, gain=1.99 * RATE, exact=False)
    with pytest.raises(ValueError, match=r"(?i)euler|gain"):
        _core.observe_momentum(time, still, still, gain=2.01 * RATE, exact=False)


@pytest.mark.parametrize(("phase", "left"), [(np.pi, 0.0), (np.pi / 2, np.sqrt(2.0))])
def test_a_phase_of_half_a_turn_cancels_and_a_quarter_leaves_root_two(
    phase: float, left: float
) -> None:
    assert sum_over_one(phase) == pytest.approx(left, abs=1e-12)


def test_of_the_drift_models_the_papers_polynomial_leaves_the_least(study: Study) -> None:
    left = drift_methods(study)["RMSE [Nm]"]
    line, curve = left["linear, with the calibration"], left["polynomial of degree 2"]
    assert curve < line < left["none"]
    assert curve < left["kernel regression"] < left["none"]
