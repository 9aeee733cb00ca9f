"""The program of a certificate: compiled with the exported model, run over a log, its cost counted.

A device is this machine, or a processor with a compiler, its options, and the board that QEMU
emulates. The program reads a log as rows; their layout and that of its results is in
`cpp/firmware/certify/rows.hpp`.

QEMU counts instructions, not cycles, so cycles are estimated: the mean cost of an instruction over
the machine code of the step (how often each is run is not known), memory without wait states, by
Arm's table as Texas Instruments prints it for the Cortex-M4F of the CC13x2 ([TI2021], tables 3-25
and 3-27, after Arm's Cortex-M4 Technical Reference Manual [Arm2010], tables 3-1 and 7-1):

    load or store of a word or a float    2, of a double 3, of a list 1 + words
    float between FPU and core            2
    multiply and accumulate               3
    division, square root                 14; of integers 2 to 12, taken as 7
    branch                                1, taken 1 + (1 to 3), as 2.5
    all else                              1

Consecutive loads overlap, so code that loads much is faster than this. Arm publishes no such table
of the Cortex-M7, which may issue two instructions in one cycle: its estimate leaves that out
(measured pairs: quinapalus.com/cm7cycles.html).
"""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flexspline import _core
from flexspline.errors import InputError, did_you_mean
from flexspline.logs.log import Log
from flexspline.logs.segments import median_step, runs
from flexspline.programs import (
    STRICT,
    call,
    firmware_folder,
    found,
    host_compiler,
    include_folder,
)

__all__ = [
    "CHANNELS",
    "DEVICES",
    "METHOD",
    "RESULT",
    "ROW",
    "Built",
    "Device",
    "Run",
    "alone",
    "build",
    "calls_of",
    "counted_on_host",
    "cycles_per_instruction",
    "device_of",
    "instruction_cost",
    "rows_of",
    "run",
    "sizes_of",
    "version_of",
]


BARE = ("-nostdlib", "-lc", "-lgcc")  # no start-up code, no C++ library

Rows = NDArray[np.void]

CHANNELS = (*_core.numbers, *_core.instruments, "known_load")
ANGLES = ("output_position", "motor_position")
MOST_TURNS = 2**30 + 128  # where the core's turns saturate, out of range

FOOTER = 4  # bytes behind the results: the stack
SHIFT = 10  # an instruction takes 2^10 ns of the emulated time
TICKS_PER_INSTRUCTION = 2**SHIFT * 25e6 * 1e-9  # the boards' SysTick counts at 25 MHz
MOST_COUNTED = 2000  # rows that valgrind sees: it is slow

METHOD = {
    "cortex-m4f": "estimated: counted instructions, weighed with Arm's table for the mean over the "
    "step's machine code, memory without wait states",
    "cortex-m7": "estimated: counted instructions, one cycle each, divisions and square roots 14; "
    "two issued together and waiting for memory are left out",
}
LINE = re.compile(r"^\s+[0-9a-f]+:\t[0-9a-f ]+\t(\w[\w.]*)\s*(.*)$", flags=re.MULTILINE)
LISTS = re.compile(r"^(?:push|pop|ldm|stm|vpush|vpop|vldm|vstm)")
CONDITIONS = "eq|ne|cs|cc|mi|pl|vs|vc|hi|ls|ge|lt|gt|le"
CORE = re.compile(r"\b(?:r\d+|sl|fp|ip|lr)\b")  # a register of the core
BRANCH = re.compile(rf"^(?:b|bl|bx|blx|cbz|cbnz|b(?:{CONDITIONS}))(?:\.|$)")

ARM = ("-mthumb", "-mfloat-abi=hard")


@dataclass(frozen=True)
class Device:
    """A processor.

    Parameters
    ----------
    name : as in `--device`.
    processor : in words.
    compiler : its C++ compiler; None is the host's.
    options : of the compiler, beside those that every device has.
    machine : QEMU's board, or None.
    size, disassembler : of the compiler's binutils.
    """

    name: str
    processor: str
    compiler: str | None = None
    options: tuple[str, ...] = ()
    machine: str | None = None
    size: str = "size"
    disassembler: str = "objdump"


def _cortex(name: str, processor: str, machine: str, *options: str) -> Device:
    tools = ("arm-none-eabi-g++", (*options, *ARM), machine)
    return Device(name, processor, *tools, "arm-none-eabi-size", "arm-none-eabi-objdump")


