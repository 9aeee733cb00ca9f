"""A load that is known at the output, and whether what is to be explained makes use of it.

A load cell, a brake or a known weight says what the joint carries. Taken off the target (the known
load), it leaves what the effects are: a drive's friction, a sensor's own errors. As the target
itself, or beside it and unused, it is something that the effects have to explain.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from flexspline.logs.channels import CHANNELS
from flexspline.logs.checks.findings import Finding, Findings
from flexspline.logs.log import Log

__all__ = ["UNUSED", "load_of_target", "told_once", "unused_load"]

UNUSED = "load_not_used"
KNOWN = "reference_torque"
TARGETS = ("sensor_torque", "motor_torque", "motor_current")


def load_of_target(log: Log, target: str | None) -> Iterator[Finding]:
    """A known load beside the target. A sensor_torque may be a load cell's too: no run tells."""
    if target not in TARGETS or target not in log:
        return
    if _varies(log, KNOWN):
        yield _note(log, UNUSED, KNOWN, _unused(target))


def told_once(made: Sequence[Findings]) -> list[Findings]:
    """Return the findings of all runs, without what an earlier run has already said of its load."""
    said: set[str] = set()
    told = []
    for one in made:
        own = {f.sentence for f in one if f.name == UNUSED}
        left = tuple(f for f in one if f.sentence not in own & said)
        told.append(replace(one, items=left))
        said |= own
    return told


def unused_load(logs: Sequence[Log], target: str, known_load: str | None) -> list[str]:
    """Return a sentence where all runs have a known load that was not given as one."""
    unused = known_load is None and target in TARGETS and all(_varies(log, KNOWN) for log in logs)
    return [_unused(target)] if unused else []


def _unused(target: str) -> str:
    return (
        f"{KNOWN}, the load that a load cell, brake or weight at the output tells, is not used "
        f"unless a fit is given known_load (--known-load {KNOWN}), the usual way: the effects then "
        f"explain {target} less the load, and without it the load too."
    )


def _varies(log: Log, channel: str) -> bool:
    if channel not in log:
        return False
    low, high = _ends(log, channel)
    return low < high


def _ends(log: Log, channel: str) -> tuple[float, float]:
    """The least and the largest value beside NaN; NaN where there is no other."""
    return float(np.fmin.reduce(log[channel])), float(np.fmax.reduce(log[channel]))


def _note(log: Log, name: str, channel: str, said: str, remedy: str = "") -> Finding:
    low, high = _ends(log, channel)
    unit = CHANNELS[channel].unit
    return Finding(name, "note", channel, (0, len(log)), high - low, unit, said, remedy)
