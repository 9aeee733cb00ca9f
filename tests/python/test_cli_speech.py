"""Options of every command: --json, -q, -v, --no-overwrite, --threads; what is kept of a file."""

from __future__ import annotations

import json
import os
from pathlib import Path

import click
import pytest
from cli_calls import EFFECTS, call, fitted, write_runs
from click.testing import CliRunner, Result
from threadpoolctl import threadpool_info, threadpool_limits

from flexspline.cli import commands
from flexspline.cli.speech import spoken
from flexspline.files import Writing, atomic_write, remove_file, whole_folder, writing

pytestmark = pytest.mark.usefixtures("undrawn")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two runs, run1.csv and run2.csv, and joint/model.json that was fitted to them."""
    folder = tmp_path_factory.mktemp("speech")
    fitted(folder, write_runs(folder))
    return folder


def runs_of(folder: Path) -> list[Path]:
    return sorted(folder.glob("*.csv"))


def one_object(said: Result) -> dict[str, object]:
    (line,) = said.stdout.splitlines()
    content = json.loads(line, parse_constant=pytest.fail)  # NaN is no JSON
    assert isinstance(content, dict)
    return content


CALLS = {
    "check": ("check", "RUN", "--out", "OUT"),
    "init": ("init", "RUN", "--out", "OUT/map.toml"),
    "orders": ("orders", "RUN", "--target", "sensor_torque", "--out", "OUT/orders.csv"),
    "fit": ("fit", "RUN", "--target", "sensor_torque", "--effects", EFFECTS, "--out", "OUT"),
    "predict": ("predict", "RUN", "--model", "MODEL", "--out", "OUT/residual.csv"),
    "compare": ("compare", "RUN", "--model", "MODEL", "--out", "OUT"),
    "estimate": ("estimate", "RUN", "--model", "MODEL", "--out", "OUT/torque.csv"),
    "export": ("export", "--model", "MODEL", "--format", "header", "--out", "OUT/joint.hpp"),
}


def arguments(name: str, folder: Path, out: Path) -> list[str]:
    put = {"RUN": str(runs_of(folder)[0]), "MODEL": str(folder / "joint" / "model.json")}
    return [put.get(word, word).replace("OUT", str(out)) for word in CALLS[name]]


@pytest.mark.parametrize("name", list(CALLS))
def test_json_is_one_object_with_the_files_that_were_written(
    name: str, folder: Path, tmp_path: Path
) -> None:
    said = call(*arguments(name, folder, tmp_path / "out"), "--json")
    assert said.exit_code == 0, said.stderr
    content = one_object(said)
    assert (content["command"], content["exit_code"], content["kept"]) == (name, 0, [])
    written = sorted(str(path) for path in (tmp_path / "out").rglob("*"))
    assert sorted(content["wrote"]) == written  # type: ignore[type-var]
    assert len(content) > 4  # what was found


def test_json_says_the_numbers_that_the_text_says(folder: Path, tmp_path: Path) -> None:
    told = arguments("predict", folder, tmp_path)
    content = one_object(call(*told, "--json"))
    text = call(*told).stdout
    assert f"RMSE {content['rmse']:.4g} Nm" in text
    fit = one_object(call(*arguments("fit", folder, tmp_path / "fit"), "--json"))
    named = {p["name"].split(".")[0] for p in fit["parameters"]}  # type: ignore[attr-defined, union-attr]
    assert named >= set(EFFECTS.split(","))


def test_a_finding_that_forbids_a_fit_is_an_object_with_exit_code_3(
    folder: Path, tmp_path: Path
) -> None:
    lines = runs_of(folder)[0].read_text().splitlines(keepends=True)
    broken = tmp_path / "broken.csv"
    broken.write_text("".join(lines[:200] + lines[100:120] + lines[200:]))  # time goes back
    said = call("check", broken, "--json")
    assert said.exit_code == 3
    assert one_object(said)["exit_code"] == 3


def test_a_wrong_call_leaves_standard_output_empty(folder: Path, tmp_path: Path) -> None:
    said = call("predict", tmp_path / "none.csv", "--model", folder, "--out", "x", "--json")
    assert (said.exit_code, said.stdout) == (2, "")
    assert len(said.stderr.splitlines()) == 1


def test_quiet_prints_nothing_and_verbose_says_what_was_read(folder: Path, tmp_path: Path) -> None:
    quiet = call(*arguments("predict", folder, tmp_path), "-q")
    assert (quiet.exit_code, quiet.stdout) == (0, "")
    loud = call(*arguments("predict", folder, tmp_path), "-v")
    plain = call(*arguments("predict", folder, tmp_path))
    assert loud.stdout == plain.stdout
    assert "read " in loud.stderr and "done in" in loud.stderr
    assert "done in" not in plain.stderr


# files that are there


def test_a_file_that_is_replaced_is_kept_once_and_the_last_line_says_so(
    folder: Path, tmp_path: Path
) -> None:
    out = tmp_path / "residual.csv"
    told = arguments("predict", folder, tmp_path)
    for content in ("first", "second"):
        out.write_text(content)
        said = call(*told)
        assert said.stdout.splitlines()[-1].endswith(str(out) + ".previous")
        assert Path(f"{out}.previous").read_text() == content
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "residual.csv",
        out.name + ".previous",
    ]


def test_a_file_that_stays_the_same_is_not_kept_beside_itself(folder: Path, tmp_path: Path) -> None:
    told = arguments("predict", folder, tmp_path)
    assert "kept" not in call(*told).stdout + call(*told).stdout
    assert [path.name for path in tmp_path.iterdir()] == ["residual.csv"]


@pytest.mark.parametrize("name", ["predict", "fit", "export", "init"])
def test_no_overwrite_refuses_in_one_sentence_and_changes_nothing(
    name: str, folder: Path, tmp_path: Path
) -> None:
    told = arguments(name, folder, tmp_path / "out")
    assert call(*told).exit_code == 0
    before = {path: path.read_bytes() for path in (tmp_path / "out").iterdir()}
    said = call(*told, "--no-overwrite")
    assert said.exit_code == 2
    assert "is there already" in said.stderr and len(said.stderr.splitlines()) == 1
    assert before == {path: path.read_bytes() for path in (tmp_path / "out").iterdir()}


@pytest.mark.parametrize(
    ("written", "told"),
    [
        ("orders.png", ["orders", "missing.csv", "--target", "sensor_torque"]),
        ("model.json", ["demo"]),
    ],
)
def test_no_overwrite_of_a_folder_refuses_before_the_work(
    written: str, told: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("flexspline.demo.demo", None)  # the work; and missing.csv is not read
    (tmp_path / written).write_text("old")
    said = call(*told, "--out", tmp_path, "--no-overwrite")
    assert said.exit_code == 2 and f"{written}: is there already" in said.stderr


def test_a_file_that_would_be_kept_in_the_place_of_an_input_is_refused(
    folder: Path, tmp_path: Path
) -> None:
    (tmp_path / "out.csv").write_text("old")
    recording = tmp_path / "out.csv.previous"
    recording.write_bytes(runs_of(folder)[0].read_bytes())
    (tmp_path / "map.toml").write_text('[columns]\ntime = "time"\n')
    said = call(
        "convert", recording, "--columns", tmp_path / "map.toml", "--out", tmp_path / "out.csv"
    )
    assert said.exit_code == 2 and "which is read" in said.stderr
    assert (tmp_path / "out.csv").read_text() == "old"


def test_a_folder_in_the_place_of_the_previous_file_is_one_sentence(
    folder: Path, tmp_path: Path
) -> None:
    told = arguments("predict", folder, tmp_path)
    (tmp_path / "residual.csv").write_text("old")
    (tmp_path / "residual.csv.previous").mkdir()
    said = call(*told)
    assert said.exit_code == 2 and "residual.csv.previous: cannot be replaced" in said.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "residual.csv",
        "residual.csv.previous",
    ]


def test_help_is_text_whatever_else_is_asked_for() -> None:
    said = call("check", "--json", "--help")
    assert said.stdout.startswith("Usage") and "{" not in said.stdout.splitlines()[-1]


def test_a_new_folder_and_new_names_are_no_overwriting(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    assert call(*arguments("fit", folder, tmp_path), "--no-overwrite").exit_code == 0


def test_the_package_itself_replaces_and_keeps_nothing(tmp_path: Path) -> None:
    for content in ("first", "second"):
        atomic_write(tmp_path / "file", content)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_what_is_written_counts_where_it_ends_and_not_in_a_draft(tmp_path: Path) -> None:
    with writing() as record, whole_folder(tmp_path / "new") as draft:
        atomic_write(draft / "a", "1")
    assert (record.written, record.kept) == ([tmp_path / "new" / "a"], [])
    with writing() as record, whole_folder(tmp_path / "new") as draft:
        atomic_write(draft / "a", "2")
    assert record.kept == [tmp_path / "new" / "a.previous"]
    assert Writing.current().written == []


def test_a_file_of_an_earlier_call_that_goes_is_kept_like_one_that_is_replaced(
    tmp_path: Path,
) -> None:
    (tmp_path / "plan.csv").write_text("mine")
    with writing() as record:
        remove_file(tmp_path / "plan.csv")
        remove_file(tmp_path / "none.csv")
    assert record.kept == [tmp_path / "plan.csv.previous"]
    assert [path.read_text() for path in tmp_path.iterdir()] == ["mine"]


@pytest.mark.parametrize("name", list(commands.commands))
def test_every_command_has_the_options(name: str) -> None:
    said = call(name, "--help").stdout
    assert all(option in said for option in ("--json", "-q", "-v", "--no-overwrite"))


def test_every_command_takes_threads_and_gives_them_back(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    seen: list[tuple[str | None, set[int]]] = []

    def look() -> None:
        pools = {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}
        seen.append((os.environ.get("OPENBLAS_NUM_THREADS"), pools))

    with threadpool_limits(2):
        said = CliRunner().invoke(spoken(click.Command("probe", callback=look)), ["--threads", "1"])
        look()
    assert said.exit_code == 0, said.output
    assert seen == [("1", {1}), (None, {2})]
    said = CliRunner().invoke(commands, ["check", "--threads", "0", "run.csv"])
    assert said.exit_code == 2 and "--threads" in said.output