DEVICES = {
    device.name: device
    for device in (
        Device("host", "this machine"),
        _cortex(
            "cortex-m4f",
            "Arm Cortex-M4 with single-precision FPU",
            "mps2-an386",
            "-mcpu=cortex-m4",
            "-mfpu=fpv4-sp-d16",
        ),
        _cortex(
            "cortex-m7",
            "Arm Cortex-M7 with double-precision FPU",
            "mps2-an500",
            "-mcpu=cortex-m7",
            "-mfpu=fpv5-d16",
        ),
    )
}


def device_of(name: str) -> Device:
    """Return the device of this name.

    Raises
    ------
    InputError
        Where there is none.
    """
    if name not in DEVICES:
        near = did_you_mean(name, DEVICES)
        raise InputError(f"there is no device '{name}'{near}; give {' or '.join(DEVICES)}")
    return DEVICES[name]


def version_of(tool: str) -> str:
    """Return the first line of what `tool --version` says."""
    said = subprocess.run([tool, "--version"], capture_output=True, text=True, check=True).stdout
    return said.splitlines()[0]


@dataclass(frozen=True)
class Built:
    """A program, and the object file of the exported model in it."""

    program: Path
    unit: Path


@dataclass(frozen=True)
class Sizes:
    """Bytes of what one step needs: code with constants, these with initial values, and memory."""

    code: int
    flash: int
    ram: int


def build(
    device: Device, folder: Path, unit: str, scalar: str, options: Sequence[str] = ("-O2",)
) -> Built:
    """Compile the exported header `joint.hpp` of a folder into a program beside it.

    Parameters
    ----------
    unit : "joint_unit", the chain of estimators, or "model_unit", the part's model.
    options : of the compiler, after all others.

    Raises
    ------
    InputError
        Where a tool is missing or the compiler refuses.
    """
    sources = firmware_folder()
    board = "certify/host.cpp" if device.machine is None else "cortex_m/board.cpp"
    files = [f"certify/{unit}.cpp", "certify/main.cpp", board]
    if device.machine is not None:
        files.append("cortex_m/startup.cpp")
    command: list[str | Path] = [_compiler(device), *device.options, *STRICT.split(), *options]
    command += [f"-DFLEXSPLINE_SCALAR={scalar}", f"-I{include_folder()}", f"-I{folder}"]
    stem = "-".join((device.name, scalar, *options)).replace("/", "_")
    objects: list[Path] = []
    for file in files:
        objects.append(folder / f"{stem}-{Path(file).stem}.o")
        does = f"compiling {Path(file).name} for {device.name}"
        call([*command, "-c", sources / file, "-o", objects[-1]], folder, does=does)
    program = folder / stem
    libraries: tuple[str, ...] = ()
    if device.machine is not None:
        command += ["-T", sources / "cortex_m/mps2.ld"]
        libraries = BARE
    call([*command, *objects, "-o", program, *libraries], folder, does=f"linking for {device.name}")
    return Built(program, objects[0])


def sizes_of(device: Device, built: Built, folder: Path) -> Sizes:
    """Return what one step needs: on a device with what it calls, on a host the object alone."""
    measured = built.unit
    if device.machine is not None:
        measured = alone(device, built, folder)
    said = call([found(device.size), measured], folder, does="measuring the size").decode()
    text, data, bss = (int(word) for word in said.splitlines()[1].split()[:3])
    return Sizes(text, text + data, data + bss)


def alone(device: Device, built: Built, folder: Path) -> Path:
    """Return a program of one step and what it calls, without start-up code."""
    program = folder / "step-alone"
    linker = ["-Wl,--gc-sections", "-Wl,-e,flexspline_step"]
    command = [_compiler(device), *device.options, *linker]
    call([*command, built.unit, "-o", program, *BARE], folder, does=f"linking for {device.name}")
    return program


def calls_of(device: Device, built: Built, folder: Path) -> tuple[str, ...]:
    """Return the names of what the unit takes from the compiler's libraries."""
    command = [found(device.disassembler), "-t", str(built.unit)]
    said = call(command, folder, does="reading the symbols").decode()
    return tuple(sorted(re.findall(r"\*UND\*\s+\w+ (\S+)$", said, flags=re.MULTILINE)))


def _compiler(device: Device) -> str:
    return host_compiler() if device.compiler is None else found(device.compiler)


def _row(real: str, fraction: str) -> np.dtype[np.void]:
    numbers = [(name, real) for name in CHANNELS]
    angles = [("fractions", fraction, 2), ("turns", "<i4", 2)]
    marks = [("marks", "<u4"), ("spare", "<u4")]
    return np.dtype([*numbers, *angles, *marks], align=True)


def _result(real: str) -> np.dtype[np.void]:
    marks = [(name, "u1") for name in ("contact", "flags", "faults", "status")]
    ticks = [("spare", "<u2"), ("ticks", "<u4"), ("unused", "<u4")]
    return np.dtype([("values", real, 16), ("missed", "<u2"), *marks, *ticks])


