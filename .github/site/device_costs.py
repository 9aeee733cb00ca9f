"""Counts what a step of each effect costs a microcontroller, for the pages of the effects.

    python .github/site/device_costs.py

Each effect alone, with three orders of each of its pairs where it has orders, on an emulated
Cortex-M4F in single precision; written to device_costs.json beside this file. Needs the tools of
`flexspline certify --device cortex-m4f`.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "tests" / "bench"))

from certify_everything import alone

import flexspline

COSTS = Path(__file__).parent / "device_costs.json"
DEVICE = "cortex-m4f"
ROWS = 2000


def main() -> None:
    """Certify each effect of the catalogue and write its instructions per step."""
    counted = {}
    for name in flexspline.CATALOGUE:
        made = flexspline.certify(*alone(name, ROWS), DEVICE)
        if not made.bit_identical:
            raise SystemExit(f"{name}: other bits on {DEVICE} than on this machine")
        counted[name] = round(made.cost.instructions_per_step)
        print(f"{name}: {counted[name]}", flush=True)
    costs = {"device": DEVICE, "instructions_per_step": counted}
    text = json.dumps(costs, indent=2) + "\n"
    COSTS.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
