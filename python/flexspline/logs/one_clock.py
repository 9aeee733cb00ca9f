"""Columns that a file samples at instants of their own, on one clock.

The clock is that of the column that is `time`, else of the fastest series that is chosen, where all
chosen ones have samples. Numbers lie on a line between two samples, but not across a gap, where
they are missing. Held from the last sample, and not on a line, are whole numbers (counts), states
(text, truth values, `enabled`), and a number that jumps by more than half of its range: an angle
that wraps, a switch.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from functools import partial
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import InputError, listed
from flexspline.logs.segments import GAP_STEPS, median_step
from flexspline.logs.table import Later, Series, Table

__all__ = ["ANY_CLOCK", "MARK", "on_one_clock", "spanning", "with_time"]

ANY_CLOCK: Final = -1
"""Number of the series of a column that is the clock itself, whichever is chosen."""
MARK: Final = "one clock: "
"""How the sentence of a log's history begins that says what was done."""
JUMP: Final = 0.5
"""Share of a column's range, beyond which a step from sample to sample is no line. A wrap is a step
of nearly all of it; halved, it would be met by a sine of 12 samples, doubled by no wrap."""
SAME: Final = 1e-6
"""Share of a median step, within which two instants are the same: stamps are rounded."""

Array = NDArray[np.float64]


def with_time(table: Table) -> Table:
    """Return a table of series with the column `time`, unless one is called so.

    One series alone in its file, whose clock counts seconds there, is that column.
    """
    if not table.series or "time" in (table.names or ()):
        return table
    stamps = table.series[0].stamps
    alone = len(table.series) == 1 and isinstance(stamps, Later) and stamps.part is not None
    clock = stamps if alone else Later(table.rows, lambda: np.zeros(0))
    return replace(
        table,
        data=(clock, *table.data),
        names=("time", *(table.names or ())),
        units=("s", *(table.units or [None] * len(table.data))),
        series=() if alone else table.series,
        of_series=() if alone else (ANY_CLOCK, *table.of_series),
    )


def spanning(table: Table) -> dict[str, int]:
    """Return the numbers, by name, of columns whose series last half as long as the longest."""
    if not table.series:
        return {}
    spans = [float(each[-1] - each[0]) if len(each) > 1 else 0.0
             for each in _seconds(table.series)]  # fmt: skip
    long = {number for number, span in enumerate(spans) if span > 0.5 * max(spans)}
    names = enumerate(table.names or ())
    return {name: n for n, name in names if table.of_series[n] in {*long, ANY_CLOCK}}


def on_one_clock(table: Table, chosen: Mapping[str, int]) -> Table:
    """Return a table of one series with all columns on its clock.

    Parameters
    ----------
    table : as its file has it; one without series is returned as it is.
    chosen : numbers of columns by the channels that they are to be; by their names where these are
        not known. They decide which clock, over which time, and which of them are states.

    Raises
    ------
    InputError
        Where a clock goes back or is no number, or the chosen series have no time in common.
    """
    if not table.series:
        return table
    used = sorted({table.of_series[number] for number in chosen.values()} - {ANY_CLOCK})
    if not used:
        return table
    seconds = _seconds(table.series, used)
    leading = table.of_series[chosen["time"]] if "time" in chosen else ANY_CLOCK
    if leading == ANY_CLOCK:
        leading = min(used, key=lambda number: _slowness(seconds[number]))
    keep = slice(None)
    if len(used) > 1:
        for number in used:
            _require_forward(table, number, seconds[number])
        keep = _common(table, used, leading, seconds)
    clock = seconds[leading][keep][table.drop :]
    if len(clock) < 2:
        raise InputError(
            f"{table.label}: {table.series[leading].name} has fewer than two samples; choose "
            "columns that have more, or record the run again"
        )
    states = {chosen[name] for name in ("enabled",) if name in chosen}

    def column(number: int) -> NDArray[Any]:
        own = table.of_series[number]
        if own == ANY_CLOCK:
            return clock
        values = table.column(number)
        if own == leading:
            return values[keep][table.drop :]
        return _held_or_on_line(values, seconds[own], clock, number in states)

    data = tuple(Later(len(clock), partial(column, n)) for n in range(len(table.data)))
    notes = (*table.notes, *_said(table, used, leading, len(clock)))
    return replace(table, data=data, notes=notes, series=(), of_series=(), drop=0)


