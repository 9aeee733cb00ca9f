"""All joints of a robot in one call: maps with a place for the joint, one summary of all."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas
import pytest
from checks_logs import sound_log
from cli_calls import call
from undrawn import undrawn

from flexspline import InputError, Model, check, guess_map, joints_of, read_log, read_runs
from flexspline.logs.splitting import placed_joint

NAMED = {"time": "t", "output_position": "q_{joint}", "sensor_torque": "tau_{joint}"}
MATRIX = {"time": "t", "output_position": "q[:, {joint - 1}]"}


def robot(joints: int = 3) -> dict[str, np.ndarray]:
    """Return columns of a robot whose joints are one run of a rig, scaled by their number."""
    log = sound_log(3).rows(slice(0, 1000))
    columns = {"t": log["time"]}
    for k in range(1, joints + 1):
        columns[f"q_{k}"] = log["output_position"]
        columns[f"tau_{k}"] = k * log["sensor_torque"]
    return columns


def written(folder: Path, more: str = "", columns: dict[str, str] = NAMED) -> tuple[Path, Path]:
    """Write the robot and its map; return both paths."""
    path, mapped = folder / "robot.csv", folder / "map.toml"
    pandas.DataFrame(robot()).to_csv(path, index=False)
    mapped.write_text(
        "\n".join(["[columns]", *(f"{name} = '{text}'" for name, text in columns.items()), more])
    )
    return path, mapped


def test_a_joint_takes_its_place_in_names_and_in_columns_of_a_matrix() -> None:
    columns = robot()
    log = read_log(columns, NAMED, joint=2, name="robot")
    np.testing.assert_array_equal(log["sensor_torque"], columns["tau_2"])
    assert log.facts["joint"] == "2"
    matrix = {"t": columns["t"], "q": np.stack([columns["t"], columns["q_2"]], axis=1)}
    np.testing.assert_array_equal(
        read_log(matrix, MATRIX, joint="2")["output_position"], columns["q_2"]
    )
    assert placed_joint("{joint+6}", "1", "file") == 7
    assert placed_joint("arm.{joint}.q", "elbow", "file") == "arm.elbow.q"


def test_the_joints_of_a_file_are_those_with_every_column_of_the_map() -> None:
    columns = robot()
    del columns["tau_3"]
    assert joints_of(columns, NAMED) == ("1", "2")
    matrix = {"t": columns["t"], "q": np.stack([columns["t"]] * 4, axis=1)}
    assert joints_of(matrix, MATRIX) == ("1", "2", "3", "4")


@pytest.mark.parametrize(
    ("columns", "joint", "sentence"),
    [
        (NAMED, None, "has a place {joint}, and no joint is given"),
        (NAMED, 4, r"no column 'q_4' \(did you mean 'q_3'\?\)"),
        (MATRIX, "elbow", "counts joints, and joint 'elbow' is no number"),
        ({"time": "t", "output_position": "q_1"}, 1, "no column of the map has a place for it"),
    ],
)
def test_a_joint_that_cannot_be_read_is_refused_in_one_sentence(
    columns: dict[str, str], joint: str | int | None, sentence: str
) -> None:
    with pytest.raises(InputError, match=sentence):
        read_log(robot(), columns, joint=joint)


def test_joints_of_a_map_by_numbers_are_not_guessed() -> None:
    with pytest.raises(InputError, match="goes by the numbers of columns; name them"):
        joints_of(np.zeros((50, 7)), {"time": 0, "output_position": "{joint}"})


def test_one_call_fits_every_joint_into_a_folder_of_its_own(tmp_path: Path) -> None:
    path, columns = written(tmp_path)
    with undrawn():
        made = call("fit", path, "--columns", columns, "--joint", "all", "--target",
                    "sensor_torque", "--effects", "offset", "--out", tmp_path / "all")  # fmt: skip
    assert made.exit_code == 0, made.stderr
    table = pandas.read_csv(tmp_path / "all" / "joints.csv")
    offsets = table["offset.offset"].to_numpy()
    np.testing.assert_allclose(offsets, offsets[0] * np.array([1.0, 2.0, 3.0]), rtol=1e-9)
    assert list(table["joint"]) == [1, 2, 3] and set(table["offset.offset_unit"]) == {"Nm"}
    for joint in "123":
        model = Model.load(tmp_path / "all" / f"joint_{joint}" / "model.json")
        assert model.facts["joint"] == joint
    assert "offset [Nm]" in made.stdout and "joint_1, joint_2, joint_3" in made.stdout


def test_one_call_finds_what_the_models_of_all_joints_lack(tmp_path: Path) -> None:
    path, columns = written(tmp_path)
    out = tmp_path / "found"
    with undrawn():
        made = call("discover", path, "--columns", columns, "--joint", "1,3", "--target",
                    "sensor_torque", "--effects", "offset", "--out", out)  # fmt: skip
    assert made.exit_code == 0, made.stderr
    table = pandas.read_csv(out / "joints.csv")
    found = [json.loads((out / f"joint_{k}" / "discovery.json").read_text()) for k in (1, 3)]
    assert list(table["joint"]) == [1, 3]
    names = [", ".join(one["effect"] for one in each["found"]) for each in found]
    assert list(table["found"]) == [each or "unexplained" for each in names]
    for base, each in zip(table["rmse_base"], found, strict=True):
        assert base == pytest.approx(each["rmse"]["base"], rel=1e-9)


def test_a_folder_of_several_joints_is_named_without_their_place(tmp_path: Path) -> None:
    path, columns = written(tmp_path)
    made = call("check", path, "--columns", columns, "--joint", "1,3", "--out",
                tmp_path / "audit_{joint}")  # fmt: skip
    assert made.exit_code == 2 and "give a name without {joint}" in made.stderr
    assert not list(tmp_path.glob("audit*"))


def test_a_joint_that_fails_leaves_the_others_and_ends_with_two(tmp_path: Path) -> None:
    path, columns = written(tmp_path)
    out = tmp_path / "audit"
    made = call("check", path, "--columns", columns, "--joint", "1,9,3", "--out", out, "--json")
    assert made.exit_code == 2
    assert made.stderr.startswith("flexspline: joint 9: ") and made.stderr.count("\n") == 1
    joints = json.loads(made.stdout)["joints"]
    assert {name: one["exit_code"] for name, one in joints.items()} == {"1": 0, "9": 2, "3": 0}
    assert "no column 'q_9'" in joints["9"]["failed"] and joints["1"]["runs"]
    assert sorted(each.name for each in out.iterdir()) == ["joint_1", "joint_3", "joints.csv"]


def test_a_joint_that_forbids_a_fit_ends_the_check_of_all_with_three(tmp_path: Path) -> None:
    path, columns = written(tmp_path)
    table = pandas.read_csv(path)
    table.loc[100:200, "tau_2"] = np.nan
    table.to_csv(path, index=False)
    made = call("check", path, "--columns", columns, "--joint", "all")
    assert made.exit_code == 3
    lines = made.stdout.splitlines()
    assert [line.split()[:2] for line in lines[1:4]] == [["1", "yes"], ["2", "no"], ["3", "yes"]]
    log = read_log(path, NAMED, joint=2)
    assert check(log).errors


def test_where_no_joint_can_be_done_nothing_is_written(tmp_path: Path) -> None:
    path, columns = written(tmp_path)
    made = call("check", path, "--columns", columns, "--joint", "8,9", "--out", tmp_path / "out")
    assert made.exit_code == 2 and made.stderr.count("\n") == 1
    assert "joint 8: " in made.stderr and not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("asked", "sentence"),
    [
        ("1,1", "1 is named twice"),
        ("1,", "'' is no name of a joint"),
        ("../x", "'../x' is no name of a joint"),
    ],
)
def test_names_of_joints_that_are_no_folders_are_refused(
    tmp_path: Path, asked: str, sentence: str
) -> None:
    path, columns = written(tmp_path)
    made = call("check", path, "--columns", columns, "--joint", asked)
    assert made.exit_code == 2 and sentence in made.stderr


def test_a_command_of_one_joint_takes_one_of_them(tmp_path: Path) -> None:
    path, columns = written(tmp_path)
    out = tmp_path / "run.csv"
    several = call("convert", path, "--columns", columns, "--joint", "1,2", "--out", out)
    assert several.exit_code == 2 and "convert takes one joint; give one of 1, 2" in several.stderr
    assert call("convert", path, "--columns", columns, "--joint", "2", "--out", out).exit_code == 0
    np.testing.assert_array_equal(read_log(out)["sensor_torque"], robot()["tau_2"])


def test_a_section_of_the_map_gives_a_joint_facts_of_its_own(tmp_path: Path) -> None:
    path, columns = written(tmp_path, "[facts]\ngear_ratio = 100\n[joints.2]\ngear_ratio = 50")
    ratios = {}
    for joint in "12":
        out = tmp_path / f"{joint}.csv"
        call("convert", path, "--columns", columns, "--joint", joint, "--out", out)
        ratios[joint] = read_log(out).facts["gear_ratio"]
    assert ratios == {"1": 100, "2": 50}


def test_a_map_by_numbers_lists_its_joints(tmp_path: Path) -> None:
    numbers = {"time": "0", "output_position": "{joint}"}
    path, columns = written(tmp_path, "[read]\nheader = true\n[joints.1]\n[joints.3]", numbers)
    text = columns.read_text().replace("time = '0'", "time = 0")
    columns.write_text(text)
    made = call("check", path, "--columns", columns, "--joint", "all")
    assert [line.split()[0] for line in made.stdout.splitlines()[1:3]] == ["1", "3"]


def test_the_map_of_all_joints_is_guessed_from_one_and_reads_each(tmp_path: Path) -> None:
    columns = robot(3)
    names = {f"tau_{k}": f"joint torque {k} [Nm]" for k in (1, 2, 3)}
    names |= {f"q_{k}": f"joint position {k} [deg]" for k in (1, 2, 3)}
    table = pandas.DataFrame(columns).rename(columns={"t": "time [s]", **names})
    table.to_csv(tmp_path / "robot.csv", index=False)
    guess = guess_map(tmp_path / "robot.csv", joint="all")
    assert guess.columns["output_position"].source == "joint position {joint} [deg]"
    assert any("those of joint" in doubt for doubt in guess.unsure)
    for joint in ("1", "2", "3"):
        log = read_log(tmp_path / "robot.csv", guess.columns, joint=joint, **guess.read)
        np.testing.assert_allclose(log["output_position"], np.radians(columns[f"q_{joint}"]))
    np.testing.assert_allclose(  # reads the one that it is guessed from
        guess.log()["output_position"], np.radians(columns[f"q_{guess.joint}"])
    )


def test_a_map_of_all_joints_is_refused_where_there_is_one(tmp_path: Path) -> None:
    log = sound_log(3).rows(slice(0, 500))
    log.to_frame().to_csv(tmp_path / "one.csv", index=False)
    with pytest.raises(InputError, match="has columns of one joint alone"):
        guess_map(tmp_path / "one.csv", joint="all")


def test_columns_without_names_are_not_said_to_be_of_one_joint(tmp_path: Path) -> None:
    time = np.arange(0.0, 10.0, 0.01)
    table = np.column_stack([time, np.sin(time), np.sin(2 * time), np.cos(time)])
    np.savetxt(tmp_path / "bare.csv", table, delimiter=",")
    with pytest.raises(InputError, match=r"its columns have no names.*leave --joint out"):
        guess_map(tmp_path / "bare.csv", joint="1")


def test_a_map_file_names_the_joints_and_the_runs_of_a_file(tmp_path: Path) -> None:
    path, columns = written(tmp_path, "[read]\nsplit_gaps = 5.0\n[joints.2]\ngear_ratio = 50")
    assert joints_of(path, columns) == ("1", "2", "3")
    (run,) = read_runs(path, columns, joint=2)
    assert run.facts["gear_ratio"] == 50
    with pytest.raises(InputError, match="would be 1000 runs"):  # an argument overrules the map
        read_runs(path, columns, joint=2, split_column="q_2")
    with pytest.raises(InputError, match="read_runs several"):
        read_log(path, columns, joint=2)
