"""Coefficients and shapes of a model together, in the noise's own metric (Gauss-Newton)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flexspline.discovery.physics import varying
from flexspline.discovery.settings import SETTINGS
from flexspline.discovery.table import solved, tabulated
from flexspline.discovery.whitening import Whitening
from flexspline.discovery.working import Working
from flexspline.fit.names import coefficient_names
from flexspline.fit.problem import Problem

__all__ = ["at_upper_bound", "coefficients_of", "mixed", "refitted", "started"]

Array = NDArray[np.float64]

LOAD_ROUNDS = SETTINGS.tried - 1  # solves until the load that inertia and gravity make stands
FARTHEST = float(np.log(2.0))  # of a shape's logarithm in one step
ROUNDING = SETTINGS.singular * np.sqrt(SETTINGS.singular)  # of squares: a difference's own


def started(problem: Problem, work: Working, whitening: Whitening) -> tuple[Working, float]:
    """Return the model at its optimum, from the best point of a scan along each shape in turn.

    A shape that these rows do not tell stays where it is, not at whichever bound rounding prefers.
    """
    told = SETTINGS.told / max(sum(run.counted for run in problem.runs), 1)
    for number, shape in enumerate(work.searched):
        ends = np.log([shape.info.lower, shape.info.upper])
        here = work.logarithms
        trials = []
        for value in (here[number], *np.linspace(ends[0], ends[1], SETTINGS.points)):
            moved = here.copy()
            moved[number] = value
            made, squares = solved_at(problem, work.at(moved), whitening)
            trials.append((squares, made))
        best = min(trials, key=lambda trial: trial[0])
        work = best[1] if best[0] < (1.0 - told) * trials[0][0] else trials[0][1]
    return refitted(problem, work, whitening)


def at_upper_bound(work: Working) -> list[str]:
    """Return the shapes that stand there: such a shape has lost what it shapes."""
    upper = np.log([s.info.upper for s in work.searched])
    there = np.isclose(work.logarithms, upper, atol=SETTINGS.singular)
    return [shape.name for shape, at in zip(work.searched, there, strict=True) if at]


def refitted(problem: Problem, work: Working, whitening: Whitening) -> tuple[Working, float]:
    """Return the model at its optimum, and its squares over σ².

    A shape is moved along the tangent as far as that lowers the squares; one that stands at its
    bound or bends nothing stays where it is.
    """
    work, squares, step = coefficients_of(problem, work, whitening)
    for _ in range(SETTINGS.functions if len(work.searched) else 0):
        if not step.any():
            break
        before = squares
        move = np.clip(step, -FARTHEST, FARTHEST)
        for _ in range(SETTINGS.tried):
            trial = work.at(work.logarithms + move)
            if np.allclose(trial.logarithms, work.logarithms, rtol=0.0, atol=SETTINGS.singular):
                break
            made, reached, ahead = coefficients_of(problem, trial, whitening)
            if reached < squares:
                work, squares, step = made, reached, ahead
                break
            move = 0.5 * move
        if before - squares < SETTINGS.negligible:
            break
    return work, squares


def coefficients_of(
    problem: Problem, work: Working, whitening: Whitening
) -> tuple[Working, float, Array]:
    """Solve for the coefficients at these shapes.

    Returns
    -------
    The model with its coefficients, the squares over σ² that it leaves, and the step (S,) of the
    shapes' logarithms that the tangent suggests; 0 where that promises next to nothing.
    """
    count = len(work.searched)
    if not count:
        return *solved_at(problem, work, whitening), np.zeros(0)
    if _moves(work):
        work, _ = solved_at(problem, work, whitening, LOAD_ROUNDS - 1)
    sheet, slopes = work.opened()
    total = tabulated(problem, sheet, whitening).total
    total = _drawn(problem, work, total)
    work, squares = _solved(work, total)
    if not np.any(work.coefficients):
        return work, squares, np.zeros(count)
    full = mixed(total, slopes @ work.coefficients)
    both = solved(full, np.arange(len(full) - 1))
    ahead = squares - float(full[-1, -1] - full[:-1, -1] @ both)
    return work, squares, both[len(work.free) :] * (ahead >= SETTINGS.negligible)


def mixed(total: Array, weights: Array) -> Array:
    """Products of [columns, M parts of shapes, y] with the parts mixed to columns of shapes.

    A difference of parts that is no more than rounding is none.
    """
    parts, shapes = weights.shape
    linear = len(total) - 1 - parts
    mix = np.zeros((len(total), linear + shapes + 1))
    mix[:linear, :linear] = np.eye(linear)
    mix[linear:-1, linear:-1] = weights
    mix[-1, -1] = 1.0
    size = np.abs(mix).T @ np.sqrt(np.maximum(np.diag(total), 0.0))
    full = mix.T @ total @ mix
    mix[:, np.diag(full) <= ROUNDING * size**2] = 0.0
    return np.asarray(mix.T @ total @ mix)


def solved_at(
    problem: Problem, work: Working, whitening: Whitening, rounds: int = LOAD_ROUNDS
) -> tuple[Working, float]:
    """Return the model with its coefficients at these shapes, and the squares over σ²."""
    squares = 0.0
    for _ in range(rounds if _moves(work) else 1):
        total = tabulated(problem, work.sheet(bends=False), whitening).total
        work, squares = _solved(work, _drawn(problem, work, total))
    return work, squares


def _drawn(problem: Problem, work: Working, total: Array) -> Array:
    """Add what physics says of the size of free coefficients, whose columns come first, in χ².

    With this the squares over σ² that a fit leaves hold (coefficient / size)² of each, too.
    """
    sizes = varying(work, problem)
    if not sizes:
        return total
    names = coefficient_names(work.effects)
    total = total.copy()
    for column, k in enumerate(work.free):
        if names[k] in sizes:
            total[column, column] += sizes[names[k]] ** -2
    return total


def _solved(work: Working, total: Array) -> tuple[Working, float]:
    """Solve for the free coefficients, whose columns come first, the target last."""
    linear = np.arange(len(work.free))
    beta = solved(total, linear)
    values = work.coefficients.copy()
    values[work.free] = beta
    return replace(work, coefficients=values), float(total[-1, -1] - total[linear, -1] @ beta)


def _moves(work: Working) -> bool:
    """Whether the model makes a load that its rows read."""
    reads = any("load" in effect.reads for effect in work.effects)
    return reads and any(effect.info.carries_load for effect in work.effects)
