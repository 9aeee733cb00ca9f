"""`flexspline calibrate`: what it writes, what it prints, and that it writes all or nothing."""

from __future__ import annotations

import re
from pathlib import Path

import calibration_logs as bench
import numpy as np
import pytest
from cli_calls import call

import flexspline
from flexspline.estimation import with_sensor_torque
from flexspline.logs.writing import write_log
from flexspline.model import Model


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("runs")
    paths = [folder / "load.csv", folder / "warmup.csv"]
    write_log(bench.load_run(), paths[0])
    write_log(bench.drift_run(cooling=True), paths[1])
    return paths


def test_calibrate_leaves_model_and_report_and_nothing_else(
    tmp_path: Path, runs: list[Path]
) -> None:
    out = tmp_path / "sensor"
    result = call("calibrate", *runs, "--full-scale", 70, "--out", out)
    assert result.exit_code == 0, result.stderr
    assert result.stderr == ""
    assert sorted(path.name for path in out.iterdir()) == ["model.json", "report.html"]
    made = flexspline.calibrate([flexspline.read_log(path) for path in runs], full_scale=70.0)
    assert str(made) in result.stdout
    assert Model.load(out / "model.json").estimators == made.model.estimators


@pytest.mark.usefixtures("undrawn")
def test_estimate_runs_with_what_calibrate_leaves(tmp_path: Path, runs: list[Path]) -> None:
    out = tmp_path / "sensor"
    assert call("calibrate", *runs, "--out", out).exit_code == 0
    log = flexspline.read_log(runs[0])
    read = flexspline.estimate(Model.load(out / "model.json"), log)["sensor_torque"]
    # bend 0.3, hysteresis 0.2, ripple 0.05 and noise of the rig
    assert np.sqrt(np.mean((read - log["reference_torque"]) ** 2)) < 0.3


@pytest.mark.usefixtures("undrawn")
def test_options_reach_the_calibration(tmp_path: Path, runs: list[Path]) -> None:
    out = tmp_path / "sensor"
    result = call(
        "calibrate", *runs, "--degree", 3, "--reference-temperature", 30, "--thermal-lag", 5,
        "--gradient", 0.01, "--sensitivity", 62.5, "--full-scale", 100, "--out", out,
    )  # fmt: skip
    assert result.exit_code == 0, result.stderr
    found = Model.load(out / "model.json").estimators
    compensation, calibration = found["temperature_compensation"], found["calibration"]
    assert isinstance(compensation, flexspline.TemperatureCompensation)
    assert isinstance(calibration, flexspline.Calibration)
    assert len(compensation.coefficients) == 3
    assert compensation.reference_temperature == 30.0
    assert (compensation.thermal_lag, compensation.gradient) == (5.0, 0.01)
    assert (calibration.sensitivity, calibration.full_scale) == (62.5, 100.0)


@pytest.mark.usefixtures("undrawn")
def test_into_updates_the_drift_of_a_model(tmp_path: Path, runs: list[Path]) -> None:
    first, second = tmp_path / "first", tmp_path / "second"
    assert call("calibrate", runs[0], "--degree", 0, "--out", first).exit_code == 0
    into = first / "model.json"
    result = call("calibrate", runs[1], "--reference", "none", "--into", into, "--out", second)
    assert result.exit_code == 0, result.stderr
    found = Model.load(second / "model.json").estimators
    assert set(found) == {"temperature_compensation", "calibration"}


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--reference", "sensor_torque"], "no run has the channel 'sensor_torque'"),
        (["--degree", "9"], "--degree"),
        (["--thermal-lag", "soon"], "'soon' is no number and not 'fit'"),
        (["--gradient", "fit"], "give thermal_lag as well"),
        (["--thermistor", "3.3:10000"], "SUPPLY:DIVIDER:NOMINAL:BETA"),
        (["--into", "nowhere.json"], "nowhere.json: cannot be read"),
        (["--reference-temperature", "1e200"], "is that of no sensor"),
    ],
)
def test_a_wrong_call_ends_with_2_and_one_line_and_no_folder(
    tmp_path: Path, runs: list[Path], arguments: list[str], says: str
) -> None:
    result = call("calibrate", *runs, *arguments, "--out", tmp_path / "out")
    assert result.exit_code == 2
    assert says in result.stderr and result.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("channel", "size", "says"),
    [
        ("reference_torque", None, "mapped twice"),
        ("reference_torque", 1e-200, "less than any torque sensor reads"),
        ("reference_torque", 1e-310, "less than any torque sensor reads"),
        ("reference_torque", 1e306, "cannot be"),
        ("sensor_voltage", 0.0, "in every row"),
        ("sensor_voltage", 1e306, "cannot be"),
    ],
)
def test_a_run_that_makes_no_calibration_ends_with_2_and_one_line_and_no_folder(
    tmp_path: Path, channel: str, size: float | None, says: str
) -> None:
    log = bench.load_run()
    values = log["sensor_voltage"] if size is None else size * log[channel]
    write_log(log.with_columns({channel: values}, note="changed"), tmp_path / "odd.csv")
    result = call("calibrate", tmp_path / "odd.csv", "--degree", 0, "--out", tmp_path / "out")
    assert result.exit_code == 2
    assert says in result.stderr and result.stderr.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["odd.csv"]


