"""The line that shows how far a computation is, read from a terminal as it was written."""

from __future__ import annotations

import fcntl
import os
import pty
import struct
import sys
import termios
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="opens a terminal as Linux has it")

COLUMNS = 60
SOLVING = """
import flexspline.progress
flexspline.progress.PATIENCE = {patience}
with flexspline.progress.Progress("solving", True, unit=" solves") as bar:
    bar.step()
    bar.say("errors and validation")
print("the verdict")
"""
ESTIMATING = """
from types import SimpleNamespace
import flexspline.progress
flexspline.progress.PATIENCE = 0
clock = iter([0.0, 10.0, 12.0, 50.0])
flexspline.progress.time = SimpleNamespace(monotonic=lambda: next(clock))
usual = {"a quarter": 0.25, "a fifth": 0.2}
with flexspline.progress.Progress("solving", True, usual=usual) as bar:
    for what in ("a quarter", "a fifth", "the end"):
        bar.say(what)
"""
READING = """
import flexspline.progress
flexspline.progress.PATIENCE = 0
from flexspline.cli import commands
commands(["check", "one.csv", "two.csv", "-v"])
"""


def in_terminal(code: str, folder: Path, *arguments: str) -> list[str]:
    """What a program writes to a terminal, standard output and error alike, by line ends."""
    child, terminal = pty.fork()
    if child == 0:  # pragma: no cover
        os.chdir(folder)
        os.environ["TQDM_MININTERVAL"] = "0"  # each step is shown, however fast
        os.execv(sys.executable, [sys.executable, "-c", code, *arguments])
    fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", 24, COLUMNS, 0, 0))
    written = b""
    try:
        while part := os.read(terminal, 65536):
            written += part
    except OSError:  # the program has ended
        pass
    os.waitpid(child, 0)
    os.close(terminal)
    return written.decode().split("\r\n")


def test_a_verdict_begins_its_own_line_below_the_progress(tmp_path: Path) -> None:
    progress, verdict, rest = in_terminal(SOLVING.format(patience=0), tmp_path)
    *_, last, left = progress.split("\r")
    assert last.startswith("errors and validation: 1 solves")
    assert left.startswith("solving: 1 solves")
    assert (verdict, rest) == ("the verdict", "")


def test_what_ends_at_once_shows_no_progress(tmp_path: Path) -> None:
    assert in_terminal(SOLVING.format(patience=60), tmp_path) == ["the verdict", ""]


def test_how_long_the_rest_may_take_is_told_from_the_largest_share_that_is_done(
    tmp_path: Path,
) -> None:
    """Of 40 s, when a quarter took 10 s; nothing when these are over."""
    *_, quarter, fifth, end, left = in_terminal(ESTIMATING, tmp_path)[0].split("\r")
    assert quarter.startswith("a quarter, about 30 s left: 00:")
    assert fifth.startswith("a fifth, about 28 s left: 00:")
    assert end.startswith("the end: 00:")
    assert left.startswith("solving: 00:")


def test_what_is_said_while_runs_are_read_has_lines_of_its_own(tmp_path: Path) -> None:
    table = "time,sensor_torque\n" + "".join(f"{row / 100},{row % 7}\n" for row in range(50))
    (tmp_path / "one.csv").write_text(table)
    (tmp_path / "two.csv").write_text(table + "9,9,9,9\n")
    told, left, error, rest = in_terminal(READING, tmp_path)
    assert told.split("\r")[-1].startswith("flexspline: read one.csv: 50 rows")
    assert left.split("\r")[-1].startswith("reading:  50%")
    assert error.startswith("flexspline: two.csv: ")
    assert rest == ""
