"""The measured logs of other people's joints: read by a few lines, and what is known of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from measured import KINOVA_SPEEDS, iiwa, kinova, two_encoder, ur10e, xl330

from flexspline.errors import InputError
from flexspline.logs import read_log

pytestmark = pytest.mark.usefixtures("data_folder")


@pytest.mark.parametrize("speed", KINOVA_SPEEDS)
def test_kinova_turns_forward_at_its_speed_and_needs_torque_for_it(speed: float) -> None:
    log = kinova(speed)
    assert 2900 < len(log) < 3000
    assert log.rate == pytest.approx(1000)
    assert log.effective_ratio == 100
    settled = log.rows(slice(1500, None))
    slope = np.polyfit(settled["time"], settled["output_position"], 1)[0]
    assert slope == pytest.approx(settled["output_velocity"].mean(), rel=0.06)
    assert slope == pytest.approx(speed, abs=0.03)
    np.testing.assert_allclose(100 * log["motor_torque"], 7.6 * log["motor_current"], rtol=1e-14)
    assert 1.4 < 100 * settled["motor_torque"].mean() < 2.5
    assert -0.32 < settled["sensor_torque"].mean() < -0.13


@pytest.mark.parametrize("speed", KINOVA_SPEEDS)
def test_kinovas_position_has_no_jump_once_it_is_unwrapped(speed: float) -> None:
    log = kinova(speed)
    assert np.abs(np.diff(log["output_position"])).max() < 3 * 1.6e-3  # 1.6 rad/s, a cycle or two
    assert log.history[-1].startswith("unwrap: jumps of 2π in output_position undone:")


def test_kinovas_position_stays_wrapped_unless_unwrapping_is_asked_for(data_folder: Path) -> None:
    path = data_folder / "kinova_gen3_joint7" / "velocity_0.900000readings.csv"
    log = read_log(path, {"output_position": 1}, rate=1000)
    assert np.diff(log["output_position"]).min() < -6
    assert log["output_position"].max() < 2 * np.pi


@pytest.mark.parametrize(("joint", "rows"), [(1, 5889), (2, 6030), (4, 6288)])
def test_of_the_ur10e_one_joint_moves(joint: int, rows: int) -> None:
    logs = [ur10e(number, f"joint_{joint}") for number in range(1, 7)]
    moved = [float(np.ptp(log["output_position"])) for log in logs]
    assert len(logs[0]) == rows
    assert moved[joint - 1] > 2 and sorted(moved)[-2] < 0.01
    steps = np.diff(ur10e(joint)["time"])[1:]
    assert set(np.round(steps, 4)) == {0.01, 0.012}


@pytest.mark.parametrize("joint", range(1, 7))
def test_all_joints_of_the_ur10e_move_in_the_long_run(joint: int) -> None:
    log = ur10e(joint, "14harm50sec")
    moved = np.diff(log["output_position"])
    told = np.diff(log["time"]) * (log["output_velocity"][1:] + log["output_velocity"][:-1]) / 2
    assert len(log) == 5375
    assert np.corrcoef(moved, told)[0, 1] > 0.98  # the same motion in both channels


RUNS = [(1, "p25"), (1, "p6"), (2, "p1"), (2, "p8"), (5, "p1"), (5, "p9"), (7, "p1"), (7, "p9")]


@pytest.mark.parametrize(("joint", "speed"), RUNS)
def test_the_iiwas_torque_does_work_on_the_joint_once_its_sign_is_turned(
    joint: int, speed: str
) -> None:
    log = iiwa(joint, speed)
    velocity = np.gradient(log["output_position"], log["time"])
    assert log.rate == pytest.approx(200)
    assert np.median(np.abs(velocity)) == pytest.approx(float(speed.replace("p", "0.")), rel=0.02)
    assert np.mean(log["sensor_torque"] * velocity) > 0  # friction takes power, it never gives any
    assert any("column 'tau_Nm' times -1" in said for said in log.history)


def test_the_iiwas_run_named_1_is_no_faster_than_a_tenth_whatever_its_name_says() -> None:
    log = iiwa(1, "1")
    velocity = np.gradient(log["output_position"], log["time"])
    assert np.median(np.abs(velocity)) == pytest.approx(0.1, rel=0.02)


@pytest.mark.parametrize("run", ["10h28m10", "10h28m17", "10h28m57", "10h29m21", "10h29m47"])
def test_the_xl330_follows_its_own_law(run: str) -> None:
    log = xl330(run)
    gain = float(log.facts["kp"]) * 4096 / (2 * np.pi) / (256 * 885)
    error = log["commanded_position"] - log["output_position"]
    on = log["enabled"] == 1
    # duty is whole in 1/885, and as old as two samples at most
    stale = 2 * np.abs(np.diff(error, append=error[-1])).max()
    late = np.abs(np.clip(gain * error, -1, 1) - log["duty"])[on].max()
    assert late < 1.5 / 885 + gain * stale
    assert np.abs(log["duty"]).max() <= 1
    assert not log["duty"][~on].any()
    assert log.facts["mass"] == 0.49 and log.facts["motor"] == "xl330"


def test_undecoded_duty_would_be_beyond_its_range(data_folder: Path) -> None:
    path = data_folder / "xl330_pendulum" / "2026-01-15_10h28m10.json"
    log = read_log(path, {"time": "timestamp", "duty": "load"})
    assert log["duty"].max() > 65_000


@pytest.mark.parametrize(("joint", "ratio"), [(1, 7.296), (2, 7.328)])
def test_the_two_encoders_have_their_ratio(joint: int, ratio: float) -> None:
    log = two_encoder(joint)
    assert len(log) == 26_213 - 5000
    assert log.rate == pytest.approx(1000)
    # ±3.5 mrad of hysteresis and delay move the slope of a plain line by up to a thousandth
    found = np.polyfit(log["output_position"], log["motor_position"], 1)[0]
    assert found == pytest.approx(ratio, rel=1e-3)


def test_a_wrong_variable_of_a_measured_file_is_named(data_folder: Path) -> None:
    path = data_folder / "two_encoder_joint" / "transmission_data_part1.mat"
    with pytest.raises(InputError, match=r"no variable 'data' .*there is data_1"):
        read_log(path, {"time": 0}, variable="data")
