"""The most that functions without a name could explain: their products, made once for a noise.

Models come and go while a cause is looked for, the functions stay. Of logs too long to hold them,
blocks that lie evenly over all runs are looked at: what matters here is far above its noise.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from flexspline.discovery.evidence import gain_of
from flexspline.discovery.nameless import Nameless, nameless_of
from flexspline.discovery.stretches import fold_blocks
from flexspline.discovery.table import SINGULAR, Table
from flexspline.discovery.values import values_of
from flexspline.discovery.whitening import Whitening
from flexspline.discovery.working import Working
from flexspline.fit.problem import Problem, Run
from flexspline.parallel import in_order

__all__ = ["Ceiling", "Overlap"]

Array = NDArray[np.float64]
Rows = NDArray[np.intp]

MOST_ROWS = 40_000
BLOCK = 2_000


class Ceiling:
    """Functions of all channels and pairs of them, as a noise sees them.

    `blocks`: products (F, C, C) over σ² of each of the `groups`, by fold.
    """

    def __init__(self, problem: Problem, whitening: Whitening) -> None:
        self.problem, self.whitening = problem, whitening
        self.groups = nameless_of(problem)
        ends = np.cumsum([0, *(group.count for group in self.groups)])
        self.at = [slice(a, b) for a, b in pairwise(ends.tolist())]
        self.rows, self.columns = [], []
        self.folds: list[tuple[int, int, int]] = []
        for number in range(len(problem.runs)):
            columns, rows = _whitened(problem, whitening, self.groups, self.at, number)
            self.rows.append(rows)
            self.columns.append(columns)
            self.folds += [(number, a, b) for a, b in fold_blocks(problem, number, rows)]
        self.blocks = [
            np.array([self.part(f, at).T @ self.part(f, at) for f in self.folds])
            / whitening.variance
            for at in self.at
        ]

    @property
    def taken(self) -> float:
        """Share of the rows that are looked at."""
        rows = sum(r.counted for r in self.problem.runs) // self.whitening.decimation
        return 1.0 / _step(rows)

    def part(self, fold: tuple[int, int, int], at: slice) -> Array:
        """Columns of some functions on the rows of a fold."""
        number, first, last = fold
        return self.columns[number][first:last, at]

    def beside(self, work: Working) -> Overlap:
        """Return the functions beside the columns and shapes of a model."""
        sheet, made = work.sheet(), []
        for number in range(len(self.problem.runs)):
            white, at = sheet.white(self.problem, self.whitening, number)
            white = np.roll(white, 1, axis=1)  # the target first
            made.append(white[np.searchsorted(at, self.rows[number])])
        return Overlap(self, [made[number][first:last] for number, first, last in self.folds])


class Overlap:
    """Products over σ² of a model's columns M with themselves and with all functions, by fold.

    `inside`: (F, 1 + M, 1 + M), the target first. `across`: (F, C, 1 + M). Functions that are
    taken join M.
    """

    def __init__(self, ceiling: Ceiling, columns: list[Array]) -> None:
        self.ceiling, self.chosen = ceiling, list[int]()
        self._columns = columns
        self.inside = self._scaled([part.T @ part for part in columns])
        every = slice(0, ceiling.columns[0].shape[1])
        self.across = self._scaled(
            [
                ceiling.part(f, every).T @ part
                for f, part in zip(ceiling.folds, columns, strict=True)
            ]
        )
        self.own = columns[0].shape[1]

    def _scaled(self, products: list[Array]) -> Array:
        return np.array(products) / self.ceiling.whitening.variance

    def take(self, groups: Sequence[int]) -> None:
        """Let functions join the model: the columns of all are read once."""
        folds = self.ceiling.folds
        new = [
            np.column_stack([self.ceiling.part(f, self._place(k)) for k in groups]) for f in folds
        ]
        every = slice(0, self.across.shape[1])
        across = self._scaled(
            [self.ceiling.part(f, every).T @ part for f, part in zip(folds, new, strict=True)]
        )
        at = np.concatenate([np.arange(a.start, a.stop) for a in map(self._place, groups)])
        self.inside = np.array([_bordered(i, a[at], b[at]) for i, a, b in
                                zip(self.inside, self.across, across, strict=True)])  # fmt: skip
        self.across = np.concatenate([self.across, across], axis=2)
        self.chosen += groups

    def _place(self, group: int) -> slice:
        return self.ceiling.at[group]

    def gains(self) -> list[tuple[float, int]]:
        """Squares over σ² that each group explains beside the model, and columns seen."""
        inside, across = self.inside.sum(axis=0), self.across.sum(axis=0)
        model = np.arange(1, len(inside))
        scale = np.sqrt(np.maximum(np.diag(inside)[1:], 1e-300))
        inverse = np.linalg.pinv(inside[1:, 1:] / np.outer(scale, scale), SINGULAR, hermitian=True)
        towards = inverse @ (inside[model, 0] / scale)
        made = []
        for at, block in zip(self.ceiling.at, self.ceiling.blocks, strict=True):
            total, own = block.sum(axis=0), across[at, 1:] / scale
            left = np.empty((len(total), len(total) + 1))
            left[:, :-1] = total - own @ inverse @ own.T
            left[:, -1] = across[at, 0] - own @ towards
            square = np.vstack([left, np.append(left[:, -1], 0.0)])
            made.append(gain_of(square, np.arange(len(total)), np.diag(total)))
        return made

    def table(self, group: int | None = None) -> Table:
        """Products of [model, functions taken, a group, y] by fold."""
        inside = self.inside
        if group is not None:
            at = self.ceiling.at[group]
            inside = np.array([_bordered(i, a[at], b) for i, a, b in
                               zip(inside, self.across, self.ceiling.blocks[group],
                                   strict=True)])  # fmt: skip
        order = np.append(np.arange(1, inside.shape[1]), 0)
        rows = [last - first for _, first, last in self.ceiling.folds]
        return Table(inside[:, order][:, :, order], np.array(rows, dtype=np.int64))


def _bordered(inside: Array, across: Array, block: Array) -> Array:
    return np.block([[inside, across.T], [across, block]])


def _whitened(
    problem: Problem,
    whitening: Whitening,
    groups: Sequence[Nameless],
    at: Sequence[slice],
    number: int,
) -> tuple[Array, Rows]:
    """Filtered functions of a run, (n, C), and the rows that they belong to."""
    run, lead = problem.runs[number], whitening.order
    pieces = _looked_at(problem, whitening, run)
    made = np.empty((sum(len(rows) - lead for rows in pieces), at[-1].stop), order="F")

    def filtered(piece: tuple[int, Rows]) -> None:
        first, rows = piece
        whole = slice(int(rows[0]), int(rows[-1]) + 1)
        values = values_of(problem, number, whole)
        out = made[first : first + len(rows) - lead]
        for part, those in _parts(problem, run.log["time"][whole], values, groups, at):
            whitening.filter(part[:: whitening.decimation], out[:, those])

    firsts = np.cumsum([0, *(len(rows) - lead for rows in pieces)])[:-1].tolist()
    for _ in in_order(problem.threads, filtered, zip(firsts, pieces, strict=True)):
        pass
    kept = [rows[lead:] for rows in pieces] or [np.empty(0, dtype=np.intp)]
    return made, np.concatenate(kept)


def _looked_at(problem: Problem, whitening: Whitening, run: Run) -> list[Rows]:
    """Rows of the blocks of a run that are looked at, each with what starts the filter."""
    lead = whitening.order
    step = _step(sum(r.counted for r in problem.runs) // whitening.decimation)
    pieces = []
    for rows in whitening.taken(run):
        starts = range(0, len(rows), BLOCK * step) if step > 1 else (0,)
        size = BLOCK if step > 1 else len(rows)
        pieces += [rows[max(k - lead, 0) : k + size] for k in starts]
    return [rows for rows in pieces if len(rows) > 2 * lead + 2]


def _step(rows: int) -> int:
    """One block of how many is looked at."""
    return max(1, -(-rows // MOST_ROWS))


def _parts(
    problem: Problem,
    time: Array,
    values: Mapping[str, Array],
    groups: Sequence[Nameless],
    at: Sequence[slice],
) -> Iterator[tuple[Array, slice]]:
    """Functions of some rows and their places: a group's at a time, behind a low pass all."""
    made = (group.columns(values) for group in groups)
    if problem.lowpass is None:
        yield from zip(made, at, strict=True)
        return
    from flexspline.logs.derive import lowpass

    yield lowpass(np.column_stack([*made]), time, problem.lowpass).values, slice(None)
