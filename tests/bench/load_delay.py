"""Is the delay of a load cell known before any name is? Estimates against the recorder's own.

    python tests/bench/load_delay.py [--fresh 63] [--limit 40]

Cases of class lab with a known load, torsion apart, go as far as `delay_beside_everything`. Printed
for each: the true delay, the estimate with its standard error, and their difference in standard
errors; at the end how many lie within two and three. A hidden lag of the sensor is left out, whose
difference to the delay is what a log shows.
"""

from __future__ import annotations

import argparse
import os
from dataclasses import replace

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from hidden.cases import Case, recorded_cases
from hidden.recorded import UnreachableError, recorded
from hidden.rig import LOAD
from scipy.constants import milli

from flexspline.discovery.candidates import LAG, freedoms
from flexspline.discovery.discovering import _Recorded, _task
from flexspline.discovery.faults import Delay, delay_beside_everything
from flexspline.prepared import learned


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--fresh", type=int, default=63, help="a deal of cases, by its number")
    parser.add_argument("--limit", type=int, default=40, help="the first so many")
    given = parser.parse_args()
    off = []
    for case in _chosen(given.fresh)[: given.limit]:
        try:
            true, found = _both(case)
        except UnreachableError:
            continue
        off.append((found.seconds - true) / found.error)
        print(f"{case.key:70s} {true / milli:6.3f}  {found.seconds / milli:6.3f} ± "
              f"{found.error / milli:.3f} ms  {off[-1]:+5.1f}", flush=True)  # fmt: skip
    for errors in (2.0, 3.0):
        print(f"within {errors:g}: {np.sum(np.abs(off) < errors)} of {len(off)}")


def _chosen(fresh: int) -> list[Case]:
    every = recorded_cases("lab", fresh)
    return [c for c in every if c.target != "torsion" and LAG not in (*c.hidden, *c.excluded)]


def _both(case: Case) -> tuple[float, Delay]:
    made = recorded(case)
    inputs, ways = learned(made.logs, case.target, LOAD)
    task = _task(made.base, case.target, LOAD, {})
    task = replace(task, preparations=tuple(ways), exclude=tuple(case.excluded))
    free = freedoms(task.effects, case.target, LOAD, made.logs, inputs)
    look = _Recorded.of(made.logs, task).look(free)
    return made.recorder.load_delay, delay_beside_everything(look)


if __name__ == "__main__":
    main()
