"""What tests of every format of files ask of it."""

from __future__ import annotations

import gzip
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli_calls import call

from flexspline import InputError, Log, read_log


def refused(path: Path, columns: Any = None, **how: Any) -> str:
    """The sentence by which a file is refused: it names the file and says what to do."""
    with pytest.raises(InputError) as caught:
        read_log(path, columns, **how)
    said = str(caught.value)
    assert said.startswith(str(path)) and "; " in said and said.isprintable()
    return said


def refused_without(library: str, path: Path, columns: Any, monkeypatch: pytest.MonkeyPatch) -> str:
    """The sentence by which a file is refused where the library that reads it is not installed."""
    for module in [m for m in sys.modules if m.startswith(f"{library}.")]:
        monkeypatch.setitem(sys.modules, module, None)
    monkeypatch.setitem(sys.modules, library, None)
    return refused(path, columns)


def known_by_its_beginning_and_packed(path: Path, columns: Any, rows: int) -> None:
    """The file is read under a name that says nothing, and packed."""
    content = path.read_bytes()
    (path.parent / "recording").write_bytes(content)
    (path.parent / "run.dat").write_bytes(content)
    (path.parent / f"packed{path.suffix}.gz").write_bytes(gzip.compress(content))
    for name in ("recording", "run.dat", f"packed{path.suffix}.gz"):
        assert len(read_log(path.parent / name, columns)) == rows


def converted_by_a_guessed_map(path: Path, entry: str) -> Log:
    """The run that `convert` makes of a file by the map of `init`, which has this entry."""
    written = path.parent / "map.toml"
    made = call("init", path, "--out", written)
    assert made.exit_code == 0, made.output
    assert entry in written.read_text()
    made = call("convert", path, "--columns", written, "--out", path.parent / "run.csv")
    assert made.exit_code == 0, made.output
    return read_log(path.parent / "run.csv")


def refused_or_read_when_damaged(
    path: Path, columns: Any, *, times: int, until: int, bytes_at_once: int
) -> None:
    """Bytes anywhere before `until` may be any: the file is refused by its name, or read."""
    content, random, refusals = path.read_bytes(), np.random.default_rng(5), 0
    for _ in range(times):
        damaged = bytearray(content)
        for at in random.integers(0, min(len(content), until), bytes_at_once):
            damaged[at] = random.integers(256)
        path.write_bytes(bytes(damaged))
        try:
            read_log(path, columns, max_memory=0.1)
        except InputError as error:
            refusals += 1
            assert str(error).startswith(str(path))
    assert refusals > 5


def read_alone_with_a_rate(path: Path, columns: Any, heat: Any) -> None:
    """The group 'oven' has no time: it is read by itself, with a rate."""
    said = refused(path, {**columns, "temperature": "heat"})
    assert "its group 'oven' has no channel of time; read that group alone, by variable='oven'" in (
        said
    )
    log = read_log(path, {"temperature": "heat"}, variable="oven", rate=100)
    assert np.array_equal(log["temperature"], heat)
    said = refused(path, {"temperature": "heat"}, variable="oven")
    assert "no time stamps; map a column to 'time' or give the rate" in said
