"""Nanoseconds for one sample step of the core on this machine, median and worst.

    python tests/bench/step.py

Compiles `step.cpp` with the system's compiler (CXX, else c++) as firmware does, without
instructions beyond the machine's baseline, and prints a table.
"""

from __future__ import annotations

import os
import subprocess
import tempfile
from pathlib import Path

FLAGS = "-std=c++20 -O2 -ffp-contract=off -fno-exceptions -fno-rtti -Wall -Wextra -Werror"
HERE = Path(__file__).parent
INCLUDE = HERE.parents[1] / "cpp" / "include"


def results() -> list[list[str]]:
    """Words of the lines that the program prints."""
    compiler = os.environ.get("CXX", "c++")
    with tempfile.TemporaryDirectory() as folder:
        program = str(Path(folder) / "step")
        source = str(HERE / "step.cpp")
        command = [compiler, *FLAGS.split(), f"-I{INCLUDE}", source, "-o", program]
        subprocess.run(command, check=True)
        done = subprocess.run([program], check=True, capture_output=True, text=True)
    return [line.split() for line in done.stdout.splitlines()]


def main() -> None:
    *rows, clock = results()
    print("One step: encoder [rad] -> velocity, acceleration -> nine effects with n harmonics.")
    print("ns per step; batches of 1000 steps, then 200 000 steps timed one by one")
    heads = f"{'median':>9}{'worst batch':>13}{'median one':>12}{'99.9 %':>9}{'worst':>9}"
    print(f"{'':<8}{'n':>3}{heads}")
    for precision, n, median, worst, one, high, highest, flagged, _ in rows:
        print(f"{precision:<8}{n:>3}{median:>9}{worst:>13}{one:>12}{high:>9}{highest:>9}")
        if flagged != "0":
            raise SystemExit(f"{flagged} steps were flagged; the timing is of no use")
    print(f"The clock itself takes {clock[1]} ns, which the steps timed one by one include;")
    print("the worst ones are those in which the system ran something else.")


if __name__ == "__main__":
    main()
