"""Descents of the cost from several starts: least squares by trust regions [Branch1999]."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from flexspline.output_error.cost import Cost

__all__ = ["Descent", "best_of", "descend", "drawn_starts"]

Array = NDArray[np.float64]

WIDTH = 0.5  # standard deviation of the starts, in coordinates: a factor of 1.6 either way
DRAWS_A_START = 6
TOLERANCE = 1e-4  # relative, of the cost: simulations that stick are not smoother
INSIDE = 1e-9  # a start on a bound is moved in by this share of its coordinate


@dataclass(frozen=True)
class Descent:
    """One descent: RMSE [rad] where it started and where it ended, and the point of the end."""

    first_rmse: float
    rmse: float
    start: Array
    point: Array
    evaluations: int


def descend(cost: Cost, start: Array, most: int) -> Descent:
    """Descend from a start, by slopes to one side and then to both, which stall later.

    `most`: evaluations of the residuals on each of the two ways.
    """
    low, high = cost.space.bounds
    inside = INSIDE * np.maximum(np.abs(start), 1.0)
    begin = np.clip(start, low + inside, high - inside)
    first = cost.rmse(begin)
    point, count = begin, 0
    for slopes in (cost.jacobian, partial(cost.jacobian, central=True)):
        found = least_squares(
            cost.residuals,
            point,
            jac=slopes,
            bounds=(low, high),
            method="trf",
            x_scale="jac",
            ftol=TOLERANCE,
            xtol=TOLERANCE,
            gtol=None,
            max_nfev=most,
        )
        point, count = np.clip(found.x, low + inside, high - inside), count + int(found.nfev)
    rmse = float(np.sqrt(2.0 * found.cost / len(found.fun)))
    return Descent(first, rmse, begin, found.x, count)


def drawn_starts(cost: Cost, count: int, seed: int) -> list[Array]:
    """Return the regression and `count` − 1 points around it: the best of several times as many.

    Drawn from normal distributions of `WIDTH`, the same for the same seed.
    """
    centre, (low, high) = cost.space.start, cost.space.bounds
    noise = np.random.default_rng(seed).normal(
        0.0, WIDTH, (DRAWS_A_START * (count - 1), len(centre))
    )
    points = list(np.clip(centre + noise, low, high))
    if not points:
        return [centre]
    order = np.argsort(cost.rmses(points), kind="stable")
    return [centre, *(points[k] for k in order[: count - 1])]


def best_of(descents: Sequence[Descent]) -> Descent:
    """Return the lowest."""
    return min(descents, key=lambda made: made.rmse)
