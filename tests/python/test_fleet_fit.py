"""A fleet from folders to the table, the page and the models: the numbers, and what is left out."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cli_calls import call
from fleet_logs import MEAN, NAMES, SPREAD, drawn, effects, fleet_in, run_of

import flexspline
from flexspline.errors import InputError
from flexspline.fleet import FleetFit, Plan, fit_sums
from flexspline.fleet import fit as fit_fleet
from flexspline.fleet.sessions import sessions_of
from flexspline.logs.writing import write_log
from flexspline.model import Model
from flexspline.rigs.sensor import Recorder

EFFECTS = ",".join(NAMES)


@pytest.fixture(scope="module")
def line(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Twelve joints of two runs; one is stiff, one has 6 s alone, one a damaged run."""
    folder = tmp_path_factory.mktemp("line") / "line7"
    fleet_in(folder, 12, 2, recorder=Recorder())
    rng = np.random.default_rng(9)
    stiff = {**drawn(rng), "coulomb_friction": 0.75}
    for run in (1, 2):
        log = run_of(stiff, rng, name=f"run{run}", recorder=Recorder())
        write_log(log, folder / "joint05" / f"run{run}.csv")
    (folder / "joint07" / "run2.csv").unlink()
    write_log(run_of(drawn(rng), rng, 6.0, recorder=Recorder()), folder / "joint07" / "run1.csv")
    (folder / "joint03" / "run2.csv").write_text("time,sensor_torque\n0,1\n")
    return folder


@pytest.fixture(scope="module")
def made(line: Path) -> FleetFit:
    return fit_fleet(line, "sensor_torque", NAMES, workers=0)


def test_the_fleet_s_mean_and_spread_are_those_that_were_drawn(made: FleetFit) -> None:
    for name, margin in zip(NAMES, made.population.margins, strict=True):
        assert abs(margin.mean - MEAN[name]) < 4.0 * margin.mean_error
        assert margin.spread_interval[0] < SPREAD[name] < margin.spread_interval[1]
    assert [margin.units for margin in made.population.margins] == [12, 11, 12]


def test_the_stiff_joint_alone_stands_out_and_keeps_its_value(made: FleetFit) -> None:
    (one,) = made.outlying
    assert (one.joint, one.parameter, one.unit) == ("joint05", "coulomb_friction.level", "Nm")
    assert one.value == pytest.approx(0.75, abs=0.02) and one.p < 1e-4
    stiff = made.unit("joint05")
    assert np.array_equal(stiff.shrunken.values, stiff.own.values)


def test_what_is_left_out_is_named_with_one_sentence(made: FleetFit) -> None:
    ((what, why),) = made.failed
    assert what == "joint03/run2" and "only one row of data" in why
    assert "Left out: joint03/run2" in str(made)
    assert len(made.unit("joint03").runs) == 1


def test_a_short_log_is_drawn_to_the_fleet_and_a_long_one_is_not(made: FleetFit) -> None:
    def drawn_by(joint: str) -> float:
        unit = made.unit(joint)
        off = unit.own.values[2] - made.population.mean[2]
        return float((unit.own.values[2] - unit.shrunken.values[2]) / off)

    assert 0.0 < drawn_by("joint01") < 0.5
    short, long = made.unit("joint07"), made.unit("joint01")
    assert short.own.errors[2] > long.own.errors[2]
    assert short.shrunken.errors[2] < short.own.errors[2]


def test_held_out_runs_judge_separate_fits_drawn_values_and_the_mean(made: FleetFit) -> None:
    held = made.held_out
    assert held is not None and len(held.runs) == 10  # of joints with two runs
    assert held.separate < 0.05 and held.shrunken < 1.05 * held.separate < held.mean
    assert held.worst[0].endswith("run2")
    said = " ".join(str(made).split())
    assert "what a fit to the run itself leaves is taken off" in said
    assert f"Worst given the fleet is {held.worst[0]}: " in said


def test_a_reason_that_ends_with_a_full_stop_gets_no_second_one(made: FleetFit) -> None:
    text = str(replace(made, failed=(("a/b", "b: repair it."), ("a/c", "c: is empty"))))
    assert "Left out: a/b: b: repair it.\nLeft out: a/c: c: is empty.\n" in f"{text}\n"


