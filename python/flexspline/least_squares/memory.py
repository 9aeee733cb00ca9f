"""Rows that a fit must not trust: what an effect remembers from before its run, nobody knows.

Each run, and each stretch behind a gap, starts an effect's memory with a guess. The rows that
still depend on it do not count. Which rows these are depends on the shapes (a wider loop takes
longer to turn over), so a fit repeats with those of the shapes that it found; while it searches,
the rows stay the same, for sums of squares over different rows cannot be compared.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from flexspline.effects import Effect
from flexspline.errors import listed

if TYPE_CHECKING:
    from flexspline.least_squares.problem import Problem

__all__ = ["kept_rows", "memory_warnings", "settled"]

LEAST_SETTLED = 0.1  # of the rows; with fewer the guess of the start is the lesser evil


def settled(problem: Problem, effects: Sequence[Effect]) -> Problem:
    """Return the problem in which only rows count whose memory is known.

    Where that would leave next to nothing, all rows count.
    """
    if not any(effect.info.remembers for effect in effects):
        return problem
    design, nothing = problem.design(effects), np.empty(0)
    starts: list[Sequence[tuple[int, int]]] = [
        kept_rows(run.unbroken, design.settled(run.channels, len(run), nothing))
        for run in problem.runs
    ]
    left = sum(last - first for run in starts for first, last in run)
    if left < LEAST_SETTLED * _whole(problem):
        starts = [run.unbroken for run in problem.runs]
    runs = [
        replace(run, stretches=tuple(kept)) for run, kept in zip(problem.runs, starts, strict=True)
    ]
    return replace(problem, runs=tuple(runs))


def kept_rows(
    stretches: Sequence[tuple[int, int]], valid: NDArray[np.bool_]
) -> list[tuple[int, int]]:
    """Shorten each stretch [first, last) to its valid rows; `valid`: (N,)."""
    kept = []
    for first, last in stretches:
        inside = np.flatnonzero(valid[first:last])
        if len(inside):
            kept.append((first + int(inside[0]), first + int(inside[-1]) + 1))
    return kept


def memory_warnings(problem: Problem, effects: Sequence[Effect]) -> list[str]:
    """Say what the unknown start of effects with memory cost."""
    remembering = [effect.name for effect in effects if effect.info.remembers]
    if not remembering:
        return []
    whole = _whole(problem)
    left_out = whole - sum(run.counted for run in problem.runs)
    if left_out:
        return [
            f"{left_out} of {whole} rows at the start of runs do not count: there "
            f"{listed(remembering)} still depends on what came before"
        ]
    design, nothing = problem.design(effects), np.empty(0)
    if all(design.settled(run.channels, len(run), nothing).all() for run in problem.runs):
        return []
    return [
        f"the runs hardly take {listed(remembering)} through its whole width, so that its start, "
        "in the middle, remains a guess; record runs that go further each way"
    ]


def _whole(problem: Problem) -> int:
    return sum(last - first for run in problem.runs for first, last in run.unbroken)
