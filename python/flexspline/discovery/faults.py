"""Faults of the data, looked for before any physics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from flexspline.effects import Effect
from flexspline.fit.fitting import NO_TORSION
from flexspline.logs.checks import check
from flexspline.logs.log import Log

__all__ = ["DataFault", "data_faults"]


@dataclass(frozen=True)
class DataFault:
    """A fault of one run: `name` of the check, channel, size in `unit`, rows [first, last)."""

    run: str
    name: str
    channel: str
    size: float
    unit: str
    rows: tuple[int, int]
    sentence: str


def data_faults(
    logs: Sequence[Log], base: Sequence[Effect], target: str, known_load: str | None
) -> tuple[DataFault, ...]:
    """Return the faults of all runs.

    Raises
    ------
    InputError
        Where a fault makes every fit meaningless.
    """
    elsewhere = known_load not in (None, "reference_torque")
    asked = [e.name for e in base if not (elsewhere and "load" in e.reads)]
    found = []
    for log in logs:
        findings = check(log, effects=asked, target=target)
        findings.raise_errors()
        if target == "torsion":
            findings.raise_named(NO_TORSION)
        found += [
            DataFault(log.name, f.name, f.channel, f.size, f.unit, f.rows,
                      f"{log.name}: {f.sentence} {f.remedy}".rstrip())
            for f in findings.faults
        ]  # fmt: skip
    return tuple(found)
