"""By how much the gap shrank, on folds that no fit saw: overall, and where it matters.

A single RMSE hides that friction fails at reversals, drift when it is hot, and a compliant joint
under load. So the same held-out residuals, of the base and of the extended model, are sorted by
run, frequency, order, direction, speed, temperature, load, and distance from a reversal.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexspline.discovery.bands import frequency_bands, order_bands
from flexspline.discovery.settings import SETTINGS
from flexspline.fit.scores import LEAST_ROWS, bands, groups
from flexspline.logs.log import Log

__all__ = ["HeldRun", "Slice", "slices", "telling"]

Array = NDArray[np.float64]

GROUPS = (
    "all", "run", "reversals", "direction", "speed", "temperature", "load", "frequency", "order"
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class HeldRun:
    """One run, as fits predict it that never saw the rows; arrays (N,), unit of the target.

    `base`, `final`: NaN where a row does not count. `load`: Nm at the output, None where it is not
    known.
    """

    log: Log
    measured: Array
    base: Array
    final: Array
    load: Array | None

    @property
    def counts(self) -> NDArray[np.bool_]:
        """Rows that count, in both."""
        return np.isfinite(self.base) & np.isfinite(self.final)


@dataclass(frozen=True)
class Slice:
    """Some of the rows, or one band of the residual: RMS before and after, unit of the target.

    `group`: "all", "run", "frequency", "order", "reversals", "direction", "speed", "temperature" or
    "load". `rows`: as many as it holds; of a band, of the runs in all.
    """

    group: str
    label: str
    rows: int
    base: float
    final: float


def slices(runs: Sequence[HeldRun]) -> tuple[Slice, ...]:
    """Sort the residuals of base and extended model."""
    logs, counts = [run.log for run in runs], [run.counts for run in runs]
    before = [np.where(run.counts, run.measured - run.base, np.nan) for run in runs]
    after = [np.where(run.counts, run.measured - run.final, np.nan) for run in runs]
    joined = [np.concatenate(values) for values in (before, after)]
    joined = [values[np.isfinite(values)] for values in joined]
    whole = len(joined[0])
    made = [_of_rows("all", "all rows", np.ones(whole, dtype=bool), *joined)]
    made += [
        _of_rows(group, label, mask, *joined)
        for group, label, mask in _parts(runs, logs, counts)
        if mask.sum() >= LEAST_ROWS
    ]
    for group, found in (
        ("frequency", frequency_bands(logs, [before, after])),
        ("order", order_bands(logs, [before, after])),
    ):
        made += [Slice(group, label, whole, *sizes) for label, sizes in found]
    return tuple(sorted(made, key=lambda part: GROUPS.index(part.group)))


def telling(every: Sequence[Slice]) -> tuple[Slice, ...]:
    """Return the parts that say more than the row of all: not the only one of its group."""
    counts = Counter(part.group for part in every)
    return tuple(part for part in every if part.group == "all" or counts[part.group] > 1)


def _parts(
    runs: Sequence[HeldRun], logs: Sequence[Log], counts: Sequence[NDArray[np.bool_]]
) -> Iterator[tuple[str, str, NDArray[np.bool_]]]:
    names = [log.name for log in logs]
    seen = iter(range(1, len(logs) + 1))
    for group, label, mask in groups(logs, counts):
        twice = group == "run" and names.count(label) > 1
        number = next(seen) if group == "run" else 0
        yield group, f"{label} (run {number})" if twice else label, mask
    loads = [run.load for run in runs]
    if all(load is not None for load in loads):
        size = np.concatenate([np.abs(load[c]) for load, c in zip(loads, counts, strict=True)
                               if load is not None])  # fmt: skip
        yield from bands("load", size, SETTINGS.tried - 1, "Nm")


def _of_rows(group: str, label: str, mask: NDArray[np.bool_], before: Array, after: Array) -> Slice:
    base, final = (float(np.sqrt(np.mean(values[mask] ** 2))) for values in (before, after))
    return Slice(group, label, int(mask.sum()), base, final)
