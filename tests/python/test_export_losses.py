"""What a simulator's joint leaves out of a model, told on the user's runs."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli_calls import call
from test_export_joint import VALIDITY, losses_of, model_of

from flexspline import own_effect
from flexspline.effects import effect
from flexspline.exporting import export, joint_of
from flexspline.logs.log import Log
from flexspline.model import Model, Part
from flexspline.simulator import Simulated


@pytest.fixture(autouse=True)
def an_older_mujoco(monkeypatch: pytest.MonkeyPatch) -> None:
    """One without passive DC motors, which would take some of what is lost here."""
    monkeypatch.setattr("flexspline.exporting.has_dcmotor", lambda: False)


LOSSY = ("viscous_friction", "coulomb_friction_per_direction", "stribeck_friction", "gravity")
LOSSY_NUMBERS = [0.3, 0.5, -0.3, 0.2, 1.5, -0.4]


def run_of(seed: int, rows: int = 3000) -> Log:
    """A run in which a joint goes to and fro, and what LOSSY makes of it measured with noise."""
    random = np.random.default_rng(seed)
    time = np.arange(rows) / 200.0
    angle = np.sin(time * (0.7 + 0.3 * seed)) + 0.2 * np.sin(2.3 * time)
    speed = np.gradient(angle, time)
    log = Log.from_arrays(time=time, output_position=angle, output_velocity=speed)
    made = model_of(LOSSY, LOSSY_NUMBERS).predict(log).predicted + random.normal(0, 0.01, rows)
    return log.with_columns({"motor_torque": made / 50.0}, note="made").with_facts(
        {"gear_ratio": 50.0, "name": f"run {seed}"}
    )


def by_hand(logs: list[Log]) -> dict[str, float]:
    """The same sizes from the model's own parts, with no table."""
    model = model_of(LOSSY, LOSSY_NUMBERS, gear_ratio=50.0)
    sums: dict[str, float] = dict.fromkeys(
        ("stribeck_friction", "gravity", "coulomb_friction_per_direction", "model", "joint"), 0.0
    )
    sums["placed"] = rows = 0
    for log in logs:
        parts, said = model.components(log), model.predict(log)
        (level,) = model_of(("coulomb_friction",), [0.4]).components(log).values()
        plain = parts["viscous_friction"] + level
        sums["stribeck_friction"] += (parts["stribeck_friction"] ** 2).sum()
        sums["gravity"] += (parts["gravity"] ** 2).sum()
        gap = parts["coulomb_friction_per_direction"] - level
        sums["coulomb_friction_per_direction"] += (gap**2).sum()
        sums["model"] += (said.residual**2).sum()
        sums["joint"] += ((said.measured - plain) ** 2).sum()
        sums["placed"] += ((said.measured - plain - parts["gravity"]) ** 2).sum()
        rows += len(log)
    return {name: float(np.sqrt(each / rows)) for name, each in sums.items()}


@pytest.mark.parametrize("form", ["mujoco", "urdf"])
def test_what_is_lost_is_told_on_the_users_runs(form: str, tmp_path: Path) -> None:
    logs, model = [run_of(1), run_of(2, 1500)], model_of(LOSSY, LOSSY_NUMBERS, gear_ratio=50.0)
    joint, expected = joint_of(model, form, runs=logs), by_hand(logs)
    for loss in joint.lost:
        assert loss.rms == pytest.approx(expected[loss.effect], rel=1e-9), loss.effect
    sizes = [loss.rms for loss in joint.lost]
    assert len(sizes) == 3 and sizes == sorted(sizes, key=lambda size: -(size or 0.0))
    cost = joint.on_runs
    assert cost is not None and cost.rows == 4500 and cost.names == ("run 1", "run 2")
    assert cost.model == pytest.approx(0.01, rel=0.05)
    for name in ("model", "joint", "placed"):
        assert getattr(cost, name) == pytest.approx(expected[name], rel=1e-9)
    path = export(model, tmp_path / "joint.xml", format=form, runs=logs)
    text = path.read_text()
    assert f"error of the joint alone {' ' * 28} {cost.joint:>8.3g}" in text
    assert "On 2 runs (run 1, run 2), 4500 rows, root mean square [Nm]:" in text
    ET.fromstring(text)


@pytest.mark.parametrize("form", ["mujoco", "urdf"])
@pytest.mark.parametrize("coulomb", [("coulomb_friction", [0.3]), ("coulomb_friction", [-0.1]),
                                     ("coulomb_friction_per_direction", [0.5, -0.1])])  # fmt: skip
