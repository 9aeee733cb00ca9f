"""Faults of the data, looked for before any physics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from flexspline.effects import Effect
from flexspline.fit.fitting import NO_TORSION
from flexspline.logs.checks import check
from flexspline.logs.log import Log

__all__ = ["DataFault", "data_faults", "with_measured_ratio"]

RATIO = "gear_ratio"
TWISTED = 0.01  # of the ratio: more than this no torsion makes of it
WHOLE = 0.05  # from a whole number, which a ratio of teeth mostly is
NO_TWIST = tuple(name for name in NO_TORSION if name != RATIO)


@dataclass(frozen=True)
class DataFault:
    """A fault of one run: `name` of the check, channel, size in `unit`, rows [first, last).

    `makes`: RMS of what it makes of the target, in its unit, None where that is not known. `grave`:
    whether it matters beside the noise floor (`grades.py`).
    """

    run: str
    name: str
    channel: str
    size: float
    unit: str
    rows: tuple[int, int]
    sentence: str
    makes: float | None = None
    grave: bool = True


def data_faults(
    logs: Sequence[Log],
    base: Sequence[Effect],
    target: str,
    known_load: str | None,
    threads: int = 1,
) -> tuple[DataFault, ...]:
    """Return the faults of all runs.

    Raises
    ------
    InputError
        Where a fault makes every fit meaningless. A ratio that the encoders contradict does not:
        they show the right one, see `with_measured_ratio`.
    """
    elsewhere = known_load not in (None, "reference_torque")
    asked = [e.name for e in base if not (elsewhere and "load" in e.reads)]
    found = []
    for log in logs:
        findings = check(log, effects=asked, target=target, threads=threads)
        findings.raise_errors()
        if target == "torsion":
            findings.raise_named(NO_TWIST)
        found += [
            DataFault(log.name, f.name, f.channel, f.size, f.unit, f.rows,
                      f"{log.name}: {f.sentence} {f.remedy}".rstrip())
            for f in findings.faults
        ]  # fmt: skip
    return tuple(found)


def with_measured_ratio(
    logs: Sequence[Log], faults: Sequence[DataFault], target: str
) -> tuple[list[Log], tuple[DataFault, ...]]:
    """Return the runs with the ratio that their encoders show, where a torsion would be nothing.

    With a wrong ratio q Ñ − θ grows with every turn, and all that could be found is the ratio. The
    fault's sentence then says which one is used instead. A ratio that is off by a little, and is no
    whole number, may be a torsion that follows the angle: the one that was stated stays.
    """
    shown = [fault.size for fault in faults if fault.name == RATIO]
    stated = logs[0].effective_ratio
    if target != "torsion" or not shown or stated is None:
        return list(logs), tuple(faults)
    ratio = float(np.median(shown))
    if abs(ratio / stated - 1.0) < TWISTED and abs(ratio - round(ratio)) > WHOLE:
        return list(logs), tuple(faults)
    circular = logs[0].facts.get("output_spline") == "circular"
    said = f"What follows is with {ratio:.5g} turns of the motor side per turn of the output."
    mended = [log.with_facts({"gear_ratio": ratio - circular}, note=said) for log in logs]
    told = [replace(f, sentence=f"{f.sentence} {said}") if f.name == RATIO else f for f in faults]
    return mended, tuple(told)
