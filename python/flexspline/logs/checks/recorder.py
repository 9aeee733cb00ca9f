"""What a recorder does to all of its runs alike, and what only some of them show for sure.

A velocity that a recorder delays is late in each of its runs by the same. Where the delay is about
as large as the least that is told, or where a run's motion hardly shows it, single runs would be
called late and others not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from flexspline.logs.checks.consistency import (
    PAIRS,
    VELOCITY_DELAY,
    Delay,
    is_delay,
    late_velocity,
    velocity_delay,
)
from flexspline.logs.checks.findings import Finding, Findings, sorted_findings
from flexspline.logs.checks.samples import motion_of
from flexspline.logs.log import Log, emptied

__all__ = ["with_shared_delays"]

ALIKE = 0.1
"""Share of a delay by which it may differ between runs of one recorder, beside its errors."""


def with_shared_delays(logs: Sequence[Log], made: Sequence[Findings]) -> list[Findings]:
    """Return the findings with a velocity's delay told of all runs that have it, and of how many.

    Parameters
    ----------
    logs, made : the runs and what was found in each.
    """
    told = list(made)
    for channel in PAIRS:
        has = [k for k, log in enumerate(logs) if channel in log and PAIRS[channel] in log]
        has = [k for k in has if not told[k].errors]
        found = {k: f for k in has for f in told[k].named(VELOCITY_DELAY) if f.channel == channel}
        if found and len(found) < len(has):
            _share(logs, told, channel, has, found)
    return told


def _share(
    logs: Sequence[Log],
    told: list[Findings],
    channel: str,
    has: Sequence[int],
    found: dict[int, Finding],
) -> None:
    """Tell the delay of a channel of all runs among `has` that have it as those of `found` do."""
    usual = float(np.median([finding.size for finding in found.values()]))
    late: dict[int, Delay | None] = {}
    for k in has:
        if k not in found:
            late[k] = velocity_delay(emptied(logs[k]), channel)
            motion_of.cache_clear()  # it would keep the log
    also = {k: one for k, one in late.items() if one and is_delay(one) and _alike(one, usual)}
    others = [one for k, one in late.items() if k not in also]
    said = _of_how_many(len(found) + len(also), len(has), others, usual)
    for k, finding in found.items():
        mine = replace(finding, sentence=f"{finding.sentence}{said}")
        rest = [one for one in told[k] if one is not finding]
        told[k] = sorted_findings(told[k].log_name, [*rest, mine], told[k].excited)
    for k, one in also.items():
        more = [*told[k], late_velocity(logs[k], channel, one, said)]
        told[k] = sorted_findings(told[k].log_name, more, told[k].excited)


def _alike(late: Delay, usual: float) -> bool:
    return abs(late.seconds - usual) <= max(ALIKE * abs(usual), 4 * late.error)


def _of_how_many(seen: int, runs: int, others: Sequence[Delay | None], usual: float) -> str:
    """How many runs show the delay, and whether the others contradict it; "" where all do."""
    if seen == runs:
        return ""
    open_ = sum(one is None or _alike(one, usual) for one in others)
    against = len(others) - open_
    told = [f"{open_} do{'es' if open_ == 1 else ''} not tell"] if open_ else []
    told += [f"{against} show{'s' if against == 1 else ''} another or none"] if against else []
    return f" Seen in {seen} of {runs} runs; of the others {' and '.join(told)}."
