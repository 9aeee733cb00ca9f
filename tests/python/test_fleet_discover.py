"""What joints of a fleet lack and where a model fails them: each by itself, then counted."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from cli_calls import call
from fleet_logs import MEAN, drawn, run_of

from flexspline.effects import effect
from flexspline.errors import InputError
from flexspline.fleet import FleetComparison, FleetDiscovery, compare, discover
from flexspline.fleet.each_joint import UnitDiscovery, pooled_confidence
from flexspline.fleet.each_joint import _names as names_of
from flexspline.logs.writing import write_log
from flexspline.model import Model
from flexspline.part import Part

KNOWN = ["offset", "viscous_friction"]
MODEL = Model({"sensor": Part("sensor_torque", (
    effect("offset"), effect("coulomb_friction"), effect("viscous_friction"),
), np.array([MEAN["offset"], MEAN["coulomb_friction"], MEAN["viscous_friction"]]))})  # fmt: skip


@pytest.fixture(scope="module")
def line(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three joints with Coulomb friction; one of them has a ripple too, one a damaged run."""
    folder = tmp_path_factory.mktemp("line")
    rng = np.random.default_rng(3)
    for number in (1, 2, 3):
        truth = {**drawn(rng), "offset": MEAN["offset"]}
        for run in (1, 2):
            log = run_of(truth, rng, 40.0, noise=0.02, name=f"run{run}")
            if number == 2:
                wave = 0.08 * np.cos(2.0 * log["output_position"])
                log = log.with_columns({"sensor_torque": log["sensor_torque"] + wave}, note="x")
            file = folder / f"joint{number}" / f"run{run}.csv"
            file.parent.mkdir(exist_ok=True)
            write_log(log, file)
    (folder / "joint3" / "run3.csv").write_text("time,sensor_torque\n0,1\n")
    return folder


@pytest.fixture(scope="module")
def found(line: Path) -> FleetDiscovery:
    return discover(line, "sensor_torque", KNOWN, workers=0)


def test_a_name_of_all_joints_and_one_of_a_single_joint_are_told(found: FleetDiscovery) -> None:
    names = {name.effect: name for name in found.names}
    assert names["coulomb_friction"].joints == ("joint1", "joint2", "joint3")
    assert names["output_ripple"].joints == ("joint2",)
    assert names["output_ripple"].share == pytest.approx(1 / 3)
    assert names["output_ripple"].share_low < 1 / 3 < names["output_ripple"].share_high
    assert found.names[0].effect == "coulomb_friction"
    text = str(found)
    assert text.startswith("All 3 joints lack coulomb_friction.")
    assert "Only some: output_ripple in 1 (joint2)" in text
    base, final, floor = found.rmse
    assert base > 3.0 * final and final < 1.2 * floor


def test_a_damaged_run_is_left_out_and_its_joint_is_looked_at(found: FleetDiscovery) -> None:
    ((what, why),) = found.failed
    assert what == "joint3/run3" and "only one row" in why
    assert found["joint3"].runs == ("run1", "run2")


def test_the_others_make_a_name_surer_or_less_sure() -> None:
    """Share π = (k + ½)/(J + 1) of even odds: at ½ nothing changes."""
    assert pooled_confidence(0.9, 1, 2) == pytest.approx(0.9)
    assert pooled_confidence(0.9, 9, 10) > 0.98
    assert pooled_confidence(0.9, 1, 10) == pytest.approx(0.9 * 1.5 / (0.9 * 1.5 + 0.1 * 9.5))
    assert 0.0 < pooled_confidence(0.5, 1, 1000) < 0.01


def joint(name: str, **found: list[str]) -> UnitDiscovery:
    """A joint by what is found in it, and what explains its runs as well as each."""
    each = [{"effect": effect, "confidence": 0.5, "indistinguishable_from": others}
            for effect, others in found.items()]  # fmt: skip
    return UnitDiscovery(name, ("run1",), {"found": each, "also_seen": []}, MODEL)


SINE = ["output_ripple"]


def test_joints_none_of_which_tells_a_name_from_another_make_it_no_surer() -> None:
    confused = [joint("a", gravity=SINE), joint("b", gravity=SINE)]
    (gravity,) = names_of(confused)
    assert gravity.pooled == gravity.confidences == (0.5, 0.5)
    (gravity,) = names_of([*confused, joint("c", gravity=[])])
    assert min(gravity.pooled) > 0.5


