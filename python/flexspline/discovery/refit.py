"""Coefficients and shapes of a model together, in the noise's own metric (Gauss-Newton)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flexspline.discovery.table import solved, tabulated
from flexspline.discovery.whitening import Whitening
from flexspline.discovery.working import Working
from flexspline.fit.problem import Problem

__all__ = ["coefficients_of", "refitted", "started"]

Array = NDArray[np.float64]

ROUNDS = 12
FARTHEST = 0.7  # of a shape's logarithm in one step
STANDS = 1e-2  # of the squares over σ², in χ²
HALVINGS = 3
SCANNED = 6  # values of a shape, from bound to bound
LOAD_ROUNDS = 3  # solves until the load that inertia and gravity make stands


def started(problem: Problem, work: Working, whitening: Whitening) -> tuple[Working, float]:
    """Return the model at its optimum, from the best point of a scan along each shape in turn."""
    for number, shape in enumerate(work.searched):
        ends = np.log([shape.info.lower, shape.info.upper])
        here = work.logarithms
        trials = []
        for value in (here[number], *np.linspace(ends[0], ends[1], SCANNED)):
            moved = here.copy()
            moved[number] = value
            made, squares = solved_at(problem, work.at(moved), whitening)
            trials.append((squares, made))
        work = min(trials, key=lambda trial: trial[0])[1]
    return refitted(problem, work, whitening)


def refitted(problem: Problem, work: Working, whitening: Whitening) -> tuple[Working, float]:
    """Return the model at its optimum, and its squares over σ².

    A shape is moved along the tangent as far as that lowers the squares; one that stands at its
    bound or bends nothing stays where it is.
    """
    work, squares, step = coefficients_of(problem, work, whitening)
    for _ in range(ROUNDS if len(work.searched) else 0):
        before = squares
        move = np.clip(step, -FARTHEST, FARTHEST)
        for _ in range(HALVINGS):
            trial = work.at(work.logarithms + move)
            made, reached, ahead = coefficients_of(problem, trial, whitening)
            if reached < squares:
                work, squares, step = made, reached, ahead
                break
            move = 0.4 * move
        if before - squares < STANDS:
            break
    return work, squares


def coefficients_of(
    problem: Problem, work: Working, whitening: Whitening
) -> tuple[Working, float, Array]:
    """Solve for the coefficients at these shapes.

    Returns
    -------
    The model with its coefficients, the squares over σ² that it leaves, and the step (S,) of the
    shapes' logarithms that the tangent suggests.
    """
    work, squares = solved_at(problem, work, whitening)
    if not len(work.searched) or not np.any(work.coefficients):
        return work, squares, np.zeros(len(work.searched))
    full = tabulated(problem, work.sheet(), whitening).total
    both = solved(full, np.arange(len(full) - 1))
    return work, squares, both[len(work.free) :]


def solved_at(problem: Problem, work: Working, whitening: Whitening) -> tuple[Working, float]:
    """Return the model with its coefficients at these shapes, and the squares over σ²."""
    moves = any("load" in e.reads for e in work.effects)
    moves = moves and any(e.info.carries_load for e in work.effects)
    for _ in range(LOAD_ROUNDS if moves else 1):
        total = tabulated(problem, work.sheet(bends=False), whitening).total
        linear = np.arange(len(work.free))
        beta = solved(total, linear)
        values = work.coefficients.copy()
        values[work.free] = beta
        work = replace(work, coefficients=values)
    return work, float(total[-1, -1] - total[linear, -1] @ beta)
