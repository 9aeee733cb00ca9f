"""`flexspline check` by the contract, and the figure of the channels with what was found."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from checks_logs import sound_log
from cli_calls import call

import flexspline as fx
from flexspline.logs.read import write_log
from flexspline.plot.channels import plot_channels

SEED = 3


def written(folder: Path, log: fx.Log, name: str) -> Path:
    path = folder / f"{name}.csv"
    write_log(log.with_facts({"name": name}), path)
    return path


def holed(log: fx.Log) -> fx.Log:
    torque = log["sensor_torque"].copy()
    torque[100:140] = np.nan
    return log.with_columns({"sensor_torque": torque}, note="a hole")


def late(log: fx.Log) -> fx.Log:
    """The velocity 10 ms late: a fault that forbids no fit."""
    rows = round(0.01 * log.rate)
    velocity = np.roll(log["output_velocity"], rows)
    return log.with_columns({"output_velocity": velocity}, note="late").rows(slice(rows, None))


def test_a_sound_run_ends_with_zero_and_says_so(tmp_path: Path) -> None:
    result = call("check", written(tmp_path, sound_log(SEED), "run1"))
    assert result.exit_code == 0, result.stderr
    assert "run1: nothing found" in result.stdout
    assert "The run can be fitted: no error and no fault was found." in result.stdout


def test_an_error_ends_with_three_and_names_run_row_and_repair(tmp_path: Path) -> None:
    good = written(tmp_path, sound_log(SEED), "good")
    bad = written(tmp_path, holed(sound_log(SEED)), "bad")
    result = call("check", good, bad)
    assert result.exit_code == 3
    assert "No fit of bad can mean anything until the errors are repaired." in result.stdout
    assert "NaN or infinite in 40 rows, first in row 100. Ask for the repair" in result.stdout
    assert call("fit", bad, "--target", "sensor_torque", "--effects", "offset",
                "--out", tmp_path / "joint").exit_code == 2  # fmt: skip


def test_a_run_of_time_alone_is_not_said_to_be_fit_for_a_fit(tmp_path: Path) -> None:
    path = written(tmp_path, fx.Log.from_arrays(time=np.arange(100.0) / 100.0), "clock.csv")
    made = call("check", path)
    assert made.exit_code == 3
    assert "no channel but time is there" in made.stdout
    assert "can be fitted" not in made.stdout


def test_a_fault_ends_with_zero_but_is_no_clean_bill(tmp_path: Path) -> None:
    result = call("check", written(tmp_path, late(sound_log(SEED)), "run1"))
    assert result.exit_code == 0
    assert "Faults in run1 would be taken for physics" in result.stdout


def test_what_makes_nonsense_of_a_torsion_alone_forbids_its_fit_alone(tmp_path: Path) -> None:
    log = sound_log(SEED)
    log = log.with_columns({"motor_position": -log["motor_position"]}, note="reversed")
    run = written(tmp_path, log, "run1")
    assert call("check", run).exit_code == 0
    assert call("check", run, "--target", "torsion").exit_code == 3
    assert call("check", run, "--target", "motor_torque").exit_code == 0


def test_a_channel_that_an_effect_needs_is_missed(tmp_path: Path) -> None:
    log = sound_log(SEED)
    bare = fx.Log({k: v for k, v in log.columns.items() if k != "temperature"}, log.facts)
    run = written(tmp_path, bare, "run1")
    assert call("check", run).exit_code == 0
    result = call("check", run, "--effects", "temperature_drift")
    assert result.exit_code == 3 and "temperature_drift" in result.stdout


def test_wrong_calls_end_with_two(tmp_path: Path) -> None:
    run = written(tmp_path, sound_log(SEED), "run1")
    assert call("check", tmp_path / "none.csv").exit_code == 2
    assert call("check", run, "--effects", "stiction").exit_code == 2
    assert call("check", run, "--target", "torque").exit_code == 2


def test_folder_holds_numbers_and_a_page_with_a_figure_of_each_run(tmp_path: Path) -> None:
    runs = [written(tmp_path, sound_log(SEED), "run1"), written(tmp_path, holed(sound_log(4)), "b")]
    out = tmp_path / "deep" / "audit"
    assert call("check", *runs, "--out", out).exit_code == 3
    content = json.loads((out / "check.json").read_text())
    assert content["fit_forbidden"] and [r["name"] for r in content["runs"]] == ["run1", "b"]
    (found,) = (f for f in content["runs"][1]["findings"] if f["severity"] == "error")
    assert (found["name"], found["channel"], found["rows"]) == (
        "not_finite", "sensor_torque", [100, 140],
    )  # fmt: skip
    page = (out / "report.html").read_text()
    assert page.count("<svg") == 2 and content["verdict"] in page


def test_a_name_of_a_run_reaches_no_terminal_and_no_page_as_it_is(tmp_path: Path) -> None:
    log = sound_log(SEED).with_facts({"name": "a\x1b[31m<b>"})
    write_log(log, tmp_path / "run.csv")
    out = tmp_path / "audit"
    said = call("check", tmp_path / "run.csv", "--out", out)
    assert said.exit_code == 0 and "\x1b" not in said.stdout and "a" in said.stdout
    assert "<b>" not in (out / "report.html").read_text()


def test_rows_with_an_error_are_shaded_on_their_channel_alone() -> None:
    log = holed(sound_log(SEED))
    figure = plot_channels(log, fx.check(log))
    axes = dict(zip((n for n in log.channels if n != "time"), figure.axes, strict=True))
    time = log["time"]
    shaded = {name: list(ax.patches) for name, ax in axes.items()}
    assert [name for name, patches in shaded.items() if patches] == ["sensor_torque"]
    (mark,) = shaded["sensor_torque"]
    assert mark.get_x() <= time[100] and mark.get_x() + mark.get_width() >= time[139]
    assert axes["sensor_torque"].get_title(loc="right") == "not finite 40 rows"
    assert axes["sensor_torque"].get_ylabel() == "sensor torque\n[Nm]"


def test_a_finding_of_the_clock_is_in_every_panel() -> None:
    keep = np.ones(len(sound_log(SEED)), dtype=bool)
    keep[1500:1560] = False
    log = sound_log(SEED).rows(keep)
    figure = plot_channels(log, fx.check(log))
    assert all(len(ax.patches) == 1 for ax in figure.axes)
    assert "dropped samples 60 rows" in figure.axes[-1].get_xlabel()


@pytest.mark.parametrize("kind", ["backwards", "one row", "nothing finite", "time alone"])
def test_every_log_can_be_drawn(kind: str) -> None:
    log = sound_log(SEED)
    if kind == "backwards":
        log = log.with_columns({"time": log["time"][::-1].copy()}, note="backwards")
    elif kind == "one row":
        log = log.rows(slice(0, 1))
    elif kind == "nothing finite":
        log = log.with_columns({"sensor_torque": np.full(len(log), np.nan)}, note="dead")
    else:
        log = fx.Log({"time": log["time"]})
    figure = log.plot()
    figure.canvas.draw()
    assert len(figure.axes) == max(len(log.channels) - 1, 1)
    expected = "row" if kind in ("backwards", "one row") else "time [s]"
    assert figure.axes[-1].get_xlabel().startswith(expected)
