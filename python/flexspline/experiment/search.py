"""The best run of the family: scored one by one, the best refined.

A run is worth Σ ln(1 + t²) over all questions, with t as it would be with the recorded runs and
this one: to settle one question that was open is worth more than to settle another twice. Of two
that tell the same the plainer one is taken.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from flexspline.experiment.family import kinds_for
from flexspline.experiment.information import Layout, Question, products
from flexspline.experiment.limits import Bounds
from flexspline.experiment.motor import Motor
from flexspline.experiment.plan import ENOUGH, TAKEN
from flexspline.experiment.recording import Excitation, as_problem, commanded
from flexspline.experiment.setting import settings
from flexspline.experiment.trust import Trust
from flexspline.least_squares.problem import Problem
from flexspline.parallel import in_order
from flexspline.regression.gram import Whitening

__all__ = ["Bench", "Scored", "best_of_family", "refined"]

Array = NDArray[np.float64]

IN_ALL_SETTINGS = 3  # motions that are tried at every load and temperature
EVALUATIONS = 60
MOST_TIMES = 5
PLAIN = 0.03  # of ln t², that a step more in what has to be set up has to bring
OFTEN = 3  # where a rival still explains nearly as much then


@dataclass(frozen=True, eq=False)
class Bench:
    """Everything that a planned run is judged by. `before`: products (C, C) of recorded runs."""

    problem: Problem
    layout: Layout
    whitening: Whitening
    trust: Trust
    rate: float
    motor: Motor | None
    before: Array

    def gained(self, columns: dict[str, Array]) -> Array:
        """Products (C, C) of a planned run."""
        problem = as_problem(columns, self.problem, self.layout.effects, self.motor)
        return products(self.layout, problem, self.whitening, self.trust)

    @property
    def now(self) -> tuple[float, ...]:
        """t of each question with the recorded runs alone."""
        return self.t(self.before)

    def t(self, total: Array) -> tuple[float, ...]:
        """t of each question that these products promise."""
        return tuple(float(np.sqrt(q.information(total))) for q in self.layout.questions)

    def scored(self, excitation: Excitation, bounds: Bounds) -> Scored:
        """Judge one planned run."""
        t = self.t(self.before + self.gained(commanded(excitation, bounds, self.rate)))
        values = [abs(q.value) if q.parameter else 1.0 for q in self.layout.questions]
        worth = sum(np.log1p((v * x) ** 2) for v, x in zip(values, t, strict=True))
        plain = PLAIN * (excitation.kind.steps + len(excitation.setting.parts))
        return Scored(excitation, t, float(worth) - plain)

    def repetitions(self, gained: Array) -> int:
        """How often a run has to be recorded until no rival explains nearly as much (`aliases`)."""
        for times in range(1, MOST_TIMES + 1):
            total = self.before + times * gained
            if all(q.parameter or q.taken(total) < TAKEN for q in self._within_reach(total)):
                return times
        return OFTEN

    def _within_reach(self, total: Array) -> list[Question]:
        pairs = zip(self.layout.questions, self.t(total), strict=True)
        return [question for question, t in pairs if t >= ENOUGH]


@dataclass(frozen=True, eq=False)
class Scored:
    """A run, t of each question with it, and what it is worth."""

    excitation: Excitation
    t: tuple[float, ...]
    worth: float


def best_of_family(bench: Bench, bounds: Bounds) -> list[Scored]:
    """Return runs of all kinds, the best first."""
    every = settings(bounds)

    def scored(runs: Iterable[Excitation]) -> list[Scored]:
        work = partial(bench.scored, bounds=bounds)
        return [*in_order(bench.problem.threads, work, runs)]

    kinds = kinds_for(bounds, bench.layout.remembers)
    made = scored(Excitation(kind, numbers, every[0]) for kind in kinds for numbers in kind.starts)
    chosen = [one.excitation for one in _ranked(made)[:IN_ALL_SETTINGS]]
    made += scored(replace(one, setting=other) for one in chosen for other in every[1:])
    return _ranked(made)


def refined(bench: Bench, bounds: Bounds, start: Scored) -> Scored:
    """Improve a run's numbers within the limits."""
    best = [start]

    def loss(numbers: Array) -> float:
        trial = replace(start.excitation, numbers=np.clip(numbers, 0.0, 1.0))
        made = bench.scored(trial, bounds)
        if made.worth > best[0].worth:
            best[0] = made
        return -made.worth

    numbers = start.excitation.numbers
    corner = np.where(numbers > 0.5, numbers - 0.2, numbers + 0.2)
    simplex = np.vstack([numbers, *(np.where(row, corner, numbers)
                                    for row in np.eye(len(numbers), dtype=bool))])  # fmt: skip
    minimize(
        loss,
        numbers,
        method="Nelder-Mead",
        bounds=[(0.0, 1.0)] * len(numbers),
        options={"maxfev": EVALUATIONS, "initial_simplex": simplex},
    )
    return best[0]


def _ranked(made: Sequence[Scored]) -> list[Scored]:
    return sorted(made, key=lambda one: -one.worth)
