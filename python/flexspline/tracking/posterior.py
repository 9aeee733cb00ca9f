"""What sessions leave open of a number's course: draws of its level, change, noise and onset.

Given a candidate and a noise (`changes.py`), the coefficients β and the scale s² of the noise have
the posterior of generalised least squares with flat priors,

    s² ~ rest / χ²(S − K),        β ~ N(β̂, s² (Xᵀ R⁻¹ X)⁻¹)

and candidates and noises are drawn by their weights. So intervals of a date, a size and of what is
to come hold what is not known of when, how and in which noise it began.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from flexspline.tracking.changes import (
    NOISES,
    SHAPES,
    STEP,
    Candidates,
    Series,
    Shape,
    course,
)

__all__ = ["LEVEL", "Posterior", "posterior_of"]

Array = NDArray[np.float64]

DRAWS: Final = 4000
"""The ends of an interval of 95 % are drawn to a fortieth of its width."""
LEVEL: Final = (2.5, 97.5)  # percentiles of an interval of 95 %


@dataclass(frozen=True, eq=False)
class Posterior:
    """N draws of the course of a number.

    Parameters
    ----------
    series : the sessions.
    levels : (N,) before the change, at `series.reference`.
    by_known : (N, J) sizes of the changes that are known.
    by_temperature : (N, K) coefficients of temperature.
    starts : (N,) days; NaN without a change.
    kinds : (N,) which of `SHAPES` it is; −1 without one.
    sizes : (N,) by which its course is multiplied; 0 without one.
    """

    series: Series
    levels: Array
    by_known: Array
    by_temperature: Array
    starts: Array
    kinds: NDArray[np.intp]
    sizes: Array

    def changed(self, days: Array) -> Array:
        """(N, D): what the change made by these days."""
        since = np.asarray(days, dtype=np.float64)[None, :] - self.starts[:, None]
        made = np.zeros(since.shape)
        for k, kind in enumerate(SHAPES):
            own = self.kinds == k
            made[own] = course(kind, since[own])
        return np.asarray(self.sizes[:, None] * made)

    def chance(self, kind: str) -> float:
        """Probability that the change is of this kind."""
        return float(np.mean(self.kinds == SHAPES.index(kind)))

    def course(self, days: Array) -> Array:
        """(N, D): the level at the reference temperature on these days, also of days to come."""
        known = [shape.of(np.asarray(days, dtype=np.float64)) for shape in self.series.known]
        made = self.by_known @ np.array(known) if known else 0.0
        return np.asarray(self.levels[:, None] + made + self.changed(days))

    def thermal(self) -> Array:
        """(S,) what temperature made of each session, the mean of all draws."""
        columns = self.series.covariates[:, 1 : 1 + self.by_temperature.shape[1]]
        return np.asarray(columns @ self.by_temperature.mean(axis=0))


def posterior_of(
    series: Series, candidates: Candidates | None, rng: np.random.Generator, draws: int = DRAWS
) -> Posterior:
    """Draw the course of a series with one change among these candidates; None: with none."""
    if candidates is None:
        last = Candidates.of(series).plain[-1] if len(series.days) >= 8 else np.zeros(len(NOISES))
        weights = np.exp(last - last.max())[None, :]
        shapes: tuple[Shape | None, ...] = (None,)
    else:
        weights, shapes = candidates.weights, candidates.shapes
    often = rng.multinomial(draws, (weights / weights.sum()).ravel()).reshape(weights.shape)
    width = series.covariates.shape[1] + (candidates is not None)
    coefficients = np.empty((draws, width))
    starts, kinds = np.full(draws, np.nan), np.full(draws, -1)
    first = 0
    for k, m in np.argwhere(often):
        last_one, shape = first + int(often[k, m]), shapes[k]
        rows = slice(first, last_one)
        coefficients[rows] = _drawn(series, shape, NOISES[m], rng, last_one - first)
        if shape is not None:
            starts[rows] = _onsets(series, shape, rng, last_one - first)
            kinds[rows] = SHAPES.index(shape.kind)
        first = last_one
    known = len(series.known)
    warm = series.covariates.shape[1] - 1 - known
    return Posterior(
        series,
        coefficients[:, 0],
        coefficients[:, 1 + warm : 1 + warm + known],
        coefficients[:, 1 : 1 + warm],
        starts,
        kinds,
        coefficients[:, -1] if candidates is not None else np.zeros(draws),
    )


def _onsets(series: Series, shape: Shape, rng: np.random.Generator, count: int) -> Array:
    """Days (n,): a step is told to one session before and behind that at which it is seen.

    Between sessions it may be anywhere, and in noise with tails it is taken for its neighbour's:
    between the session before and itself alone it lies in 78 of 100 joints.
    """
    if shape.kind != STEP:
        return np.full(count, shape.start)
    at = int(np.searchsorted(series.days, shape.start))
    behind = int(np.searchsorted(series.days, shape.start, side="right"))
    first = series.days[max(at - 1, 0)]
    last = series.days[min(behind, len(series.days) - 1)]
    return np.asarray(rng.uniform(first, last, count))


def _drawn(
    series: Series,
    shape: Shape | None,
    noise: tuple[float, float],
    rng: np.random.Generator,
    count: int,
) -> Array:
    """Coefficients (n, K) of the covariates and, at last, of the change."""
    values, columns = series.white(noise, () if shape is None else (shape,))
    size = np.sqrt(np.einsum("sk,sk->k", columns, columns))
    size[size == 0.0] = 1.0
    left, singular, right = np.linalg.svd(columns / size, full_matrices=False)
    seen = singular > 1e-7 * singular[0]
    inverse = np.where(seen, 1.0 / np.where(seen, singular, 1.0), 0.0)
    best = right.T @ (inverse * (left.T @ values))
    rest = float(np.sum((values - (columns / size) @ best) ** 2))
    free = max(len(values) - columns.shape[1], 1)
    scale = np.maximum(rest / rng.chisquare(free, count), series.floor)
    normal = rng.normal(size=(count, len(inverse))) * inverse
    return np.asarray((best + np.sqrt(scale)[:, None] * (normal @ right)) / size)
