"""Files appear whole or not at all."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas
import pytest
from arrows import nodes_of

import flexspline
from flexspline.errors import InputError
from flexspline.files import atomic_write, atomic_writer, save_columns, save_table, whole_folder
from flexspline.logs.read import read_map


def test_a_failure_half_way_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    out = tmp_path / "model.json"
    atomic_write(out, "old")
    with pytest.raises(RuntimeError), atomic_writer(out) as file:
        file.write(b"new")
        raise RuntimeError
    assert out.read_text() == "old"
    assert list(tmp_path.iterdir()) == [out]


def test_what_is_written_replaces_the_file_and_keeps_its_mode(tmp_path: Path) -> None:
    out = tmp_path / "run.csv"
    out.write_text("old")
    out.chmod(0o640)
    atomic_write(out, "θ")
    assert out.read_text(encoding="utf-8") == "θ"
    assert out.stat().st_mode & 0o777 == 0o640


def test_a_missing_folder_is_made_and_goes_again_with_what_did_not_come_about(
    tmp_path: Path,
) -> None:
    out = tmp_path / "of" / "mine" / "run.csv"
    with pytest.raises(RuntimeError), atomic_writer(out):
        raise RuntimeError
    assert list(tmp_path.iterdir()) == []
    atomic_write(out, "new")
    assert out.read_text() == "new" and [p.name for p in out.parent.iterdir()] == ["run.csv"]


def test_a_name_too_long_is_told_and_leaves_no_folder(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="give "):
        atomic_write(tmp_path / "of" / "mine" / (250 * "x"), "new")
    assert list(tmp_path.iterdir()) == []
    for read in (
        flexspline.read_log,
        flexspline.Model.load,
        read_map,
        flexspline.PositionServo.load,
    ):
        with pytest.raises(InputError, match=r"cannot be looked at .*; give "):
            read(tmp_path / (300 * "x"))


@pytest.mark.skipif(os.name != "posix", reason="links and pipes of POSIX")
def test_nothing_of_a_folder_is_replaced_where_one_of_its_files_is_refused(tmp_path: Path) -> None:
    with whole_folder(tmp_path / "joint") as draft:
        (draft / "a.txt").write_text("old")
    os.mkfifo(tmp_path / "joint" / "z.txt")
    with (
        pytest.raises(InputError, match="is a device, a pipe"),
        whole_folder(tmp_path / "joint") as draft,
    ):
        (draft / "a.txt").write_text("new")
        (draft / "z.txt").write_text("new")
    assert (tmp_path / "joint" / "a.txt").read_text() == "old"
    lost = tmp_path / "lost"
    lost.symlink_to(tmp_path / "nowhere")
    with pytest.raises(InputError, match="leads nowhere"), whole_folder(lost):
        raise AssertionError("nothing is computed for it")


@pytest.mark.skipif(os.name != "posix", reason="links of POSIX")
def test_a_link_to_another_device_is_followed(tmp_path: Path) -> None:
    memory = Path("/dev/shm")
    with tempfile.TemporaryDirectory(dir=memory if memory.is_dir() else None) as other:
        (tmp_path / "joint").mkdir()
        (tmp_path / "joint" / "model.json").symlink_to(Path(other) / "model.json")
        with whole_folder(tmp_path / "joint") as draft:
            (draft / "model.json").write_text("new")
        assert [file.name for file in Path(other).iterdir()] == ["model.json"]
        assert (Path(other) / "model.json").read_text() == "new"
    assert (tmp_path / "joint" / "model.json").is_symlink()


def test_a_file_in_the_place_of_a_folder_is_named(tmp_path: Path) -> None:
    (tmp_path / "no").write_text("mine")
    with pytest.raises(InputError, match=r"run\.csv: cannot be written .* that you may write to"):
        atomic_write(tmp_path / "no" / "run.csv", b"")
    assert (tmp_path / "no").read_text() == "mine"


@pytest.mark.skipif(os.name != "posix", reason="links and pipes of POSIX")
def test_a_link_stays_and_the_file_that_it_leads_to_is_written(tmp_path: Path) -> None:
    there, link = tmp_path / "there" / "model.json", tmp_path / "latest.json"
    atomic_write(there, "old")
    link.symlink_to(there)
    atomic_write(link, "new")
    assert link.is_symlink() and there.read_text() == "new"
    with whole_folder(tmp_path / "joint") as draft:
        (draft / "model.json").write_text("one")
    (tmp_path / "joint" / "model.json").unlink()
    (tmp_path / "joint" / "model.json").symlink_to(there)
    with whole_folder(tmp_path / "joint") as draft:
        (draft / "model.json").write_text("two")
    assert (tmp_path / "joint" / "model.json").is_symlink() and there.read_text() == "two"


@pytest.mark.skipif(os.name != "posix", reason="links and pipes of POSIX")
def test_a_pipe_a_device_and_a_circle_are_refused_and_stay(tmp_path: Path) -> None:
    pipe, circle = tmp_path / "pipe", tmp_path / "circle"
    os.mkfifo(pipe)
    circle.symlink_to(circle)
    for path in (pipe, circle, Path("/dev/null")):
        with pytest.raises(InputError, match="give the name of a file"):
            atomic_write(path, "new")
    assert pipe.is_fifo() and circle.is_symlink() and Path("/dev/null").is_char_device()


@pytest.mark.skipif(not Path("/proc/self/fd").is_dir(), reason="open files by name")
def test_an_open_file_of_this_process_is_refused_and_stays(tmp_path: Path) -> None:
    with (tmp_path / "printed.txt").open("w") as printed:
        for path in (f"/proc/self/fd/{printed.fileno()}", f"/dev/fd/{printed.fileno()}"):
            with pytest.raises(InputError, match=r"open; give the name of a file"):
                atomic_write(path, "new")
    assert [p.name for p in tmp_path.iterdir()] == ["printed.txt"]
    assert not (tmp_path / "printed.txt").read_text()


def test_a_folder_in_the_way_is_named_and_nothing_is_left(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    with pytest.raises(InputError, match="cannot be replaced"):
        atomic_write(tmp_path / "run", b"")
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


@pytest.mark.skipif(os.name != "posix", reason="SIGKILL and fork are POSIX's")
def test_a_kill_in_the_middle_of_any_write_leaves_a_whole_file(tmp_path: Path) -> None:
    script = Path(__file__).with_name("write_until_killed.py")
    package = str(Path(flexspline.__file__).parents[1])
    done = subprocess.run(
        [sys.executable, str(script), str(tmp_path)],
        capture_output=True,
        text=True,
        timeout=300,
        env={**os.environ, "PYTHONPATH": package},
    )
    assert done.returncode == 0, done.stderr
    said = [line.split() for line in done.stdout.splitlines()]
    assert len(said) == 7
    for name, hit, torn in said:
        assert int(torn) == 0, name
        assert int(hit) == 8, f"{name}: the kills came while nothing was written"


@pytest.mark.skipif(os.name != "posix", reason="pipes of POSIX")
@pytest.mark.parametrize(
    "read",
    [flexspline.read_log, flexspline.Model.load, read_map, flexspline.PositionServo.load],
)
@pytest.mark.parametrize("place", ["pipe", "/dev/zero"])
def test_what_may_never_end_is_not_read(
    read: Callable[[Path], object], place: str, tmp_path: Path
) -> None:
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InputError, match="is a device, a pipe or a socket; give "):
        read(tmp_path / place)


def test_nothing_of_ours_writes_a_file_in_place() -> None:
    """Every writer goes through `flexspline.files`, but for scratch and drafts of its folders."""
    package = Path(flexspline.__file__).parent
    drafts = {"certification/program.py", "demo.py", "exporting/fmu.py"}
    found = set()
    for file in sorted(package.rglob("*.py")):
        for node in nodes_of(file.read_text(encoding="utf-8")):
            called = node.func if isinstance(node, ast.Call) else None
            method = called.attr if isinstance(called, ast.Attribute) else ""
            opens = isinstance(called, ast.Name) and called.id == "open"
            if opens or method in {"write_text", "write_bytes"}:
                found.add(file.relative_to(package).as_posix())
    assert found == drafts


def test_columns_are_written_as_pandas_writes_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("flexspline.files.ROWS_AT_ONCE", 7)
    chance = np.random.default_rng(2)
    columns = {
        "time": np.arange(20) / 7.0,
        "a, b": chance.normal(size=20) * 10.0 ** chance.integers(-320, 300, 20),
        "stuck": np.arange(20) % 2,
    }
    columns["time"][[3, 7]] = np.nan, -0.0
    save_columns(columns, tmp_path / "quick.csv")
    save_table(pandas.DataFrame(columns), tmp_path / "slow.csv")
    assert (tmp_path / "quick.csv").read_bytes() == (tmp_path / "slow.csv").read_bytes()
