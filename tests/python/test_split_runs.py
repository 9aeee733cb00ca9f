"""One file of several runs: cut where a column changes its value, or where time jumps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas
import pytest
from cli_calls import call

from flexspline import check, read_log, read_runs
from flexspline.errors import InputError
from flexspline.logs.splitting import GAP, ROWS_PER_UNKNOWN

STEP = 0.01
COLUMNS = {"time": "time", "output_position": "q"}


def frame(*rows: int, pause: float = 5.0) -> pandas.DataFrame:
    """Return runs of so many rows, one behind the other, with a pause [s] between them."""
    parts = [
        pandas.DataFrame({
            "time": np.arange(count) * STEP + k * (pause + 100.0 * (pause > 0.0)),
            "q": np.sin(np.arange(count)) + k,
            "trial": f"run {k}",
        })
        for k, count in enumerate(rows)
    ]  # fmt: skip
    return pandas.concat(parts, ignore_index=True)


def test_a_run_is_what_lies_between_two_changes_of_the_column() -> None:
    table = frame(50, 60, 70, pause=0.0)
    runs = read_runs(table, COLUMNS, split_column="trial", name="day")
    assert [log.name for log in runs] == ["day_1", "day_2", "day_3"]
    assert [len(log) for log in runs] == [50, 60, 70]
    together = np.concatenate([log["output_position"] for log in runs])
    np.testing.assert_array_equal(together, table["q"])


def test_a_value_that_comes_again_begins_another_run() -> None:
    table = frame(40, 40, 40)
    table["trial"] = np.repeat([1.0, 2.0, 1.0], 40)
    assert len(read_runs(table, COLUMNS, split_column=2)) == 3
    assert len(read_runs(table, COLUMNS, split_column="2")) == 3  # as a command line gives it


def test_time_cuts_where_it_jumps_ahead_and_where_it_goes_back() -> None:
    ahead, back = frame(50, 60, 70), frame(50, 60, 70, pause=0.0)
    for table in (ahead, back):
        assert [len(log) for log in read_runs(table, COLUMNS, split_gaps=True)] == [50, 60, 70]
    assert len(read_runs(ahead, COLUMNS, split_gaps=200.0)) == 1
    assert not any(check(log).errors for log in read_runs(back, COLUMNS, split_gaps=True))
    with pytest.raises(InputError, match="--split-gaps"):
        check(read_log(back, COLUMNS)).raise_errors()


def test_a_burst_of_lost_rows_is_no_new_run_and_one_more_is() -> None:
    table = frame(400)
    lost = table.drop(index=range(100, 100 + round(GAP) - 1))
    assert len(read_runs(lost, COLUMNS, split_gaps=True)) == 1
    assert len(read_runs(lost.drop(index=99), COLUMNS, split_gaps=True)) == 2


def test_no_row_is_lost_in_silence() -> None:
    table = frame(100, ROWS_PER_UNKNOWN - 1, 100, ROWS_PER_UNKNOWN)
    table.loc[:4, "trial"] = " "
    runs = read_runs(table, COLUMNS, split_column="trial")
    assert [len(log) for log in runs] == [95, 100, 20]
    said = "24 rows are in none: 5 have no value there, 19 make a run of fewer than 20 rows"
    assert all(said in "\n".join(log.history) for log in runs)


def test_each_run_is_repaired_by_itself_and_has_the_facts_of_the_file() -> None:
    table = frame(50, 50, pause=0.0)
    runs = read_runs(table, COLUMNS, split_column="trial", repair="drop_start=0.1", gear_ratio=100)
    assert [len(log) for log in runs] == [40, 40]
    assert all(log.facts["gear_ratio"] == 100 for log in runs)


@pytest.mark.parametrize(
    ("cut", "sentence"),
    [
        ({}, "give split_column or split_gaps"),
        ({"split_column": "trail"}, r"no column 'trail' \(did you mean 'trial'\?\)"),
        ({"split_column": "empty"}, "column 'empty' has no value in any row"),
        ({"split_column": "q"}, "would be 100 runs by column 'q', and 100 of its 100 rows in runs"),
        ({"split_gaps": STEP / 2}, "would be 100 runs by gaps of more than 0.005 s"),
        ({"split_gaps": -1.0}, "split_gaps is -1.0; give seconds above zero"),
        ({"split_gaps": "auto"}, "split_gaps is 'auto'; give seconds above zero"),
    ],
)
def test_what_cannot_cut_is_refused_in_one_sentence(cut: dict[str, object], sentence: str) -> None:
    table = frame(100).assign(empty="")
    with pytest.raises(InputError, match=sentence):
        read_runs(table, COLUMNS, **cut)  # type: ignore[arg-type]


def test_commands_take_runs_of_one_file_and_say_what_is_in_none(tmp_path: Path) -> None:
    path = tmp_path / "day.csv"
    frame(100, 5, 100).rename(columns={"q": "output_position"}).to_csv(path, index=False)
    made = call("check", path, "--split-column", "trial")
    assert made.exit_code == 0, made.stderr
    assert "day_1: " in made.stdout and "day_2: " in made.stdout
    assert "warning: day.csv: 2 runs by column 'trial'; 5 rows are in none" in made.stderr.replace(
        str(path), "day.csv"
    )
    assert "day_2: " in call("check", path, "--split-gaps").stdout
    assert "one run by gaps of more than 900 s" in call("check", path, "--split-gaps=900").stderr
    eaten = call("check", "--split-gaps", path)
    assert eaten.exit_code == 2 and "--split-gaps behind the runs" in eaten.stderr


def test_a_map_says_how_a_file_is_cut_and_convert_refuses_it(tmp_path: Path) -> None:
    path, columns = tmp_path / "day.csv", tmp_path / "map.toml"
    frame(100, 100).to_csv(path, index=False)
    columns.write_text(
        "[read]\nsplit_column = 'trial'\n[columns]\ntime = 'time'\noutput_position = 'q'\n"
    )
    assert "day_2: " in call("check", path, "--columns", columns).stdout
    made = call("convert", path, "--columns", columns, "--out", tmp_path / "run.csv")
    assert made.exit_code == 2 and "convert writes one run; leave split_column out" in made.stderr
    assert not (tmp_path / "run.csv").exists()


def test_python_takes_the_file_of_a_map_with_all_that_it_says(tmp_path: Path) -> None:
    recording, columns = tmp_path / "day.txt", tmp_path / "map.toml"
    text = frame(40, 60).to_csv(index=False, sep=";", decimal=",")
    recording.write_text("rig 3, Prüfer: Weiß\n" + text, encoding="latin-1")
    columns.write_text(
        '[read]\nencoding = "latin-1"\nskip_lines = 1\nrepair = "drop_start=0.05"\n'
        '[facts]\ngear_ratio = 100\npole_pairs = 7\n'
        '[columns]\ntime = "time"\noutput_position = {source = "q", sign = -1}\n'
    )  # fmt: skip
    log = read_log(recording, columns, gear_ratio=50)
    assert dict(log.facts) == {"name": "day", "gear_ratio": 50.0, "pole_pairs": 7}
    assert log["output_position"][0] == pytest.approx(-np.sin(5.0)) and len(log) == 95
    assert len(read_log(recording, str(columns), repair="drop_start=0.1")) == 90
    runs = read_runs(recording, columns, split_column="trial")
    assert [len(run) for run in runs] == [35, 55] and runs[1].facts["pole_pairs"] == 7
    columns.write_text(columns.read_text().replace("[facts]", 'split_column = "trial"\n[facts]'))
    assert [len(run) for run in read_runs(recording, columns)] == [35, 55]
    with pytest.raises(InputError, match=r"map.toml: read_log reads one run.*split_column"):
        read_log(recording, columns)
