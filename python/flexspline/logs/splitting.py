"""Runs in one file: where a column changes its value, or where time jumps.

A run is an unbroken range of rows. Behind it the next begins wherever the label of the rows
changes, or where time goes on by more than a gap, or back. Rows whose label is empty are in no run,
nor are those of runs too short for one unknown.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import InputError
from flexspline.logs.segments import GAP_STEPS, median_step
from flexspline.logs.table import Table

__all__ = ["Cut", "Gaps", "Parts", "parts_of"]

ROWS_PER_UNKNOWN: Final = 20
"""Rows of a run for each unknown of a fit, below which a check calls it short: what has fewer than
one unknown takes is no run. Halved, ten rows are one; doubled, a second at 20 Hz is none."""
GAP: Final = 10.0 * GAP_STEPS
"""Median steps without a row, from which a new run begins where no number is given: ten times what
is a gap inside of a run. Bursts of lost rows stay inside; at 1 kHz it is 25 ms. The measured logs
that the tests read have no step beyond 2 median ones: halved or doubled it cuts none of them."""

Gaps = bool | float | None
"""Whether time cuts a file into runs: by the gaps of `GAP`, by gaps of so many seconds, or not."""


@dataclass(frozen=True)
class Cut:
    """What begins a new run.

    Parameters
    ----------
    column : name or number of a column of the file, or of a channel; None: none.
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

    def checked(self) -> Cut:
        """Return it.

        Raises
        ------
        InputError
            Where it cuts nowhere, or a gap is no number of seconds above zero.
        """
        if not self.wanted:
            raise InputError("give split_column or split_gaps: what begins a new run")
        known = isinstance(self.gaps, (int, float)) and math.isfinite(self.gaps) and self.gaps > 0
        if self.by_time and not known:
            raise InputError(
                f"split_gaps is {self.gaps!r}; give seconds above zero, or True for {GAP:g} median "
                "steps"
            )
        return self


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
        runs = f"{len(self.ranges)} run{'' if len(self.ranges) == 1 else 's'}"
        said = f"{label}: {runs} {_by(cut)}"
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
        Where the column is not there or has no value at all, or where no run is long enough.
    """
    begins, empty = _begins(time, cut), np.zeros(len(time), dtype=bool)
    if cut.column is not None:
        codes = _codes(table, cut.column)
        empty = codes < 0
        begins[1:] |= np.diff(codes) != 0
    edges = np.append(np.flatnonzero(begins), len(time))
    ranges = [(int(a), int(b)) for a, b in pairwise(edges) if not empty[a]]
    kept = tuple((a, b) for a, b in ranges if b - a >= ROWS_PER_UNKNOWN)
    if not kept:
        longest = max(b - a for a, b in ranges)
        raise InputError(
            f"{table.label}: is cut into {len(ranges)} runs {_by(cut)}, the longest of {longest} "
            f"row{'' if longest == 1 else 's'}, and a run takes {ROWS_PER_UNKNOWN}; give "
            f"{_instead(cut)}"
        )
    inside = sum(b - a for a, b in kept)
    nothing = int(np.count_nonzero(empty))
    return Parts(kept, nothing, len(ranges) - len(kept), len(time) - inside - nothing)


def _begins(time: NDArray[np.float64], cut: Cut) -> NDArray[np.bool_]:
    """Rows (N,) with which a run begins by time, the first among them."""
    begins = np.zeros(len(time), dtype=bool)
    begins[0] = True
    if cut.by_time:
        gap = GAP * median_step(time) if cut.gaps is True else float(cut.gaps or 0.0)
        steps = np.diff(time)
        begins[1:] = (steps > gap) | (steps < 0.0)
    return begins


def _codes(table: Table, column: str | int) -> NDArray[np.intp]:
    """Return a number for each value of a column, (N,), −1 where it is empty."""
    import pandas

    number = table.index(column)
    codes, values = pandas.factorize(_cells(table.data[number]), use_na_sentinel=True)
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


def _instead(cut: Cut) -> Literal["a column that keeps its value during a run", "a longer gap"]:
    if cut.column is not None:
        return "a column that keeps its value during a run"
    return "a longer gap"