def test_runs_without_load_end_with_0_and_the_reason(tmp_path: Path, runs: list[Path]) -> None:
    result = call("calibrate", runs[1], "--out", tmp_path / "drift")
    assert result.exit_code == 0
    assert "the reference never leaves zero" in result.stdout
    assert Model.load(tmp_path / "drift" / "model.json").estimators == {}


PER_KELVIN = 1e-3  # by which the gain of a warmer bridge is larger, 1/K


@pytest.mark.usefixtures("undrawn")
def test_a_gain_that_changes_with_temperature_is_fitted_by_the_command_that_is_named(
    tmp_path: Path,
) -> None:
    paths = []
    for number, warmth in enumerate((15.0, 25.0, 40.0)):
        log = bench.load_run(bench.QUIET, seed=number, count=1, temperature=warmth)
        more = PER_KELVIN * (log["temperature"] - 25.0) * log["reference_torque"]
        voltage = log["sensor_voltage"] + more / bench.SENSITIVITY
        paths.append(tmp_path / f"at{warmth:.0f}.csv")
        write_log(log.with_columns({"sensor_voltage": voltage}, note="a warmer bridge"), paths[-1])
    first, second = tmp_path / "first", tmp_path / "second"
    told = " ".join(call("calibrate", *paths, "--out", first).stdout.split())
    named = re.search(r"flexspline fit RUN\.csv\.\.\. (.*?) \(with the runs", told)
    assert named is not None
    given = named[1].replace("DIR2", str(second)).replace("DIR/", f"{first}/").split()
    made = call("fit", *paths, *given)
    assert made.exit_code == 0, made.stderr
    (gain,) = (
        row["value"]
        for row in Model.load(second / "model.json").part("sensor_torque").record["parameters"]
        if row["name"] == "gain_temperature_dependence.gain"
    )
    assert gain == pytest.approx(PER_KELVIN, rel=0.05)
    wrong = {}
    for folder in (first, second):
        model = Model.load(folder / "model.json")
        left = [
            flexspline.estimate(model, log)["external_torque_sensor"] - log["reference_torque"]
            for log in map(flexspline.read_log, paths)
        ]
        wrong[folder] = np.sqrt(np.mean(np.concatenate(left) ** 2))
    assert wrong[second] < 0.2 * wrong[first]


def test_a_torque_that_was_recorded_is_not_read_from_the_voltage_again() -> None:
    log = bench.load_run()
    model = flexspline.calibrate([log, bench.drift_run(cooling=True)], full_scale=70.0).model
    recorded = log.with_columns({"sensor_torque": log["reference_torque"]}, note="recorded")
    assert with_sensor_torque(model, recorded) is recorded
    assert with_sensor_torque(Model({}, {}), log) is log
    made = with_sensor_torque(model, log)
    assert np.array_equal(made["sensor_torque"], flexspline.estimate(model, log)["sensor_torque"])
