"""A known load that is recorded later than the target: a freedom of the fit, not of the model.

A load cell has a clock and a filter of its own. Where it is late by d, a millisecond or two, the
known load L that is taken off the target and that the rows read leaves, to first order,

    r(t) = y − X β = d c(t) + e(t),     c = L′ (∂y/∂L − ∂(Xβ)/∂L) · (−1)

which is often more than all other noise, follows the load and not time, and is no autoregression.
So c stands beside the rows while coefficients are found, and their errors are those beside it
(partialling out: [FrischWaugh1933]). L′ is that of the load as the rows read it, smoothed, so
that the cell's noise does not attenuate d. Nothing is moved: the model predicts from the runs as
they are, and its residual holds what the delay makes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexspline.effects import Effect
from flexspline.effects.causes import LAG
from flexspline.least_squares.estimate import Estimate
from flexspline.least_squares.noise_model import Chunk, Chunks
from flexspline.least_squares.problem import Problem
from flexspline.least_squares.shapes import Tangent
from flexspline.signals import target_of

__all__ = ["Beside", "LateLoad", "basis_beside", "beside_delay", "can_be_late", "slopes_by"]

Array = NDArray[np.float64]

STEP = 1e-3  # s, by which the load is moved either way along its slope, for differences
ROUNDS = 4
STANDS = 0.02  # of the delay's error as if the noise were white: steps below it change nothing
UNSEEN = 1e-10  # of a column's squares: what rows leave of it, at which they explain it


@dataclass(frozen=True, eq=False)
class LateLoad:
    """By how much the known load is later than the target, s.

    `columns`: what a second of delay makes of each run's residual, (N,), unit of the target / s.
    """

    channel: str
    seconds: float
    columns: tuple[Array, ...]

    def of(self, number: int) -> Array:
        """What the delay makes of the residual of a run, (N,), unit of the target."""
        return self.seconds * self.columns[number]


@dataclass(frozen=True, eq=False)
class Beside:
    """Rows of a fit with one more column, (N,) for each run, behind all others."""

    tangent: Tangent
    columns: tuple[Array, ...]

    def __call__(self) -> Iterator[Chunk]:
        """Give the rows piece by piece, as the noise model reads them."""
        return self.some(1)()

    def some(self, every: int) -> Chunks:
        """Return what gives one chunk of `every`, as `Tangent.some`."""
        return lambda: (chunk for _, _, chunk in self.pieces(every))

    def pieces(self, every: int = 1) -> Iterator[tuple[int, slice, Chunk]]:
        """Run number, rows and chunk of each piece, as `Tangent.pieces`."""
        for number, rows, chunk in self.tangent.pieces(every):
            wide = np.column_stack([chunk.rows, self.columns[number][rows]])
            yield number, rows, replace(chunk, rows=wide)


def can_be_late(problem: Problem, effects: Sequence[str]) -> bool:
    """Whether the delay of the load is to be found: it is a noisy channel, and no effect is one."""
    read = problem.known_load is not None and LAG not in effects
    return read and any(way.channel == problem.known_load for way in problem.preparations)


def beside_delay(
    problem: Problem, made: Estimate, again: Callable[[Problem, Estimate], Estimate]
) -> tuple[Estimate, LateLoad]:
    """Return the estimate beside a delay of the load, and the delay.

    Parameters
    ----------
    problem : of the runs as they are.
    made : the estimate without a delay.
    again : estimates a problem anew, near the last estimate.
    """
    delay, columns = 0.0, _columns(problem, made)
    for _ in range(ROUNDS):
        step, error = _step(made, columns)
        if not np.isfinite(error) or abs(step) <= STANDS * error:
            break
        delay += step
        made = again(_without(problem, columns, delay), made)
        columns = _columns(problem, made)
    assert problem.known_load is not None
    return made, LateLoad(problem.known_load, delay, columns)


def basis_beside(made: Estimate, columns: Sequence[Array]) -> Array:
    """Return the basis of an estimate with one direction more, for rows beside a column."""
    _, products, correlations, squares, _ = _sums(made, columns)
    known = made.prior_rows @ made.basis
    through = np.linalg.solve(products + known.T @ known, correlations)
    left = squares - float(correlations @ through)
    count, width = made.basis.shape
    basis = np.zeros((count + 1, width + (left > UNSEEN * squares)))
    basis[:count, :width] = made.basis
    if left > UNSEEN * squares:
        basis[:, -1] = np.append(-made.basis @ through, 1.0) / np.sqrt(left)
    return basis


def _step(made: Estimate, columns: Sequence[Array]) -> tuple[float, float]:
    """By how much the delay has to grow, s, and its error as if the noise were white."""
    rows, products, correlations, squares, (of_rows, own, residual) = _sums(made, columns)
    known = made.prior_rows @ made.basis
    products = products + known.T @ known
    through = np.linalg.solve(products, correlations)
    left = squares - float(correlations @ through)
    if not left > UNSEEN * squares:
        return 0.0, float("inf")
    step = (own - float(of_rows @ through)) / left
    return step, float(np.sqrt(residual / max(rows, 1) / left))


def _sums(
    made: Estimate, columns: Sequence[Array]
) -> tuple[int, Array, Array, float, tuple[Array, float, float]]:
    """Rows; products of Z with Z, c, of c with c; and of Z, c and r with r. Z: rows @ basis."""
    width = made.basis.shape[1]
    products, correlations, of_rows = np.zeros((width, width)), np.zeros(width), np.zeros(width)
    squares, own, residual, count = 0.0, 0.0, 0.0, 0
    for number, rows, chunk in made.tangent.pieces():
        z, c = chunk.rows @ made.basis, columns[number][rows]
        weight = np.ones(len(c)) if chunk.weights is None else chunk.weights
        products += z.T @ (weight[:, None] * z)
        correlations += z.T @ (weight * c)
        of_rows += z.T @ (weight * chunk.residual)
        squares += float(c @ (weight * c))
        own += float(c @ (weight * chunk.residual))
        residual += float(chunk.residual @ (weight * chunk.residual))
        count += len(c)
    return count, products, correlations, squares, (of_rows, own, residual)


def _columns(problem: Problem, made: Estimate) -> tuple[Array, ...]:
    """c of each run, low-passed and centred as its target is."""
    slopes = slopes_by(problem, made.linear.effects, made.linear.coefficients)
    smooth = [problem.smooth(run, one) for run, one in zip(problem.runs, slopes, strict=True)]
    if not problem.takes_out:
        return tuple(smooth)
    return tuple(problem.apart(k, one) for k, one in enumerate(smooth))


def slopes_by(
    problem: Problem, effects: Sequence[Effect], coefficients: Array
) -> tuple[Array, ...]:
    """Return c of each run, (N,), for a model of these effects."""
    design, load = problem.design(effects), problem.known_load
    assert load is not None
    found = []
    for number, run in enumerate(problem.runs):
        own = coefficients[problem.place(effects, number)]
        slope = np.gradient(run.log[load], run.log["time"])
        left = []
        for way in (STEP, -STEP):
            moved = run.log[load] + way * slope
            channels = {**run.channels, "known_load": np.ascontiguousarray(moved)}
            told = np.asarray(design.predict(channels, len(run), own))
            log = run.log.with_columns({load: moved}, note="moved along its slope")
            left.append(target_of(log, problem.target, load) - told)
        found.append((left[1] - left[0]) / (2.0 * STEP))
    return tuple(found)


def _without(problem: Problem, columns: Sequence[Array], delay: float) -> Problem:
    """The problem whose target lacks what the delay makes of it."""
    runs = [
        replace(run, target=run.target - delay * column)
        for run, column in zip(problem.runs, columns, strict=True)
    ]
    return replace(problem, runs=tuple(runs))
