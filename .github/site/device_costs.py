"""Counts what a step of each effect costs a microcontroller, for the pages of the effects.

    python .github/site/device_costs.py [NAME ...]

Each effect, or each of these names, alone, with three orders of each of its pairs where it has
orders, on an emulated Cortex-M4F in single precision; written to device_costs.json beside this
file, where the others stay. Needs the tools of `flexspline certify --device cortex-m4f`.
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
    """Certify each effect asked for and write its instructions per step."""
    asked = sys.argv[1:] or [*flexspline.CATALOGUE]
    counted = json.loads(COSTS.read_text(encoding="utf-8"))["instructions_per_step"]
    for name in asked:
        made = flexspline.certify(*alone(name, ROWS), DEVICE)
        if not made.bit_identical:
            raise SystemExit(f"{name}: other bits on {DEVICE} than on this machine")
        counted[name] = round(made.cost.instructions_per_step)
        print(f"{name}: {counted[name]}", flush=True)
    known = {name: counted[name] for name in flexspline.CATALOGUE if name in counted}
    costs = {"device": DEVICE, "instructions_per_step": known}
    text = json.dumps(costs, indent=2) + "\n"
    COSTS.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