def test_a_joint_that_has_a_name_is_not_counted_where_that_explains_as_much() -> None:
    """Orders of a ripple that is named may be what else gravity is."""
    joints = [joint("a", gravity=SINE, output_ripple=[]), joint("b", gravity=SINE)]
    (ripple,) = (one for one in names_of(joints) if one.effect == "output_ripple")
    assert ripple.joints == ("a",) and ripple.indistinguishable == ("b",)


def test_a_discovery_has_a_table_pages_and_models(found: FleetDiscovery, tmp_path: Path) -> None:
    assert found.to_frame().loc["joint2", "output_ripple"] > 0.5
    assert np.isnan(found.to_frame().loc["joint1", "output_ripple"])
    names = [each.name for each in found["joint2"].model.part().effects]
    assert "output_ripple" in names
    found.save(tmp_path / "f.json")
    found.report(tmp_path)
    assert "coulomb_friction" in (tmp_path / "report.html").read_text()
    assert "output_ripple" in (tmp_path / "units" / "joint2.html").read_text()
    assert "joint2" in found._repr_html_()
    with pytest.raises(InputError, match="there is no joint 'joint9'"):
        found["joint9"]


@pytest.fixture(scope="module")
def gap(line: Path) -> FleetComparison:
    return compare(MODEL, line, workers=0)


def test_errors_are_pooled_and_the_worst_joint_stands_beside_them(gap: FleetComparison) -> None:
    squares = [unit.rows * unit.rmse**2 for unit in gap.units]
    rows = sum(unit.rows for unit in gap.units)
    assert gap.rmse == pytest.approx(float(np.sqrt(sum(squares) / rows)))
    assert gap.worst.excess == max(unit.excess for unit in gap.units)
    assert gap.noise_floor < gap.rmse
    assert str(gap).count("joint") > 4 and gap.worst.name in str(gap)
    assert [what for what, _ in gap.failed] == ["joint3/run3"]


def test_a_joint_without_a_model_is_left_out(line: Path) -> None:
    def of_joint(name: str) -> Model:
        if name == "joint1":
            raise InputError("joint1.json: is not there; fit it")
        return MODEL

    made = compare(of_joint, line, workers=0)
    assert [unit.name for unit in made.units] == ["joint2", "joint3"]
    assert ("joint1", "joint1.json: is not there; fit it") in made.failed


def test_the_commands_leave_numbers_and_pages(line: Path, tmp_path: Path) -> None:
    MODEL.save(tmp_path / "joint1.json")
    MODEL.save(tmp_path / "joint2.json")
    given = ("--workers", 0, "--out", tmp_path / "gap", "--json")
    one = call("fleet", "compare", line, "--model", tmp_path / "{joint}.json", *given)
    assert one.exit_code == 0, one.stderr
    content = json.loads(one.stdout)
    assert len(content["joints"]) == 2 and content["failed"][0]["what"] == "joint3"
    names = ["fleet_comparison.json", "report.html", "units"]
    assert sorted(p.name for p in (tmp_path / "gap").iterdir()) == names
    lacks = call("fleet", "discover", line, "--target", "sensor_torque", "--effects",
                 "offset,coulomb_friction,viscous_friction", "--exclude", "output_ripple",
                 "--workers", 0, "--out", tmp_path / "lacks", "-q")  # fmt: skip
    assert lacks.exit_code == 0, lacks.stderr
    names = ["fleet_discovery.json", "report.html", "units"]
    assert sorted(p.name for p in (tmp_path / "lacks").iterdir()) == names
    Model.load(tmp_path / "lacks" / "units" / "joint1.json")


@pytest.mark.parametrize(
    ("line_of", "said"),
    [
        ("discover DIR --effects offset", "--target is needed beside --effects"),
        ("discover DIR --target sensor_torque", "exactly one of --effects"),
        ("compare DIR --model nowhere.json", "nowhere.json"),
    ],
)
def test_a_wrong_call_is_one_line(line_of: str, said: str, line: Path, tmp_path: Path) -> None:
    words = [str(line) if word == "DIR" else word for word in line_of.split()]
    result = call("fleet", *words, "--workers", 0, "--out", tmp_path / "out")
    assert result.exit_code == 2 and said in result.stderr and result.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()
