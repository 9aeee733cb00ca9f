"""Do 95 % intervals of `fit` cover the truth where every channel is recorded? Class lab.

    python tests/bench/coverage.py --class lab [sets of runs] [deal]

Joints, motions and noise are those of the hidden benchmark (`hidden/rig.py`), poor motion in one
set of five included, behind its recorder of class lab (`hidden/recorder.py`): quantised encoders, a
drive's filtered velocity that is late, a noisy acceleration or none, a load cell with noise and
delay. The target is a model of the catalogue with known coefficients, of exact channels: friction
is the same both ways, and its forms are not others than those that are fitted. So nothing but the
recorder and the noise of the target stands between a fit and the truth.

Printed for channels as recorded, and for `fit` as it is called without anything: coverage with its
Wilson interval, the mean of (estimate − truth) / standard error, the deviation of the same, the
median error and the median standard error over the truth.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby
from operator import attrgetter
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parent))

from hidden.cases import Case, recorded_cases
from hidden.made import noise_of
from hidden.recorded import Rig
from hidden.recorder import Recorder
from hidden.rig import LOAD

import flexspline
from flexspline.logs.log import Log

__all__ = ["MODEL", "WAYS", "Drawn", "Interval", "drawn", "intervals_of", "lab_cases", "main"]

Array = NDArray[np.float64]

FACTOR = 0.03  # of the load, that friction grows by
MODEL = ("offset", "coulomb_friction", "viscous_friction", "inertia", "load_dependent_friction")
WATCHED = ("inertia", "viscous_friction", "load_dependent_friction")
BESIDE = ("coulomb_friction", "direction_width")
WAYS = {"as recorded": math.inf, "fit": None}
NORMAL = 1.959964


@dataclass(frozen=True)
class _Rig(Rig):
    """A rig whose friction is the same both ways: what a fit to the catalogue may assume."""

    @cached_property
    def recorder(self) -> Recorder:
        return replace(super().recorder, one_way=0.0)


@dataclass(frozen=True)
class Drawn:
    """Recorded runs of one case, and the parameters behind them by name."""

    case: Case
    recorder: Recorder
    logs: list[Log]
    truth: dict[str, float]


@dataclass(frozen=True)
class Interval:
    """What one fit says of one parameter; `source` of the motion that the rows read."""

    way: str
    parameter: str
    number: int
    excitation: str
    truth: float
    value: float
    error: float
    low: float
    high: float
    source: str

    @property
    def off(self) -> float:
        """In standard errors."""
        return (self.value - self.truth) / self.error

    @property
    def covers(self) -> bool:
        return self.low <= self.truth <= self.high


def lab_cases(deal: int) -> list[Case]:
    """Return cases in which nothing is hidden, of the targets with friction, of deal after deal."""
    kept = [
        case
        for own in range(deal, deal + 20)
        for case in recorded_cases("lab", own)
        if case.kind == "nothing" and case.target in ("sensor_torque", "motor_torque")
    ]
    return kept


def drawn(case: Case) -> Drawn:
    """Record the runs of a case."""
    rig = _Rig(case)
    joint, logs = rig.joint, []
    for number in range(rig.runs):
        seen = rig.taken(number)
        s = seen.truth
        own = s.friction + FACTOR * np.abs(s.transmitted) * s.direction
        noise = noise_of(case, rig.level, number, len(own))
        logs.append(rig.recorded(seen, own + noise, number))
    truth = {
        "offset": joint.offset,
        "coulomb_friction": joint.coulomb,
        "direction_width": joint.width,
        "viscous_friction": joint.viscous,
        "inertia": joint.inertia,
        "load_dependent_friction": FACTOR,
    }
    return Drawn(case, rig.recorder, logs, truth)


def intervals_of(one: Drawn, way: str) -> list[Interval]:
    """Fit the model to the runs and return what is said of each parameter."""
    made = flexspline.fit(
        MODEL,
        one.logs,
        one.case.target,
        known_load=LOAD,
        checks=False,
        options=flexspline.FitOptions(bandwidth=WAYS[way]),
    )
    source = next((p.source for p in made.part.preparations if "accel" in p.channel), "")
    return [
        Interval(way, name, one.case.number, one.case.excitation, one.truth[name],
                 made[name].value, made[name].standard_error, *made[name].interval, source)
        for name in (*WATCHED, *BESIDE)
    ]  # fmt: skip


def wilson(hits: int, count: int) -> tuple[float, float]:
    """Return the ends of Wilson's 95 % interval of a share."""
    share, square = hits / count, NORMAL**2
    middle = (share + square / (2 * count)) / (1 + square / count)
    half = np.sqrt(share * (1 - share) / count + square / (4 * count**2)) / (1 + square / count)
    return middle - NORMAL * float(half), middle + NORMAL * float(half)


def line(label: str, found: Sequence[Interval]) -> str:
    """One line of the table."""
    hits = sum(one.covers for one in found)
    low, high = wilson(hits, len(found))
    off = np.array([one.off for one in found])
    error = np.median([abs(one.value / one.truth - 1.0) for one in found])
    told = np.median([one.error / one.truth for one in found])
    return (
        f"{label:<38s} {100 * hits / len(found):5.1f} % ({100 * low:.1f}–{100 * high:.1f}) "
        f"{off.mean():+6.2f} {np.median(off):+6.2f} {off.std():5.2f}  {100 * error:7.3f} % "
        f"{100 * told:8.3f} %"
    )


def table(found: Sequence[Interval]) -> str:
    """Coverage by parameter and way; of the intervals of `fit` also by excitation."""
    head = f"{'':38s} {'95 % interval covers':22s} mean  median  dev.  |error|  standard error"
    lines = [head + "; off by, in standard errors, and median over the truth"]
    for name in (*WATCHED, *BESIDE):
        for way in WAYS:
            own = [one for one in found if one.parameter == name and one.way == way]
            if own:
                lines.append(line(f"{name}, {way}", own))
    for name in WATCHED:
        own = [one for one in found if one.parameter == name and one.way == "fit"]
        for kind, some in groupby(sorted(own, key=attrgetter("excitation")),
                                  key=attrgetter("excitation")):  # fmt: skip
            lines.append(line(f"  {name}, {kind}", list(some)))
    return "\n".join(lines)


def main(arguments: Sequence[str]) -> None:
    """Print the table; a preliminary one every hundred sets."""
    count = int(arguments[0]) if arguments else 1000
    deal = int(arguments[1]) if len(arguments) > 1 else 1
    found: list[Interval] = []
    started, seconds = time.perf_counter(), dict.fromkeys(WAYS, 0.0)
    for number, case in enumerate(lab_cases(deal)[:count], start=1):
        one = drawn(case)
        for way in WAYS:
            begun = time.process_time()
            found += intervals_of(one, way)
            seconds[way] += time.process_time() - begun
        if number % 100 == 0 or number == count:
            spent = ", ".join(f"{way} {total / number:.2f} s" for way, total in seconds.items())
            passed = time.perf_counter() - started
            print(f"{number} sets of runs, {passed:.0f} s; processor time of a fit: {spent}")
            print(table(found), flush=True)
