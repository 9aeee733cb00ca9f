"""The dictionary of `discover` as plain columns, for methods that select columns.

What the base and its bends explain is taken out of columns and target, each column is scaled to
a mean square of one, and columns that others determine exactly are dropped. Each run is then
reduced to the triangle of its QR: the squares of every fit to any choice of runs stay the same.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr

from flexspline.discovery.search import search_context_of
from flexspline.regression.candidate_model import candidate_model_of, started
from flexspline.regression.gram import Whitening
from hidden.made import Made
from hidden.rig import LOAD, Array

__all__ = ["Columns", "columns_of", "reduced"]

DEPENDENT = 1e-6  # of a column, that the others leave of it


@dataclass(frozen=True)
class Columns:
    """X (K, C) and y (K,) of all runs, reduced; `owners`: effect of each column; `runs`: (K,)."""

    X: Array
    y: Array
    owners: tuple[str, ...]
    runs: NDArray[np.intp]
    rows: int

    def of(self, chosen: NDArray[np.bool_]) -> tuple[str, ...]:
        """Names of the effects of the columns that are chosen, (C,) of bool."""
        return tuple(dict.fromkeys(o for o, kept in zip(self.owners, chosen, strict=True) if kept))


def columns_of(made: Made, target: str, excluded: tuple[str, ...]) -> Columns:
    """Return the columns of every candidate in each of its forms."""
    context = search_context_of(
        made.base, made.logs, target, known_load=LOAD, lowpass_hz=None, threads=1, exclude=excluded
    )
    plain = Whitening(np.ones(1), 1.0, 1)
    work, _ = started(context.problem, candidate_model_of(made.base, len(made.base), {}), plain)
    context.scan(work, context.problem)
    wanted = [e for c in context.candidates(work.effects) for e in c.effects]
    wanted = list(dict.fromkeys(wanted))
    owners = [e.name for e in wanted for _ in e.terms]
    base, beside, y = [], [], []
    for number in range(len(made.logs)):
        rows, left = work.assembly(beside=wanted).rows(context.problem, number)
        count = len(work.owners())
        base.append(rows[:, :count])
        beside.append(rows[:, count:])
        y.append(left)
    return reduced(base, beside, y, owners)


def reduced(base: list[Array], beside: list[Array], y: list[Array], owners: list[str]) -> Columns:
    """Return the columns `beside` the base, (N, C) of each run, whose owners are given, (C,)."""
    known = np.concatenate(base)
    every = np.column_stack([np.concatenate(beside), np.concatenate(y)])
    left = every - known @ np.linalg.lstsq(known, every, rcond=1e-9)[0]
    before, after = np.linalg.norm(every, axis=0), np.linalg.norm(left, axis=0)
    seen = np.flatnonzero(after[:-1] > DEPENDENT * before[:-1])
    X = left[:, seen] / np.sqrt(np.mean(left[:, seen] ** 2, axis=0))
    _, R, order = qr(X, mode="economic", pivoting=True)
    depth = np.abs(np.diag(R))
    kept = np.sort(order[: int((depth > DEPENDENT * depth[0]).sum())])
    both = np.column_stack([X[:, kept], left[:, -1]])
    ends = np.cumsum([len(rows) for rows in y])[:-1]
    triangles = [np.linalg.qr(part, mode="r") for part in np.split(both, ends)]
    stacked = np.concatenate(triangles)
    runs = np.repeat(np.arange(len(triangles)), [len(r) for r in triangles])
    names = tuple(owners[seen[k]] for k in kept)
    return Columns(stacked[:, :-1], stacked[:, -1], names, runs, len(both))
