"""`flexspline track`: models or runs of one joint, by date, to track.json and a report."""

from __future__ import annotations

import gzip
import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from cli_calls import call
from figure_layout import figure_faults, page_faults
from fit_logs import FRICTION, HELD, WIDTH, autoregressive, friction, motion, simulated
from worn_joints import NAMES, ramp, worn_history

import flexspline
from flexspline import InputError, Model
from flexspline.logs.log import Log
from flexspline.logs.writing import write_log
from flexspline.tracking import History, history_of, track

EFFECTS = "offset,coulomb_friction,viscous_friction,inertia"
COUNT, ONSET = 14, 8


def date(week: int) -> str:
    return str(np.datetime64("2027-01-04") + 7 * week)


@cache
def runs() -> tuple[Log, ...]:
    """Fourteen weeks of a joint whose Coulomb friction doubles in the ninth."""
    found = []
    for week in range(COUNT):
        generator = np.random.default_rng([week, 5])
        worn = FRICTION * np.array([1.0, 2.0 if week >= ONSET else 1.0, 1.0, 1.0])
        worn = worn * (1.0 + 0.01 * generator.normal(size=4))
        noise = autoregressive(generator, 1000)
        warm = np.full(1000, 20.0 + 2.0 * np.sin(week))
        name = f"run {week}"
        log = simulated(friction(), worn, motion(week, 1000), noise, name, temperature=warm)
        found.append(log.with_facts({"date": date(week)}))
    return tuple(found)


@cache
def history() -> History:
    return history_of(runs(), target="sensor_torque", effects=EFFECTS.split(","), fixed=HELD)


def write_all(folder: Path, dated: bool = True) -> Path:
    for week, log in enumerate(runs()):
        plain = Log(log.columns, {k: v for k, v in log.facts.items() if k != "date"})
        write_log(plain, folder / (f"{date(week)}.csv" if dated else f"w{week}.csv"))
    return folder


def write_models(folder: Path, count: int = COUNT, **more) -> list[Path]:
    paths = []
    for week, log in enumerate(runs()[:count]):
        made = flexspline.fit(EFFECTS.split(","), log, "sensor_torque", fixed=HELD, checks=False)
        paths.append(folder / f"joint {date(week)}.json")
        made.model.save(paths[-1])
    return paths


def test_runs_become_a_history_by_date() -> None:
    made = history()
    assert len(made) == COUNT
    assert made.target == "sensor_torque"
    velocity = made.ranges["output_velocity"]
    assert velocity.shape == (COUNT, 2) and (velocity[:, 0] < velocity[:, 1]).all()
    assert made.names == (
        "offset.offset", "coulomb_friction.level", "viscous_friction.viscosity", "inertia.inertia",
    )  # fmt: skip
    assert np.isfinite(made.values).all()
    assert np.isfinite(made.covariance).all()
    assert made.temperatures[0] == pytest.approx(20.0)
    (change,) = track(made).changes
    assert change.causes == ("coulomb_friction.level",)
    assert change.sentence.startswith("coulomb_friction rose")
    assert change.needs == "a look at its lubricant and bearings"


def test_the_command_writes_what_the_call_tells(tmp_path: Path) -> None:
    data = tmp_path / "runs"
    data.mkdir()
    write_all(data)
    result = call(
        "track", data, "--target", "sensor_torque", "--effects", EFFECTS, "--fix",
        f"direction_width={WIDTH}", "--limit", "coulomb_friction=2", "--out", tmp_path / "out",
        "--json",
    )  # fmt: skip
    assert result.exit_code == 0, result.stderr
    said = json.loads(result.stdout)
    written = json.loads((tmp_path / "out" / "track.json").read_text())
    assert said["changes"] == written["changes"]
    assert [c["causes"] for c in written["changes"]] == [["coulomb_friction.level"]]
    assert len(written["sessions"]) == COUNT
    assert written["forecasts"][0]["parameter"] == "coulomb_friction.level"
    assert page_faults(tmp_path / "out" / "report.html") == []
    page = (tmp_path / "out" / "report.html").read_text()
    assert "coulomb_friction rose" in page


@pytest.mark.usefixtures("undrawn")
def test_models_of_each_session_tell_the_same(tmp_path: Path) -> None:
    paths = write_models(tmp_path)
    made = history_of(paths)
    at = [made.names.index(name) for name in history().names]
    assert made.values[:, at] == pytest.approx(history().values, rel=1e-6)
    result = call("track", *paths, "--out", tmp_path / "out")
    assert result.exit_code == 0, result.stderr
    assert "coulomb_friction rose" in result.stdout
    assert "wrote track.json and report.html" in result.stdout


