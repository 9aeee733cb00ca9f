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

__all__ = ["Columned", "Dictionary", "columned"]


@dataclass(frozen=True, eq=False)
class Dictionary:
    """The table of a model beside candidates.

    `target`: what is explained. `model`: its columns, shapes' included; the first `linear` are of
    coefficients. `owners`: effect of each of them. `at`: columns of each effect that a candidate
    consists of.
    """

    target: str
    table: Table
    model: Columns
    linear: int
    owners: tuple[str, ...]
    candidates: tuple[Candidate, ...]
    at: dict[Effect, Columns]

    def coefficients(self, name: str) -> Columns:
        """Columns of the free coefficients of one of the model's effects."""
        owners = np.array(self.owners[: self.linear])
        return np.asarray(self.model[: self.linear][owners == name])

    def without(self, names: Sequence[str]) -> Columns:
        """Columns of the model but those of some effects."""
        keep = [k for k, owner in enumerate(self.owners) if owner not in names]
        return self.model[keep]


@dataclass(frozen=True, eq=False)
class Columned:
    """The table of a model beside every effect that is looked at while it stands.

    One pass over the logs serves all questions about a model: what may join it, and what would
    take the place of each of its names.
    """

    target: str
    work: Working
    whitening: Whitening
    table: Table
    at: dict[Effect, Columns]

    def has(self, candidates: Sequence[Candidate]) -> bool:
        """Whether every column of these candidates is there."""
        return all(effect in self.at for c in candidates for effect in c.effects)

    def dictionary(self, candidates: Sequence[Candidate]) -> Dictionary:
        """Return the part of the table that these candidates need."""
        wanted = list(dict.fromkeys(e for c in candidates for e in c.effects))
        own = np.arange(len(self.work.owners()))
        columns = np.concatenate([own, *(self.at[effect] for effect in wanted)])
        at, first = {}, len(own)
        for effect in wanted:
            at[effect] = np.arange(first, first + len(effect.terms))
            first += len(effect.terms)
        return Dictionary(
            self.target,
            self.table.of(columns),
            own,
            len(self.work.free),
            tuple(self.work.owners()),
            tuple(candidates),
            at,
        )


def columned(
    problem: Problem, work: Working, wanted: Sequence[Effect], whitening: Whitening
) -> Columned:
    """Add up the products of the columns of a model and of effects beside it."""
    wanted = list(dict.fromkeys(wanted))
    at, first = {}, len(work.owners())
    for effect in wanted:
        at[effect] = np.arange(first, first + len(effect.terms))
        first += len(effect.terms)
    table = tabulated(problem, work.sheet(beside=wanted), whitening)
    return Columned(problem.target, work, whitening, table, at)
