"""Sessions of a fleet: which file is a run of which joint, how it is read, and when it was made."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

import numpy as np
import pytest

from flexspline.errors import InputError
from flexspline.fleet import mean_temperature, sessions_of
from flexspline.fleet.sessions import date_in

RUN = "time,output_velocity,sensor_torque\n0,0.1,1\n0.01,0.2,2\n0.02,0.3,3\n"


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """Two joints, three runs, and files that are none."""
    for name in ("b/run2.csv", "a/run1.csv", "a/2026-11-28/night.csv"):
        file = tmp_path / "line" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(RUN)
    (tmp_path / "line" / "a" / "notes.docx").write_text("x")
    (tmp_path / "line" / "a" / "model.json").write_text("{}")
    (tmp_path / "line" / ".hidden").mkdir()
    (tmp_path / "line" / ".hidden" / "run.csv").write_text(RUN)
    return tmp_path / "line"


def labels(folders: object, **how: object) -> list[str]:
    return [session.label for session in sessions_of(folders, **how)]  # type: ignore[arg-type]


def test_each_folder_is_a_joint_and_the_files_below_are_its_runs(tree: Path) -> None:
    found = sessions_of(tree)
    assert labels(tree) == ["a/2026-11-28/night", "a/run1", "b/run2"]
    assert found.units == ("a", "b")
    assert len(found.remarks) == 1 and "notes.docx" in found.remarks[0]
    assert len(found.sessions[0].read()) == 3
    assert found.sessions[0].read().name == "2026-11-28/night"


def test_a_folder_without_folders_is_one_joint(tree: Path) -> None:
    assert labels(tree / "b") == ["b/run2"]
    assert labels(tree / "b" / "run2.csv") == ["b/run2"]


def test_runs_of_a_joint_in_two_trees_are_those_of_one_unit(tree: Path, tmp_path: Path) -> None:
    other = tmp_path / "next_month" / "b"
    other.mkdir(parents=True)
    (other / "run2.csv").write_text(RUN)
    (other / "run3.csv").write_text(RUN)
    assert labels([tree, other.parent]) == [
        "a/2026-11-28/night",
        "a/run1",
        "b/run2 (1)",
        "b/run2 (2)",
        "b/run3",
    ]
    assert labels([tree, tree]) == labels(tree)


def test_runs_beside_folders_of_joints_are_refused(tree: Path) -> None:
    (tree / "stray.csv").write_text(RUN)
    with pytest.raises(InputError, match=r"stray\.csv, beside folders of joints, such as a"):
        sessions_of(tree)


def test_a_folder_that_is_missing_or_empty_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="nowhere: is not there"):
        sessions_of(tmp_path / "nowhere")
    with pytest.raises(InputError, match="holds no run"):
        sessions_of(tmp_path)
    with pytest.raises(InputError, match="no folder with runs"):
        sessions_of([])


def test_the_map_of_a_joint_goes_before_that_of_the_tree(tmp_path: Path) -> None:
    for unit in ("a", "b"):
        (tmp_path / unit).mkdir()
        (tmp_path / unit / "r.csv").write_text("t,x,y\n0,1,5\n0.01,2,6\n")
    (tmp_path / "map.toml").write_text(
        '[facts]\ngear_ratio = 100\n[columns]\ntime = "t"\nsensor_torque = "x"\n'
    )
    (tmp_path / "b" / "map.toml").write_text('[columns]\ntime = "t"\nsensor_torque = "y"\n')
    a, b = (session.read() for session in sessions_of(tmp_path))
    assert a["sensor_torque"].tolist() == [1, 2] and b["sensor_torque"].tolist() == [5, 6]
    assert a.facts["gear_ratio"] == 100 and "gear_ratio" not in b.facts
    (_, d) = (session.read() for session in sessions_of(tmp_path, columns=tmp_path / "map.toml"))
    assert d["sensor_torque"].tolist() == [1, 2] and d.facts["gear_ratio"] == 100
    (e, _) = (session.read() for session in sessions_of(tmp_path, gear_ratio=50))
    assert e.facts["gear_ratio"] == 50


def test_joints_of_a_robots_files_are_units_of_their_own(tmp_path: Path) -> None:
    robot = tmp_path / "robot7"
    robot.mkdir()
    (robot / "r.csv").write_text("t,tau_1,tau_2\n0,1,5\n0.01,2,6\n")
    (tmp_path / "map.toml").write_text(
        '[columns]\ntime = "t"\nsensor_torque = "tau_{joint}"\n[joints.2]\ngear_ratio = 50\n'
    )
    found = sessions_of(tmp_path, joints="all")
    assert found.units == ("robot7.1", "robot7.2")
    assert found.sessions[1].read()["sensor_torque"].tolist() == [5, 6]
    assert found.sessions[1].read().facts["gear_ratio"] == 50
    assert sessions_of(tmp_path, joints=["2"]).units == ("robot7.2",)


@pytest.mark.parametrize(
    ("name", "date"),
    [
        ("run_2026-11-28", datetime(2026, 11, 28)),
        ("20261128T0915", datetime(2026, 11, 28, 9, 15)),
        ("20261128T091530Z_b", datetime(2026, 11, 28, 9, 15, 30)),
        ("2026-11-28_09-15-30", datetime(2026, 11, 28, 9, 15, 30)),
        ("run_20261128", datetime(2026, 11, 28)),
        ("2026-11-27 to 2026-11-28", datetime(2026, 11, 28)),
        ("serial_99999999", None),
        ("2026-13-28", None),
        ("120261128", None),
        ("run17", None),
    ],
)
def test_a_date_is_read_from_a_name(name: str, date: datetime | None) -> None:
    assert date_in(name) == date


def test_the_date_is_from_table_name_map_or_log_in_this_order(tmp_path: Path) -> None:
    unit = tmp_path / "a"
    unit.mkdir()
    for name in ("r_2026-01-02", "s_2026-01-03", "t"):
        (unit / f"{name}.csv").write_text("# date: 2025-05-05\n" + RUN)
    (tmp_path / "dates.csv").write_text("run,date\na/r_2026-01-02,2026-09-09T10:00+02:00\n")
    found = sessions_of(tmp_path, dates=tmp_path / "dates.csv")
    r, s, t = found
    assert (r.date, r.dated_by) == (datetime(2026, 9, 9, 8), "table")
    assert (s.date, s.dated_by) == (datetime(2026, 1, 3), "name")
    assert (t.date, t.dated_by) == (None, "")
    assert found.of("a") == (r, s, t)  # one has no date: by name
    dated = t.dated(t.read())
    assert (dated.date, dated.dated_by) == (datetime(2025, 5, 5), "log")
    assert r.dated(r.read()) is r
    (tmp_path / "map.toml").write_text("[facts]\ndate = 2024-04-04\n")
    found = sessions_of(tmp_path, dates=tmp_path / "dates.csv")
    assert (found.sessions[2].date, found.sessions[2].dated_by) == (datetime(2024, 4, 4), "map")
    assert [session.run for session in found.of("a")] == ["t", "s_2026-01-03", "r_2026-01-02"]


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ("run,date\nx,2026-01-01\n", "line 2: 'x' is no run of these folders"),
        ("run,date\nrun1,soon\n", "date of run1 is 'soon'; write it as 2026-11-28"),
        ("name,day\nrun1,2026-01-01\n", "line 2: has no run or no date"),
    ],
)
def test_a_wrong_table_of_dates_is_refused(tree: Path, rows: str, said: str) -> None:
    (tree / "dates.csv").write_text(rows)
    with pytest.raises(InputError, match=said):
        sessions_of(tree, dates=tree / "dates.csv")


def test_a_name_of_two_runs_is_ambiguous_in_the_table(tree: Path) -> None:
    (tree / "b" / "run1.csv").write_text(RUN)
    (tree / "dates.csv").write_text("run,date\nrun1,2026-01-01\n")
    with pytest.raises(InputError, match="'run1' may be a/run1, b/run1; write UNIT/RUN"):
        sessions_of(tree, dates=tree / "dates.csv")


def test_the_mean_temperature_is_that_of_the_joint_else_of_the_motor(tree: Path) -> None:
    log = sessions_of(tree).sessions[0].read()
    assert mean_temperature(log) is None
    warm = log.with_columns({"motor_temperature": np.array([40.0, np.nan, 50.0])}, note="x")
    assert mean_temperature(warm) == 45.0
    both = warm.with_columns({"temperature": np.array([20.0, 21.0, 22.0])}, note="x")
    assert mean_temperature(both) == 21.0


def test_pieces_hold_the_numbers_of_the_whole(tree: Path) -> None:
    session = sessions_of(tree).sessions[0]
    parts = [piece["time"] for piece in session.pieces(2)]
    assert np.array_equal(np.concatenate(parts), session.read()["time"])
