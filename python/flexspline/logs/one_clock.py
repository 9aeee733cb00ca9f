"""Columns that a file samples at instants of their own, on one clock.

The clock is that of the column that is `time`, else of the fastest series that is chosen, where all
chosen ones have samples. Numbers lie on a line between two samples, but not across a gap, where
they are missing. Held from the last sample, and not on a line, are whole numbers (counts), states
(text, truth values, `enabled`), and a number that jumps by more than half of its range: an angle
that wraps, a switch.

MDF and TDMS have channels in groups, each group at instants of its own. There a channel is called
by its name; where several groups have that name, by ``group.name``. A channel that cannot be read
stays out, with the reason: it is said when that channel is asked for.
"""

from __future__ import annotations

import io
import logging
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import InputError, did_you_mean, listed, printable, shortened
from flexspline.logs.log import Fact
from flexspline.logs.packed import require_memory
from flexspline.logs.segments import GAP_STEPS, median_step
from flexspline.logs.table import Later, Series, Table

__all__ = [
    "ANY_CLOCK",
    "MARK",
    "Group",
    "GroupedChannel",
    "grouped_table",
    "named_apart",
    "on_one_clock",
    "sound",
    "spanning",
    "with_time",
]

ANY_CLOCK: Final = -1
"""Number of the series of a column that is the clock itself, whichever is chosen."""
MARK: Final = "one clock: "
"""How the sentence of a log's history begins that says what was done."""
JUMP: Final = 0.5
"""Share of a column's range, beyond which a step from sample to sample is no line. A wrap is a step
of nearly all of it; halved, it would be met by a sine of 12 samples, doubled by no wrap."""
SAME: Final = 1e-6
"""Share of a median step, within which two instants are the same: stamps are rounded."""

NUMBER = 8  # bytes of a number in memory
TIME = "time"
CLOCKLESS = (
    "its group '{0}' has no channel of time; read that group alone, by variable='{0}', and give "
    "its rate"
)


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


@dataclass(frozen=True)
class GroupedChannel:
    """A channel: its unit in the file, how it is read, and why it cannot be, if so.

    `read` returns samples [a, b); all of them, where it is given none.
    """

    name: str
    read: Callable[..., NDArray[Any]]
    unit: str | None = None
    why: str = ""


@dataclass(frozen=True)
class Group:
    """Channels of `rows` samples at the same instants, which `clock` reads [s], if it has one.

    It reads samples [a, b) as a channel does. `part_of`: the group of the file, where that has
    channels of several clocks.
    """

    name: str
    rows: int
    channels: tuple[GroupedChannel, ...]
    clock: Callable[..., NDArray[Any]] | None
    part_of: str = ""


def grouped_table(
    groups: Sequence[Group],
    label: str,
    variable: str | None,
    most: int,
    facts: Mapping[str, Fact],
    notes: tuple[str, ...],
) -> Table:
    """Return the channels of all groups, or of the one that `variable` names, as a table.

    Channels of one group can be read in pieces; those of several are laid on one clock as a whole.

    Raises
    ------
    InputError
        Where there is no such group, or none with a sample; where a channel takes more than `most`
        bytes; where none of several groups has a clock.
    """
    chosen = _chosen(groups, label, variable)
    require_memory(NUMBER * max(group.rows for group in chosen), most, label)
    clocked = [group for group in chosen if group.clock is not None]
    if not clocked and len(chosen) > 1:
        raise InputError(
            f"{label}: none of its groups {listed(group.name for group in chosen)} has a channel "
            "of time; name one with variable=, and give its rate"
        )
    with_clock = bool(clocked)
    met = Counter(each.name for group in chosen for each in group.channels)
    names: list[str] = []
    data: list[Later] = []
    units: list[str | None] = []
    of_series: list[int] = []
    left: dict[str, str] = {}
    for group in chosen:
        for each in group.channels:
            if with_clock and each.name == TIME:
                continue  # every group's clock is the table's column of that name
            name = each.name if met[each.name] == 1 else f"{group.name}.{each.name}"
            why = each.why or (
                CLOCKLESS.format(group.name) if with_clock and not group.clock else ""
            )
            if why:
                left[name] = why
                continue
            names.append(name)
            data.append(Later(group.rows, each.read, part=each.read))
            units.append(each.unit)
            of_series += [clocked.index(group)] if with_clock else []
    series = tuple(Series(f"group '{group.name}'", Later(group.rows, group.clock, part=group.clock))
                   for group in clocked if group.clock is not None)  # fmt: skip
    table = Table(
        label,
        tuple(data),
        tuple(names),
        facts,
        (*notes, *([f"not read: {listed(left)}"] if left else [])),
        units=tuple(units),
        series=series,
        of_series=tuple(of_series),
        unreadable=left,
    )
    _require_readable(table)
    return with_time(table)


def _chosen(groups: Sequence[Group], label: str, variable: str | None) -> list[Group]:
    filled = [group for group in groups if group.rows and group.channels]
    if variable is not None:
        known = [group.name for group in groups]
        if variable not in known:
            raise InputError(
                f"{label}: no group '{variable}'{did_you_mean(variable, known)}; it has "
                f"{listed(known)}"
            )
        filled = [group for group in filled if variable in (group.name, group.part_of)]
    if not filled:
        raise InputError(f"{label}: has no samples; record the run again")
    return filled


def _require_readable(table: Table) -> None:
    if not table.data:
        name, why = next(iter(table.unreadable.items()), ("", "it has no channels"))
        raise InputError(
            f"{table.label}: no channel can be read, such as '{name}', for {why}"
            if name
            else f"{table.label}: {why} but its clock; record the run again"
        )


def named_apart(names: Sequence[str]) -> list[str]:
    """Return names of groups, numbered where they are not there or not the only ones."""
    met = Counter(names)
    return [name if name and met[name] == 1 else f"{name} {number}".strip()
            for number, name in enumerate(names)]  # fmt: skip


@contextmanager
def sound(label: str, kind: str, library: str) -> Iterator[None]:
    """Say of which file it is that a library cannot read something; it says nothing itself.

    `kind`: of file.
    """
    with _silent(library):
        try:
            yield
        except (InputError, ModuleNotFoundError):
            raise
        except Exception as error:  # these libraries raise many kinds on a damaged file
            said = str(error)
            said = said if " " in said else f"{type(error).__name__} {said}".strip()
            why = printable(shortened(said))
            raise InputError(
                f"{label}: not {kind} file, or a damaged one ({why}); copy or record it again"
            ) from error


@contextmanager
def _silent(library: str) -> Iterator[None]:
    """Keep what a library logs from standard error, and what asammdf prints from standard output.

    It prints how fast it reads, where that takes long.
    """
    names = [name for name in logging.root.manager.loggerDict
             if name == library or name.startswith(f"{library}.")]  # fmt: skip
    logs = [log for log in map(logging.getLogger, names) if not log.disabled]
    for log in logs:
        log.disabled = True
    try:
        with redirect_stdout(io.StringIO()):
            yield
    finally:
        for log in logs:
            log.disabled = False
