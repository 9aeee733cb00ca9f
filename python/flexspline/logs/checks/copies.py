"""A run that is there twice: fitted and held out at once, it makes every score look better."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from flexspline.logs.checks.findings import Finding
from flexspline.logs.log import Log

__all__ = ["called", "copies", "copy_finding"]


def copies(logs: Sequence[Log]) -> Iterator[tuple[int, int]]:
    """Yield the number of each run that holds the same values as another before it, and of that."""
    seen: dict[tuple[object, ...], list[int]] = {}
    for number, log in enumerate(logs):
        ends = tuple((name, log[name][[0, -1]].tobytes()) for name in log.channels if len(log))
        alike = seen.setdefault((len(log), ends), [])
        for other in alike:
            if all(_equal(log, logs[other], name) for name in log.channels):
                yield number, other
                break
        alike.append(number)


def _equal(one: Log, other: Log, name: str) -> bool:
    return np.array_equal(one[name], other[name], equal_nan=True)


def copy_finding(log: Log, other: Log) -> Finding:
    """Return what is said of a run that holds the same values as another."""
    return Finding(
        "copy_of_a_run",
        "error",
        "all",
        (0, len(log)),
        float(len(log)),
        "rows",
        f"it holds the same values as the run {called(other)}: a run counts once.",
        "Leave one of them out.",
    )


def called(log: Log) -> str:
    """Return a run's name, and its file where it has one: copies of a file share the name."""
    return f"'{log.name}'" + (f" ({log.source.path})" if log.source is not None else "")
