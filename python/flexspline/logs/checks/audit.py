"""What is wrong with several logs: in one sentence, and as numbers for scripts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import Any

from flexspline.about import __version__
from flexspline.logs.checks.excitation import excited_together
from flexspline.logs.checks.findings import Excited, Findings, excitation_lines
from flexspline.logs.log import Log
from flexspline.schema import checked_json

__all__ = ["Audits", "audit_text", "check_json", "check_verdict", "together"]

Audits = Sequence[tuple[Log, Findings]]


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


def check_verdict(audits: Audits, target: str | None = None) -> str:
    """Return one sentence: whether the runs can be fitted, and what would be taken for physics."""
    forbidden = [log.name for log, found in audits if found.forbidding(target)]
    faulty = [log.name for log, found in audits if found.faults]
    count = f"{len(audits)} runs" if len(audits) > 1 else "run"
    if forbidden:
        return f"No fit of {_named(forbidden)} can mean anything until the errors are repaired."
    if faulty:
        return f"Faults in {_named(faulty)} would be taken for physics; repair them before a fit."
    return f"The {count} can be fitted: no error and no fault was found."


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
