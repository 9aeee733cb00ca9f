"""What is wrong with logs, as a report of one page and as numbers for scripts."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

from flexspline.about import __version__
from flexspline.files import atomic_write
from flexspline.formatting import short
from flexspline.logs.checks.findings import EXCITED, excitation_lines
from flexspline.plot.canvas import own_style
from flexspline.report.html import templates
from flexspline.schema import checked_json

if TYPE_CHECKING:
    from flexspline.logs.checks import Excited, Findings
    from flexspline.logs.log import Log

__all__ = ["audit_text", "check_json", "check_verdict", "together", "write_check_report"]

MOST_BESIDE = 12
"""Runs that have a column each in the table of effects: as many as a wide page holds."""
Audits = Sequence[tuple["Log", "Findings"]]


def _sound(audits: Audits) -> list[Log]:
    """Return the runs without any error: of the others nothing can be said of what they excite."""
    return [log for log, found in audits if not found.errors]


def together(
    audits: Audits, effects: Sequence[str] = (), target: str | None = None
) -> tuple[Excited, ...]:
    """Return what the runs excite together; nothing where all have errors."""
    from flexspline.logs.checks.excitation import excited_together

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


@own_style()
def write_check_report(
    audits: Audits,
    path: str | os.PathLike[str],
    target: str | None = None,
    excited: Sequence[Excited] = (),
) -> None:
    """Write a self-contained report, whole or not at all.

    `excited`: what the runs excite together.

    Raises
    ------
    InputError
        Where the file cannot be written.
    """
    from flexspline.plot.channels import plot_channels
    from flexspline.report.html import inline_svg

    runs = [
        {
            "name": log.name,
            "rows": f"{len(log)} rows, {short(log.duration, 4)} s at {short(log.rate, 4)} Hz",
            "path": log.source.path if log.source else "not from a file",
            "sha256": log.source.sha256 if log.source else "",
            "findings": list(found),
            "svg": inline_svg(plot_channels(log, found), f"channels of run {k}, {log.name}"),
        }
        for k, (log, found) in enumerate(audits, 1)
    ]
    page = (
        templates()
        .get_template("check.html")
        .render(
            verdict=check_verdict(audits, target),
            grave=any(found.forbidding(target) or found.faults for _, found in audits),
            runs=runs,
            effects=_effects(audits, excited),
            version=__version__,
        )
    )
    atomic_write(path, page)


def _effects(audits: Audits, excited: Sequence[Excited]) -> list[dict[str, Any]]:
    """Of each effect: what the runs do together, what each does, what is lacking and to do."""
    beside = 1 < len(audits) <= MOST_BESIDE
    by_run = [{one.effect: EXCITED[one.excited] for one in found.excited} for _, found in audits]
    return [
        {
            "name": one.effect,
            "together": EXCITED[one.excited],
            "runs": [run.get(one.effect, "–") for run in by_run] if beside else [],
            "said": one.said,
        }
        for one in excited
    ]


def _named(names: Sequence[str]) -> str:
    shown = ", ".join(names[:4])
    return shown if len(names) <= 4 else f"{shown} and {len(names) - 4} more"


def _known(size: float) -> float | None:
    return size if math.isfinite(size) else None
