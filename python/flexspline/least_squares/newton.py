"""An estimate moved to the least squares of filtered rows, by Gauss and Newton.

Rows move with shapes, and with coefficients where the load is the model's own, so steps are taken
until they stand; none that raises the squares is.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flexspline.least_squares.estimate import Estimate
from flexspline.least_squares.prewhitening import filtered

__all__ = ["newton"]

Array = NDArray[np.float64]

ROUNDS = 15
SHORTER = (1.0, 0.4, 0.16)  # parts of a step that are tried
FARTHEST = 0.7  # of a shape's logarithm in one step
STANDS = 1e-3  # of the noise's variance, by which the squares may still fall


def newton(made: Estimate) -> Estimate | None:
    """Return the estimate of least squares on rows filtered by its `denominator`.

    None where it is not found: steps do not stand, or a bound is in the way.
    """
    squares, promised, step = _ahead(made)
    rows = sum(run.counted for run in made.tangent.problem.runs)
    for _ in range(ROUNDS):
        if promised <= STANDS * squares / rows:
            return made
        for share in SHORTER:
            trial = _moved(made, share * step)
            if trial is None:
                continue
            reached, further, onwards = _ahead(trial)
            if reached < squares:
                made, squares, promised, step = trial, reached, further, onwards
                break
        else:
            return None
    return None


def _ahead(made: Estimate) -> tuple[float, float, Array]:
    """Squares of the filtered residual, what a step may take off them, and the step, (F + S,)."""
    assert made.denominator is not None
    width = made.basis.shape[1]
    products, pull, squares = np.zeros((width, width)), np.zeros(width), 0.0
    for chunk in filtered(made.tangent, made.denominator)():
        rows = chunk.rows @ made.basis
        products += rows.T @ rows
        pull += rows.T @ chunk.residual
        squares += float(chunk.residual @ chunk.residual)
    step = np.linalg.lstsq(products, pull, rcond=1e-13)[0]
    return squares, float(step @ pull), made.basis @ step


def _moved(made: Estimate, step: Array) -> Estimate | None:
    """The estimate after a step, shapes along their logarithm; None beyond a bound."""
    count, linear = len(made.fitted), made.linear
    coefficients = linear.coefficients.copy()
    coefficients[made.fitted] += step[:count]
    limits = made.constraints
    if (coefficients < limits.lower).any() or (coefficients > limits.upper).any():
        return None
    effects = linear.effects
    for shape, change in zip(made.free_shapes, step[count:], strict=True):
        value = shape.value(effects)
        value *= float(np.exp(np.clip(change / value, -FARTHEST, FARTHEST)))
        if not shape.info.lower <= value <= shape.info.upper:
            return None
        effects = shape.set(effects, value)
    linear = replace(linear, effects=effects, coefficients=coefficients)
    tangent = replace(made.tangent, effects=effects, coefficients=coefficients)
    return replace(made, linear=linear, tangent=tangent)
