"""One step of the ten-harmonic chain: nanoseconds on this machine, instructions on a Cortex-M.

    python tests/bench/chain.py [--device cortex-m4f] [--rows 3000]

The first table is of this machine, in float and double, with calls of the heap counted; the second
of the emulated device, a stage more in each line (QEMU counts instructions, so it is the same in
every run).
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "python"))

import chain_rig
import device_chains

import flexspline
from flexspline.certification.program import rows_of
from flexspline.exporting import export
from flexspline.logs.log import Log
from flexspline.model import Model
from flexspline.programs import STRICT, firmware_folder, host_compiler

WRAPPED = "-Wl,--wrap=malloc"


def host_steps(model: Model, log: Log, scalar: str, *batches: str) -> list[float]:
    """What `chain.cpp` prints for a model, compiled as firmware is, and a log."""
    sources, here = firmware_folder() / "certify", Path(__file__).parent
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        export(model, folder / "joint.hpp")
        program = folder / "chain"
        include = flexspline.get_include()
        if not Path(include).is_dir():
            include = str(sources.parents[1] / "include")
        command = [host_compiler(), *STRICT.split(), "-O2", f"-DFLEXSPLINE_SCALAR={scalar}"]
        command += [f"-I{include}", f"-I{folder}", f"-I{sources}", WRAPPED]
        command += [str(here / "chain.cpp"), str(sources / "joint_unit.cpp"), "-o", str(program)]
        subprocess.run(command, check=True)
        given = rows_of(log, scalar).tobytes()
        done = subprocess.run([program, *batches], input=given, capture_output=True, check=True)
    return [float(word) for word in done.stdout.split()]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--device", default="cortex-m4f")
    parser.add_argument("--rows", type=int, default=3000)
    options = parser.parse_args()
    log = chain_rig.raw_channels(options.rows)
    print("Nanoseconds per step here; batches, then steps one by one with the clock's own time")
    print(f"{'':<8}{'median':>8}{'worst':>8}{'one':>8}{'99.9 %':>8}{'worst':>8}{'heap':>6}")
    for scalar in ("float", "double"):
        *times, heap = host_steps(device_chains.ten_harmonics(), log, scalar)
        print(f"{scalar:<8}" + "".join(f"{time:>8.0f}" for time in times) + f"{heap:>6.0f}")
    print(f"Instructions per step on {options.device}, over {len(log)} rows; bytes of code")
    print(f"{'':<34}{'median':>8}{'most':>8}{'code':>8}")
    for name, model in device_chains.growing_chain().items():
        cost = flexspline.certify(model, log, options.device).cost
        numbers = (cost.instructions_per_step, cost.most_instructions, cost.code_bytes)
        print(f"{name:<34}" + "".join(f"{number or 0:>8.0f}" for number in numbers), flush=True)


if __name__ == "__main__":
    main()
