"""Faults of the data, looked for before any physics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from flexspline.discovery.forms import owned_gain
from flexspline.discovery.freedom import LAG
from flexspline.effects import Effect
from flexspline.fit.fitting import NO_TORSION
from flexspline.logs.checks import check
from flexspline.logs.log import Log
from flexspline.logs.repairs import move_earlier

if TYPE_CHECKING:
    from flexspline.discovery.analysis import Analysis
    from flexspline.discovery.working import Working

__all__ = ["SENSOR", "DataFault", "data_faults", "late_load", "lead_of", "with_measured_ratio"]

RATIO = "gear_ratio"
SENSOR = ("sensor_torque",)
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


def lead_of(work: Working) -> float:
    """Return by how much the sensor of a model is ahead of its load, s; 0 without a lag."""
    owners = [e.name for e in work.effects for _ in e.terms]
    return -float(work.coefficients[owners.index(LAG)]) if LAG in owners else 0.0


def late_load(
    made: Analysis, logs: Sequence[Log]
) -> tuple[list[Log], tuple[DataFault, ...]] | None:
    """Return the runs with a late load cell moved to where it belongs, and the fault of each.

    A sensor cannot read a torque before it is there: where its lag comes out negative, the channel
    of the known load is late by that much more than the sensor. Between the torque of a drive and
    the load cell any delay is one of the recorder. None where there is none, or where what is left
    without a name explains more than the delay does, and may be what makes it.
    """
    problem, late = made.study.problem, lead_of(made.final)
    load = problem.known_load
    if load is None or late == 0.0 or (problem.target in SENSOR and late < 0.0):
        return None
    if made.leftover.groups and not made.final.named:
        dictionary = made.searcher.study.dictionary(made.final, made.searcher.whitening)
        if made.leftover.gain > owned_gain(dictionary, LAG):
            return None
    channel = load if late > 0.0 else problem.target
    why = ", which cannot read a torque before it is there" if problem.target in SENSOR else ""
    moved = [move_earlier(log, load, late) for log in logs]
    told = [
        DataFault(
            log.name,
            "load_delay",
            channel,
            abs(late),
            "s",
            (0, len(log)),
            f"{log.name}: {channel} is {1e3 * abs(late):.3g} ms late against "
            f"{problem.target if channel == load else load}{why}; names are looked for with {load} "
            f"moved by that much. Ask for the repair shift={channel}:{abs(late):.3g}.",
        )
        for log in logs
    ]
    return moved, tuple(told)
