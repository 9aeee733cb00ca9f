"""A noisy velocity is derived from the angle before friction is named for it. A second together."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import flexspline
from flexspline.discovery.faults import DataFault, graded
from flexspline.effects import effect
from flexspline.exporting.header import header_text
from flexspline.logs.log import Log
from flexspline.prepared import Preparation, noise_of_channels, preparations_for, prepared

RATE, WIDTH, LEVEL = 200.0, 0.03, 0.4
BASE = (effect("offset"), effect("coulomb_friction"), effect("viscous_friction"))


def run(seed: int, noise: float) -> Log:
    """Strokes with rests; friction of the true velocity; a measured one with this noise."""
    generator = np.random.default_rng([seed, 5])
    time = np.arange(0.0, 12.0, 1.0 / RATE)
    sides = np.sign(np.sin(1.3 * time + seed)) * (np.sin(0.4 * time) ** 2 > 0.2)
    kernel = np.hanning(41) / np.hanning(41).sum()
    velocity = np.convolve(0.5 * sides, kernel, mode="same")
    angle = np.cumsum(velocity) / RATE
    velocity = np.gradient(angle, time)
    torque = 0.1 + LEVEL * np.tanh(velocity / WIDTH) + 0.2 * velocity
    return Log.from_arrays(
        facts={"name": f"run {seed}"},
        time=time,
        output_position=angle,
        output_velocity=velocity + noise * generator.normal(size=len(time)),
        sensor_torque=torque + 0.01 * generator.normal(size=len(time)),
    )


def made_ready(noise: float, *without: str) -> tuple[list[Log], list[Log]]:
    """Runs as recorded, and as the rows read them."""
    logs = [
        Log.from_arrays(**{n: log[n] for n in log.channels if n not in without})
        for log in (run(seed, noise) for seed in range(4))
    ]
    ways = preparations_for(noise_of_channels(logs), "sensor_torque", None)
    return logs, [prepared(log, ways) for log in logs]


def off(logs: list[Log]) -> float:
    """RMS by which velocities differ from the true ones."""
    true = [run(seed, 0.0)["output_velocity"] for seed in range(4)]
    pairs = zip(logs, true, strict=True)
    return float(np.sqrt(np.mean([(log["output_velocity"] - v) ** 2 for log, v in pairs])))


@pytest.mark.parametrize(("without", "left"), [((), 0.1), (("output_position",), 0.5)])
def test_a_noisy_velocity_comes_from_the_angle_or_is_smoothed(
    without: tuple[str, ...], left: float
) -> None:
    logs, made = made_ready(0.004, *without)
    assert off(made) < left * off(logs)


def test_a_smooth_velocity_stays_as_it_is() -> None:
    logs, made = made_ready(0.0)
    assert all(a is b for a, b in zip(logs, made, strict=True))


@cache
def found() -> flexspline.Discovery:
    """Runs of a velocity so noisy that names are sought with a steadier one."""
    return flexspline.discover(
        BASE, [run(seed, 0.004) for seed in range(4)], target="sensor_torque"
    )


def test_a_model_found_with_a_steadier_velocity_steadies_it_before_it_predicts() -> None:
    made = found()
    (way,) = made.model.part().preparations
    assert way.channel == "output_velocity"
    kept = flexspline.Model.from_json(made.model.to_json())
    assert kept.part().preparations == (way,)
    as_recorded, as_found = run(0, 0.004), made.runs[0].log
    assert not np.array_equal(as_recorded["output_velocity"], as_found["output_velocity"])
    both = [kept.predict(log).predicted for log in (as_recorded, as_found)]
    assert np.array_equal(*both)  # and what is steady already is not smoothed twice
    assert f"Expects output_velocity {way.how}" in header_text(kept, "joint").replace("\n// ", " ")


def test_a_model_of_before_says_nothing_of_its_channels_and_reads_them_as_they_are() -> None:
    content = json.loads(found().model.to_json())
    del content["sensor"]["prepared"]
    old = flexspline.Model.from_json(json.dumps(content))
    assert old.part().preparations == ()
    log = run(0, 0.004)
    assert not np.array_equal(old.predict(log).predicted, found().model.predict(log).predicted)


def test_a_velocity_that_is_missing_in_a_row_is_missing_there_alone() -> None:
    way = Preparation("output_velocity", "output_velocity", 16.0)
    log = run(0, 0.004)
    holed = np.array(log["output_velocity"])
    holed[[700, 701]] = np.nan
    made = way(log.with_columns({"output_velocity": holed}, note="holed"))["output_velocity"]
    assert np.flatnonzero(np.isnan(made)).tolist() == [700, 701]


@pytest.mark.parametrize("floor", [0.1, 10.0])
def test_a_fault_matters_by_the_torque_it_makes_beside_the_noise_floor(floor: float) -> None:
    """A late velocity: what the prediction moves by when the velocity is moved to its place."""
    log, fit, late = run(0, 0.0), found().fit, 0.02
    fault = DataFault(log.name, "velocity_delay", "output_velocity", late, "s", (0, len(log)), "")
    (one,) = graded([fault], [log], fit, 1.0)
    assert one.makes is not None
    rows = round(late * RATE)
    moved = log.with_columns(
        {"output_velocity": np.roll(log["output_velocity"], -rows)}, note="earlier"
    )
    both = [recorded(found().model).predict(each).predicted[:-rows] for each in (log, moved)]
    assert one.makes == pytest.approx(float(np.sqrt(np.mean((both[0] - both[1]) ** 2))), rel=1e-6)
    assert graded([fault], [log], fit, floor * one.makes)[0].grave is (floor < 1.0)


def test_it_is_said_which_velocity_names_are_looked_for_with() -> None:
    log, made = run(0, 0.0), found().fit
    fault = DataFault(log.name, "velocity_delay", "output_velocity", 0.02, "s", (0, len(log)), "")
    (derived,) = graded([fault], [log], made, 1e-3)
    assert "with a velocity derived from output_position; as recorded it makes" in derived.sentence
    as_recorded = replace(made, model=recorded(made.model))
    (late,) = graded([fault], [log], as_recorded, 1e-3)
    assert "with it as recorded; by itself it makes" in late.sentence
    (little,) = graded([fault], [log], as_recorded, 1e3)
    assert little.sentence.endswith("too little to matter.")


def recorded(model: flexspline.Model) -> flexspline.Model:
    """The model that reads its channels as they are."""
    part = model.part()
    record = {name: value for name, value in part.record.items() if name != "prepared"}
    return model.with_part(replace(part, record=record), {})


def test_an_estimate_reads_the_velocity_as_the_joint_does_and_says_so() -> None:
    made, log = found().model, run(0, 0.004)
    both = [flexspline.estimate(model, log) for model in (made, recorded(made))]
    name = "external_torque_sensor"
    assert np.array_equal(both[0][name], both[1][name], equal_nan=True)
    (way,) = made.part().preparations
    assert any(way.how in note for note in both[0].notes)
    assert not any(way.how in note for note in both[1].notes)


def test_a_comparison_is_of_what_the_model_predicts() -> None:
    made, log = found().model, run(0, 0.004)
    residual = made.predict(log).residual
    compared = flexspline.compare(made, log)
    rows = np.isfinite(compared.runs[0].residual)  # but those that the recorder does not resolve
    assert rows.mean() > 0.95
    assert compared.rmse == pytest.approx(float(np.sqrt(np.mean(residual[rows] ** 2))), rel=1e-9)
