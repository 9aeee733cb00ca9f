"""A part of long runs that stands for the whole: short stretches spread evenly over them.

Effects with memory are followed from some rows before each stretch on: what they remember from
before these is a guess.
"""

from __future__ import annotations

from dataclasses import replace

from flexspline import _core
from flexspline.least_squares.problem import Problem, Run

__all__ = ["rows_of", "thinned"]


def rows_of(problem: Problem) -> int:
    """How many rows count."""
    return sum(run.counted for run in problem.runs)


def thinned(problem: Problem, enough: int, stretch: int, lead: int) -> Problem:
    """Return the problem with about `enough` of its rows, in pieces of about `stretch`.

    `lead`: rows before each, from which effects with memory are followed.

    Itself where it has less than twice as many. Behind a low pass one row of several is news: it
    is these that are counted.
    """
    enough, stretch = enough * problem.decimation, stretch * problem.decimation
    share = rows_of(problem) // enough
    if share < 2:
        return problem
    runs = tuple(replace(run, stretches=_parts(run, share, stretch)) for run in problem.runs)
    return replace(problem, runs=runs, remembered=_core.Remembered(lead))


def _parts(run: Run, share: int, stretch: int) -> tuple[tuple[int, int], ...]:
    """One part of so many of each stretch, from its middle."""
    parts = []
    for first, last in run.stretches:
        count = max(1, round((last - first) / (share * stretch)))
        step = (last - first) / count
        length = round(step / share)
        begins = [first + round((k + 0.5) * step) - length // 2 for k in range(count)]
        parts += [(begin, begin + length) for begin in begins]
    return tuple(parts)
