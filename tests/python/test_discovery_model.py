"""The extended model is an ordinary one: what was there stays, and it predicts on a device too."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import numpy as np
from hidden_logs import LOAD, friction_of, log_of, noise, rich_run

import flexspline
from flexspline.demo import run_exported
from flexspline.discovery.result import Discovery
from flexspline.effects import effect
from flexspline.estimators import TemperatureCompensation
from flexspline.exporting import export
from flexspline.logs.log import Log
from flexspline.part import Part, part_to_json

BASE = ["offset", "coulomb_friction", "viscous_friction", "inertia"]
HELD = {"inertia": 0.0195, "direction_width": 0.05}
ROWS = 1500


@cache
def runs() -> tuple[Log, ...]:
    """A sensor that hides a crosstalk of the motor."""
    made = []
    for seed in range(1, 5):
        c = rich_run(seed, ROWS)
        torque = c[LOAD] + friction_of(c) + noise(seed, ROWS) + 0.05 * c["motor_torque"]
        made.append(log_of(c, sensor_torque=torque).with_facts({"name": f"run {seed}"}))
    return tuple(made)


@cache
def start() -> flexspline.Model:
    """A sensor part with parameters that the user holds, a drive part, and an estimator."""
    fit = flexspline.fit(BASE, runs(), "sensor_torque", known_load=LOAD, fixed=HELD)
    drive = Part("motor_torque", (effect("offset"), effect("viscous_friction")), np.array([0.1, 3]))
    warm = TemperatureCompensation((0.01, -2e-4), reference_temperature=25.0)
    return fit.model.with_part(drive, fit.model.facts).with_estimator(warm)


@cache
def found() -> Discovery:
    return flexspline.discover(start(), runs(), target="sensor_torque")


def test_other_parts_estimators_and_facts_of_the_model_are_kept() -> None:
    made = found().model
    assert part_to_json(made.part("motor_torque")) == part_to_json(start().part("motor_torque"))
    assert made.estimators == start().estimators
    assert made.facts == start().facts
    assert [e.name for e in made.part("sensor_torque").effects] == [*BASE, "motor_crosstalk"]


def test_coefficients_and_shapes_that_the_user_fixed_are_left_alone() -> None:
    for name, value in HELD.items():
        parameter = found().fit[name]
        assert parameter.value == value and parameter.state == "fixed"
    again = flexspline.discover(found().model, runs(), target="sensor_torque")
    assert again.names == ()
    assert again.fit["direction_width"].value == HELD["direction_width"]


def test_what_is_fitted_again_follows_what_was_added() -> None:
    old = start().part("sensor_torque").coefficients
    new = found().model.part("sensor_torque").coefficients
    assert not np.array_equal(new[: len(old)], old)


def test_the_extended_model_is_saved_loaded_exported_and_runs_sample_by_sample(
    tmp_path: Path,
) -> None:
    log = runs()[0]
    found().model.save(tmp_path / "joint.json")
    loaded = flexspline.Model.load(tmp_path / "joint.json")
    expected = found().model.predict(log, "sensor_torque").predicted
    assert np.array_equal(loaded.predict(log, "sensor_torque").predicted, expected)
    alone = flexspline.Model({"sensor": loaded.part("sensor_torque")}, loaded.facts)
    said = run_exported(export(alone, tmp_path / "joint.hpp"), alone, log)
    apart = re.search(r"from predict is ([\d.e+-]+) Nm", said)
    assert "no C++ compiler" in said or (apart and float(apart[1]) < 1e-9), said
