"""What is wrong with a log, looked for before anything is fitted."""

from __future__ import annotations

from collections.abc import Sequence

from flexspline.logs.checks.consistency import (
    Gear,
    gear,
    measured_gear,
    torque,
    velocity_of_position,
)
from flexspline.logs.checks.copies import copies, copy_finding
from flexspline.logs.checks.ends import drive_disabled, homing_move, start_transient, stuck_tail
from flexspline.logs.checks.excitation import excitation, excited
from flexspline.logs.checks.findings import Excited, Finding, Findings, Severity, sorted_findings
from flexspline.logs.checks.load import load_of_target, told_once
from flexspline.logs.checks.motion import motion_of
from flexspline.logs.checks.recorder import with_shared_delays
from flexspline.logs.checks.samples import (
    clipped,
    constant,
    dropped_samples,
    impossible,
    no_channels,
    not_finite,
    quantised,
    repeated_rows,
    time_order,
    wrapped,
)
from flexspline.logs.log import Log
from flexspline.logs.plausible import emptied
from flexspline.logs.read import LogLike, as_log
from flexspline.parallel import in_order

__all__ = [
    "Excited",
    "Finding",
    "Findings",
    "Gear",
    "Severity",
    "check",
    "check_runs",
    "measured_gear",
]

ALWAYS = (no_channels, not_finite, impossible, time_order)
"""Checks that any numbers pass through; the others see what no instrument reads as empty."""
CHECKS = (
    dropped_samples,
    repeated_rows,
    constant,
    clipped,
    wrapped,
    start_transient,
    homing_move,
    stuck_tail,
    drive_disabled,
    velocity_of_position,
    gear,
    torque,
    quantised,
)


def check(
    log: LogLike, *, effects: Sequence[str] = (), target: str | None = None, threads: int = 1
) -> Findings:
    """Look for faults of the data. Nothing is changed; each finding names the repair to ask for.

    Parameters
    ----------
    log : any log, broken ones too; or what `read_log` reads as one
    effects : names of the catalogue that are to be fitted: missing channels and lacking
        excitation are then found as well
    target : the channel to be fitted (or ``torsion``): it has to be there
    threads : checks that are made at the same time

    Returns
    -------
    Findings, the worst first. Rows count from 0, as in ``log[channel][row]``. Its `excited` says,
    of the effects or of all that explain a target whose channels are there, whether the run
    excites them.

    Raises
    ------
    InputError : an effect or target that does not exist.
    """
    log = as_log(log)
    found = [finding for one in ALWAYS for finding in one(log)]
    if any(finding.name == "impossible_clock" for finding in found):
        return sorted_findings(log.name, found)
    log = emptied(log)
    try:
        motion_of(log)  # once, before several ask for it
        made = in_order(threads, lambda one: list(one(log)), CHECKS)
        found.extend(finding for some in made for finding in some)
        broken = any(finding.severity == "error" for finding in found)
        found.extend(load_of_target(log, target))
        found.extend(excitation(log, effects, target))
        shown = () if broken else excited(log, effects, target)
    finally:
        motion_of.cache_clear()  # it would keep the log
    return sorted_findings(log.name, found, shown)


def check_runs(
    logs: Sequence[Log],
    *,
    effects: Sequence[str] = (),
    target: str | None = None,
    threads: int = 1,
) -> list[Findings]:
    """Look for faults of each run, as `check` does, and for what runs show together.

    Those are runs that are there twice, and a velocity's delay that is its recorder's in all runs.
    What is said of a load beside the target is said of the first run alone.
    """
    made = [check(log, effects=effects, target=target, threads=threads) for log in logs]
    made = told_once(with_shared_delays(logs, made))
    for number, other in copies(logs):
        found = [*made[number], copy_finding(logs[number], logs[other])]
        made[number] = sorted_findings(logs[number].name, found, made[number].excited)
    return made
