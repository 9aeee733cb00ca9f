"""`flexspline predict` and `flexspline convert` as the specification has them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas
import pytest
from cli_calls import call, fitted, small_rig, write_holed, write_runs
from click.testing import Result

import flexspline
from flexspline.logs.log import Log
from flexspline.logs.writing import write_log


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
    holed = write_holed(log, "sensor_torque", tmp_path / "run.csv")
    out = tmp_path / "out.csv"
    assert call("predict", "--model", model, holed, "--out", out).exit_code == 0
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


def several(folder: Path, model: Path, *more: object) -> tuple[list[Path], Path, Result]:
    """Predict both runs of the small rig into a folder: the runs, the folder, what was printed."""
    runs = write_runs(folder)
    out = folder / "predicted"
    return runs, out, call("predict", "--model", model, *runs, "--out", out, *more)


def test_several_runs_get_a_file_each_that_is_that_of_the_run_alone(
    tmp_path: Path, model: Path
) -> None:
    runs, out, result = several(tmp_path, model)
    assert result.exit_code == 0, result.stderr
    assert sorted(path.name for path in out.iterdir()) == [path.name for path in runs]
    for run in runs:
        alone = tmp_path / "alone.csv"
        assert call("predict", "--model", model, run, "--out", alone).exit_code == 0
        assert (out / run.name).read_bytes() == alone.read_bytes()
    assert result.stdout.endswith(f"wrote {', '.join(path.name for path in runs)} to {out}\n")


def test_the_pooled_error_is_that_of_all_rows_of_all_files(tmp_path: Path, model: Path) -> None:
    runs, out, result = several(tmp_path, model)
    residuals = [pandas.read_csv(out / run.name)["residual"] for run in runs]
    rmse = np.sqrt(np.mean(np.concatenate(residuals) ** 2))
    assert f"2 runs, RMSE {rmse:.4g} Nm over {sum(map(len, residuals))} rows" in result.stdout
    sizes = {run.stem: np.sqrt(np.mean(each**2)) for run, each in zip(runs, residuals, strict=True)}
    worst = max(sizes, key=lambda name: sizes[name])
    assert f"the worst run is {worst}: RMSE {sizes[worst]:.4g} Nm" in result.stdout


def test_a_folder_that_is_there_gets_the_file_of_one_run_too(tmp_path: Path, model: Path) -> None:
    run = write_runs(tmp_path)[0]
    (tmp_path / "out").mkdir()
    for out in (tmp_path / "out", f"{tmp_path / 'new'}/"):
        assert call("predict", "--model", model, run, "--out", out).exit_code == 0
        assert [path.name for path in Path(out).iterdir()] == [run.name]


def test_slow_rows_are_left_out_of_the_error_and_stay_in_the_file(
    tmp_path: Path, model: Path
) -> None:
    runs, out, both = several(tmp_path, model, "--speed-above", 0.3)
    one = tmp_path / "out.csv"
    result = call("predict", "--model", model, runs[0], "--speed-above", 0.3, "--out", one)
    assert result.exit_code == 0, result.stderr
    logs, table = [flexspline.read_log(run) for run in runs], pandas.read_csv(one)
    fast = np.abs(logs[0]["output_velocity"]) >= 0.3
    assert len(table) == len(logs[0]) and (out / runs[0].name).read_bytes() == one.read_bytes()
    rmse = np.sqrt(np.mean(table["residual"][fast] ** 2))
    said = f"RMSE {rmse:.4g} Nm over {fast.sum()} rows at 0.3 rad/s or more ({(~fast).sum()} slower"
    assert said in result.stdout
    slow = sum(int((np.abs(log["output_velocity"]) < 0.3).sum()) for log in logs)
    assert f"{slow} of {sum(map(len, logs))} rows are slower than 0.3 rad/s" in both.stdout


WRONG_FOLDERS = {
    "the name of a file": ("{one} {two} --out {folder}/out.csv", "is the name of a file"),
    "a file that is there": ("{one} {two} --out {model}", "is the name of a file"),
    "the folder of the runs": ("{one} {two} --out {folder}", "would overwrite"),
    "runs of one name": ("{one} {other} --out {folder}/new", "would be named"),
    "a run that is given twice": ("{one} {one} --out {folder}/new", "twice"),
    "a speed that no row has": (
        "{one} {two} --speed-above 99 --out {folder}/new",
        "the 2 logs: no row with a measured value moves at 99 rad/s or more, the fastest at",
    ),
    "a speed that no row of one run has": ("{one} --speed-above 99 --out {folder}/new", "log '"),
    "a speed below zero": ("{one} --speed-above -1 --out {folder}/new", "no number above zero"),
    "no run": ("--out {folder}/new", "RUN.csv"),
    "another number of simulations": (
        "{one} {two} --simulation {one} --out {folder}/new",
        "--simulation is given 1 time; give one for each of the 2 runs, in their order",
    ),
}


@pytest.mark.parametrize(("line", "says"), WRONG_FOLDERS.values(), ids=WRONG_FOLDERS.keys())
def test_a_wrong_call_of_several_runs_is_one_line_and_writes_nothing(
    line: str, says: str, tmp_path: Path, model: Path
) -> None:
    one, two = write_runs(tmp_path)
    other = tmp_path / "other" / one.name
    other.parent.mkdir()
    other.write_bytes(two.read_bytes())
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    given = line.format(one=one, two=two, other=other, folder=tmp_path, model=model)
    result = call("predict", "--model", model, *given.split())
    assert result.exit_code == 2
    assert says in result.stderr and result.stderr.count("\n") == 1, result.stderr
    after = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    assert after == before and not (tmp_path / "new").exists()


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


@pytest.mark.usefixtures("undrawn")
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
