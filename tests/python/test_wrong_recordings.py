"""Recordings as a laboratory makes them by mistake: each is refused or named in one sentence."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from calibration_logs import drift_run, load_run
from cli_calls import call
from torsion_logs import LOAD, log_of, noise, stiffness_run

from flexspline import calibrate
from flexspline.collision import (
    Residual,
    calibrate_detector,
    smallest_detectable_torque,
    standstill_residual,
)
from flexspline.errors import InputError
from flexspline.fitting import fit
from flexspline.logs.log import Log
from flexspline.observer import observe, observer_noise
from flexspline.sensor import Bridge, Electronics, Gauge, Heating, common_bridge, noise_budget

OVERLOAD = 9.91e37  # what an instrument writes where it has nothing (SCPI)
WEAK = -1e-3  # rad/Nm, of a gear without a shape


def changed(log: Log, channel: str, row: int, value: float) -> Log:
    values = np.array(log[channel])
    values[row] = value
    return log.with_columns({channel: values}, note="spoilt")


@pytest.mark.parametrize(
    ("channel", "value"),
    [
        ("sensor_voltage", OVERLOAD),
        ("reference_torque", -OVERLOAD),
        ("temperature", OVERLOAD),
        ("temperature", -300.0),
        ("temperature", 850.0),  # an open thermocouple, one row: nothing near it is as warm
    ],
)
def test_a_number_that_no_instrument_reads_is_refused_with_its_row(
    channel: str, value: float
) -> None:
    with pytest.raises(InputError, match=rf"{channel} is .* in row 99, which cannot be"):
        calibrate([load_run(), changed(drift_run(), channel, 99, value)])


def test_steps_between_settled_temperatures_are_no_leap() -> None:
    log = drift_run()
    assert np.ptp(log["temperature"]) > 20.0
    calibrate([load_run(), log.rows(slice(0, None, 200), note="one row each 20 s")])


def test_a_reference_in_millinewtonmetres_is_suspected() -> None:
    loads = [
        log.with_columns({"reference_torque": 1e3 * log["reference_torque"]}, note="mNm")
        for log in (load_run(), drift_run())
    ]
    assert any("in mNm" in said for said in calibrate(loads).warnings)


def test_a_path_is_no_model_to_calibrate_into() -> None:
    with pytest.raises(InputError, match=r"into is a str; give what it holds, Model\.load"):
        calibrate([load_run(), drift_run()], into="model.json")  # type: ignore[arg-type]


def torsion_log(**more: Any) -> Log:
    channels = stiffness_run(1, samples=6000)
    log = log_of(channels, WEAK * channels[LOAD] + noise(1, 6000))
    return log.with_columns(more, note="spoilt") if more else log


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda motor: np.mod(motor, 2 * np.pi), "wrapped. Ask for the repair unwrap"),
        (lambda motor: -motor, "the other way.* Ask for the repair flip_sign=motor_position"),
        (np.degrees, "as stated: degrees and radians .*the encoders' right units"),
        (lambda motor: motor * 100.0 / 101.0, "the other spline is the output"),
    ],
)
def test_a_torsion_of_encoders_that_do_not_agree_is_refused(spoil: Any, said: str) -> None:
    log = torsion_log(motor_position=spoil(torsion_log()["motor_position"]))
    with pytest.raises(InputError, match=said):
        fit(["offset", "mesh_compliance"], log, "torsion", known_load=LOAD)


def test_a_fault_that_is_only_warned_of_says_what_to_do() -> None:
    log = torsion_log(motor_position=-torsion_log()["motor_position"])
    made = fit(["offset", "viscous_friction"], log, "motor_torque", known_load=None)
    assert any("Ask for the repair flip_sign=motor_position" in said for said in made.warnings)


def test_a_target_that_never_changes_is_refused() -> None:
    still = np.zeros(6000)
    log = torsion_log(output_position=still, motor_position=still)
    with pytest.raises(InputError, match="torsion is 0 in every row"):
        fit(["offset", "mesh_compliance"], log, "torsion", known_load=LOAD)


def test_one_row_is_no_run_to_fit() -> None:
    with pytest.raises(InputError, match="one row is no run"):
        fit(["offset"], torsion_log().rows(slice(0, 1), note="one"), "torsion", checks=False)


TIME = np.arange(60_000) * 0.01


def quiet(seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(0.0, 0.01, len(TIME))


def test_a_contact_in_a_contact_free_log_is_named_and_its_rate_stays_in_its_interval() -> None:
    values = quiet()
    values[5000] = 100.0
    made = calibrate_detector(Residual(TIME, values), false_alarms_per_hour=1.0)
    assert any("look there for a contact" in said for said in made.warnings)
    spoilt = next(t for t in made.thresholds if t.direction > 0)
    low, high = spoilt.rate_interval
    assert low <= spoilt.rate <= high
    assert spoilt.likely <= spoilt.value


def test_noise_alone_has_no_tail_that_stands_out() -> None:
    made = calibrate_detector(Residual(TIME, quiet()), false_alarms_per_hour=1.0)
    assert not any("stand out" in said for said in made.warnings)


def test_rows_of_unknown_speed_belong_to_no_band() -> None:
    speed = np.full(len(TIME), 0.1)
    speed[:30_000] = np.nan
    values = quiet()
    values[:30_000] += 5.0  # would be the largest of any band that took them in
    made = calibrate_detector(Residual(TIME, values, speed), false_alarms_per_hour=None)
    assert max(t.largest for t in made.thresholds) < 0.1
    assert made.thresholds[0].hours == pytest.approx(300.0 / 3600.0)
    assert not made.detect(Residual(TIME, values, speed))[:30_000].any()


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: calibrate_detector([], false_alarms_per_hour=1.0), "no contact-free logs"),
        (lambda: calibrate_detector([5], false_alarms_per_hour=1.0), "a int is no contact-free"),  # type: ignore[list-item]
        (lambda: Residual(TIME, np.where(TIME < 1.0, np.inf, 0.0)), "infinite at row 0"),
        (
            lambda: calibrate_detector(Residual(TIME[:1], quiet()[:1]), false_alarms_per_hour=None),
            "1 rows",
        ),
        (
            lambda: calibrate_detector(
                Residual(TIME, quiet()), false_alarms_per_hour=None, margin=0.5
            ),
            "below the largest",
        ),
        (
            lambda: calibrate_detector(
                Residual(TIME, quiet()), false_alarms_per_hour=1.0, input="motor"
            ),
            "detector: input",
        ),
        (lambda: smallest_detectable_torque(0.0, 0.03, 100.0), "duration = 0 s"),
        (lambda: observe([0, 1], [0, 1], [0, 1], [0, 1], gain="fast", dynamics=1.0), "gain"),
        (lambda: observe([0, 1], [0, 1], [0, 1], ["a", "b"], gain=1.0, dynamics=1.0), "no number"),
        (
            lambda: observe([0, 1], [0, 1], [0, 1], [np.nan] * 2, gain=1.0, dynamics=1.0),
            "in no row",
        ),
        (
            lambda: observe([0, 1], [0, 1], [0, 1], [0, 1], gain=1.0, dynamics="arm.urdf"),  # type: ignore[arg-type]
            "dynamics_from_urdf",
        ),
        (lambda: observer_noise(10.0, 0.01, torque_noise=-1.0), "torque_noise"),
        (lambda: common_bridge().voltage([0.0, np.nan], 0.0), "angle is not finite at row 1"),
        (lambda: common_bridge().voltage(np.zeros(3), np.zeros(4)), "3 angles and 4 torques"),
        (lambda: common_bridge().with_errors(angle=[0.1, 0.2, 0.3]), "3 values for 4 gauges"),
        (lambda: Bridge((Gauge(0.0, 1), Gauge(90.0, -1))), "give radians"),
        (lambda: Gauge(0.0, 1, factor_error=-1.0), "leaves no gauge"),
        (lambda: common_bridge(poisson=np.nan), "poisson"),
        (lambda: Electronics().read([1.0, 0.0], [0.0, 1.0]), "times that increase"),
        (lambda: noise_budget(common_bridge(), load=np.nan), "finite torque"),
        (lambda: Heating(across=np.nan), "finite numbers"),
    ],
)
def test_each_mistake_is_one_sentence(make: Any, said: str) -> None:
    with pytest.raises(InputError, match=said) as refused:
        make()
    assert "\n" not in str(refused.value)


def test_a_run_that_never_stands_still_leaves_nothing_to_watch() -> None:
    made = standstill_residual(TIME, quiet(), np.ones(len(TIME)))
    with pytest.raises(InputError, match="no finite residual"):
        calibrate_detector(made, false_alarms_per_hour=1.0)


def test_a_negative_seed_is_the_caller_s_fault_and_writes_nothing(tmp_path: Any) -> None:
    result = call("reproduce", "turlapati", "--seed", "-1", "--out", tmp_path / "made")
    assert result.exit_code == 2 and len(result.stderr.strip().splitlines()) == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("value", [OVERLOAD, -1e300])
def test_an_overload_in_a_run_to_fit_is_refused_with_its_row(value: float) -> None:
    log = changed(torsion_log(), "motor_torque", 42, value)
    with pytest.raises(InputError, match=r"motor_torque is .* in row 42, which no instrument"):
        fit(["offset", "viscous_friction"], log, "motor_torque", checks=False)
