"""Channels in groups, each group at instants of its own: what MDF and TDMS have in common.

A channel is called by its name; where several groups have that name, by ``group.name``. The
instants of a group are those of its clock, on which `one_clock` lays what is chosen. A channel that
cannot be read stays out, with the reason: it is said when that channel is asked for.
"""

from __future__ import annotations

import io
import logging
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from flexspline.errors import InputError, did_you_mean, listed, printable, shortened
from flexspline.logs.log import Fact
from flexspline.logs.one_clock import with_time
from flexspline.logs.packed import require_memory
from flexspline.logs.table import Later, Series, Table

__all__ = ["Group", "GroupedChannel", "grouped_table", "named_apart", "sound"]

NUMBER = 8  # bytes of a number in memory
TIME = "time"
CLOCKLESS = (
    "its group '{0}' has no channel of time; read that group alone, by variable='{0}', and give "
    "its rate"
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
