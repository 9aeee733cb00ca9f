"""What is wrong with logs, as a report of one page and as numbers for scripts."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from flexspline.about import __version__
from flexspline.files import atomic_write
from flexspline.formatting import short
from flexspline.logs.checks import check_verdict
from flexspline.logs.checks.findings import EXCITED
from flexspline.plot.canvas import own_style
from flexspline.report.html import templates

if TYPE_CHECKING:
    from flexspline.logs.checks import Audits, Excited

__all__ = ["write_check_report"]

MOST_BESIDE = 12
"""Runs that have a column each in the table of effects: as many as a wide page holds."""


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
