"""`flexspline discover`: its files are a contract."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hidden_logs import LOAD, friction_of, log_of, noise, rich_run

from flexspline import Model
from flexspline.cli import commands

ROWS = 2000


def saved(folder: Path, *, bad: bool = False) -> list[str]:
    """CSV files of four runs that hide a crosstalk of the motor."""
    paths = []
    for seed in range(1, 5):
        c = rich_run(seed, ROWS)
        torque = c[LOAD] + friction_of(c) + noise(seed, ROWS) + 0.05 * c["motor_torque"]
        if bad and seed == 3:
            torque[200] = np.nan
        paths.append(str(folder / f"run{seed}.csv"))
        log_of(c, sensor_torque=torque).to_frame().to_csv(paths[-1], index=False)
    return paths


def called(*args: str) -> int:
    with pytest.raises(SystemExit) as left:
        commands.main(list(args))
    return int(left.value.code or 0)


def options(out: Path) -> list[str]:
    return ["--target", "sensor_torque", "--known-load", LOAD, "--gear-ratio", "100",
            "--output-spline", "circular", "--effects",
            "offset,coulomb_friction,viscous_friction,inertia", "--out", str(out)]  # fmt: skip


def test_the_three_files_are_written_and_say_what_is_missing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "found"
    assert called("discover", *saved(tmp_path), *options(out)) == 0
    content = json.loads((out / "discovery.json").read_text(encoding="utf-8"))
    assert [one["effect"] for one in content["found"]] == ["motor_crosstalk"]
    assert content["rmse"]["final"] < content["rmse"]["base"]
    names = [e.name for e in Model.load(out / "model.json").part("sensor_torque").effects]
    assert names == [*content["base_effects"], "motor_crosstalk"]
    assert "motor_crosstalk" in (out / "report.html").read_text(encoding="utf-8")
    assert "lacks motor_crosstalk" in capsys.readouterr().out


def test_a_target_that_is_not_finite_is_exit_code_2_and_leaves_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "found"
    assert called("discover", *saved(tmp_path, bad=True), *options(out)) == 2
    said = capsys.readouterr().err
    assert "sensor_torque" in said and "200" in said and said.count("\n") == 1
    assert not out.exists()


def test_effects_and_a_model_together_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    paths = saved(tmp_path)
    assert called("discover", *paths, *options(tmp_path / "x"), "--model", "model.json") == 2
    assert "either --effects" in capsys.readouterr().err


WRONG = {
    "offset,": (["--effects", "offset,"], "a name is missing"),
    "no effect": (["--effects", "frictoin"], "frictoin"),
    "orders": (["--effects", "offset", "--orders", "output_ripple=a"], "EFFECT=1,2,4"),
    "fix": (["--effects", "offset", "--fix", "offset"], "NAME=VALUE"),
    "fix of nothing": (["--effects", "offset", "--fix", "inertia=1"], "inertia"),
    "no model": (["--model", "nowhere.json"], "nowhere.json"),
    "orders of no ripple": (["--effects", "offset", "--orders", "inertia=1"], "inertia"),
    "orders of none": (["--effects", "offset", "--orders", "output_ripple=1"], "output_ripple"),
    "no channel": (["--effects", "offset", "--known-load", "no_channel"], "no_channel"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_call_is_one_sentence_and_leaves_nothing(
    case: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given, says = WRONG[case]
    out = tmp_path / "found"
    code = called("discover", saved(tmp_path)[0], "--target", "sensor_torque", *given,
                  "--out", str(out))  # fmt: skip
    said = capsys.readouterr().err
    assert code == 2 and says in said and said.count("\n") == 1, said
    assert not out.exists()


@pytest.mark.usefixtures("undrawn")
def test_a_parameter_that_is_fixed_on_the_command_line_is_fixed_in_the_model(
    tmp_path: Path,
) -> None:
    out = tmp_path / "found"
    held = ["--fix", "inertia=0.0195", "--fix", "direction_width=0.05"]
    assert called("discover", *saved(tmp_path), *options(out), *held) == 0
    record = Model.load(out / "model.json").part("sensor_torque").record
    fixed = {p["name"]: p["value"] for p in record["parameters"] if p["state"] == "fixed"}
    assert fixed == {"inertia.inertia": 0.0195, "direction_width": 0.05}


@pytest.mark.usefixtures("undrawn")
def test_an_excluded_effect_is_not_named(tmp_path: Path) -> None:
    out = tmp_path / "found"
    excluded = ["--exclude", "motor_crosstalk, gravity"]
    assert called("discover", *saved(tmp_path), *options(out), *excluded) == 0
    content = json.loads((out / "discovery.json").read_text(encoding="utf-8"))
    assert "motor_crosstalk" not in [one["effect"] for one in content["found"]]


def test_an_excluded_name_that_is_no_effect_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "found"
    assert called("discover", *saved(tmp_path), *options(out), "--exclude", "gravitiy") == 2
    assert "there is no effect 'gravitiy'" in capsys.readouterr().err
    assert not out.exists()