def test_a_joint_brakes_as_much_as_the_model_once_it_slides(
    form: str, coulomb: tuple[str, list[float]]
) -> None:
    """Coulomb friction and the springs of presliding together, whatever the share of each."""
    (name, levels), springs = coulomb, [0.2, 0.0, 0.1, 0.05]
    level = levels[0] if len(levels) == 1 else 0.5 * (levels[0] - levels[1])
    model = model_of((name, "presliding_friction"), [*levels, *springs], gear_ratio=50.0)
    logs = [run_of(1)]
    joint, parts = joint_of(model, form, runs=logs), model.components(logs[0])
    assert joint.friction == pytest.approx(level + sum(springs))
    assert dict(joint.kept) == {name: "friction", "presliding_friction": "friction"}
    lost = {loss.effect: loss.rms for loss in joint.lost}
    (direction,) = model_of(("coulomb_friction",), [1.0]).components(logs[0]).values()
    gap = parts["presliding_friction"] - sum(springs) * direction
    assert lost.pop("presliding_friction") == pytest.approx(np.sqrt(np.mean(gap**2)), rel=1e-9)
    assert np.sqrt(np.mean(gap**2)) < 0.5 * np.sqrt(np.mean(parts["presliding_friction"] ** 2))
    assert lost.keys() == ({name} if len(levels) == 2 else set())


def test_friction_that_is_negative_once_it_slides_is_no_number_of_a_joint() -> None:
    names, numbers = ("coulomb_friction", "presliding_friction"), [-0.6, 0.2, 0.0, 0.1, 0.05]
    joint = joint_of(model_of(names, numbers), "urdf")
    assert joint.friction == 0.0 and not joint.kept
    assert [loss.effect for loss in joint.lost] == [*names]


def test_one_run_is_a_file_too_and_its_unmeasured_rows_count_for_nothing(tmp_path: Path) -> None:
    log = run_of(3)
    torque = np.array(log["motor_torque"])
    torque[:1000] = np.nan
    frame = log.to_frame().assign(motor_torque=torque)
    frame.drop(columns="motor_torque").to_csv(tmp_path / "run.csv", index=False)
    model = model_of(LOSSY, LOSSY_NUMBERS, gear_ratio=50.0)
    holed = joint_of(model, "mujoco", runs=log.with_columns({"motor_torque": torque}, note="holed"))
    late = joint_of(model, "mujoco", runs=log.rows(slice(1000, None)))
    assert holed.on_runs is not None and late.on_runs is not None
    assert holed.on_runs.rows == 3000 and late.on_runs.rows == 2000
    assert holed.on_runs.joint == pytest.approx(late.on_runs.joint, rel=1e-9)
    text = export(model, tmp_path / "j.xml", format="mujoco", runs=tmp_path / "run.csv").read_text()
    assert "On 1 run (run), 3000 rows" in text and "There is no error" in text


def test_a_current_costs_newton_metres_on_the_runs() -> None:
    log = run_of(4).with_columns({"motor_current": run_of(4)["motor_torque"] * 10.0}, note="made")
    facts: dict[str, Any] = {"gear_ratio": 50.0, "torque_constant": 0.1}
    amperes = [value / 5.0 for value in LOSSY_NUMBERS]
    torque = joint_of(model_of(LOSSY, LOSSY_NUMBERS, gear_ratio=50.0), "mujoco", runs=log)
    current = joint_of(model_of(LOSSY, amperes, "motor_current", **facts), "mujoco", runs=log)
    assert torque.on_runs is not None and current.on_runs is not None
    for name in ("lost", "model", "joint", "placed"):
        pair = getattr(current.on_runs, name), getattr(torque.on_runs, name)
        assert pair[0] == pytest.approx(pair[1], rel=1e-9)


