"""`discover --by simulation`: a drive's missing effect, found by its motion alone."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from cli_calls import call

import flexspline
from flexspline import Fit, InputError, Log, Model, Part
from flexspline.discovery.by_simulation import Driven, _where
from flexspline.effects import effect
from flexspline.forward import PositionServo
from flexspline.logs.writing import write_log

BASE = ["inertia", "gravity", "coulomb_friction", "viscous_friction"]
WEIGHT = 0.5  # Nm
SERVO = PositionServo(8.0, limit=1.0, torque=1.2, back_emf=0.05)
COARSE = 2 * np.pi / 4096
SECONDS, RATE = 5.0, 80.0


def truth(factor: float) -> Model:
    """A pendulum with friction that grows with its weight's torque by `factor`."""
    effects = [effect(name).without_load() for name in (*BASE, "load_dependent_friction")]
    at = {"inertia.inertia": 0.006, "coulomb_friction.level": 0.02,
          "viscous_friction.viscosity": 0.01, "gravity.sine": WEIGHT, "gravity.cosine": 0.0,
          "load_dependent_friction.factor": factor}  # fmt: skip
    names = [f"{e.name}.{term.name}" for e in effects for term in e.terms]
    values = [at[name] for name in names]
    return Model({"drive": Part("motor_torque", tuple(effects), np.array(values))},
                 {"gear_ratio": 1.0})  # fmt: skip


@cache
def runs(factor: float) -> tuple[Log, ...]:
    """Eight runs of the servo: command, duty and the angle as its encoder counts it."""
    made = []
    time = np.arange(0.0, SECONDS, 1.0 / RATE)
    for number in range(8):
        speed, size = 1.0 + 0.35 * number, 1.6 - 0.1 * number
        goal = size * np.sin(speed * time) + 0.4 * np.sin(2.7 * speed * time + number)
        log = Log.from_arrays(
            time=time, output_position=np.zeros_like(time), commanded_position=goal
        ).with_facts({"gear_ratio": 1.0, "name": f"run {number}"})
        driven = flexspline.simulate(truth(factor), log, controller=SERVO)
        angle = np.round(driven.simulated / COARSE) * COARSE
        duty = np.clip(SERVO.position_gain * (goal - angle), -1.0, 1.0)
        made.append(log.with_columns({"output_position": angle, "duty": duty}, note="simulated"))
    return tuple(made)


def found_in(factor: float) -> flexspline.Discovery:
    return flexspline.discover(
        BASE, runs(factor), by="simulation", controller=replace(SERVO), exclude=SLOW,
        fixed={"gravity.sine": WEIGHT, "gravity.cosine": 0.0},
    )  # fmt: skip


SLOW = ("presliding_friction", "position_dependent_friction", "stribeck_friction")  # to search


@pytest.fixture(scope="module")
def found() -> flexspline.Discovery:
    return found_in(0.3)


def test_friction_that_grows_with_the_load_is_named_with_its_size(
    found: flexspline.Discovery,
) -> None:
    assert found.names == ("load_dependent_friction",)
    (factor,) = found.parameters("load_dependent_friction")
    assert factor.value == pytest.approx(0.3, rel=0.1)
    assert found.final_rmse < 0.5 * found.base_rmse


def test_errors_are_of_the_angle_and_the_report_is_that_of_every_discovery(
    found: flexspline.Discovery, tmp_path: Path
) -> None:
    content = json.loads(found.to_json())
    assert (content["by"], content["unit"], content["target"]) == (
        "simulation", "rad", "motor_torque",
    )  # fmt: skip
    assert content["simulated_rmse"]["final"] == pytest.approx(content["rmse"]["final"])
    assert "driven forward, lacks load_dependent_friction" in str(found)
    found.report(tmp_path / "report.html")
    assert "load_dependent_friction" in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_the_extended_model_drives_unseen_runs(found: flexspline.Discovery) -> None:
    law = found.fit.simulation.controller
    made = flexspline.simulate(found.model, list(runs(0.3)), controller=law)
    assert np.sqrt(np.mean([run.rmse**2 for run in made])) < 2.0 * found.final_rmse


def test_a_joint_that_lacks_nothing_gets_no_name() -> None:
    nothing = found_in(0.0)
    assert nothing.names == ()
    assert set(nothing.refused) >= {"load_dependent_friction"}


def test_the_command_line_searches_by_simulation_too(tmp_path: Path) -> None:
    paths = [tmp_path / f"run{k}.csv" for k in range(8)]
    for path, log in zip(paths, runs(0.3), strict=True):
        write_log(log, path)
    SERVO.save(tmp_path / "servo.json")
    out = tmp_path / "found"
    made = call(
        "discover", *paths, "--by", "simulation", "--controller", tmp_path / "servo.json",
        "--effects", ",".join(BASE), "--exclude", ",".join((*SLOW, "nonlinear_viscous_friction")),
        "--fix", f"gravity.sine={WEIGHT}", "--fix", "gravity.cosine=0", "--out", out,
    )  # fmt: skip
    assert made.exit_code == 0, made.stderr
    content = json.loads((out / "discovery.json").read_text(encoding="utf-8"))
    assert [one["effect"] for one in content["found"]] == ["load_dependent_friction"]
    assert (out / "report.html").is_file() and Model.load(out / "model.json").part().target


def test_what_cannot_be_driven_is_refused() -> None:
    logs = list(runs(0.3))
    with pytest.raises(InputError, match="needs the effect inertia"):
        flexspline.discover(["coulomb_friction"], logs, by="simulation", controller=SERVO)
    with pytest.raises(InputError, match="leave the foreign simulation out"):
        flexspline.discover(BASE, logs, by="simulation", simulated_torque="x")
    with pytest.raises(InputError, match="give by='simulation' or leave it out"):
        flexspline.discover(BASE, logs, target="motor_torque", controller=SERVO)


def test_the_motion_gains_most_where_its_mean_square_falls_most() -> None:
    swings, leans = np.array([1.0, -1.0, 1.0, -1.0]), np.full(4, 0.5)
    before = cast(Driven, SimpleNamespace(held_out=[swings, leans, np.full(4, np.nan)]))
    after = cast(Driven, SimpleNamespace(held_out=[0.0 * swings, 0.0 * leans, np.full(4, np.nan)]))
    runs = [SimpleNamespace(log=SimpleNamespace(name=name)) for name in ("swings", "leans", "lost")]
    assert _where(before, after, cast(Fit, SimpleNamespace(runs=runs))) == "most in swings"
