"""Rows that a smoother blurs at ends and gaps do not count, and moving a load blurs no others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from driven_joint import driven, strokes, waves
from hidden_logs import friction_of, log_of, noise, rich_run
from numpy.typing import NDArray
from recorded_joint import LOAD, base, runs

import flexspline
from flexspline.discovery.discovering import _Recorded, _task
from flexspline.fitting import fit_near
from flexspline.least_squares.problem import away_from_ends, problem_of
from flexspline.logs.log import Log
from flexspline.logs.repairs import move_earlier
from flexspline.prepared import Preparation, learned

Array = NDArray[np.float64]

LATE = 1.5e-3  # s
PLAIN = ("offset", "coulomb_friction", "viscous_friction", "inertia", "gravity")


def curve(time: Array) -> Log:
    """A load with a curvature, on which a smoother of lower degree is off."""
    load = 5.0 * np.sin(2.0 * np.pi * 0.9 * time)
    return Log.from_arrays(time=time, output_position=np.sin(time), reference_torque=load)


@pytest.mark.parametrize("gap", [False, True])
def test_every_row_that_counts_has_a_whole_window(gap: bool) -> None:
    """The error of a curve at the rows that count is that of the smoother's gain, and no jump."""
    time = np.arange(0.0, 12.0, 0.005)
    inside = np.abs(time - 6.0) > 0.1 if gap else np.ones(len(time), dtype=bool)
    log, way = curve(time[inside]), Preparation(LOAD, LOAD, 4.5)
    counted = away_from_ends(log, log, [way])
    error = np.abs(way(log)[LOAD] - log[LOAD])
    assert 0.75 < np.mean(counted) < 1.0
    assert error[counted].max() < 0.01 < 5.0 * error[~counted].max()
    held = np.diff(log["time"][counted])
    assert np.count_nonzero(held > 0.3) == int(gap)  # the same reach on both sides of a gap


def test_rows_that_do_not_count_behind_a_gap_are_as_if_they_were_not_recorded() -> None:
    """Inside a recording the noise goes on through them, behind a gap it does not."""
    c, effects = rich_run(1, 2000), base()
    log = log_of(c, sensor_torque=friction_of(c) + c[LOAD] + noise(1, 2000))
    rows = np.arange(len(log))
    resolved = (rows < 700) | (rows >= 711)

    def errors(recorded: NDArray[np.bool_]) -> list[float]:
        made = problem_of([log.rows(recorded)], effects, "sensor_torque", known_load=LOAD,
                          lowpass_hz=None, threads=1, counted=[resolved[recorded]])  # fmt: skip
        return [one.standard_error for one in fit_near(made, effects, {}, {}, None).parameters]

    without = errors(resolved)
    assert errors(resolved | (rows >= 709)) == pytest.approx(without, rel=1e-9)
    assert errors(rows >= 0) != pytest.approx(without, rel=1e-6)


def test_a_temperature_leaves_its_ends_in() -> None:
    log = curve(np.arange(0.0, 12.0, 0.005))
    slow = Preparation("temperature", "temperature", 0.3)
    assert away_from_ends(log, log, [slow]).all()


def test_a_moved_load_is_that_of_the_moved_logs_where_rows_count() -> None:
    logs = runs(2, late=LATE)
    _, ways = learned(logs, "sensor_torque", LOAD, None)
    way = replace(_task(base(), logs, "sensor_torque", LOAD, {}), preparations=tuple(ways))
    moved = _Recorded.of(logs, way).moved(logs, LOAD, LATE)
    again = _Recorded.of([move_earlier(log, LOAD, LATE) for log in logs], way)
    assert moved.counted is not None and again.counted is not None
    for number, (one, other) in enumerate(zip(moved.inputs, again.inputs, strict=True)):
        kept = np.isin(one["time"], other["time"])
        both = moved.counted[number][kept] & again.counted[number]
        assert np.mean(both) > 0.8 and np.mean(moved.counted[number][kept] == both) > 0.99
        assert one[LOAD][kept][both] == pytest.approx(other[LOAD][both], abs=1e-9)
        assert (one["output_position"] == _Recorded.of(logs, way).inputs[number]["output_position"]
                ).all()  # fmt: skip


def sharp(seed: int, period: float, rate: float = 1000.0) -> Log:
    """A joint without lag or friction whose acceleration jumps, as where friction changes sides."""
    rng, time = np.random.default_rng(seed), np.arange(0.0, 20.0, 1.0 / rate)
    a = np.where(time % period < 0.5 * period, 8.0, -8.0) * (1.0 + 0.3 * np.sin(0.7 * time))
    v = np.cumsum(a) / rate
    q = np.cumsum(v - v.mean()) / rate
    q -= np.polyval(np.polyfit(time, q, 1), time)
    torque = 0.35 + 0.9 * np.r_[0.0, np.diff(q, 2) * rate**2, 0.0]
    return Log.from_arrays(
        time=time, output_position=np.round((q + 2e-6 * rng.normal(size=len(q))) / 6e-6) * 6e-6,
        sensor_torque=torque + 0.05 * rng.normal(size=len(q)),
        facts={"gear_ratio": 100, "output_spline": "circular"},
    )  # fmt: skip


