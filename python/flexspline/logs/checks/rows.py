"""Checks of rows: order of time, duplicated and dropped samples, a stuck recorder, NaN."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from flexspline.logs.checks.findings import Finding
from flexspline.logs.log import Log
from flexspline.logs.segments import at_rest, median_step, true_ranges

DROP_STEPS = 1.75
"""A step of more median steps than this has lost at least one sample."""

JITTER_SHARE = 0.05
"""Where more steps than this share are long, the clock is uneven and nothing was dropped."""

STUCK_ROWS = 3
"""As many equal rows in a row are a stuck recorder; fewer are repeated rows, and fewer in the
whole log are chance."""

LIVELY = 0.01
"""A channel with a smaller share of repeated values changes with every sample that it gets."""


def not_finite(log: Log) -> Iterator[Finding]:
    """NaN and infinities: channel, first row and count."""
    for channel in log.channels:
        bad = np.flatnonzero(~np.isfinite(log[channel]))
        if bad.size:
            yield Finding(
                "not_finite",
                "error",
                channel,
                _span(bad),
                float(bad.size),
                "rows",
                f"{channel} is NaN or infinite in {_rows(bad.size)}, first in row {bad[0]}.",
                "Ask for the repair drop_invalid.",
            )


def time_order(log: Log) -> Iterator[Finding]:
    """Time that runs backwards or stands."""
    steps = np.diff(log["time"])
    back, same = np.flatnonzero(steps < 0) + 1, np.flatnonzero(steps == 0) + 1
    if back.size:
        worst = float(-np.min(steps[back - 1]))
        yield Finding(
            "time_not_increasing",
            "error",
            "time",
            _span(back),
            worst,
            "s",
            f"time runs backwards in {_rows(back.size)}, first in row {back[0]}, by up to "
            f"{worst:.4g} s.",
            "Ask for the repair sort_time.",
        )
    if same.size:
        yield Finding(
            "duplicate_time",
            "error",
            "time",
            _span(same),
            float(same.size),
            "rows",
            f"the time of the row before is repeated in {_rows(same.size)}, first row {same[0]}.",
            "Ask for the repair drop_duplicates.",
        )


def dropped_samples(log: Log) -> Iterator[Finding]:
    """Steps of time that are too long by whole samples."""
    time = log["time"]
    step = median_step(time)
    if step == 0:
        return
    steps = np.diff(time)
    long = np.flatnonzero(steps > DROP_STEPS * step)
    if long.size == 0 or long.size > JITTER_SHARE * steps.size:
        return
    missing = int(np.sum(np.round(steps[long] / step) - 1))
    widest = float(np.max(steps[long]))
    yield Finding(
        "dropped_samples",
        "fault",
        "time",
        _span(long + 1),
        float(missing),
        "rows",
        f"about {_rows(missing)} missing in {_counted(long.size, 'place')}, first before row "
        f"{long[0] + 1}; the longest step is {widest:.4g} s where {step:.4g} s is usual.",
        "Nothing bridges a gap of more than 2.5 steps; resample=RATE closes shorter ones.",
    )


def repeated_rows(log: Log) -> Iterator[Finding]:
    """Rows in which no lively channel differs from the row before: a recorder that stood still.

    Lively is a channel that hardly ever repeats a value in other rows; one at least must exist, for
    a joint at rest with coarse encoders repeats its values with good reason. Rows in which it
    certainly rests count as neither.
    """
    same = {c: np.diff(log[c]) == 0 for c in log.channels if c != "time"}
    if len(log) < 10 or not same:
        return
    rest = at_rest(log)[1:]
    stuck = np.logical_and.reduce(list(same.values())) & ~rest
    others = ~stuck & ~rest
    lively = others.any() and any(np.mean(s[others]) < LIVELY for s in same.values())
    ranges = true_ranges(stuck)
    if not lively or np.count_nonzero(stuck) < STUCK_ROWS:
        return
    lengths = ranges[:, 1] - ranges[:, 0]
    rows, longest = np.flatnonzero(stuck) + 1, int(np.max(lengths))
    name = "stuck_recorder" if longest >= STUCK_ROWS else "repeated_rows"
    yield Finding(
        name,
        "fault",
        "all",
        _span(rows),
        float(rows.size),
        "rows",
        f"{_rows(rows.size)} repeat all values of the row before, first row {rows[0]}, up to "
        f"{longest} on end: the recorder was read faster than it was written.",
        "Drop these rows, or record again.",
    )


def _span(rows: NDArray[np.intp]) -> tuple[int, int]:
    return int(rows[0]), int(rows[-1]) + 1


def _rows(count: int) -> str:
    return _counted(count, "row")


def _counted(count: int, what: str) -> str:
    return f"{count} {what}" + ("" if count == 1 else "s")