def test_a_table_gives_dates_and_temperatures(tmp_path: Path) -> None:
    paths = write_models(tmp_path, 3)
    table = tmp_path / "dates.csv"
    rows = [f"{path.name},2026-05-0{k + 1},{20 + k}" for k, path in enumerate(paths)]
    table.write_text("run,date,temperature\n" + "\n".join(rows) + "\n")
    made = history_of(paths, dates=table)
    assert [str(each)[:10] for each in made.dates] == ["2026-05-01", "2026-05-02", "2026-05-03"]
    assert made.temperatures == pytest.approx([20.0, 21.0, 22.0])
    table.write_text("run,date\nm,yesterday\n")
    with pytest.raises(InputError, match="line 2: has no run or no date"):
        history_of(paths, dates=table)


def test_a_run_that_cannot_be_fitted_is_left_out_and_told() -> None:
    first = runs()[0]
    still = np.zeros(len(first))
    broken = Log(
        {**first.columns, "output_velocity": still, "output_acceleration": still,
         "output_position": still, "sensor_torque": np.full(len(first), np.nan)},
        {**first.facts, "name": "broken"},
    )  # fmt: skip
    made = history_of(
        [*runs()[:9], broken], target="sensor_torque", effects=EFFECTS.split(","), fixed=HELD
    )
    assert len(made) == 9
    assert any(remark.startswith("broken is left out") for remark in made.remarks)


@pytest.mark.usefixtures("undrawn")
def test_files_that_cannot_be_read_are_left_out_and_told(tmp_path: Path) -> None:
    data = tmp_path / "runs"
    data.mkdir()
    write_all(data)
    (data / "2026-12-01.csv").touch()
    (data / "2027-02-03.csv").write_bytes(bytes(range(256)) * 20)
    result = call(
        "track", data, "--target", "sensor_torque", "--effects", EFFECTS, "--out", tmp_path / "out"
    )
    assert result.exit_code == 0, result.stderr
    written = json.loads((tmp_path / "out" / "track.json").read_text())
    assert len(written["sessions"]) == COUNT
    for name, why in (("2026-12-01", "the file is empty"), ("2027-02-03", "not a text file")):
        (said,) = [each for each in written["remarks"] if each.startswith(f"{name} is left out: ")]
        assert why in said
    made = history_of(data, target="sensor_torque", effects=EFFECTS.split(","))
    assert not any("differ" in remark for remark in made.remarks)  # shapes of the first are held
    for log in data.glob("2027-0[1-4]-*"):
        log.write_bytes(b"")
    with pytest.raises(InputError, match=r"2026-12-01\.csv: the file is empty"):
        history_of(data, target="sensor_torque", effects=EFFECTS.split(","))


def test_models_that_cannot_be_read_are_left_out_and_told(tmp_path: Path) -> None:
    paths = write_models(tmp_path, 3)
    paths[1].write_text(paths[1].read_text()[:3000])
    (tmp_path / "joint 2027-02-01.json").touch()
    for given in (tmp_path, sorted(tmp_path.iterdir())):
        made = history_of(given)
        assert made.labels == ("joint 2027-01-04", "joint 2027-01-18")
        for label in ("joint 2027-01-11", "joint 2027-02-01"):
            assert any(said.startswith(f"{label} is left out: ") for said in made.remarks)


@pytest.mark.parametrize("name", ["copy.csv", "2027-01-09.csv", "2027-01-04 again.csv.gz"])
def test_a_run_that_is_given_twice_counts_once(tmp_path: Path, name: str) -> None:
    for week, log in enumerate(runs()[:2]):
        write_log(log, tmp_path / f"{date(week)}.csv")
    content = (tmp_path / "2027-01-04.csv").read_bytes()
    (tmp_path / name).write_bytes(gzip.compress(content) if name.endswith(".gz") else content)
    made = history_of(tmp_path, target="sensor_torque", effects=EFFECTS.split(","), fixed=HELD)
    assert made.labels == ("2027-01-04", "2027-01-11")
    run = name.partition(".")[0]
    assert [said for said in made.remarks if "counts once" in said] == [
        f"{run} is left out: it holds the same as the session 2027-01-04, and a session counts "
        "once; give the right file if it was another one"
    ]


