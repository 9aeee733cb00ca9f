"""How inputs are made for a model: only what is noisy, the motion as one, and never the target."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from recorded_joint import LOAD, RATIO, base, exact, recorded, runs

import flexspline
from flexspline.effects import effect
from flexspline.least_squares.problem import Problem, problem_of
from flexspline.logs.log import Log
from flexspline.prepared import (
    Preparation,
    noise_of_channels,
    preparations_for,
    preparations_of,
    prepared,
)

Array = NDArray[np.float64]
POSITION, VELOCITY, ACCELERATION = "output_position", "output_velocity", "output_acceleration"


def ways_of(*logs: Log, target: str = "sensor_torque") -> tuple[Preparation, ...]:
    return preparations_for(noise_of_channels(logs), target, LOAD)


def with_noise(log: Log, **sizes: float) -> Log:
    """The log with white noise of these sizes on its channels."""
    generator = np.random.default_rng(3)
    noisy = {n: log[n] + generator.normal(0.0, s, len(log)) for n, s in sizes.items()}
    return log.with_columns(noisy, note="recorded")


def exact_log(seed: int = 0) -> Log:
    """A run whose channels are those of a simulation."""
    c = exact(seed)
    torque = c[LOAD] + c[VELOCITY]
    warm = 25.0 + np.sin(0.3 * c["time"])
    theta = RATIO * c[POSITION]
    return Log.from_arrays(
        facts={"gear_ratio": 100.0, "output_spline": "circular"},
        **c, sensor_torque=torque, motor_torque=torque / RATIO, temperature=warm,
        motor_position=theta,
    )  # fmt: skip


@pytest.mark.parametrize("target", ["sensor_torque", "motor_torque", "torsion"])
def test_exact_channels_stay_as_they_are(target: str) -> None:
    log = exact_log()
    assert ways_of(log, exact_log(1), target=target) == ()
    assert prepared(log, ()) is log


def test_a_noisy_position_makes_acceleration_velocity_and_then_itself() -> None:
    bare = with_noise(exact_log(), output_position=1e-4)
    channels = [c for c in bare.channels if c not in ("time", VELOCITY, ACCELERATION)]
    log = Log.from_arrays(time=bare["time"], facts=bare.facts, **{c: bare[c] for c in channels})
    ways = ways_of(log)
    assert [way.channel for way in ways] == [ACCELERATION, VELOCITY, POSITION]
    assert {way.source for way in ways} == {POSITION}
    noise = noise_of_channels([log])[POSITION]
    assert [way.bandwidth for way in ways] == [noise.smoother(k) for k in (2, 1, 0)]
    made, truth = prepared(log, ways), exact(0)
    inside = slice(100, -100)
    for channel, share in ((POSITION, 1e-4), (VELOCITY, 0.01), (ACCELERATION, 0.1)):
        missed = (made[channel] - truth[channel])[inside]
        assert np.std(missed) < share * np.std(truth[channel]), channel
    assert np.std((made[POSITION] - truth[POSITION])[inside]) < 0.5 * 1e-4


@pytest.mark.parametrize(("size", "source"), [(1e-4, VELOCITY), (1.0, POSITION)])
def test_a_recorded_velocity_is_used_where_it_is_quieter_than_the_derivative(
    size: float, source: str
) -> None:
    log = with_noise(exact_log(), output_position=1e-3, output_velocity=size)
    ways = {way.channel: way for way in ways_of(log)}
    assert ways[VELOCITY].source == ways[ACCELERATION].source == source
    assert ways[POSITION].source == POSITION
    assert [*ways] == [ACCELERATION, VELOCITY, POSITION]
    made, truth = prepared(log, ways.values())[VELOCITY], exact(0)[VELOCITY]
    plain = prepared(log, [Preparation(VELOCITY, POSITION, ways[VELOCITY].bandwidth)])[VELOCITY]
    missed, by_position = (np.std((v - truth)[100:-100]) for v in (made, plain))
    assert missed <= by_position


def test_an_exact_recorded_velocity_stays_beside_a_noisy_position() -> None:
    log = with_noise(exact_log(), output_position=1e-3)
    ways = ways_of(log)
    assert [way.channel for way in ways] == [ACCELERATION, POSITION]
    assert np.array_equal(prepared(log, ways)[VELOCITY], log[VELOCITY])


@pytest.mark.parametrize("target", ["motor_torque", "motor_current", "sensor_torque"])
def test_a_drives_own_torque_is_never_smoothed(target: str) -> None:
    log = exact_log().with_columns({"motor_current": exact_log()["motor_torque"]}, note="also")
    log = with_noise(log, motor_torque=1e-3, motor_current=1e-3, sensor_torque=0.1)
    log = with_noise(log, reference_torque=0.1, temperature=0.05, motor_position=1e-2)
    made = {way.channel for way in ways_of(log, target=target)}
    assert made >= {LOAD, "temperature", "motor_position"}
    assert ({"motor_torque", "motor_current"} <= made) == (target == "sensor_torque")
    assert "sensor_torque" not in made


def posed(log: Log, ways: tuple[Preparation, ...], target: str = "sensor_torque") -> Problem:
    effects = [*base(), effect("load_dependent_friction")]
    return problem_of(
        [log], effects, target, known_load=LOAD, lowpass_hz=None, threads=1, preparations=ways
    )


@pytest.mark.parametrize("target", ["sensor_torque", "motor_torque"])
def test_smoothing_a_known_load_changes_rows_and_not_what_they_explain(target: str) -> None:
    log = with_noise(recorded(1, target=target), reference_torque=0.1)
    ways = ways_of(log, target=target)
    assert LOAD in [way.channel for way in ways]
    (raw,), (made,) = posed(log, (), target).runs, posed(log, ways, target).runs
    assert np.array_equal(raw.target, made.target)
    factor = RATIO if target == "motor_torque" else 1.0
    assert made.target == pytest.approx(factor * log[target] - log[LOAD], abs=1e-12)
    truth = exact(1)[LOAD]
    before, after = (np.std(run.channels["known_load"] - truth) for run in (raw, made))
    assert after < 0.7 * before


def test_a_log_is_made_once_and_lost_values_stay_lost() -> None:
    log = with_noise(exact_log(), temperature=0.05)
    way = Preparation("temperature", "temperature", 2.0)
    made = prepared(log, [way])
    assert prepared(log, [way]) is made and way(made) is made
    warm = log["temperature"].copy()
    warm[40:43] = np.nan
    lost = way(log.with_columns({"temperature": warm}, note="lost"))["temperature"]
    assert np.array_equal(np.flatnonzero(np.isnan(lost)), [40, 41, 42])
    assert way(Log.from_arrays(time=log["time"], output_position=log[POSITION])).channels == (
        "time",
        POSITION,
    )


@pytest.fixture(scope="module")
def found() -> flexspline.Discovery:
    lacking = [e for e in base() if e.name != "viscous_friction"]
    return flexspline.discover(lacking, runs(), target="sensor_torque", known_load=LOAD)


def test_a_model_file_holds_how_its_inputs_are_made(
    found: flexspline.Discovery, tmp_path: Path
) -> None:
    part = found.model.part()
    assert [way.channel for way in part.preparations][:3] == [ACCELERATION, VELOCITY, POSITION]
    found.model.save(tmp_path / "model.json")
    again = flexspline.Model.load(tmp_path / "model.json").part()
    assert again.preparations == part.preparations == preparations_of(part.record)
    assert preparations_of({}) == ()


def test_a_prediction_measures_the_raw_log_and_predicts_from_prepared_inputs(
    found: flexspline.Discovery,
) -> None:
    log = with_noise(recorded(7), reference_torque=0.05)
    made = found.model.predict(log)
    assert np.array_equal(made.measured, log["sensor_torque"] - log[LOAD])
    by_hand = prepared(log, found.model.part().preparations)
    again = found.model.predict(by_hand)
    assert made.predicted == pytest.approx(again.predicted, abs=1e-9)
    assert np.std(made.measured - again.measured) > 0.03  # of the load's noise, which it has lost