def _seconds(series: tuple[Series, ...], used: Collection[int] | None = None) -> list[Array]:
    """Return the stamps of each series in seconds; whole nanoseconds from the first of all.

    Of series that are not `used`, those that are still in their file stay there: they are empty.
    """
    if used is not None and any(isinstance(each.stamps, Later) for each in series):
        read = dict(zip(used, _seconds(tuple(series[k] for k in used)), strict=True))
        return [read.get(number, np.zeros(0)) for number in range(len(series))]
    stamps = [each.stamps.now() if isinstance(each.stamps, Later) else each.stamps
              for each in series]  # fmt: skip
    whole = [each.dtype.kind in "iuM" for each in stamps]
    if not all(whole):
        return [np.asarray(each, dtype=np.float64) for each in stamps]
    counted = [each.astype("datetime64[ns]").astype(np.int64) if each.dtype.kind == "M"
               else each.astype(np.int64) for each in stamps]  # fmt: skip
    zero = min(int(each.min()) for each in counted if len(each))
    return [np.asarray(1e-9 * (each - zero), dtype=np.float64) for each in counted]


def _slowness(seconds: Array) -> float:
    step = median_step(seconds)
    return step if step > 0.0 else np.inf


def _require_forward(table: Table, number: int, seconds: Array) -> None:
    wrong = np.flatnonzero(~(np.diff(seconds) >= 0.0))
    if len(wrong):
        raise InputError(
            f"{table.label}: the clock of {table.series[number].name} goes back or is no number "
            f"behind its row {wrong[0] + 1}, and cannot be laid beside others; choose columns of "
            "one series alone, or correct the recording"
        )


def _common(table: Table, used: list[int], leading: int, seconds: list[Array]) -> slice:
    """Return the rows of the leading series in which every used one has samples."""
    there = [seconds[number] for number in used if len(seconds[number])]
    first, last = max(each[0] for each in there), min(each[-1] for each in there)
    near = SAME * median_step(seconds[leading])
    rows = np.searchsorted(seconds[leading], [first - near, last + near])
    if rows[1] - rows[0] < 2 or len(there) < len(used):
        names = listed(table.series[number].name for number in used)
        raise InputError(
            f"{table.label}: {names} have no two samples of the clock in common; choose columns "
            "that were recorded at one time"
        )
    return slice(int(rows[0]), int(rows[1]))


def _held_or_on_line(values: NDArray[Any], own: Array, clock: Array, state: bool) -> NDArray[Any]:
    """Return values that were sampled at `own` as they are at the instants of another clock."""
    if len(values) == 0:
        return np.full(len(clock), np.nan)
    step = median_step(own)
    near = SAME * step
    found = np.searchsorted(own, clock + near, side="right") - 1
    last, before = np.maximum(found, 0), found < 0
    held, kind = values[last], values.dtype.kind
    if kind in "OUSmM":
        if before.any():
            held = held.astype(object)
            held[before] = None
        return held
    made = held.astype(np.float64)
    made[before] = np.nan
    if state or kind == "b":
        return made
    following = np.minimum(last + 1, len(values) - 1)
    width, past = own[following] - own[last], clock - own[last]
    inside = ~before & (past > near)
    made[inside & ((width > GAP_STEPS * step) | (following == last))] = np.nan
    if kind == "f":
        rise = values[following].astype(np.float64) - made
        line = inside & ~(np.abs(rise) > JUMP * _range(values))
        made[line] += (past / np.where(width > 0.0, width, 1.0) * rise)[line]
    return made


def _range(values: NDArray[Any]) -> float:
    there = values[np.isfinite(values)]
    return float(np.ptp(there)) if len(there) else 0.0


def _said(table: Table, used: list[int], leading: int, rows: int) -> tuple[str, ...]:
    """Say which clock all columns are on, where there are several."""
    if len(used) == 1:
        return ()
    others = listed(table.series[number].name for number in used if number != leading)
    return (
        f"{MARK}{rows} samples of {table.series[leading].name}, and on a line between two samples "
        f"of {others}, but none across a gap; whole numbers, states and jumps as last sampled",
    )
