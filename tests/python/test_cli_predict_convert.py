"""`flexspline predict` and `flexspline convert` as the specification has them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas
import pytest
from cli_calls import call, fitted, small_rig, write_runs

import flexspline
from flexspline.logs.log import Log
from flexspline.logs.read import write_log


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("joint")
    return fitted(folder, write_runs(folder)) / "model.json"


def test_measured_and_residual_are_empty_where_the_run_lacks_them(
    tmp_path: Path, model: Path
) -> None:
    log = small_rig().logs[0]
    columns = {name: log[name] for name in log.channels if name != "sensor_torque"}
    write_log(Log(columns, log.facts), tmp_path / "run.csv")
    out = tmp_path / "out.csv"
    result = call("predict", "--model", model, tmp_path / "run.csv", "--out", out)
    assert result.exit_code == 0, result.stderr
    lines = out.read_text().splitlines()
    assert lines[0] == "time,measured,predicted,residual"
    assert len(lines) == len(log) + 1
    assert all(line.split(",")[1] == "" and line.endswith(",") for line in lines[1:])
    assert pandas.read_csv(out)["predicted"].notna().all()


def test_rows_without_a_reading_stay_rows(tmp_path: Path, model: Path) -> None:
    log = small_rig().logs[0]
    torque = log["sensor_torque"].copy()
    torque[7] = np.nan
    write_log(log.with_columns({"sensor_torque": torque}, note="gap"), tmp_path / "run.csv")
    out = tmp_path / "out.csv"
    assert call("predict", "--model", model, tmp_path / "run.csv", "--out", out).exit_code == 0
    table = pandas.read_csv(out)
    assert len(table) == len(log)
    assert np.flatnonzero(table["residual"].isna()).tolist() == [7]
    assert table["predicted"].notna().all()


def test_a_low_pass_acts_on_both_sides(tmp_path: Path, model: Path) -> None:
    run = write_runs(tmp_path)[0]
    out = tmp_path / "out.csv"
    result = call("predict", "--model", model, run, "--lowpass", 5, "--out", out)
    assert result.exit_code == 0, result.stderr
    expected = flexspline.Model.load(model).predict(flexspline.read_log(run), lowpass_hz=5.0)
    np.testing.assert_allclose(pandas.read_csv(out)["residual"], expected.residual, atol=1e-12)


def test_a_run_without_facts_takes_those_of_the_model(tmp_path: Path, model: Path) -> None:
    log = small_rig().logs[0]
    write_log(Log(dict(log.columns), {}), tmp_path / "run.csv")
    out = tmp_path / "out.csv"
    assert call("predict", "--model", model, tmp_path / "run.csv", "--out", out).exit_code == 0


def test_convert_turns_a_foreign_table_into_a_run(tmp_path: Path) -> None:
    foreign = tmp_path / "foreign.txt"
    foreign.write_text("ms;deg;mNm\n0;0;1000\n10;180;500\n20;360;-250\n")
    columns = tmp_path / "map.toml"
    columns.write_text(
        '[columns]\ntime = {source = "ms", unit = "ms"}\n'
        'output_position = {source = "deg", unit = "deg"}\n'
        'sensor_torque = {source = 2, unit = "mNm", sign = -1}\n'
    )
    out = tmp_path / "run.csv"
    result = call("convert", foreign, "--columns", columns, "--gear-ratio", 50, "--out", out)
    assert result.exit_code == 0, result.stderr
    log = flexspline.read_log(out)
    np.testing.assert_allclose(log["time"], [0.0, 0.01, 0.02])
    np.testing.assert_allclose(log["output_position"], [0.0, np.pi, 2 * np.pi])
    np.testing.assert_allclose(log["sensor_torque"], [-1.0, -0.5, 0.25])
    assert log.facts["gear_ratio"] == 50


def test_fit_reads_a_foreign_file_by_a_map(tmp_path: Path) -> None:
    log = small_rig().logs[0]
    table = pandas.DataFrame({"q": np.rad2deg(log["output_position"]), "tau": log["sensor_torque"]})
    table.to_csv(tmp_path / "foreign.csv", index=False)
    (tmp_path / "map.toml").write_text(
        '[columns]\noutput_position = {source = "q", unit = "deg"}\nsensor_torque = "tau"\n'
    )
    result = call(
        "fit", tmp_path / "foreign.csv", "--columns", tmp_path / "map.toml", "--rate", 200,
        "--target", "sensor_torque", "--effects", "offset,coulomb_friction",
        "--out", tmp_path / "joint",
    )  # fmt: skip
    assert result.exit_code == 0, result.stderr
