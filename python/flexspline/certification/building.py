"""The exported model compiled into certify's program, for a host or a device."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from flexspline.about import PACKAGE, get_include
from flexspline.certification.devices import Device
from flexspline.certification.tools import call, found, host_compiler

__all__ = ["Built", "Sizes", "alone", "build", "calls_of", "firmware_folder", "sizes_of"]

STRICT = (
    "-std=c++20 -ffp-contract=off -fno-exceptions -fno-rtti -fno-threadsafe-statics "
    "-fno-asynchronous-unwind-tables -ffunction-sections -fdata-sections "
    "-Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wdouble-promotion -Werror"
)
BARE = ("-nostdlib", "-lc", "-lgcc")  # no start-up code, no C++ library


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


def firmware_folder() -> Path:
    """The firmware's sources: those of the installed package, else those of the checkout."""
    package = PACKAGE.resolve()
    installed = package / "firmware"
    return installed if installed.is_dir() else package.parents[1] / "cpp" / "firmware"


def _include() -> Path:
    installed = Path(get_include())
    return installed if installed.is_dir() else firmware_folder().parent / "include"


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
    command += [f"-DFLEXSPLINE_SCALAR={scalar}", f"-I{_include()}", f"-I{folder}"]
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
