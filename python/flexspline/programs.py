"""Programs of this machine that the package calls, and the C++ sources that it gives them.

A program that is missing is an `InputError` that names its Debian package.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

from flexspline.about import PACKAGE, get_include
from flexspline.errors import InputError

__all__ = [
    "PACKAGES",
    "STRICT",
    "call",
    "firmware_folder",
    "found",
    "host_compiler",
    "include_folder",
]

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
STRICT = (
    "-std=c++20 -ffp-contract=off -fno-exceptions -fno-rtti -fno-threadsafe-statics "
    "-fno-asynchronous-unwind-tables -ffunction-sections -fdata-sections "
    "-Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wdouble-promotion -Werror"
)
"""Options with which everything is compiled that leaves for a device."""
LONGEST = 3600.0  # s, of a program: what takes longer hangs


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


def firmware_folder() -> Path:
    """The firmware's sources: those of the installed package, else those of the checkout."""
    package = PACKAGE.resolve()
    installed = package / "firmware"
    return installed if installed.is_dir() else package.parents[1] / "cpp" / "firmware"


def include_folder() -> Path:
    """The core's headers: those of the installed package, else those of the checkout."""
    installed = Path(get_include())
    return installed if installed.is_dir() else firmware_folder().parent / "include"


def call(
    command: Sequence[str | Path],
    folder: Path,
    given: bytes | None = None,
    *,
    does: str,
    remedy: str = "correct the model or give other compiler options",
) -> bytes:
    """Run a program in a folder and return what it wrote on standard output.

    Raises
    ------
    InputError
        Where it fails; `does` is what the sentence says was attempted, `remedy` what to do.
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
        raise InputError(f"{does}: {_reason(said, done.returncode, remedy)}")
    return done.stdout


def _reason(said: str, code: int, remedy: str) -> str:
    """One line on why a program failed."""
    header = re.search(r"fatal error: (\w+): No such file", said)
    if header:
        return (
            f"the compiler lacks the standard header {header[1]}; install Debian's "
            "libstdc++-arm-none-eabi-dev (or the C++ library of your own compiler)"
        )
    lines = [line for line in said.splitlines() if "error" in line.lower()] or said.splitlines()
    first = lines[0].strip() if lines else "it says nothing"
    return f"exit code {code}: {first}; {remedy}"