def test_a_jump_of_the_acceleration_is_no_row_of_a_fit_that_derives_it() -> None:
    """It is smoothed over 20 ms; 0.59 Nm were left where 0.067 are noise of both channels."""
    made = flexspline.fit(["offset", "inertia"], [sharp(1, 0.9)], "sensor_torque")
    assert made.part.preparations and made.rmse < 0.075
    (inertia,) = (p for p in made.parameters if p.name == "inertia.inertia")
    assert abs(inertia.value - 0.9) < 3.0 * inertia.standard_error < 5e-4


def test_what_a_smoother_takes_of_a_jump_is_no_lag_and_no_loop_of_the_sensor() -> None:
    """The base is the whole joint; it was a loop at 99 %, t = 53, and of longer runs a lag."""
    log = sharp(1, 0.9).rows(slice(0, 8000))
    made = flexspline.discover(["offset", "inertia"], log, target="sensor_torque")
    assert not made.found and "smoothed" in made.refused["sensor_lag"]


def test_inertia_of_sharp_strokes_behind_16_bit_is_within_its_interval() -> None:
    """The error of an encoder that moves evenly is a few lines, and in the strokes it is noise."""
    off = []
    for seed in range(6):
        log = driven(strokes(), 0.0, inertia=0.6, bits=16, seed=seed)
        made = flexspline.fit(PLAIN, log, "motor_torque")
        inertia = made.params["inertia.inertia"]
        off.append((inertia.value - 0.6) / inertia.standard_error)
    assert np.abs(off).max() < 3.0
    assert abs(np.mean(off)) < 1.0


@pytest.mark.parametrize(("every", "bits"), [(10, 15), (20, 17), (20, 19), (40, 15), (80, 17)])
def test_noise_that_is_left_in_an_acceleration_counts_in_the_error_of_an_inertia(
    every: int, bits: int
) -> None:
    """It takes 1 to 5 % off the inertia of strokes, which were three to eight standard errors."""
    logs = [
        driven(angle, 0.0, inertia=0.6, bits=bits, seed=seed, every=every)
        for seed, angle in enumerate((strokes(), strokes(20.0)))
    ]
    inertia = flexspline.fit(PLAIN, logs, "motor_torque").params["inertia.inertia"]
    assert abs(inertia.value - 0.6) < 2.0 * inertia.standard_error < 0.1


@pytest.mark.parametrize("recorded", [False, True])
def test_strokes_that_rows_are_few_for_make_no_effect(recorded: bool) -> None:
    """At 62.5 Hz a ramp has two to six rows; 0.8 Nm were left of 0.2 of noise, and presliding."""
    logs = [
        driven(angle, 0.0, inertia=0.6, bits=17, seed=seed, every=80)
        for seed, angle in enumerate((strokes(), waves(), waves()[::-1].copy(), strokes(20.0)))
    ]
    if recorded:  # by differences, half a row late
        speeds = [np.diff(log["output_position"], prepend=0.0) * 62.5 for log in logs]
        both = zip(logs, speeds, strict=True)
        logs = [log.with_columns({"output_velocity": speed}, note="made") for log, speed in both]
    made = flexspline.discover(PLAIN, logs, target="motor_torque")
    assert not made.found and made.unexplained is None and made.final_rmse < 0.26
    assert made.rows["where the motion is not resolved, or what came before is not known"] > 200
    inertia = flexspline.fit(PLAIN, logs, "motor_torque").params["inertia.inertia"]
    assert abs(inertia.value - 0.6) < min(0.005, 2.0 * inertia.standard_error)


@pytest.mark.parametrize(("bits", "known"), [(14, False), (16, True), (19, True)])
def test_a_width_of_friction_is_no_surer_than_the_speed_near_reversals(
    bits: int, known: bool
) -> None:
    made = flexspline.fit(
        PLAIN,
        driven(strokes(), 0.0, inertia=0.6, bits=bits), "motor_torque",
    )  # fmt: skip
    width = made.params["direction_width"]
    assert width.interval[0] < 0.005 < width.interval[1]
    assert width.determined == known
    errors = np.sqrt(np.diag(made.covariance))
    assert errors[-1] == pytest.approx(width.standard_error, rel=1e-9)
