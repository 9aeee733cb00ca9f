"""What is wrong with a log, looked for before anything is fitted.

Of several logs it is also said in one sentence, and as numbers for scripts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import Any

from flexspline.about import __version__
from flexspline.logs.checks.consistency import (
    Gear,
    drive_beside_current,
    gear,
    measured_gear,
    too_fast,
    torque,
    velocity_of_position,
    with_shared_delays,
    without_gains,
)
from flexspline.logs.checks.dependence import copies, copy_finding
from flexspline.logs.checks.ends import drive_disabled, homing_move, start_transient, stuck_tail
from flexspline.logs.checks.excitation import excitation, excited, excited_together
from flexspline.logs.checks.findings import (
    Excited,
    Finding,
    Findings,
    Severity,
    excitation_lines,
    sorted_findings,
)
from flexspline.logs.checks.load import load_of_target, told_once
from flexspline.logs.checks.samples import (
    DROPPED,
    clipped,
    constant,
    dropped_samples,
    impossible,
    kelvin,
    motion_of,
    no_channels,
    not_finite,
    quantised,
    repeated_rows,
    slow_clock,
    spiked,
    stamps_of_arrival,
    time_order,
    unsigned,
    wrapped,
)
from flexspline.logs.log import Log, emptied
from flexspline.logs.read import LogLike, as_log
from flexspline.parallel import in_order
from flexspline.schema import checked_json

__all__ = [
    "Audits",
    "Excited",
    "Finding",
    "Findings",
    "Gear",
    "Severity",
    "audit_text",
    "check",
    "check_json",
    "check_runs",
    "check_verdict",
    "measured_gear",
    "must_be_repaired",
    "together",
]


ALWAYS = (no_channels, not_finite, stamps_of_arrival, impossible, time_order)
"""Checks that any numbers pass through; the others see what no instrument reads as empty."""
CHECKS = (
    slow_clock,
    dropped_samples,
    repeated_rows,
    kelvin,
    constant,
    unsigned,
    clipped,
    spiked,
    wrapped,
    start_transient,
    homing_move,
    stuck_tail,
    drive_disabled,
    velocity_of_position,
    too_fast,
    gear,
    torque,
    drive_beside_current,
    quantised,
)

Audits = Sequence[tuple[Log, Findings]]


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

    Those are runs that are there twice, a velocity's delay that is its recorder's in all runs, and
    that a sensor's unit beside its load is none where its gain differs between runs.
    What is said of a load beside the target is said of the first run alone.
    """
    made = [check(log, effects=effects, target=target, threads=threads) for log in logs]
    made = told_once(without_gains(logs, with_shared_delays(logs, made)))
    for number, other in copies(logs):
        found = [*made[number], copy_finding(logs[number], logs[other])]
        made[number] = sorted_findings(logs[number].name, found, made[number].excited)
    return made


def _sound(audits: Audits) -> list[Log]:
    """Return the runs without any error: of the others nothing can be said of what they excite."""
    return [log for log, found in audits if not found.errors]


def together(
    audits: Audits, effects: Sequence[str] = (), target: str | None = None
) -> tuple[Excited, ...]:
    """Return what the runs excite together; nothing where all have errors."""
    if len(audits) == 1:
        return audits[0][1].excited
    logs = _sound(audits)
    return excited_together(logs, effects, target) if logs else ()


def must_be_repaired(audits: Audits, target: str | None = None) -> bool:
    """Whether a run has what forbids a fit, or a fault other than rows that are not there."""
    return any(
        found.forbidding(target) or any(f.name != DROPPED for f in found.faults)
        for _, found in audits
    )


def check_verdict(audits: Audits, target: str | None = None) -> str:
    """Return one sentence: whether the runs can be fitted, and what would be taken for physics."""
    forbidden = [log.name for log, found in audits if found.forbidding(target)]
    faults = [(log.name, {f.name for f in found.faults}) for log, found in audits]
    faulty = [name for name, its in faults if its - {DROPPED}]
    gaps = any(DROPPED in its for _, its in faults)
    count = f"{len(audits)} runs" if len(audits) > 1 else "run"
    if forbidden:
        return f"No fit of {_named(forbidden)} can mean anything until the errors are repaired."
    if faulty:
        return (
            f"Faults in {_named(faulty)} would be taken for physics; do what is said of each first."
        )
    but = " but missing rows" if gaps else ""
    return f"The {count} can be fitted: no error and no fault was found{but}."


def audit_text(audits: Audits, excited: Sequence[Excited]) -> list[str]:
    """Return lines: what was found of each run, and what all excite together."""
    lines = [
        line for _, found in audits for line in (*str(replace(found, excited=())).split("\n"), "")
    ]
    if not excited:
        return lines
    count = len(_sound(audits))
    runs = f"the {count} runs" if count > 1 else "the run"
    runs += " without errors" if count < len(audits) else ""
    head = [f"what {runs} excite{'' if count > 1 else 's'}, taken together:"]
    return [*lines, *(head if len(audits) > 1 else []), *excitation_lines(excited), ""]


def check_json(audits: Audits, target: str | None = None, excited: Sequence[Excited] = ()) -> str:
    """Return the text of `check.json`, which fits its schema; a size not known is null.

    `excited`: what the runs excite together.
    """
    content: dict[str, Any] = {
        "format": "flexspline-check",
        "version": 1,
        "made_by": f"flexspline {__version__}",
        "verdict": check_verdict(audits, target),
        "fit_forbidden": any(found.forbidding(target) for _, found in audits),
        "excited": [asdict(one) for one in excited],
        "runs": [
            {
                "name": log.name,
                "path": log.source.path if log.source else None,
                "sha256": log.source.sha256 if log.source else None,
                "rows": len(log),
                "findings": [{**asdict(f), "size": _known(f.size)} for f in found],
                "excited": [asdict(one) for one in found.excited],
            }
            for log, found in audits
        ],
    }
    return checked_json(content, "check")


def _named(names: Sequence[str]) -> str:
    shown = ", ".join(names[:4])
    return shown if len(names) <= 4 else f"{shown} and {len(names) - 4} more"


def _known(size: float) -> float | None:
    return size if math.isfinite(size) else None
