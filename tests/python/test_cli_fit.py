"""`flexspline fit`: what it writes, what it prints, and that it writes all or nothing."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas
import pytest
from cli_calls import EFFECTS, call, fitted, small_rig, write_runs

import flexspline
from flexspline.least_squares.result import Fit
from flexspline.logs.writing import write_log
from flexspline.model import Model


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    return write_runs(tmp_path_factory.mktemp("runs"))


def fit_arguments(runs: list[Path], out: Path) -> list[object]:
    return ["fit", *runs, "--target", "sensor_torque", "--effects", EFFECTS, "--out", out]


def test_fit_leaves_model_and_report_and_nothing_else(tmp_path: Path, runs: list[Path]) -> None:
    out = tmp_path / "joint"
    result = call(*fit_arguments(runs, out))
    assert result.exit_code == 0, result.stderr
    assert sorted(path.name for path in out.iterdir()) == ["model.json", "report.html"]
    assert list(tmp_path.iterdir()) == [out]
    report = (out / "report.html").read_text(encoding="utf-8")
    assert report.lstrip().lower().startswith("<!doctype")


@pytest.mark.usefixtures("undrawn")
def test_fit_prints_the_verdict_on_stdout_alone(tmp_path: Path, runs: list[Path]) -> None:
    result = call(*fit_arguments(runs, tmp_path / "joint"))
    expected = flexspline.fit(
        EFFECTS.split(","), [flexspline.read_log(path) for path in runs], "sensor_torque"
    )
    assert str(expected) in result.stdout
    assert result.stderr == ""


def test_what_fit_leaves_out_predict_reproduces_to_the_last_bit(
    tmp_path: Path, runs: list[Path]
) -> None:
    out = fitted(tmp_path, runs)
    made = flexspline.fit(
        EFFECTS.split(","), [flexspline.read_log(path) for path in runs], "sensor_torque"
    )
    for path, run in zip(runs, made.runs, strict=True):
        found = tmp_path / "residual.csv"
        result = call("predict", "--model", out / "model.json", path, "--out", found)
        assert result.exit_code == 0, result.stderr
        table = pandas.read_csv(found, float_precision="round_trip")  # by itself since pandas 3
        assert list(table.columns) == ["time", "measured", "predicted", "residual"]
        np.testing.assert_array_equal(table["measured"], run.measured)
        np.testing.assert_allclose(table["residual"], run.residual, rtol=0, atol=1e-12)


@pytest.mark.usefixtures("undrawn")
def test_no_effect_at_all_is_a_fit(tmp_path: Path, runs: list[Path]) -> None:
    result = call(
        "fit", *runs, "--target", "sensor_torque", "--effects", "none", "--out", tmp_path / "n"
    )
    assert result.exit_code == 0, result.stderr
    assert Model.load(tmp_path / "n" / "model.json").part().effects == ()
    page = (tmp_path / "n" / "report.html").read_text(encoding="utf-8")
    for said in (result.stdout, page):
        assert "No coefficient was fitted" in said
        assert "parameters in this noise" not in said and "errors to hold" not in said
    assert "determine every coefficient" not in page


@pytest.mark.usefixtures("undrawn")
def test_orders_fixed_values_bounds_and_priors_reach_the_model(
    tmp_path: Path, runs: list[Path]
) -> None:
    result = call(
        "fit", *runs, "--target", "sensor_torque", "--effects", f"{EFFECTS},output_ripple",
        "--orders", "output_ripple=1,2", "--fix", "inertia=0.019", "--bound",
        "viscous_friction=0:", "--prior", "coulomb_friction=0.3:0.1", "--robust",
        "--threads", 2, "--out", tmp_path / "joint",
    )  # fmt: skip
    assert result.exit_code == 0, result.stderr
    part = Model.load(tmp_path / "joint" / "model.json").part()
    states = {p["name"]: (p["value"], p["state"], p["prior"]) for p in part.record["parameters"]}
    assert part.effects[-1].harmonics == ((1, "output_on_housing"), (2, "output_on_housing"))
    assert states["inertia.inertia"][:2] == (0.019, "fixed")
    assert states["viscous_friction.viscosity"][0] >= 0.0
    assert states["coulomb_friction.level"][2] == [0.3, 0.1]


def test_options_overrule_the_facts_of_the_file(tmp_path: Path, runs: list[Path]) -> None:
    out = fitted(tmp_path, runs, "--output-spline", "flex", "--pole-pairs", 10)
    facts = Model.load(out / "model.json").facts
    assert (facts["output_spline"], facts["pole_pairs"]) == ("flex", 10)


@pytest.mark.usefixtures("undrawn")
def test_into_keeps_the_other_part_and_adds_this_one(tmp_path: Path, runs: list[Path]) -> None:
    sensor = fitted(tmp_path, runs) / "model.json"
    driven = []
    for log in small_rig().logs:
        current = 0.5 * log["sensor_torque"]
        driven.append(tmp_path / f"drive_{log.name}.csv")
        write_log(log.with_columns({"motor_current": current}, note="drive"), driven[-1])
    result = call(
        "fit", *driven, "--target", "motor_torque", "--torque-constant", "0.05", "--effects",
        "offset,coulomb_friction,viscous_friction", "--into", sensor, "--out", tmp_path / "both",
    )  # fmt: skip
    assert result.exit_code == 0, result.stderr
    both = Model.load(tmp_path / "both" / "model.json")
    assert set(both.parts) == {"sensor", "drive"}
    out = tmp_path / "drive.csv"
    asked = ("predict", "--model", tmp_path / "both" / "model.json", driven[0], "--out", out)
    assert call(*asked).exit_code == 2  # two parts: which?
    assert call(*asked, "--target", "motor_torque").exit_code == 0
    measured = pandas.read_csv(out)["measured"]  # Ñ K i, with the constant that the model keeps
    reading = small_rig().logs[0]["sensor_torque"]
    np.testing.assert_allclose(measured, 101.0 * 0.05 * 0.5 * reading, rtol=1e-12)


def test_a_report_that_fails_leaves_no_folder(
    tmp_path: Path, runs: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(self: Fit, path: Path) -> None:
        raise RuntimeError("no ink")

    monkeypatch.setattr(Fit, "report", broken)
    result = call(*fit_arguments(runs, tmp_path / "new" / "joint"))
    assert result.exit_code == 1
    assert "defect" in result.stderr and "no ink" in result.stderr
    assert result.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_a_report_that_fails_leaves_an_older_folder_as_it_was(
    tmp_path: Path, runs: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    out = fitted(tmp_path, runs)
    (out / "notes.txt").write_text("mine")
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    monkeypatch.setattr(Fit, "report", lambda self, path: path.unlink())
    assert call(*fit_arguments(runs[:1], out)).exit_code != 0
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before
    assert list(tmp_path.iterdir()) == [out]


def test_a_second_fit_replaces_its_files_and_keeps_others(tmp_path: Path, runs: list[Path]) -> None:
    out = fitted(tmp_path, runs)
    (out / "notes.txt").write_text("mine")
    old = (out / "model.json").read_bytes()
    fitted(tmp_path, runs[:1])
    assert (out / "notes.txt").read_text() == "mine"
    assert (out / "model.json").read_bytes() != old
    assert list(tmp_path.iterdir()) == [out]


SLOW = """
import signal, sys, time
signal.signal(signal.SIGINT, signal.default_int_handler)  # a background job starts without it
from flexspline.least_squares.result import Fit
def slow(self, path):
    path.write_text("half")
    print("writing", flush=True)
    time.sleep(60)
