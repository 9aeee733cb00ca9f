"""`flexspline estimate` by the contract: file, exit codes, one line of help or error."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas
import pytest
from chain_rig import BY_MOTOR, CALIBRATION, joint, raw_log, whole_joint, without
from cli_calls import call, write_holed

import flexspline
from flexspline import Observer
from flexspline.estimation import MEANING
from flexspline.logs.log import Log
from flexspline.logs.writing import write_log
from flexspline.model import Model


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("run") / "run.csv"
    write_log(raw_log(1500), path)
    return path


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("joint") / "model.json"
    whole_joint().save(path)
    return path


def test_the_file_holds_what_the_call_returns(tmp_path: Path, run: Path, model: Path) -> None:
    out = tmp_path / "external.csv"
    result = call("estimate", "--model", model, run, "--out", out)
    assert result.exit_code == 0, result.stderr
    table = pandas.read_csv(out, float_precision="round_trip")  # by itself since pandas 3
    made = flexspline.estimate(Model.load(model), flexspline.read_log(run))
    assert list(table.columns) == list(made.columns)
    for name in made.columns:
        np.testing.assert_allclose(table[name], made[name], rtol=1e-15)
    text = out.read_text()
    assert text.splitlines()[0].startswith("time,temperature,sensor_torque,external_torque_sensor")
    assert text.splitlines()[0].endswith("contact,status") and text.splitlines()[1].endswith(",256")
    assert "1 contact: " in result.stdout and f"wrote {out}" in result.stdout


def test_several_runs_get_a_file_each_and_the_errors_beside_their_references(
    tmp_path: Path, run: Path, model: Path
) -> None:
    other = tmp_path / "other.csv"
    write_log(raw_log(800).with_facts({"name": "other"}), other)
    out, alone = tmp_path / "external", tmp_path / "alone.csv"
    result = call("estimate", "--model", model, run, other, "--out", out)
    assert result.exit_code == 0, result.stderr
    assert sorted(path.name for path in out.iterdir()) == ["other.csv", "run.csv"]
    one = call("estimate", "--model", model, other, "--out", alone)
    assert (out / "other.csv").read_bytes() == alone.read_bytes()
    assert one.stdout.removesuffix(f"wrote {alone}\n").strip() in result.stdout
    made = flexspline.estimate(Model.load(model), [run, other])
    assert result.stdout == f"{made}\n\nwrote run.csv, other.csv to {out}\n"
    assert f"{made.rmse['external_torque_merged']:.4g}" in result.stdout


def test_what_has_no_estimate_is_empty_and_its_row_stays(
    tmp_path: Path, run: Path, model: Path
) -> None:
    holed = write_holed(raw_log(1500), "motor_torque", tmp_path / "holed.csv")
    out = tmp_path / "external.csv"
    assert call("estimate", "--model", model, holed, "--out", out).exit_code == 0
    table = pandas.read_csv(out)
    assert len(table) == 1500
    assert np.flatnonzero(table["external_torque_observer"].isna()).tolist() == [7]
    assert np.flatnonzero(table["contact"].isna()).tolist() == [7]
    # the wave generator is twisted by the motor
    assert table["status"][7] == 16 + 32 + 64 + 128 + 256 + 512  # and it starts
    assert set(table["contact"].dropna()) <= {0, 1}


def test_columns_of_estimators_that_the_model_lacks_are_not_written(
    tmp_path: Path, run: Path
) -> None:
    joint(BY_MOTOR).save(tmp_path / "model.json")
    out = tmp_path / "external.csv"
    assert call("estimate", "--model", tmp_path / "model.json", run, "--out", out).exit_code == 0
    known = "time,temperature,sensor_torque,external_torque_sensor,external_torque_observer,status"
    assert out.read_text().splitlines()[0] == known


def test_facts_of_the_model_and_options_reach_the_run(tmp_path: Path, model: Path) -> None:
    log = without(raw_log(1000), "motor_torque", "output_velocity", "output_acceleration")
    columns = {**log.columns, "motor_current": raw_log(1000)["motor_torque"] / 0.1}
    write_log(Log(columns, {}), tmp_path / "run.csv")
    out = tmp_path / "external.csv"
    result = call(
        "estimate", "--model", model, tmp_path / "run.csv", "--out", out,
        "--torque-constant", 0.1, "--bandwidth", 60,
    )  # fmt: skip
    assert result.exit_code == 0, result.stderr
    assert "60 Hz" in result.stdout
    known = pandas.read_csv(out)["external_torque_observer"].notna()
    start = 10  # rows of 2 ms: 7 / (2π 60 Hz) are 18.6 ms, in which the filter starts
    assert known[start:].all() and not known[:start].any()


def wrong_calls(folder: Path, run: Path, model: Path) -> dict[str, tuple[list[object], str]]:
    Model({}).save(folder / "bare.json")
    joint(Observer(1500.0, discretisation="euler")).save(folder / "euler.json")
    joint(CALIBRATION).save(folder / "calibrated.json")
    write_log(without(raw_log(100), "sensor_voltage", "sensor_torque"), folder / "silent.csv")
    out = folder / "out.csv"
    return {
        "a model without estimators": (
            ["--model", folder / "bare.json", run, "--out", out],
            "nothing to estimate",
        ),
        "a gain that is not stable": (
            ["--model", folder / "euler.json", run, "--out", out],
            "below 1000 1/s",
        ),
        "a run that has nothing": (
            ["--model", folder / "calibrated.json", folder / "silent.csv", "--out", out],
            "external_torque_sensor",
        ),
        "a bandwidth of zero": (
            ["--model", model, run, "--out", out, "--bandwidth", 0],
            "no number above zero",
        ),
        "no model": (["--model", folder / "none.json", run, "--out", out], "none.json"),
        "the run itself as output": (["--model", model, run, "--out", run], "would overwrite"),
        "a file in the place of a folder": (
            ["--model", model, run, "--out", run / "out.csv"],
            "cannot be written",
        ),
    }


CASES = (
    "a model without estimators",
    "a gain that is not stable",
    "a run that has nothing",
    "a bandwidth of zero",
    "no model",
    "the run itself as output",
    "a file in the place of a folder",
)


@pytest.mark.parametrize("case", CASES)
def test_a_wrong_call_ends_with_2_one_line_and_no_file(
    tmp_path: Path, run: Path, model: Path, case: str
) -> None:
    arguments, word = wrong_calls(tmp_path, run, model)[case]
    before = run.read_bytes()
    result = call("estimate", *arguments)
    assert result.exit_code == 2
    assert word in result.stderr and result.stderr.count("\n") == 1, result.stderr
    assert not (tmp_path / "out.csv").exists() and run.read_bytes() == before


def test_an_old_file_stays_where_the_call_is_wrong(tmp_path: Path, run: Path) -> None:
    Model({}).save(tmp_path / "bare.json")
    out = tmp_path / "external.csv"
    out.write_text("old\n")
    assert call("estimate", "--model", tmp_path / "bare.json", run, "--out", out).exit_code == 2
    assert out.read_text() == "old\n"


def test_the_help_has_an_example_and_every_bit_of_the_status() -> None:
    text = " ".join(call("estimate", "--help").stdout.split())
    assert "flexspline estimate --model joint/model.json run3.csv --out external.csv" in text
    for bit, meaning in MEANING.items():
        assert f"{int(bit)} {' '.join(meaning.split())}"[:60] in text


def test_the_installed_command_does_the_same(tmp_path: Path, run: Path, model: Path) -> None:
    out = tmp_path / "external.csv"
    command = [sys.executable, "-m", "flexspline", "estimate", "--model", str(model), str(run)]
    done = subprocess.run(
        [*command, "--out", str(out)], capture_output=True, text=True, env=dict(os.environ)
    )
    assert done.returncode == 0 and done.stderr == ""
    assert len(out.read_text().splitlines()) == 1501


def test_estimate_takes_a_least_speed_and_strict_refuses_what_is_extrapolated(
    tmp_path: Path, run: Path, model: Path
) -> None:
    out = tmp_path / "external.csv"
    result = call("estimate", "--model", model, run, "--out", out, "--speed-above", 0.3)
    assert result.exit_code == 0, result.stderr
    assert "slower than 0.3 rad/s and left out" in result.stdout
    log = raw_log(800)
    hot = log.with_columns({"sensor_voltage": 1e4 * log["sensor_voltage"]}, note="overload")
    write_log(hot, tmp_path / "hot.csv")
    refused = tmp_path / "refused.csv"
    lines = ("estimate", "--model", model, tmp_path / "hot.csv", "--out", refused)
    result = call(*lines, "--strict")
    assert result.exit_code == 2 and "status" in result.stderr and not refused.exists()
    assert call(*lines).exit_code == 0


def test_strict_refuses_rows_outside_of_the_fit_in_the_sentence_of_predict(
    tmp_path: Path, run: Path
) -> None:
    """An angle in degrees gave 156 Nm from a sensor of 12 Nm, without a word."""
    made = joint(BY_MOTOR)
    drive = made.parts["drive"]
    ranges = {"validity": {"output_velocity": [-6.0, 6.0]}}
    made.with_part(replace(drive, record=ranges), {}).save(tmp_path / "model.json")
    log = raw_log(800)
    degrees = {name: np.degrees(log[name]) for name in ("output_position", "output_velocity")}
    write_log(log.with_columns(degrees, note="degrees"), tmp_path / "degrees.csv")
    out = tmp_path / "external.csv"
    lines = ("--model", tmp_path / "model.json", tmp_path / "degrees.csv", "--out", out)
    predicted = call("predict", *lines, "--target", "motor_torque", "--strict")
    result = call("estimate", *lines, "--strict")
    assert result.exit_code == predicted.exit_code == 2 and not out.exists()
    assert result.stderr == predicted.stderr and "800 rows lie outside" in result.stderr
    assert "800 rows lie outside" in " ".join(call("estimate", *lines).stdout.split())
    right = ("--model", tmp_path / "model.json", run, "--out", out)
    assert call("estimate", *right, "--strict").exit_code == 0