def test_short_logs_are_told_better_by_the_fleet_than_by_themselves(tmp_path: Path) -> None:
    """4 s of coloured noise: 20 joints, the error of the model on runs that no fit saw."""
    rng = np.random.default_rng(11)
    for number in range(20):
        truth = drawn(rng)
        for run, seconds in ((1, 5.0), (2, 20.0)):
            log = run_of(truth, rng, seconds, noise=0.2, memory=0.1, name=f"run{run}")
            file = tmp_path / f"joint{number:02d}" / f"run{run}.csv"
            file.parent.mkdir(exist_ok=True)
            write_log(log, file)
    made = fit_fleet(tmp_path, "sensor_torque", effects(), workers=0, bandwidth=np.inf,
                     checks=False, fixed={"direction_width": 0.01})  # fmt: skip
    held = made.held_out
    assert held is not None
    assert held.shrunken < 0.8 * held.separate and held.shrunken < 1.1 * held.mean


def test_the_model_of_a_joint_predicts_its_runs(made: FleetFit, line: Path) -> None:
    model = made.model("joint01")
    run = model.predict(line / "joint01" / "run1.csv")
    assert run.rmse < 0.035
    assert model.facts["gear_ratio"] == 100 and model.facts["joint"] == "joint01"
    with pytest.raises(InputError, match=r"no joint 'joint99' \(did you mean 'joint"):
        made.model("joint99")


def test_tables_and_pages_have_every_joint(made: FleetFit, tmp_path: Path) -> None:
    assert made.to_frame().shape == (3, 12)
    assert made.to_frame("joints").shape == (36, 11)
    assert len(made.to_frame("runs")) == 22 and len(made.to_frame("outlying")) == 1
    with pytest.raises(InputError, match="there is no table 'x'"):
        made.to_frame("x")
    assert "<table" in made._repr_html_() and "joint05" in made._repr_html_()
    assert "joint12" in made.summary() and "joint12" not in str(made)
    made.report(tmp_path / "page")
    page = (tmp_path / "page" / "report.html").read_text()
    for unit in made.units:
        assert f'<a href="units/{unit.name}.html">{unit.name}</a>' in page
        own = (tmp_path / "page" / "units" / f"{unit.name}.html").read_text()
        assert '<a href="../report.html">The fleet</a>' in own
    assert page.count("<svg") == 3 and not re.search(r"(src|href)=\"https?:", page)
    assert len(made.plot().axes) == 3


def test_a_fleet_of_many_joints_is_counted_in_its_figure(made: FleetFit) -> None:
    units = tuple(replace(u, name=f"{u.name}_{k}") for k in range(5) for u in made.units)
    many = replace(made, units=units)
    labels = [text.get_text() for text in many.plot().axes[1].get_legend().get_texts()]
    assert "joints, given the fleet" in labels and "stands out" in labels


def test_a_pilot_with_ripple_gives_its_orders_to_all(tmp_path: Path) -> None:
    rig = flexspline.rigs.sensor_rig(6, duration=24.0, recorder=Recorder())
    for number, log in enumerate(rig.logs):
        file = tmp_path / f"joint{number % 3}" / f"run{number // 3}.csv"
        file.parent.mkdir(exist_ok=True)
        write_log(log, file)
    names = ["offset", "coulomb_friction", "viscous_friction", "stribeck_friction",
             "wave_generator_ripple"]  # fmt: skip
    made = fit_fleet(tmp_path, "sensor_torque", names, workers=0, checks=False, pilot="joint1")
    assert "of joint1 (" in made.plan.pilot and "orders of wave_generator_ripple" in made.plan.pilot
    assert any("cosine" in name for name in made.parameters)
    assert not made.outlying  # it is one joint, under three names


