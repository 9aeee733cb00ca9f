"""Cycles of a step, estimated from its instructions: how many and of which kinds.

QEMU counts instructions, not cycles. What an instruction costs is weighed over the machine code of
the step (how often each is run is not known), memory without wait states, by Arm's table as Texas
Instruments prints it for the Cortex-M4F of the CC13x2 ([TI2021], tables 3-25 and
3-27, after Arm's Cortex-M4 Technical Reference Manual [Arm2010], tables 3-1 and 7-1):

    load or store of a word or a float    2, of a double 3, of a list 1 + words
    float between FPU and core            2
    multiply and accumulate               3
    division, square root                 14; of integers 2 to 12, taken as 7
    branch                                1, taken 1 + (1 to 3), as 2.5
    all else                              1

Loads behind one another overlap, so code that loads much is faster than this. Arm publishes no such
table of the Cortex-M7, which may issue two instructions in one cycle: its estimate leaves that out
(measured pairs: quinapalus.com/cm7cycles.html).
"""

from __future__ import annotations

import re
from pathlib import Path

from flexspline.certification.building import Built, alone
from flexspline.certification.devices import Device
from flexspline.certification.tools import call, found

__all__ = ["METHOD", "cycles_per_instruction", "instruction_cost"]

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
