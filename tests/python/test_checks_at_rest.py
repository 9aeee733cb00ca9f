"""A coarse joint at rest repeats its values with reason; a recorder that stands still does not."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from flexspline.logs import Log
from flexspline.logs.checks import check
from flexspline.logs.checks.samples import repeated_rows
from flexspline.logs.segments import at_rest

Array = NDArray[np.float64]
Columns = dict[str, Array]

RATE = 200.0
ENCODER, CELL = 2.0 * np.pi / 2**17, 0.05  # rad, Nm: quanta
REST = slice(800, 1400)  # rows
NAMES = ("stuck_recorder", "repeated_rows", "clipped_channel")


def coarse(values: Array, step: float) -> Array:
    return np.asarray(step * np.round(values / step))


def resting(*, velocity: bool) -> Columns:
    """A joint that swings, rests for three seconds at its highest torque, and swings on; coarse."""
    time = np.arange(2400) / RATE
    moving = np.concatenate((time[:800], np.full(600, time[800]), time[800:1800]))
    swing = np.sin(np.pi * moving / 2.0 - np.pi / 2.0)  # at rest where it turns: t = 4 s
    torque = -5.0 * swing + 0.4 * np.sin(31.0 * moving) * np.cos(np.pi * moving / 4.0) ** 2
    torque[REST] = -6.0
    columns = {
        "time": time,
        "output_position": coarse(swing, ENCODER),
        "sensor_torque": coarse(torque, CELL),
    }
    if velocity:
        speed = np.gradient(swing, 1.0 / RATE)
        speed[REST] = 0.0
        columns["output_velocity"] = coarse(speed, 1e-3)
    return columns


def frozen(columns: Columns, rows: slice) -> Columns:
    """What a recorder writes that stands still in these rows."""
    return {
        name: np.where(np.isin(np.arange(len(values)), np.r_[rows]), values[rows.start], values)
        if name != "time"
        else values
        for name, values in columns.items()
    }


def found(columns: Columns) -> list[str]:
    findings = check(Log.from_arrays(facts={"gear_ratio": 100}, **columns))
    return [f.name for name in NAMES for f in findings.named(name)]


@pytest.mark.parametrize("velocity", [True, False])
def test_the_rows_at_rest_are_those_in_which_it_rests(velocity: bool) -> None:
    rest = at_rest(Log.from_arrays(**resting(velocity=velocity)))
    assert rest[REST].all()
    fast = np.abs(resting(velocity=True)["output_velocity"]) > 0.1
    assert fast.sum() > 1500 and not rest[fast].any()


@pytest.mark.parametrize("velocity", [True, False])
def test_a_coarse_joint_at_rest_is_neither_stuck_nor_clipped(velocity: bool) -> None:
    columns = resting(velocity=velocity)
    repeats = np.logical_and.reduce([np.diff(v) == 0 for n, v in columns.items() if n != "time"])
    assert repeats[REST].sum() >= 598  # they would be both, were they not at rest
    assert np.sum(columns["sensor_torque"] == columns["sensor_torque"].min()) >= 600
    assert found(columns) == []


@pytest.mark.parametrize("velocity", [True, False])
@pytest.mark.parametrize("rows", [slice(300, 310), slice(1650, 1690)])
def test_a_recorder_that_stands_still_in_motion_is_stuck(rows: slice, velocity: bool) -> None:
    stuck = frozen(resting(velocity=velocity), rows)
    assert found(stuck) == ["stuck_recorder"]
    (finding,) = check(Log.from_arrays(facts={"gear_ratio": 100}, **stuck)).named("stuck_recorder")
    assert finding.rows[0] == rows.start + 1 and finding.size == rows.stop - rows.start - 1


@pytest.mark.parametrize("velocity", [True, False])
def test_a_channel_that_is_clipped_in_motion_is_clipped_beside_a_rest(velocity: bool) -> None:
    columns = resting(velocity=velocity)
    top = float(np.percentile(columns["sensor_torque"], 90))
    columns["sensor_torque"] = np.minimum(columns["sensor_torque"], top)
    assert found(columns) == ["clipped_channel"]


@pytest.mark.parametrize("flatness", [4, 6, 8])
def test_a_current_that_levels_off_is_not_clipped(flatness: int) -> None:
    """It stays at its last quantum as long as no parabola would, and slows down on the way."""
    time = np.arange(2400) / RATE
    turning = np.abs((time / 4.0) % 1.0 - 0.5) * 2.0
    current = coarse(3.0 - 2.0 * turning**flatness, 0.01)
    columns = {"time": time, "output_position": coarse(np.sin(1.3 * time), ENCODER)}
    assert np.sum(current == current.max()) > 500
    assert found({**columns, "motor_current": current}) == []
    cut = np.maximum(current, 1.6)
    assert found({**columns, "motor_current": cut}) == ["clipped_channel"]


def test_a_motion_of_a_quantum_a_row_repeats_rows_with_reason() -> None:
    time = np.arange(2000) / RATE
    slow = 0.7 * ENCODER * np.arange(1000)
    fast = slow[-1] + 40.0 * ENCODER * np.arange(1, 1001)
    position = coarse(np.concatenate((slow, fast)), ENCODER)
    assert np.mean(np.diff(position[:1000]) == 0) == pytest.approx(0.3, abs=0.01)
    assert found({"time": time, "output_position": position}) == []


def test_a_log_without_a_position_tells_no_rest() -> None:
    time = np.arange(100) / RATE
    assert not at_rest(Log.from_arrays(time=time, output_velocity=np.zeros(100))).any()
    assert not at_rest(Log.from_arrays(time=time[:2], output_position=np.zeros(2))).any()


def test_a_joint_that_never_moves_rests() -> None:
    time = np.arange(100) / RATE
    assert at_rest(Log.from_arrays(time=time, output_position=np.ones(100))).all()


@pytest.mark.parametrize(("rows", "said"), [(9, 0), (12, 1)])
def test_of_a_few_rows_nothing_is_said_to_repeat(rows: int, said: int) -> None:
    time = np.arange(rows) / 100.0
    angle = np.sin(9.0 * time)
    angle[4:8] = angle[4]
    log = Log.from_arrays(time=time, output_position=angle, sensor_torque=angle)
    assert len([*repeated_rows(log)]) == said


def noisy_swing(top: float, noise: float, quantum: float) -> Columns:
    """A sensor that clips at -25 and 25 Nm behind its noise, and is quantised."""
    rng = np.random.default_rng(4)
    time = np.arange(8000) / RATE
    swing = np.sin(0.9 * time) * (0.9 + 0.1 * np.sin(0.31 * time))
    torque = np.clip(top * swing, -25.0, 25.0) + noise * rng.standard_normal(len(time))
    measured = np.clip(coarse(torque, quantum), -25.0, 25.0)
    return {"time": time, "output_position": 0.5 * swing, "sensor_torque": measured}


def clipped_at(columns: Columns) -> list[float]:
    findings = check(Log.from_arrays(facts={"gear_ratio": 100}, **columns))
    return sorted(finding.size for finding in findings.named("clipped_channel"))


def test_a_sensor_that_clips_in_its_noise_is_clipped() -> None:
    columns = noisy_swing(26.5, 0.05, 0.02)
    columns["sensor_torque"] = coarse(columns["sensor_torque"] + 5.0, 0.02)
    assert clipped_at(columns) == pytest.approx([-20.0, 30.0])


def test_ends_that_are_the_same_but_for_the_sign_are_clipped_by_few_rows() -> None:
    """Of these one end has 11 rows alone, and is none where it is not that of the other side."""
    columns = noisy_swing(25.8, 0.05, 0.02)
    assert np.sum(columns["sensor_torque"] == 25.0) == 11
    assert clipped_at(columns) == [-25.0, 25.0]
    columns["sensor_torque"] = coarse(columns["sensor_torque"] + 5.0, 0.02)
    assert clipped_at(columns) == pytest.approx([-20.0])


@pytest.mark.parametrize("noise", [0.0, 0.1, 0.3, 0.5, 1.0, 2.0])
@pytest.mark.parametrize("top", [20.0, 20.13, 20.25])
def test_a_swing_that_is_as_large_both_ways_is_not_clipped(noise: float, top: float) -> None:
    """Noise in quanta: its ends are often the same but for the sign."""
    for quantum in (0.02, 0.25):
        assert clipped_at(noisy_swing(top, noise * quantum, quantum)) == []