ROW = {"float": _row("<f4", "<u4"), "double": _row("<f8", "<u8")}
RESULT = {"float": _result("<f4"), "double": _result("<f8")}


def rows_of(log: Log, scalar: str, known_load: str | None = None) -> Rows:
    """Return the log as a device reads it, (N,) of `ROW[scalar]`.

    Parameters
    ----------
    log : channels that it lacks are missing in every row.
    scalar : "float", numbers rounded to single precision and angles to 2⁻³² turns, as an encoder
        counts; or "double", as the analysis has them.
    known_load : the channel of the load [Nm]; None is none: zero.
    """
    rows = np.zeros(len(log), dtype=ROW[scalar])
    numbers = {name: log[name] for name in CHANNELS if name in log} | _times(log)
    for name in CHANNELS:
        rows[name] = _real(numbers, name, rows.dtype[name])
    if known_load is None:
        rows["known_load"] = 0.0
    else:
        rows["known_load"] = log[known_load].astype(rows.dtype["known_load"])
    rows["marks"][runs(log["time"])[:, 0]] = 1
    for place, name in enumerate(ANGLES):
        if name in log:
            _set_angle(rows, place, log[name], bits=32 if scalar == "float" else 52)
    return rows


def _times(log: Log) -> dict[str, NDArray[np.float64]]:
    """Time [s] since the first row and the period [s] since the row before; usual at a start."""
    time = log["time"]
    period = np.diff(time, prepend=time[:1])
    period[runs(time)[:, 0]] = median_step(time)
    return {"time": time - time[0], "period": period}


def _real(
    numbers: Mapping[str, NDArray[np.float64]], name: str, to: np.dtype[np.void]
) -> NDArray[np.floating] | float:
    if name not in numbers:
        return np.nan
    with np.errstate(over="ignore"):
        return numbers[name].astype(to)


def _set_angle(rows: Rows, place: int, radians: NDArray[np.float64], bits: int) -> None:
    """Write an angle as turns and a fraction of `bits` bits, and its mark where it is finite."""
    with np.errstate(invalid="ignore"):
        good = np.isfinite(radians)
    turns = np.where(good, radians, -np.inf) / (2.0 * np.pi)
    turns = np.clip(turns, -MOST_TURNS, MOST_TURNS)  # which no model takes
    whole = np.floor(turns)
    counts = np.minimum(np.floor((turns - whole) * 2.0**bits), 2.0**bits - 1.0)
    spare = 0 if bits == 32 else 64 - bits
    rows["turns"][:, place] = whole
    rows["fractions"][:, place] = counts.astype(np.uint64) << np.uint64(spare)
    rows["marks"] |= np.where(good, 2 << place, 0).astype(np.uint32)


@dataclass(frozen=True, eq=False)
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


def cycles_per_instruction(device: Device, built: Built, folder: Path) -> float | None:
    """Return the mean cost of the step's machine code; None where nothing is known of it."""
    if device.name not in METHOD:
        return None
    command = [found(device.disassembler), "-d", str(alone(device, built, folder))]
    code = LINE.findall(call(command, folder, does="reading the machine code").decode())
    costs = [
        instruction_cost(device.name, name, operands) for name, operands in code if name != ".word"
    ]
    return sum(costs) / len(costs)


def instruction_cost(device: str, name: str, operands: str) -> float:
    """Return the cycles of one instruction of a device, as its disassembler writes it."""
    if name.startswith(("vdiv", "vsqrt")):
        return 14.0
    if device != "cortex-m4f":
        return 1.0
    if name.startswith(("udiv", "sdiv")):
        return 7.0  # 2 to 12
    if LISTS.match(name):
        return 1.0 + _registers(operands)
    if name.startswith(("ldrd", "strd")):
        return 3.0
    if name.startswith(("ldr", "vldr", "vstr", "str")):
        return 3.0 if operands.startswith("d") else 2.0
    if name.startswith("vmov") and CORE.search(operands):
        return 2.0
    if name.startswith(("vmla", "vmls", "vfma", "vfms")):
        return 3.0
    return 2.5 if BRANCH.match(name) else 1.0  # a branch: 1, taken 2 to 4


def _registers(operands: str) -> int:
    """How many words the registers of a list such as {r4-r7, lr} or {d8-d9} hold."""
    inside = operands[operands.find("{") + 1 : operands.find("}")]
    count = 0
    for part in inside.split(","):
        ends = re.findall(r"\d+", part)
        count += int(ends[1]) - int(ends[0]) + 1 if "-" in part and len(ends) == 2 else 1
    return 2 * count if inside.startswith("d") else count