def test_few_joints_and_wrong_calls_are_refused(line: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="joint01, joint02 alone can be used, and a fleet has 3"):
        fit_fleet([line / "joint01", line / "joint02"], "sensor_torque", NAMES, workers=0)
    with pytest.raises(InputError, match="give the effects, or the model"):
        fit_fleet(line, "sensor_torque", workers=0)
    with pytest.raises(InputError, match="there is no joint 'x'; the joints are"):
        fit_fleet(line, "sensor_torque", NAMES, pilot="x", workers=0)
    with pytest.raises(InputError, match="leave columns out"):
        fit_fleet(sessions_of(line), "sensor_torque", NAMES, columns="m.toml", workers=0)
    with pytest.raises(InputError, match="there are no runs"):
        fit_sums([], Plan(tuple(effects()), "sensor_torque"))
    for number in range(3):
        (tmp_path / f"joint{number}").mkdir()
        (tmp_path / f"joint{number}" / "run.csv").write_text("time,sensor_torque\n0,1\n")
    with pytest.raises(InputError, match=r"only one row .* \(and no other run can be used\)"):
        fit_fleet(tmp_path, "sensor_torque", effects(), workers=0,
                  fixed={"direction_width": 0.01})  # fmt: skip


def test_a_damaged_pilot_leaves_its_place_to_the_next(tmp_path: Path) -> None:
    fleet_in(tmp_path, 4, 1)
    broken = tmp_path / "joint00"
    broken.mkdir()
    (broken / "run.csv").write_text("time,sensor_torque\n0,1\n" + "0,x\n" * 200_000)
    made = fit_fleet(tmp_path, "sensor_torque", NAMES, workers=0)
    assert (
        made.plan.pilot.startswith("held as a fit of joint0") and "joint00" not in made.plan.pilot
    )
    assert [what for what, _ in made.failed] == ["joint00/run"]
    with pytest.raises(InputError, match="the pilot joint joint00, which is to tell"):
        fit_fleet(tmp_path, "sensor_torque", NAMES, workers=0, pilot="joint00")


@pytest.mark.usefixtures("undrawn")
def test_the_command_leaves_numbers_pages_and_models(line: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    asked = ("fleet", "fit", line, "--target", "sensor_torque", "--effects", EFFECTS)
    result = call(*asked, "--workers", 0, "--out", out, "--json")
    assert result.exit_code == 0, result.stderr
    content = json.loads(result.stdout)
    assert content["command"] == "fleet" and len(content["joints"]) == 12
    assert content["outlying"][0]["joint"] == "joint05"
    assert {key: content[key] for key in json.loads((out / "fleet.json").read_text())}
    assert sorted(p.name for p in out.iterdir()) == ["fleet.json", "report.html", "units"]
    assert len(list((out / "units").iterdir())) == 24
    Model.load(out / "units" / "joint01.json")
    again = call(*asked, "--model", out / "units" / "joint01.json", "--out", out)
    assert again.exit_code == 2 and "exactly one of --effects" in again.stderr
    held = call("fleet", "fit", line, "--model", out / "units" / "joint01.json", "--workers", 0,
                "--out", tmp_path / "again", "-q")  # fmt: skip
    assert (held.exit_code, held.stdout) == (0, ""), held.stderr
    same = json.loads((tmp_path / "again" / "fleet.json").read_text())
    assert same["joints"][0]["values"] == content["joints"][0]["values"]


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (("--effects", "offset"), "--target is needed beside --effects"),
        (("--target", "sensor_torque", "--effects", "offset", "--per-run", "a,"), "a name is"),
        (("--target", "torsion", "--effects", "inertia"), "does not act on the target torsion"),
        (("--target", "sensor_torque", "--effects", "ofset"), "there is no effect 'ofset'"),
        (("--target", "sensor_torque", "--effects", "offset", "--columns", "no.toml"), "no.toml"),
    ],
)
def test_a_wrong_call_is_one_line_and_writes_nothing(
    more: tuple[str, ...], said: str, line: Path, tmp_path: Path
) -> None:
    result = call("fleet", "fit", line, *more, "--workers", 0, "--out", tmp_path / "out")
    assert result.exit_code == 2 and said in result.stderr and result.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_the_folder_of_the_runs_takes_no_results(line: Path) -> None:
    result = call("fleet", "fit", line, "--target", "sensor_torque", "--effects", "offset",
                  "--out", line)  # fmt: skip
    assert result.exit_code == 2 and "holds the runs; give another folder" in result.stderr


def test_an_unknown_part_of_the_command_is_answered_with_the_nearest() -> None:
    result = call("fleet", "fitt")
    assert result.exit_code == 2 and "did you mean 'fit'" in result.stderr
