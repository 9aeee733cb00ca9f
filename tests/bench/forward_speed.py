"""What driving a fitted model forward costs for each row and Runge-Kutta step, beside scipy.

    python tests/bench/forward_speed.py

Drives of two to eight effects over 20 000 rows at 1 kHz, two steps from row to row; seconds are of
the process, best, median and worst of 15. Beside it one row of `solve_ivp` (DOP853, rtol 1e-6)
for the drive without friction that jumps, where it has nothing to locate, right-hand side in plain
Python. The last table is the error at 1, 2 and 4 steps a row against 64, rad.
"""

from __future__ import annotations

import math
import sys
import time as clock
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

sys.path.insert(0, str(Path(__file__).parents[1] / "python"))
from forward_runs import Given, drive, run_of

from flexspline.effects import effect
from flexspline.forward import drive_inputs

BASE: Given = [("inertia", [0.5]), ("viscous_friction", [3.0])]
GRAVITY: Given = [("gravity", [8.0, 0.0])]
COULOMB: Given = [("coulomb_friction", [2.0])]
DRIVES: dict[str, Given] = {
    "inertia, viscous": BASE,
    "+ gravity": [*BASE, *GRAVITY],
    "+ Coulomb, load friction": [*BASE, *GRAVITY, *COULOMB, ("load_dependent_friction", [0.1])],
    "+ Stribeck": [*BASE, *GRAVITY, *COULOMB, ("stribeck_friction", [1.0])],
    "+ presliding": [*BASE, *GRAVITY, ("presliding_friction", [1.0, 0.5, 0.3, 0.2])],
    "+ cogging, two orders": [
        *BASE, *GRAVITY, *COULOMB, (effect("cogging", orders=[6, 12]), [0.1, 0.1, 0.05, 0.05])
    ],
}  # fmt: skip
STEPS, REPEATS = 2, 15
TIME = np.arange(20_000) / 1000.0
TORQUE = 12.0 * np.sin(2 * np.pi * 0.3 * TIME)


def main() -> None:
    """Print the table."""
    print(f"{'drive':28} {'ns per row and step':>28}    error at 1, 2, 4 steps [rad]")
    for name, given in DRIVES.items():
        model = drive(given)
        inputs = drive_inputs(model, run_of(TIME, TORQUE))
        spent = []
        for _ in range(REPEATS):
            begun = clock.process_time()
            inputs.run(model.part(), STEPS)
            spent.append((clock.process_time() - begun) / len(TIME) / STEPS * 1e9)
        finest = inputs.run(model.part(), 64)["position"]
        errors = [np.abs(inputs.run(model.part(), n)["position"] - finest).max() for n in (1, 2, 4)]
        best, median, worst = min(spent), float(np.median(spent)), max(spent)
        costs = f"{best:8.0f} {median:8.0f} {worst:8.0f}"
        print(f"{name:28} {costs:>28}    " + "  ".join(f"{e:.1e}" for e in errors))
    print(f"{'scipy, + gravity':28} {scipy_cost():8.0f} per row")


def scipy_cost() -> float:
    """Nanoseconds a row of the smooth drive by scipy, best of three."""

    def slopes(t: float, y: list[float]) -> list[float]:
        torque = 12.0 * math.sin(2 * math.pi * 0.3 * t)
        return [y[1], (torque - 8.0 * math.sin(y[0]) - 3.0 * y[1]) / 0.5]

    spent = []
    for _ in range(3):
        begun = clock.process_time()
        solve_ivp(slopes, (0.0, TIME[-1]), [0.0, 0.0], "DOP853", TIME, rtol=1e-6)
        spent.append(clock.process_time() - begun)
    return min(spent) / len(TIME) * 1e9


if __name__ == "__main__":
    main()