def test_a_model_that_is_given_twice_counts_once(tmp_path: Path) -> None:
    first, _ = write_models(tmp_path, 2)
    (tmp_path / "joint 2027-01-05.json").write_bytes(first.read_bytes())
    other = first.read_text().replace('"made_by": "', '"made_by": "another ')
    (tmp_path / "joint 2027-01-04_b.json").write_text(other)
    made = history_of(tmp_path)
    assert made.labels == ("joint 2027-01-04", "joint 2027-01-11")
    assert sum("counts once" in said for said in made.remarks) == 2


def test_sessions_of_one_day_are_two(tmp_path: Path) -> None:
    for week, log in enumerate(runs()[:2]):
        write_log(log, tmp_path / f"2027-01-04 {week}.csv")
    made = history_of(tmp_path, target="sensor_torque", effects=EFFECTS.split(","), fixed=HELD)
    assert len(made) == 2
    assert not any("counts once" in said for said in made.remarks)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--effects", EFFECTS), "say which target is explained"),
        (("--target", "sensor_torque"), "give either a model or effects"),
        (("--effects", EFFECTS, "--target", "sensor_torque"), "has no date"),
        (("--model", "m.json", "--effects", EFFECTS), "give one of them"),
        (("--effects", EFFECTS, "--limit", "x"), "is not written NAME=VALUE"),
        (("--effects", EFFECTS, "--horizon", "0"), "Invalid value for '--horizon'"),
    ],
)
def test_a_wrong_call_ends_with_a_sentence(tmp_path: Path, arguments: tuple, said: str) -> None:
    write_all(tmp_path, dated=False)
    result = call("track", tmp_path / "w0.csv", *arguments, "--out", tmp_path / "out")
    assert result.exit_code == 2
    assert said in result.stderr
    assert len(result.stderr.splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_models_and_runs_are_not_mixed(tmp_path: Path) -> None:
    (model,) = write_models(tmp_path, 1)
    with pytest.raises(InputError, match=r"is no model, and .* is one"):
        history_of([model, runs()[0]])


def test_models_of_two_joints_are_not_one(tmp_path: Path) -> None:
    paths = write_models(tmp_path, 2)
    for path, joint in zip(paths, ("elbow", "wrist"), strict=True):
        model = Model.load(path)
        replace(model, facts={**model.facts, "joint": joint}).save(path)
    with pytest.raises(InputError, match="of 2 joints"):
        history_of(paths)


def test_runs_of_another_gear_than_the_model_are_refused_as_predict_does(tmp_path: Path) -> None:
    (path,) = write_models(tmp_path, 1)
    other = replace(Model.load(path), facts={"gear_ratio": 100, "output_spline": "circular"})
    log = runs()[0].with_facts({"gear_ratio": 100, "output_spline": "flex"})
    with pytest.raises(InputError, match=r"output_spline = circular, .* of one joint") as predicted:
        other.predict(log)
    with pytest.raises(InputError) as tracked:
        history_of(log, model=other)
    assert str(tracked.value) == str(predicted.value)


def test_shapes_that_differ_between_models_are_told(tmp_path: Path) -> None:
    paths = []
    for week, width in enumerate((0.05, 0.09)):
        made = flexspline.fit(
            EFFECTS.split(","), runs()[week], "sensor_torque", fixed={"direction_width": width},
            checks=False,
        )  # fmt: skip
        paths.append(tmp_path / f"{date(week)}.json")
        made.model.save(paths[-1])
    assert any("direction_width differs between" in remark for remark in history_of(paths).remarks)


def test_figure_and_report_hold_together(tmp_path: Path) -> None:
    made = track(
        worn_history(2, 100, worn={NAMES[0]: ramp(40, 8.0)}), limits={NAMES[0]: 6.2, NAMES[1]: 90.0}
    )
    figure = made.plot()
    assert figure_faults(figure) == []
    made.report(tmp_path / "report.html")
    assert page_faults(tmp_path / "report.html") == []
    page = (tmp_path / "report.html").read_text()
    assert f"Levels are those at {made.reference:.1f}\N{NO-BREAK SPACE}°C" in page
    for sentence in made.sentences:
        assert sentence[:20] in page
    assert made.to_frame().loc[NAMES[0], "state"] == "changed"
    assert "<table>" in made._repr_html_()
