"""`flexspline simulate`, `compare --simulated` and the scores, and what wrong runs are told."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas
import pytest
from cli_calls import call
from forward_runs import FACTS, drive, run_of

import flexspline
from flexspline.effects import effect
from flexspline.errors import InputError
from flexspline.forward import PositionServo, simulated_gap, simulated_rmse
from flexspline.logs.log import Log
from flexspline.logs.writing import write_log
from flexspline.model import Model

EFFECTS = [
    ("inertia", [0.5]),
    ("gravity", [8.0, 0.0]),
    ("viscous_friction", [3.0]),
    ("coulomb_friction", [2.0]),
]
MODEL = drive(EFFECTS)
TIME = np.arange(0.0, 12.0, 0.005)


def recorded(model: Model = MODEL, noise: float = 0.0) -> Log:
    """A run that the model itself made, its angle measured with counts."""
    torque = 9.0 * np.sin(1.9 * TIME) + 3.0 * np.sin(0.7 * TIME)
    log = run_of(TIME, torque)
    made = flexspline.simulate(model, log)
    angle = made.simulated + np.random.default_rng(1).normal(0.0, noise, len(TIME))
    return log.with_columns({"output_position": angle}, note="measured")


@pytest.fixture
def places(tmp_path: Path) -> dict[str, Path]:
    MODEL.save(tmp_path / "model.json")
    write_log(recorded(noise=1e-4), tmp_path / "run.csv")
    return {"model": tmp_path / "model.json", "run": tmp_path / "run.csv", "folder": tmp_path}


def test_simulate_writes_the_simulated_channels_row_by_row(places: dict[str, Path]) -> None:
    out = places["folder"] / "out.csv"
    result = call("simulate", "--model", places["model"], places["run"], "--out", out)
    assert result.exit_code == 0, result.stderr
    table = pandas.read_csv(out)
    assert list(table) == ["time", "output_position", "output_velocity", "output_acceleration",
                           "motor_torque", "stuck"]  # fmt: skip
    made = flexspline.simulate(MODEL, flexspline.read_log(places["run"], gear_ratio=100.0))
    assert np.array_equal(table["output_position"], made.simulated)
    assert set(table["stuck"]) == {0, 1}
    assert str(made) in result.stdout
    assert made.rmse < 1e-3


def test_a_servo_file_drives_a_run_without_motor_torque(places: dict[str, Path]) -> None:
    servo = places["folder"] / "servo.json"
    PositionServo(0.9, velocity_gain=0.05).save(servo)
    rest = np.zeros(len(TIME))
    log = Log.from_arrays(time=TIME, commanded_position=rest + 0.3, output_position=rest)
    write_log(log, places["folder"] / "told.csv")
    out = places["folder"] / "out.csv"
    arguments = ["simulate", "--model", places["model"], places["folder"] / "told.csv"]
    result = call(*arguments, "--controller", servo, "--steps", 3, "--out", out)
    assert result.exit_code == 0, result.stderr
    assert "3 steps from row to row" in result.stdout
    assert abs(pandas.read_csv(out)["output_position"].iloc[-1] - 0.3) < 0.05
    without = call(*arguments, "--out", places["folder"] / "none.csv")
    assert without.exit_code == 2
    assert "motor_torque" in without.stderr
    assert not (places["folder"] / "none.csv").exists()


def test_compare_tells_the_gap_of_the_motion_above_the_encoders_noise(
    places: dict[str, Path],
) -> None:
    drive([e for e in EFFECTS if e[0] != "coulomb_friction"]).save(places["model"])
    out = places["folder"] / "where"
    result = call("compare", places["run"], "--model", places["model"], "--simulated", "--out", out)
    assert result.exit_code == 0, result.stderr
    assert (out / "report.html").stat().st_size > 0
    said = json.loads((out / "comparison.json").read_text(encoding="utf-8"))
    assert (said["simulated"], said["target"], said["unit"]) == (True, "output_position", "rad")
    whole = said["overall"]
    # white noise of 1e-4 rad is known to a few hundredths from 2400 rows
    assert whole["noise_floor"] == pytest.approx(1e-4, rel=0.1)
    assert whole["rmse"] > 0.05
    assert whole["excess"] == pytest.approx(whole["rmse"], rel=1e-3)


def test_the_gap_of_two_models_is_that_of_discovery() -> None:
    less = drive([e for e in EFFECTS if e[0] != "coulomb_friction"])
    logs = [recorded(), recorded(less)]
    found = simulated_gap(less, MODEL, logs)
    assert found is not None
    assert list(found) == ["channel", "base", "final"]
    assert found["channel"] == "output_position"
    alone = simulated_rmse(MODEL, logs[:1])
    assert alone is not None and alone["value"] < 1e-5
    assert found["base"] == pytest.approx(found["final"], rel=0.7)  # each moves one run as it was
    assert simulated_gap(MODEL, MODEL, logs[:1]) == {
        "channel": "output_position", "base": alone["value"], "final": alone["value"]
    }  # fmt: skip


def test_what_cannot_be_simulated_has_no_gap() -> None:
    still = drive([e for e in EFFECTS if e[0] != "inertia"])
    assert simulated_gap(still, MODEL, [recorded()]) is None
    assert simulated_rmse(MODEL, []) is None


def without(channel: str) -> Callable[[], Log]:
    def made() -> Log:
        log = recorded()
        columns = {name: log[name] for name in log.channels if name != channel}
        return Log.from_arrays(facts=FACTS, **columns)

    return made


def spoilt(channel: str, row: int) -> Callable[[], Log]:
    def made() -> Log:
        values = recorded()[channel].copy()
        values[row] = np.nan
        return recorded().with_columns({channel: values}, note="spoilt")

    return made


WRONG: list[tuple[Model, Callable[[], Log], str]] = [
    (drive(EFFECTS[1:]), recorded, "has no inertia.*fit it with the effect inertia"),
    (drive([("inertia", [-0.2]), *EFFECTS[1:]]), recorded, "an inertia of -0.2"),
    (drive([*EFFECTS, ("load_dependent_friction", [1.2])]), recorded, "exceeds its load"),
    (MODEL, without("motor_torque"), "needs the channel motor_torque, which it lacks"),
    (MODEL, without("output_position"), "initial state is the first output_position"),
    (MODEL, spoilt("motor_torque", 77), "row 77 has no value of motor torque"),
    (MODEL, spoilt("output_position", 0), "row 0 has no value of output_position"),
    (drive([*EFFECTS[:2], ("viscous_friction", [-30.0])]), recorded, "runs away at"),
    (
        drive([*EFFECTS, ("temperature_dependent_friction", [0.1, 0.0])]),
        recorded,
        "temperature_dependent_friction needs the channel temperature",
    ),
    (MODEL, lambda: recorded().with_facts({"gear_ratio": 80.0}), "gear_ratio"),
]


@pytest.mark.parametrize(("model", "log", "says"), WRONG, ids=[says for *_, says in WRONG])
def test_what_cannot_be_driven_is_told_why(model: Model, log: Callable[[], Log], says: str) -> None:
    with pytest.raises(InputError, match=says):
        flexspline.simulate(model, log())


def test_wrong_arguments_are_told_what_to_give() -> None:
    log = recorded()
    with pytest.raises(InputError, match="'linear' or 'hold'"):
        flexspline.simulate(MODEL, log, inputs="spline")
    with pytest.raises(InputError, match="whole number above 0"):
        flexspline.simulate(MODEL, log, steps_per_sample=0)
    with pytest.raises(InputError, match="no log to simulate"):
        flexspline.simulate(MODEL, [])
    sensor = Model({"sensor": flexspline.Part("sensor_torque", (effect("offset"),), np.ones(1))})
    with pytest.raises(InputError, match="a controller drives a motor"):
        flexspline.simulate(sensor, log, controller=PositionServo(1.0))


def test_behind_a_gap_it_begins_anew_and_says_so() -> None:
    log = recorded()
    keep = (TIME < 4.0) | (TIME > 5.0)
    made = flexspline.simulate(MODEL, log.rows(keep, note="cut"))
    assert made.rmse < 1e-3
    assert "begins anew from the measured state 1 times" in str(made)
    pieces = flexspline.simulate(MODEL, log, horizon=2.0)
    assert "5 times" in str(pieces)
    assert np.array_equal(pieces.simulated[::400], pieces.measured[::400])
    several = flexspline.simulate(MODEL, [log, log])
    assert [run.rmse for run in several] == [flexspline.simulate(MODEL, log).rmse] * 2


@pytest.mark.parametrize("horizon", [-1.0, 0.0, float("nan"), "a", True])
def test_a_horizon_that_is_no_time_is_refused(horizon: object) -> None:
    sensor = Model({"sensor": flexspline.Part("sensor_torque", (effect("offset"),), np.ones(1))})
    for model in (MODEL, sensor):
        with pytest.raises(InputError, match=r"simulate: horizon = .* in s$"):
            flexspline.simulate(model, recorded(), horizon=horizon)  # type: ignore[call-overload]


def test_a_horizon_shorter_than_two_rows_is_refused_for_what_it_is() -> None:
    with pytest.raises(InputError, match=r"no two rows within a horizon of 0\.002 s"):
        flexspline.simulate(MODEL, recorded(), horizon=0.002)


def test_a_result_speaks_in_a_notebook_too() -> None:
    made = flexspline.simulate(MODEL, recorded())
    assert f"RMSE {made.rmse:.4g} rad" in str(made)
    assert "<li>" in made._repr_html_()
    assert "ForwardRun of 'run'" in repr(made)
