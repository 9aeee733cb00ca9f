"""Processors that a certificate is made for.

A device has a compiler with options, and the board that QEMU emulates.
"""

from __future__ import annotations

import subprocess
from dataclasses import dataclass

from flexspline.errors import InputError, did_you_mean

__all__ = [
    "DEVICES",
    "Device",
    "device_of",
    "version_of",
]

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
