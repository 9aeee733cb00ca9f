"""Columns of the model and of all candidates, once over the runs, and whose they are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexspline.discovery.candidates import Candidate
from flexspline.discovery.table import Columns, Table, tabulated
from flexspline.discovery.whitening import Whitening
from flexspline.discovery.working import Working
from flexspline.effects import Effect
from flexspline.fit.problem import Problem

__all__ = ["Dictionary", "dictionary_of"]


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
) -> Dictionary:
    """Add up the products of the model's and all candidates' columns."""
    wanted = list(dict.fromkeys(e for c in candidates for e in c.effects))
    at, first = {}, len(work.owners())
    for effect in wanted:
        last = first + len(effect.terms)
        at[effect] = np.arange(first, last)
        first = last
    return Dictionary(
        tabulated(problem, work.sheet(beside=wanted), whitening),
        np.arange(len(work.owners())),
        len(work.free),
        tuple(work.owners()),
        tuple(candidates),
        at,
    )
