"""A log streamed through certify's program: on this machine, or on a board that QEMU plays."""

from __future__ import annotations

import re
import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flexspline.certification.building import Built
from flexspline.certification.devices import Device
from flexspline.certification.rows import RESULT
from flexspline.certification.tools import call, found
from flexspline.errors import InputError

__all__ = ["Run", "counted_on_host", "run"]

FOOTER = 4  # bytes behind the results: the stack
SHIFT = 10  # an instruction takes 2^10 ns of the emulated time
TICKS_PER_INSTRUCTION = 2**SHIFT * 25e6 * 1e-9  # the boards' SysTick counts at 25 MHz
MOST_COUNTED = 2000  # rows that valgrind sees: it is slow


@dataclass(frozen=True)
class Run:
    """What the program made of the rows.

    Parameters
    ----------
    results : (N,) of `RESULT`.
    instructions : (N,), of each step; None where they are not counted.
    stack_bytes : of the steps together; None where it is not measured.
    """

    results: NDArray[np.void]
    instructions: NDArray[np.int64] | None = None
    stack_bytes: int | None = None


def run(device: Device, built: Built, folder: Path, rows: NDArray[np.void], scalar: str) -> Run:
    """Return what the program makes of rows of `ROW[scalar]`.

    Raises
    ------
    InputError
        Where the program ends early, or QEMU is missing.
    """
    if device.machine is None:
        answer = call([built.program], folder, rows.tobytes(), does="running on this machine")
        return Run(_results(answer, len(rows), scalar, device))
    answer = _emulated(device, built, folder, rows.tobytes())
    results = _results(answer, len(rows), scalar, device)
    ticks = results["ticks"].astype(np.float64)
    instructions = np.rint(ticks / TICKS_PER_INSTRUCTION).astype(np.int64)
    return Run(results, instructions, int.from_bytes(answer[-FOOTER:], "little"))


def _emulated(device: Device, built: Built, folder: Path, given: bytes) -> bytes:
    """Run on QEMU's board; an instruction takes a fixed time, so SysTick counts instructions."""
    qemu = found("qemu-system-arm")
    (folder / "rows.bin").write_bytes(given)
    (folder / "results.bin").unlink(missing_ok=True)
    quiet = "-display none -monitor none -serial none -semihosting-config enable=on,target=native"
    command = [qemu, "-machine", str(device.machine), *quiet.split()]
    command += ["-icount", f"shift={SHIFT},sleep=off", "-kernel", str(built.program)]
    call(command, folder, does=f"emulating {device.name} with {device.machine}")
    results = folder / "results.bin"
    return results.read_bytes() if results.exists() else b""


def _results(answer: bytes, count: int, scalar: str, device: Device) -> NDArray[np.void]:
    expected = count * RESULT[scalar].itemsize + FOOTER
    if len(answer) != expected:
        raise InputError(
            f"the program for {device.name} ended after {len(answer)} of {expected} bytes; "
            "leave out compiler options of your own, or report it as a defect"
        )
    return np.frombuffer(answer[:-FOOTER], dtype=RESULT[scalar])


def counted_on_host(built: Built, folder: Path, rows: NDArray[np.void]) -> float | None:
    """Return the mean of instructions in a step by callgrind, or None without valgrind."""
    if shutil.which("valgrind") is None:
        return None
    some = rows[:MOST_COUNTED]
    file = folder / "callgrind.out"
    options = ["--toggle-collect=flexspline_step", f"--callgrind-out-file={file}"]
    command = [found("valgrind"), "--tool=callgrind", *options, str(built.program)]
    call(command, folder, some.tobytes(), does="counting instructions with valgrind")
    total = re.search(r"^(?:summary|totals): (\d+)", file.read_text(), flags=re.MULTILINE)
    return None if total is None else int(total[1]) / len(some)
