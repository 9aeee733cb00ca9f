"""Several joints and several runs in one file.

A run is an unbroken range of rows. Behind it the next begins wherever the column's value changes,
or where time goes on by more than a gap, or back. Rows without a value are in no run, nor are those
of runs too short for one unknown; how many there are is said.

The column map of a robot has a column of each joint, with a place for its name. A source such as
``q_{joint}`` or ``q[:, {joint}]`` stands for a column of every joint, with the name of the joint in
the place. A joint that is called by a number may be counted otherwise by the file: ``q[:,
{joint-1}]``. A source that is nothing but the place is the column of that number, from 0:
``{joint+6}`` of joint 1 is column 7 of a file without names.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import InputError, listed
from flexspline.logs.columns import ColumnSource, ColumnSpec
from flexspline.logs.segments import GAP_STEPS, median_step
from flexspline.logs.table import Table

__all__ = [
    "Cut",
    "Gaps",
    "Parts",
    "columns_of_joint",
    "goes_by_number",
    "has_places",
    "joints_among",
    "joints_in",
    "parts_of",
    "placed_joint",
]


ROWS_PER_UNKNOWN: Final = 20
"""Rows of a run for each unknown of a fit, below which a check calls it short: what has fewer than
one unknown takes is no run. Halved, ten rows are one; doubled, a second at 20 Hz is none."""
GAP: Final = 10.0 * GAP_STEPS
"""Median steps without a row, from which a new run begins where no number is given: ten times what
is a gap inside of a run. Bursts of lost rows stay inside; at 1 kHz it is 25 ms. The measured logs
that the tests read have no step beyond 2 median ones: halved or doubled it cuts none of them."""

MOST_SHORT: Final = 0.5
"""Share of the rows in runs that are too short, from which a column does not tell runs apart. Of
columns that do, the rows of a change are few: halved or doubled (all rows), either sort stays as it
is."""

Gaps = bool | float | None
"""Whether time cuts a file into runs: by the gaps of `GAP`, by gaps of so many seconds, or not."""

PLACE: Final = re.compile(r"\{joint(?:\s*([+-])\s*(\d+))?\}")

Columns = Mapping[str, ColumnSpec]


@dataclass(frozen=True)
class Cut:
    """What begins a new run.

    Parameters
    ----------
    column : name of a column of the file, or its number from 0; None: none.
    gaps : True: a step longer than `GAP` median steps; a number: longer than so many seconds;
        None or False: no step.
    """

    column: str | int | None = None
    gaps: Gaps = None

    @property
    def wanted(self) -> bool:
        """Whether it cuts at all."""
        return self.column is not None or self.by_time

    @property
    def by_time(self) -> bool:
        """Whether time cuts."""
        return self.gaps is not None and self.gaps is not False

    def require_sound(self, label: str) -> None:
        """Refuse what cannot cut; `label` is what the sentence calls the file.

        Raises
        ------
        InputError
            Where it cuts nowhere, or a gap is no number of seconds above zero.
        """
        if not self.wanted:
            raise InputError(f"{label}: give split_column or split_gaps, what begins a new run")
        known = isinstance(self.gaps, (int, float)) and math.isfinite(self.gaps) and self.gaps > 0
        if self.by_time and not known:
            raise InputError(
                f"{label}: split_gaps is {self.gaps!r}; give seconds above zero, or True for "
                f"{GAP:g} median steps"
            )


@dataclass(frozen=True)
class Parts:
    """Rows of each run, half-open, and how many rows are in none: `empty`, or in `short` runs."""

    ranges: tuple[tuple[int, int], ...]
    empty: int
    short: int
    short_rows: int

    @property
    def left_out(self) -> int:
        """Rows that are in no run."""
        return self.empty + self.short_rows

    def sentence(self, label: str, cut: Cut) -> str:
        """Say how many runs a file has, and how many rows are in none and why."""
        count = len(self.ranges)
        said = f"{label}: {count} runs {_by(cut)}" if count > 1 else f"{label}: one run {_by(cut)}"
        why = [f"{self.empty} have no value there"] if self.empty else []
        if self.short:
            those = "a run" if self.short == 1 else f"{self.short} runs"
            why += [f"{self.short_rows} make {those} of fewer than {ROWS_PER_UNKNOWN} rows"]
        rows = f"{self.left_out} row{' is' if self.left_out == 1 else 's are'}"
        return f"{said}; {rows} in none: {', '.join(why)}" if why else said


def parts_of(table: Table, time: NDArray[np.float64], cut: Cut) -> Parts:
    """Return the runs of a table.

    Parameters
    ----------
    table : with the column of the cut.
    time : s, (N,).
    cut : what begins a run.

    Raises
    ------
    InputError
        Where nothing cuts, the column is not there or has no value at all, or more than half of the
        rows would be in runs that are too short.
    """
    cut.require_sound(table.label)
    begins, empty = _begins(time, cut), np.zeros(len(time), dtype=bool)
    if cut.column is not None:
        codes = _codes(table, cut.column, len(time))
        empty = codes < 0
        begins[1:] |= np.diff(codes) != 0
    edges = np.append(np.flatnonzero(begins), len(time))
    ranges = [(int(a), int(b)) for a, b in pairwise(edges) if not empty[a]]
    kept = tuple((a, b) for a, b in ranges if b - a >= ROWS_PER_UNKNOWN)
    nothing = int(np.count_nonzero(empty))
    short = len(time) - sum(b - a for a, b in kept) - nothing
    if short > MOST_SHORT * (len(time) - nothing):
        many = f"{len(ranges)} runs" if len(ranges) > 1 else "one run"
        raise InputError(
            f"{table.label}: would be {many} {_by(cut)}, and {short} of its {len(time)} rows in "
            f"runs of fewer than {ROWS_PER_UNKNOWN}; give {_instead(cut)}"
        )
    return Parts(kept, nothing, len(ranges) - len(kept), short)


def _begins(time: NDArray[np.float64], cut: Cut) -> NDArray[np.bool_]:
    """Rows (N,) with which a run begins by time, the first among them."""
    begins = np.zeros(len(time), dtype=bool)
    begins[0] = True
    if cut.by_time:
        gap = GAP * median_step(time) if cut.gaps is True else float(cut.gaps or 0.0)
        steps = np.diff(time)
        begins[1:] = (steps > gap) | (steps < 0.0)
    return begins


def _codes(table: Table, column: str | int, rows: int) -> NDArray[np.intp]:
    """Return a number for each value of a column, (N,), −1 where it is empty."""
    import pandas

    named = table.names is not None and column in table.names
    number = table.index(int(column) if str(column).isdecimal() and not named else column)
    if len(table.data[number]) != rows:
        raise InputError(
            f"{table.label}: {table.title(number)} has {len(table.data[number])} rows where time "
            f"has {rows}, and cannot say where a run begins; give another column for the runs"
        )
    codes, values = pandas.factorize(_cells(table.column(number)), use_na_sentinel=True)
    if len(values) == 0:
        raise InputError(
            f"{table.label}: {table.title(number)} has no value in any row, and cannot say where "
            "a run begins; give another column for the runs"
        )
    return np.asarray(codes, dtype=np.intp)


def _cells(data: NDArray[Any]) -> Any:
    """The cells of a column, those of text that is blank as nothing."""
    if data.dtype.kind not in "OUS":
        return data
    return np.array([None if str(cell).strip() == "" else cell for cell in data], dtype=object)


def _by(cut: Cut) -> str:
    column = f"by column '{cut.column}'" if cut.column is not None else ""
    long = f"{GAP:g} median steps" if cut.gaps is True else f"{cut.gaps:g} s" if cut.gaps else ""
    return " and ".join(filter(None, [column, f"by gaps of more than {long}" if long else ""]))


def _instead(cut: Cut) -> str:
    if cut.column is not None:
        return "a column that keeps its value during a run (--split-column)"
    return "a longer gap (--split-gaps=SECONDS)"


def has_places(columns: Columns | None) -> bool:
    """Whether a map stands for several joints."""
    return any(PLACE.search(text) for text in _texts(columns))


def goes_by_number(columns: Columns | None) -> bool:
    """Whether all places of a map are the numbers of columns, which tell no joints."""
    return all(PLACE.fullmatch(text) for text in _texts(columns) if PLACE.search(text))


def columns_of_joint(columns: Columns | None, joint: str, label: str) -> dict[str, ColumnSpec]:
    """Return the map of one joint.

    Raises
    ------
    InputError
        Where no column has a place for the joint, or a place counts a joint that is no number.
    """
    if not has_places(columns):
        raise InputError(
            f"{label}: joint {joint} is asked for, and no column of the map has a place for it; "
            "write sources such as 'q_{joint}', or let flexspline init --joint all write them"
        )
    return {
        name: _with_text(spec, placed_joint(_text(spec), joint, label))
        for name, spec in (columns or {}).items()
    }


def placed_joint(text: str, joint: str, label: str) -> str | int:
    """Return a source with a joint in its places; a number where it is nothing but a place.

    Raises
    ------
    InputError
        Where a place counts, and the joint is no number.
    """

    def name(place: re.Match[str]) -> str:
        if place[1] is None:
            return joint
        if not joint.isdecimal():
            raise InputError(
                f"{label}: '{text}' counts joints, and joint '{joint}' is no number; write "
                "{joint} alone"
            )
        return str(int(joint) + int(place[1] + place[2]))

    made = PLACE.sub(name, text)
    return int(made) if PLACE.fullmatch(text) and made.isdecimal() else made


def joints_among(names: Sequence[str], columns: Columns | None, label: str) -> tuple[str, ...]:
    """Return the joints of which a file has every column that the map has a place in.

    Parameters
    ----------
    names : of the columns of the file, in whose order the joints are.
    columns : a map with places.

    Raises
    ------
    InputError
        Where the map has no places or goes by numbers alone, and where there is no such joint.
    """
    texts = [text for text in _texts(columns) if PLACE.search(text)]
    named = [text for text in texts if not PLACE.fullmatch(text)]
    if not named:
        why = "goes by the numbers of columns" if texts else "has no place {joint}"
        raise InputError(
            f"{label}: which joints there are is not told, for the map {why}; name them, such as "
            "--joint 1,2,3, or give each a section [joints.1] in the map"
        )
    found = [joints_in(names, text) for text in named]
    every = tuple(joint for joint in found[0] if all(joint in others for others in found))
    if not every:
        raise InputError(
            f"{label}: no joint has all of the columns {listed(named)}; the file has "
            f"{listed(names)}"
        )
    return every


def joints_in(names: Sequence[str], text: str) -> list[str]:
    """Names of joints that, in the place of a source, make the name of a column."""
    place = PLACE.search(text)
    if place is None:
        return []
    pattern = re.escape(text[: place.start()]) + r"(\w+?)" + re.escape(text[place.end() :])
    found = [match[1] for name in names if (match := re.fullmatch(pattern, name))]
    if place[1] is None:
        return found
    step = int(place[1] + place[2])
    return [str(int(number) - step) for number in found if number.isdecimal()]


def _text(spec: Any) -> str:
    """Return the source of a column as text."""
    if isinstance(spec, Mapping):
        return str(spec.get("source", ""))
    if isinstance(spec, ColumnSource):
        return str(spec.source)
    return str(spec[0] if isinstance(spec, (tuple, list)) and spec else spec)


def _texts(columns: Columns | None) -> list[str]:
    return [_text(spec) for spec in (columns or {}).values()]


def _with_text(spec: ColumnSpec, source: str | int) -> ColumnSpec:
    """Return a column with another source; as it is where that is the same."""
    if str(source) == _text(spec):
        return spec
    if isinstance(spec, Mapping):
        return {**spec, "source": source}
    if isinstance(spec, ColumnSource):
        return replace(spec, source=source)
    return (source, spec[1]) if isinstance(spec, tuple) else source
