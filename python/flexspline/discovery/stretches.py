"""Which rows of a run are summed together: folds, stretches without a gap, and pieces of these."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexspline.discovery.settings import SETTINGS
from flexspline.discovery.whitening import Whitening
from flexspline.fit.problem import Problem
from flexspline.fit.validation import RUNS_NEEDED, run_edges
from flexspline.logs.local_fit import LocalFit
from flexspline.logs.segments import runs as unbroken_runs

__all__ = [
    "Stretch",
    "by_runs",
    "edges_of",
    "fold_blocks",
    "kernels_of",
    "pieces_of",
    "stretches_of",
]

Array = NDArray[np.float64]
Stretch = tuple[int, int, Array]
"""Rows [first, last), and the weights (2h + 1,) of the low pass around each; none: (0,)."""

CHUNK = 2 * SETTINGS.rows  # of which functions without a name are made at once


def by_runs(problem: Problem) -> bool:
    """Whether whole runs are left out, else blocks of them."""
    return len(problem.runs) >= RUNS_NEEDED


def edges_of(problem: Problem, number: int) -> list[int]:
    """Rows at which the folds of a run begin, and its end."""
    return run_edges(problem, number, by_runs(problem))


def fold_blocks(problem: Problem, number: int, rows: NDArray[np.intp]) -> list[tuple[int, int]]:
    """Ranges of the filtered rows of a run that lie in each of its folds."""
    edges = np.searchsorted(rows, edges_of(problem, number))
    return [(int(first), int(last)) for first, last in pairwise(edges.tolist())]


def stretches_of(problem: Problem, number: int, whitening: Whitening) -> list[Stretch]:
    """Rows [first, last) that are long enough for the filter, and the low pass around them."""
    run = problem.runs[number]
    kernels = kernels_of(problem, number) or {}
    none = np.empty(0)
    return [
        (first, last, kernels.get(first, none))
        for first, last in run.stretches
        if whitening.long_enough(last - first)
    ]


def pieces_of(stretch: Stretch, whitening: Whitening) -> Iterator[Stretch]:
    """Cut a stretch; each piece begins as early as its filter needs."""
    first, last, kernel = stretch
    history = whitening.order * whitening.decimation
    step = max(CHUNK // whitening.decimation, 1) * whitening.decimation
    for start in range(first, last - history, step):
        yield start, min(start + step + history, last), kernel


def kernels_of(problem: Problem, number: int) -> dict[int, Array] | None:
    """Low pass of each stretch, by its first row; None where its steps are not even."""
    if problem.lowpass is None:
        return {}
    run = problem.runs[number]
    kept: dict[Any, Any] = problem.kept
    key = ("kernels", number, run.stretches)
    if key not in kept:
        fit, time = LocalFit(problem.lowpass), run.log["time"]
        whole = unbroken_runs(time)
        made = {}
        for first, _ in run.stretches:
            a, b = next((int(a), int(b)) for a, b in whole if a <= first < b)
            made[first] = fit.kernel_of(time[a:b])
        kept[key] = None if any(kernel is None for kernel in made.values()) else made
    found: dict[int, Array] | None = kept[key]
    return found
