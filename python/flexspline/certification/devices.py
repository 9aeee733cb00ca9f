"""Processors that a certificate is made for, and the programs that it needs on this machine.

A device has a compiler with options, and the board that QEMU emulates. A program that is missing is
an `InputError` that names its Debian package.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from flexspline.errors import InputError, did_you_mean

__all__ = [
    "DEVICES",
    "Device",
    "call",
    "device_of",
    "found",
    "host_compiler",
    "version_of",
]

ARM = ("-mthumb", "-mfloat-abi=hard")

ARM_PACKAGES = "gcc-arm-none-eabi, libnewlib-arm-none-eabi and libstdc++-arm-none-eabi-dev"
PACKAGES = {
    "arm-none-eabi-g++": ARM_PACKAGES,
    "arm-none-eabi-size": "binutils-arm-none-eabi",
    "arm-none-eabi-objdump": "binutils-arm-none-eabi",
    "qemu-system-arm": "qemu-system-arm",
    "c++": "g++",
    "size": "binutils",
    "objdump": "binutils",
    "valgrind": "valgrind",
}
LONGEST = 3600.0  # s, of a program: what takes longer hangs


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


def found(tool: str) -> str:
    """Return the path of a program.

    Raises
    ------
    InputError
        Where it is not installed; the sentence names Debian's package.
    """
    path = shutil.which(tool)
    if path is None:
        package = PACKAGES.get(tool, tool)
        raise InputError(f"{tool} is not on this machine; install Debian's {package}")
    return path


def host_compiler() -> str:
    """Return the path of the host's C++ compiler: $CXX, else c++."""
    chosen = os.environ.get("CXX", "")
    return (shutil.which(chosen) if chosen else None) or found("c++")


def version_of(tool: str) -> str:
    """Return the first line of what `tool --version` says."""
    said = subprocess.run([tool, "--version"], capture_output=True, text=True, check=True).stdout
    return said.splitlines()[0]


def call(
    command: Sequence[str | Path], folder: Path, given: bytes | None = None, *, does: str
) -> bytes:
    """Run a program in a folder and return what it wrote on standard output.

    Raises
    ------
    InputError
        Where it fails; `does` is what the sentence says was attempted.
    """
    words = [str(word) for word in command]
    try:
        done = subprocess.run(
            words, cwd=folder, input=given or b"", capture_output=True, timeout=LONGEST
        )
    except subprocess.TimeoutExpired as error:
        raise InputError(f"{does}: no end within {LONGEST:g} s; give a shorter run") from error
    if done.returncode != 0:
        said = done.stderr.decode(errors="replace")
        raise InputError(f"{does}: {_reason(said, done.returncode)}")
    return done.stdout


def _reason(said: str, code: int) -> str:
    """One line on why a program failed."""
    header = re.search(r"fatal error: (\w+): No such file", said)
    if header:
        return (
            f"the compiler lacks the standard header {header[1]}; install Debian's "
            "libstdc++-arm-none-eabi-dev (or the C++ library of your own compiler)"
        )
    lines = [line for line in said.splitlines() if "error" in line.lower()] or said.splitlines()
    first = lines[0].strip() if lines else "it says nothing"
    return f"exit code {code}: {first}; correct the model or give other compiler options"
