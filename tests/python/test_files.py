"""Files appear whole or not at all."""

from __future__ import annotations

from pathlib import Path

import pytest

from flexspline.errors import InputError
from flexspline.files import atomic_write, atomic_writer


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


def test_a_missing_folder_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"run\.csv: cannot be written .*folder that exists"):
        atomic_write(tmp_path / "no" / "run.csv", b"")


def test_a_folder_in_the_way_is_named_and_nothing_is_left(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    with pytest.raises(InputError, match="cannot be replaced"):
        atomic_write(tmp_path / "run", b"")
    assert [path.name for path in tmp_path.iterdir()] == ["run"]