def test_the_command_prints_what_the_joint_costs_on_runs(tmp_path: Path) -> None:
    model_of(LOSSY, LOSSY_NUMBERS, gear_ratio=50.0).save(tmp_path / "model.json")
    paths = []
    for seed in (1, 2):
        paths.append(tmp_path / f"run{seed}.csv")
        run_of(seed).to_frame().to_csv(paths[-1], index=False)
    given = ("export", "--model", tmp_path / "model.json", "--format", "mujoco")
    done = call(*given, "--out", tmp_path / "j.xml", *paths)
    assert done.exit_code == 0, done.stderr
    assert "gravity" in done.stdout and "error of the joint alone" in done.stdout
    made = json.loads(call(*given, "--out", tmp_path / "j.xml", *paths, "--json").stdout)
    assert made["lost"][0]["effect"] == "gravity" and made["lost"][0]["rms"] > 0.0
    assert made["on_runs"]["rows"] == 6000 and made["on_runs"]["names"] == ["run1", "run2"]
    assert made["on_runs"]["joint"] > made["on_runs"]["placed"] > made["on_runs"]["model"]
    alone = json.loads(call(*given, "--out", tmp_path / "j.xml", "--json").stdout)
    assert alone["lost"][0]["rms"] is None and "on_runs" not in alone


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("--format", "header", "run1.csv"), "header leaves out nothing; leave them out"),
        (("--format", "mujoco", "none.csv"), "none.csv: no such file"),
        (("--format", "mujoco", "run1.csv", "run1.csv"), "is given twice"),
        (("--format", "mujoco", "short.csv"), "needs the channel output_position"),
        (("--format", "mujoco", "empty.csv"), "has all channels that the model of motor_torque"),
        (("--format", "mujoco", "run1.csv", "--gear-ratio", "100"), "the model has gear_ratio"),
        (("--format", "mujoco", "--joint", "all"), "there are no runs that tell the joints"),
        (("--format", "mujoco", "--joint", "1,2", "run1.csv"), "takes one joint"),
    ],
)
def test_runs_that_tell_nothing_get_one_sentence_and_no_file(
    arguments: tuple[str, ...], sentence: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    model_of(LOSSY, LOSSY_NUMBERS, gear_ratio=50.0).save("model.json")
    table = run_of(1).to_frame()
    table.to_csv("run1.csv", index=False)
    table.drop(columns="output_position").to_csv("short.csv", index=False)
    table.assign(output_position=np.nan).to_csv("empty.csv", index=False)
    done = call("export", "--model", "model.json", "--out", "joint.xml", *arguments)
    assert done.exit_code == 2 and sentence in done.stderr, done.stderr
    assert done.stderr.count("\n") == 1 and not Path("joint.xml").exists()


@own_effect(terms={"height": "Nm"}, shapes={"width": ("rad/s", 0.02, 3.0)})
def hump(output_velocity: Any, width: float = 0.5) -> Any:
    """Friction that is largest at one speed."""
    x = output_velocity / width
    return x * np.exp(-(x**2))


@own_effect(terms={"height": "Nm"})
def by_motor(motor_position: Any) -> Any:
    """A torque by the measured angle of the motor."""
    return np.sin(motor_position)


def test_an_own_effect_is_lost_with_its_size(tmp_path: Path) -> None:
    effects = (effect("viscous_friction"), hump, by_motor)
    part = Part("motor_torque", effects, np.array([0.3, 0.7, 0.1]), None, {"validity": VALIDITY})
    model = Model({"drive": part}, {"gear_ratio": 50.0})
    text = export(model, tmp_path / "joint.xml", format="mujoco").read_text()
    peak = 0.7 * np.sqrt(0.5) * np.exp(-0.5)
    assert float(losses_of(text)["hump"]) == pytest.approx(peak, rel=1e-2)
    assert losses_of(text)["by_motor"] == "?" and "no range of motor_position" in text
    log = run_of(1)
    log = log.with_columns({"motor_position": 50.0 * log["output_position"]}, note="made")
    found = {one.effect: one.rms for one in joint_of(model, "mujoco", runs=log).lost}
    x = log["output_velocity"] / 0.5
    own = 0.7 * x * np.exp(-(x**2))
    assert found["hump"] == pytest.approx(np.sqrt((own**2).mean()), rel=1e-12)
    assert found["by_motor"] == pytest.approx(
        0.1 * np.sqrt((np.sin(log["motor_position"]) ** 2).mean()), rel=1e-12
    )


def test_an_own_effect_of_a_file_is_refused_in_one_sentence(tmp_path: Path) -> None:
    part = Part("motor_torque", (hump,), np.array([0.7]), None, {"validity": VALIDITY})
    Model({"drive": part}).save(tmp_path / "model.json")
    for form in ("mujoco", "urdf"):
        done = call("export", "--model", tmp_path / "model.json", "--format", form, "--out",
                    tmp_path / "joint.xml")  # fmt: skip
        assert done.exit_code == 2 and "hump" in done.stderr and done.stderr.count("\n") == 1
    assert not (tmp_path / "joint.xml").exists()


def test_a_correction_asks_for_what_it_corrects_and_costs_the_same(tmp_path: Path) -> None:
    """Of a torque that a simulation explains in part: the rest is the model's."""
    log = run_of(1)
    (own,) = model_of(("viscous_friction",), [0.7]).components(log).values()
    whole = log.with_columns({"motor_torque": log["motor_torque"] + own / 50.0}, note="made")
    whole.to_frame().assign(mujoco=own).to_csv(tmp_path / "run.csv", index=False)
    log.to_frame()[["time"]].assign(mujoco=own).to_csv(tmp_path / "says.csv", index=False)
    plain = model_of(LOSSY, LOSSY_NUMBERS, gear_ratio=50.0)
    expected = joint_of(plain, "mujoco", runs=log).on_runs
    given = ("--format", "mujoco", "--out", tmp_path / "j.xml", tmp_path / "run.csv", "--json")
    for own_files, more in (
        (False, ("--simulated-torque", "mujoco")),
        (True, ("--simulation", tmp_path / "says.csv", "--simulated-torque", "mujoco")),
    ):
        corrects = Simulated("mujoco", own_files, False)
        part = replace(plain.part(), simulated=corrects)
        Model({"drive": part}, plain.facts).save(tmp_path / "model.json")
        command = ("export", "--model", tmp_path / "model.json", *given)
        asked = call(*command)
        assert asked.exit_code == 2 and "--simulated-torque mujoco" in asked.stderr
        assert not (tmp_path / "j.xml").exists()
        done = call(*command, *more)
        assert done.exit_code == 0, done.stderr
        cost = json.loads(done.stdout)["on_runs"]
        assert expected is not None
        for name in ("model", "joint", "placed", "lost"):
            assert cost[name] == pytest.approx(getattr(expected, name), rel=1e-6)
        (tmp_path / "j.xml").unlink()