Fit.report = slow
from flexspline.cli import main
sys.argv[0] = "flexspline"
main()
"""


@pytest.mark.parametrize("sent", [signal.SIGKILL, signal.SIGINT])
def test_a_process_ended_half_way_leaves_the_old_model(
    tmp_path: Path, runs: list[Path], sent: signal.Signals
) -> None:
    out = fitted(tmp_path, runs)
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    arguments = [str(a) for a in fit_arguments(runs[:1], out)]
    process = subprocess.Popen(
        [sys.executable, "-c", SLOW, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        text=True, env=os.environ,
    )  # fmt: skip
    assert process.stdout is not None
    assert process.stdout.readline() == "writing\n"
    time.sleep(0.1)
    process.send_signal(sent)
    _, said = process.communicate(timeout=30)
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before
    if sent == signal.SIGINT:
        assert process.returncode == 130
        assert said.count("\n") == 1
        assert list(tmp_path.iterdir()) == [out]


@pytest.mark.usefixtures("undrawn")
def test_two_processes_that_write_to_one_folder_leave_a_whole_model(
    tmp_path: Path, runs: list[Path]
) -> None:
    out, alone = tmp_path / "joint", []
    for number in (1, 2):
        assert call(*fit_arguments(runs[:number], tmp_path / f"{number}")).exit_code == 0
        alone.append((tmp_path / f"{number}" / "model.json").read_bytes())
    both = [
        subprocess.Popen(
            [sys.executable, "-m", "flexspline", *map(str, fit_arguments(runs[:number], out))],
            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
        )
        for number in (1, 2)
    ]  # fmt: skip
    for process in both:
        _, said = process.communicate(timeout=120)
        assert process.returncode == 0 or (process.returncode == 2 and said.count("\n") == 1), said
    assert (out / "model.json").read_bytes() in alone
    assert not list(tmp_path.glob(".*"))
