"""Columns of the model and of all candidates, once over the runs, and whose they are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexspline.discovery.candidates import Candidate
from flexspline.discovery.table import Columns, Table, tabulated
from flexspline.discovery.whitening import Whitening
from flexspline.discovery.working import Working
from flexspline.effects import Effect
from flexspline.fit.problem import Problem

__all__ = ["Dictionary", "Kept", "dictionary_of", "effect_rows"]

Array = NDArray[np.float64]
Kept = dict[tuple[int, Effect], Array]
"""Columns by run and effect, filtered as the target is."""


@dataclass(frozen=True, eq=False)
class Dictionary:
    """The table of a model beside candidates.

    `model`: its columns, shapes' included; the first `linear` are of coefficients. `owners`:
    effect of each of them. `at`: columns of each effect that a candidate consists of.
    """

    table: Table
    model: Columns
    linear: int
    owners: tuple[str, ...]
    candidates: tuple[Candidate, ...]
    at: dict[Effect, Columns]

    def without(self, names: Sequence[str]) -> Columns:
        """Columns of the model but those of some effects."""
        keep = [k for k, owner in enumerate(self.owners) if owner not in names]
        return self.model[keep]


def dictionary_of(
    problem: Problem,
    work: Working,
    candidates: Sequence[Candidate],
    whitening: Whitening,
    kept: Kept | None = None,
) -> Dictionary:
    """Add up the products of the model's and all candidates' columns.

    `kept`: columns of earlier calls, which are added to.
    """
    wanted = list(dict.fromkeys(e for c in candidates for e in c.effects))
    columns, at = [], {}
    for number in range(len(problem.runs)):
        own, target = work.rows(problem, number)
        beside = effect_rows(problem, work, wanted, number, kept)
        columns.append((np.column_stack([own, beside]), target))
    first = len(work.owners())
    for effect in wanted:
        last = first + len(effect.terms)
        at[effect] = np.arange(first, last)
        first = last
    return Dictionary(
        tabulated(problem, columns, whitening),
        np.arange(len(work.owners())),
        len(work.free),
        tuple(work.owners()),
        tuple(candidates),
        at,
    )


def effect_rows(
    problem: Problem,
    work: Working,
    wanted: Sequence[Effect],
    number: int,
    kept: Kept | None = None,
) -> Array:
    """Rows of effects beside the model, whose inertia and gravity are their load, (N, C)."""
    kept = {} if kept is None else kept
    new = [e for e in wanted if (number, e) not in kept]
    made = _rows(problem, work, new, number)
    first, fresh = 0, {}
    for effect in new:
        last = first + len(effect.terms)
        fresh[effect] = made[:, first:last]
        if not _moves(effect, work):
            kept[number, effect] = fresh[effect]
        first = last
    parts = [fresh[e] if e in fresh else kept[number, e] for e in wanted]
    return np.column_stack([np.empty((len(problem.runs[number]), 0)), *parts])


def _moves(effect: Effect, work: Working) -> bool:
    """Whether its rows change with the model's coefficients, which make the load."""
    return "load" in effect.reads and any(e.info.carries_load for e in work.effects)


def _rows(problem: Problem, work: Working, wanted: Sequence[Effect], number: int) -> Array:
    run = problem.runs[number]
    if not wanted:
        return np.empty((len(run), 0))
    carrying = [k for k, e in enumerate(work.effects) if e.info.carries_load]
    carriers = [work.effects[k] for k in carrying]
    ends = np.cumsum([0, *(len(e.terms) for e in work.effects)])
    values = [work.coefficients[ends[k] : ends[k + 1]] for k in carrying]
    count = sum(len(e.terms) for e in wanted)
    load = np.concatenate([*values, np.zeros(count)])
    design = problem.design([*carriers, *wanted])
    rows = np.asarray(design.rows(run.channels, len(run), load))
    return problem.smooth(run, rows[:, len(load) - count :])
