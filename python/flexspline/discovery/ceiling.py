"""The most that functions without a name could explain: their products, made once for a noise.

Models come and go while a cause is looked for, the functions stay.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from flexspline.discovery.evidence import gain_of
from flexspline.discovery.nameless import nameless_of
from flexspline.discovery.settings import TINY
from flexspline.discovery.sheet import Sheet
from flexspline.discovery.stretches import fold_blocks
from flexspline.discovery.table import SINGULAR, Columns, Table
from flexspline.discovery.whitening import Whitening
from flexspline.discovery.working import Working
from flexspline.fit.problem import Problem

__all__ = ["Ceiling", "Overlap"]

Array = NDArray[np.float64]
Rows = NDArray[np.intp]


class Ceiling:
    """Functions of all channels and pairs of them, as a noise sees them.

    `blocks`: products (F, C, C) over σ² of each of the `groups`, by fold.
    """

    def __init__(self, problem: Problem, whitening: Whitening) -> None:
        self.problem, self.whitening = problem, whitening
        self.groups = nameless_of(problem)
        ends = np.cumsum([0, *(group.count for group in self.groups)])
        self.at = [slice(a, b) for a, b in pairwise(ends.tolist())]
        sheet = Sheet((), np.empty(0), (), np.empty(0), tuple(self.groups))
        self.rows, self.columns = list[Rows](), list[Array]()
        self.folds: list[tuple[int, int, int]] = []
        for number in range(len(problem.runs)):
            white, rows = sheet.white(problem, whitening, number)
            self.rows.append(rows)
            self.columns.append(white[:, :-1])
            self.folds += [(number, a, b) for a, b in fold_blocks(problem, number, rows)]
        self.blocks = [
            np.array([self.part(f, at).T @ self.part(f, at) for f in self.folds])
            / whitening.variance
            for at in self.at
        ]

    def part(self, fold: tuple[int, int, int], at: slice | Columns) -> Array:
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

    `inside`: (F, 1 + M, 1 + M), the target first. `across`: (F, C, 1 + M) but for columns that
    have just joined: what they have in common with all functions is added up when it is asked for.
    Functions that are taken join M.
    """

    def __init__(self, ceiling: Ceiling, columns: list[Array]) -> None:
        self.ceiling, self.chosen = ceiling, list[int]()
        self.inside = self._scaled([part.T @ part for part in columns])
        self.across = np.empty((len(columns), ceiling.at[-1].stop, 0))
        self.joined = columns
        self.own = columns[0].shape[1]

    def _scaled(self, products: list[Array]) -> Array:
        return np.array(products) / self.ceiling.whitening.variance

    def _with(self, columns: list[Array], at: slice | Columns) -> Array:
        """Products (F, C', c) of some functions with columns (n, c) of each fold."""
        folds = zip(self.ceiling.folds, columns, strict=True)
        return self._scaled([self.ceiling.part(f, at).T @ part for f, part in folds])

    def take(self, groups: Sequence[int]) -> None:
        """Let functions join the model."""
        at = np.concatenate([np.arange(a.start, a.stop) for a in map(self._place, groups)])
        new = [self.ceiling.part(fold, at) for fold in self.ceiling.folds]
        both = np.concatenate([self.across[:, at], self._with(self.joined, at)], axis=2)
        inside = zip(self.inside, both, self._with(new, at), strict=True)
        self.inside = np.array([_bordered(*parts) for parts in inside])
        pairs = zip(self.joined, new, strict=True)
        self.joined = [np.column_stack(pair) for pair in pairs]
        self.chosen += groups

    def _caught_up(self) -> None:
        """Add up what columns that have joined have in common with all functions."""
        if self.joined[0].shape[1]:
            new = self._with(self.joined, slice(0, self.across.shape[1]))
            self.across = np.concatenate([self.across, new], axis=2)
            self.joined = [part[:, :0] for part in self.joined]

    def _place(self, group: int) -> slice:
        return self.ceiling.at[group]

    def gains(self) -> list[tuple[float, int]]:
        """Squares over σ² that each group explains beside the model, and columns seen."""
        self._caught_up()
        inside, across = self.inside.sum(axis=0), self.across.sum(axis=0)
        model = np.arange(1, len(inside))
        scale = np.sqrt(np.maximum(np.diag(inside)[1:], TINY))
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
            self._caught_up()
            at = self.ceiling.at[group]
            inside = np.array([_bordered(i, a[at], b) for i, a, b in
                               zip(inside, self.across, self.ceiling.blocks[group],
                                   strict=True)])  # fmt: skip
        order = np.append(np.arange(1, inside.shape[1]), 0)
        rows = [last - first for _, first, last in self.ceiling.folds]
        return Table(inside[:, order][:, :, order], np.array(rows, dtype=np.int64))


def _bordered(inside: Array, across: Array, block: Array) -> Array:
    return np.block([[inside, across.T], [across, block]])
