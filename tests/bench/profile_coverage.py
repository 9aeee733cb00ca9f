"""How often 95 % intervals of a Stribeck velocity hold it: by its profile, and Wald's.

    python tests/bench/profile_coverage.py [--draws 240]

Each draw is a log of 15 s at 100 Hz in AR(1) noise, φ = 0.9. The first design shows the velocity
well; the second is the first with the width of the direction fitted beside it. The third leaves
room for another valley of the squares, in which friction of the other sign explains the log as
well.

Of 240 logs: 96.7 % by either interval where the velocity is well seen; 94.2 % by the profile beside
a width, and 87.9 % by Wald's; where it is hardly seen 92 % by the profile with all its parts, and
70 % by Wald's, which knows one valley.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

import flexspline

sys.path.insert(0, str(Path(__file__).parents[1] / "python"))

from test_profile import HELD, VELOCITY, fitted, log_of, weak

DESIGNS: dict[str, tuple[Any, float, dict[str, float]]] = {
    "well seen": (log_of, 0.1, HELD),
    "beside a width": (log_of, 0.1, {}),
    "hardly seen": (weak, 0.3, HELD),
}


def inside(log: Any, truth: float, held: dict[str, float]) -> tuple[bool, bool, bool] | None:
    """Whether profile and Wald hold the truth, and whether the profile is in one closed part."""
    fit = fitted(log, fixed=held)
    try:
        found = fit.profile(VELOCITY, points=0)
    except flexspline.InputError:  # at a bound
        return None
    holds = any((a or 0.0) <= truth <= (np.inf if b is None else b) for a, b in found.parts)
    return holds, found.wald[0] <= truth <= found.wald[1], found.closed and len(found.parts) == 1


def main() -> None:
    """Print a line for each design."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=240)
    draws = parser.parse_args().draws
    for name, (made, truth, given) in DESIGNS.items():
        start = time.perf_counter()
        every = [inside(made(seed), truth, given) for seed in range(1000, 1000 + draws)]
        table = np.array([row for row in every if row is not None])
        held, wald, closed = 100.0 * table.mean(axis=0)
        spent = time.perf_counter() - start
        print(
            f"{name}: profile {held:.1f} %, Wald {wald:.1f} % of {len(table)} logs "
            f"({draws - len(table)} ended at a bound); {closed:.0f} % of the profiles are one "
            f"closed part; {spent:.0f} s",
            flush=True,
        )


if __name__ == "__main__":
    main()
