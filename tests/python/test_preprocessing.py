"""The chain's first stages: readings checked, velocity and acceleration made from the angle."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from chain_rig import (
    ANGLE_CHECKS,
    BY_MOTOR,
    CALIBRATION,
    CHECKS,
    DIFFERENTIATOR,
    angle_joint,
    blind_joint,
    checked_joint,
    joint,
    raw_log,
    whole_joint,
    without,
)

import flexspline
from flexspline import Collision, Differentiator, InputError, ReadingChecks
from flexspline.estimation import Status
from flexspline.exporting import export
from flexspline.model import Model

DERIVED = ("output_velocity", "output_acceleration")
START = 28  # rows of 2 ms: 7 / (2π 20 Hz) are 55.7 ms


def test_a_model_that_makes_its_velocity_reads_no_other() -> None:
    log = raw_log(1500)
    made = flexspline.estimate(angle_joint(), log)
    bare = flexspline.estimate(angle_joint(), without(log, *DERIVED))
    for name in made.columns:
        np.testing.assert_array_equal(made[name], bare[name])
    assert any("the log's own output_velocity, output_acceleration is not" in n for n in made.notes)
    assert not any("log's own output_velocity" in n for n in bare.notes)
    silent = made.flagged(Status.NO_VELOCITY)
    assert silent[:START].all() and not silent[START:].any()
    assert np.isnan(made["external_torque_observer"][:START]).all()


def test_it_is_what_estimate_derives_for_a_log_that_lacks_the_channels() -> None:
    bare = without(raw_log(1500), *DERIVED)
    derived = flexspline.estimate(whole_joint(), bare)
    made = flexspline.estimate(whole_joint().with_estimator(DIFFERENTIATOR), bare)
    for name in made.columns:
        np.testing.assert_array_equal(made[name], derived[name])


def test_what_is_derived_of_a_joint_that_moves_at_a_start_is_no_torque_from_outside() -> None:
    """The filter knows neither velocity nor acceleration yet: behind a gap as at the first row."""
    log = raw_log(1500)
    time = log["time"] + np.where(np.arange(1500) < 700, 0.0, 1.5)
    bare = without(log, *DERIVED).with_columns({"time": time}, note="a gap of 1.5 s")
    made = flexspline.estimate(whole_joint(), bare)
    silent = made.flagged(Status.NO_VELOCITY)
    for first in (0, 700):
        assert silent[first : first + START].all()
        assert np.isnan(made["external_torque_observer"][first : first + START]).all()
    assert np.count_nonzero(silent) == 2 * START


def test_one_derivative_alone_leaves_the_other_channel_as_it_was_read() -> None:
    log = raw_log(1500)
    speed = Differentiator(20.0, ("output_velocity",))
    mixed = log.with_columns({"output_acceleration": np.zeros(1500)}, note="at rest")
    both = [
        flexspline.estimate(whole_joint().with_estimator(speed), run)["external_torque_sensor"]
        for run in (log, mixed)
    ]
    inertia = 0.02  # kg m², of the rig's sensor
    found = (both[1] - both[0])[START:]
    left = 0.02**2  # of the rig's gain error, which is taken off to its square
    np.testing.assert_allclose(
        found, inertia * log["output_acceleration"][START:], rtol=1.01 * left
    )


def test_what_is_taken_out_is_said_and_the_rest_is_untouched() -> None:
    log = raw_log(1500)
    volts = log["sensor_voltage"].copy()
    volts[700:710] = 1.65
    wrong = log.with_columns({"sensor_voltage": volts}, note="at its end")
    made = flexspline.estimate(checked_joint(), wrong)
    plain = flexspline.estimate(whole_joint(), log)
    assert np.flatnonzero(made.flagged(Status.SENSOR_FAULT)).tolist() == [*range(700, 710)]
    assert np.isnan(made["external_torque_sensor"][700:710]).all()
    clean = np.r_[0:700, 710:1500]
    compared = "external_torque_sensor"
    np.testing.assert_array_equal(made[compared][clean], plain[compared][clean])
    assert "out of its range and was taken out" in " ".join(str(made).split())


def test_a_sensor_of_the_wrong_sign_is_told_by_the_observer() -> None:
    log = raw_log(1500)
    swapped = log.with_columns({"sensor_voltage": -log["sensor_voltage"]}, note="swapped")
    made = flexspline.estimate(checked_joint(), swapped)
    assert made.flagged(Status.TORQUES_FAULT).mean() > 0.5
    assert np.isfinite(made["external_torque_sensor"]).all()


def test_the_header_asks_for_no_channel_that_the_chain_makes(tmp_path: Path) -> None:
    for model, asked in ((checked_joint(), True), (angle_joint(), False)):
        export(model, tmp_path / "joint.hpp")
        text = (tmp_path / "joint.hpp").read_text(encoding="utf-8")
        for name in DERIVED:
            assert (f"in.{name} = {name};" in text) == asked
        assert ("Makes output_velocity, output_acceleration" in text) == (not asked)
        assert "reading_checks" in text and ".twist = S(0.2),  // rad at the motor" in text
        assert all(len(line) <= 100 for line in text.splitlines())


def test_a_derivative_that_nothing_reads_is_not_made(tmp_path: Path) -> None:
    watched = joint(BY_MOTOR, Collision("observer", (), (1.0,), (1.0,)), DIFFERENTIATOR)
    blind = Model({"drive": watched.parts["drive"]}, watched.facts, watched.estimators)
    export(blind, tmp_path / "joint.hpp")
    assert "Derivatives::velocity" in (tmp_path / "joint.hpp").read_text(encoding="utf-8")
    alone = Model({}, {}, {"calibration": CALIBRATION, "differentiator": DIFFERENTIATOR})
    export(alone, tmp_path / "joint.hpp")
    assert "Differentiator" not in (tmp_path / "joint.hpp").read_text(encoding="utf-8")


REFUSED = {
    "a way of a velocity that is made": (
        lambda: whole_joint().with_estimator(DIFFERENTIATOR).with_estimator(CHECKS),
        "most_speed or twist",
    ),
    "torques of a joint without a sensor": (
        lambda: export(blind_joint(BY_MOTOR, ANGLE_CHECKS), "unused.hpp"),
        "apart compares the torques of sensor and observer",
    ),
    "encoders without a ratio": (
        lambda: export(Model({}, {}, {"reading_checks": ReadingChecks(twist=1.0)}), "unused.hpp"),
        "nothing to estimate",
    ),
    "encoders with an unknown ratio": (
        lambda: export(
            Model({}, {}, {"calibration": CALIBRATION, "reading_checks": ReadingChecks(twist=1.0)}),
            "unused.hpp",
        ),
        "needs the gear ratio",
    ),
    "a bandwidth beside the model's own": (
        lambda: flexspline.estimate(angle_joint(), raw_log(500), bandwidth=10.0),
        "leave the bandwidth out",
    ),
    "a bandwidth above the log's rate": (
        lambda: flexspline.estimate(
            whole_joint().with_estimator(Differentiator(400.0)), raw_log(500)
        ),
        "does not suit a rate of 500 Hz",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_stages_that_cannot_run_are_refused_in_a_sentence(case: str) -> None:
    call, word = REFUSED[case]
    with pytest.raises(InputError) as caught:
        call()
    assert word in str(caught.value) and ";" in str(caught.value)
    assert "\n" not in str(caught.value) and not Path("unused.hpp").exists()
