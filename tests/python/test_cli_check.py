"""`flexspline check` by the contract, and the figure of the channels with what was found."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from checks_logs import sound_log
from cli_calls import call
from figure_layout import page_faults
from matplotlib.axes import Axes
from undrawn import undrawn

import flexspline as fx
from flexspline.logs.writing import write_log
from flexspline.plot.canvas import PlainFigure
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


def test_a_gap_that_nothing_bridges_is_not_to_be_repaired(tmp_path: Path) -> None:
    """A fit takes what lies beside it apart: it is no physics, and there is no repair."""
    log = sound_log(SEED)
    gap = log.rows(np.r_[0 : len(log) // 3, len(log) // 2 : len(log)])
    result = call("check", written(tmp_path, gap, "gap"))
    said = " ".join(result.stdout.split())
    assert "more than 2.5 steps apart and needs no repair; the repair resample=Hz closes" in said
    assert "The run can be fitted: no error and no fault was found but missing rows." in said
    both = call("check", written(tmp_path, late(gap), "both"))
    assert "would be taken for physics; do what is said of each first." in both.stdout


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
    assert page_faults(out / "report.html") == []


def test_runs_that_excite_an_effect_together_alone_are_said_to(tmp_path: Path) -> None:
    log = sound_log(SEED, duration=8.0)
    warmer = log.with_columns({"temperature": log["temperature"] * 0.1 + 30.0}, note="warm")
    cold = log.with_columns({"temperature": log["temperature"] * 0.1}, note="cold")
    runs = [written(tmp_path, warmer, "warm"), written(tmp_path, cold, "cold")]
    made = call("check", *runs, "--effects", "temperature_drift,time_drift", "--json")
    content = json.loads(made.stdout)
    assert [one["excited"] for one in content["excited"]] == [True, False]
    assert [[one["excited"] for one in run["excited"]] for run in content["runs"]] == [
        [False, False], [False, False],
    ]  # fmt: skip
    said = call("check", *runs, "--effects", "temperature_drift,time_drift").stdout
    assert "what the 2 runs excite, taken together:" in said
    assert "time_drift: the run lasts 8 s. Record 60 s or more." in " ".join(said.split())


def test_of_runs_with_errors_nothing_is_said_to_be_excited(tmp_path: Path) -> None:
    bad = written(tmp_path, holed(sound_log(SEED)), "bad")
    good = written(tmp_path, sound_log(SEED), "good")
    assert "excited" not in call("check", bad).stdout
    out = tmp_path / "audit"
    with undrawn():
        made = call("check", bad, good, "--out", out)
    content = json.loads((out / "check.json").read_text())
    assert content["runs"][0]["excited"] == [] and content["excited"]
    assert "what the run without errors excites, taken together" in made.stdout


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


def test_a_run_that_is_there_twice_can_not_be_fitted_and_says_which(tmp_path: Path) -> None:
    first = written(tmp_path, sound_log(SEED), "run1")
    other = written(tmp_path, sound_log(SEED + 1), "run2")
    again = tmp_path / "again.csv"
    again.write_bytes(first.read_bytes())
    assert call("check", first, other).exit_code == 0
    result = call("check", first, other, again, "--json")
    runs = json.loads(result.stdout)["runs"]
    assert result.exit_code == 3
    assert [[f["name"] for f in run["findings"]] for run in runs] == [[], [], ["copy_of_a_run"]]
    assert f"'run1' ({first})" in runs[2]["findings"][0]["sentence"]


def channel_axes(figure: PlainFigure, log: fx.Log) -> list[Axes]:
    """Return the axes of the channels; those of the effects come behind them."""
    return figure.axes[: max(len(log.channels) - 1, 1)]


def test_a_gap_is_shaded_where_no_sample_is_in_every_panel_and_the_line_is_broken() -> None:
    keep = np.ones(len(sound_log(SEED)), dtype=bool)
    keep[1500:1560] = False
    log = sound_log(SEED).rows(keep)
    figure = plot_channels(log, fx.check(log))
    before, behind = log["time"][1499], log["time"][1500]
    for ax in channel_axes(figure, log):
        (mark,) = ax.patches
        assert (mark.get_x(), mark.get_x() + mark.get_width()) == pytest.approx((before, behind))
        assert np.count_nonzero(np.isnan(ax.lines[0].get_xdata())) == 1
    assert figure.get_suptitle().endswith("\ndropped samples 60 rows")
    assert channel_axes(figure, log)[-1].get_xlabel() == "time [s]"
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["no samples"]


def test_single_rows_here_and_there_do_not_shade_all_that_lies_between() -> None:
    log = sound_log(SEED)
    again = np.arange(len(log))
    again[200:1800:80] -= 1  # 20 rows that repeat the one before
    channels = {name: log[name] if name == "time" else log[name][again] for name in log.channels}
    log = fx.Log.from_arrays(facts=log.facts, **channels)
    found = fx.check(log)
    (fault,) = found.named("repeated_rows")
    assert fault.size == 20.0 and fault.rows[1] - fault.rows[0] > 1500
    figure = plot_channels(log, found)
    assert [ax for ax in channel_axes(figure, log) if ax.patches] == []
    assert "repeated rows 20 rows" in figure.get_suptitle()


def test_thousands_of_gaps_are_drawn_as_few_marks() -> None:
    log = sound_log(SEED)
    lost = log.rows(np.arange(len(log)) % 40 != 7)
    figure = plot_channels(lost, fx.check(lost))
    assert 0 < len(figure.axes[0].patches) <= 340  # as many as have room, each 0.3 % wide


def test_the_figure_marks_which_effects_the_run_excites() -> None:
    log = sound_log(SEED)
    found = fx.check(log)
    panel = plot_channels(log, found).axes[-1]
    told = [one for one in found.excited if one.excited is not None]
    assert [t.get_text() for t in panel.texts] == [one.effect.replace("_", " ") for one in told]
    full = [len(mark.get_facecolor()) == 1 for mark in panel.collections]
    assert full == [one.excited for one in told] and {True, False} == set(full)


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
    axes = channel_axes(figure, log)
    assert len(figure.axes) == len(axes) + (kind == "one row")  # others have errors
    expected = "row" if kind in ("backwards", "one row") else "time [s]"
    assert axes[-1].get_xlabel().startswith(expected)
