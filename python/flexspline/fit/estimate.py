"""The estimate itself: shapes around coefficients, weights and priors around both."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexspline.effects import Effect
from flexspline.errors import InputError
from flexspline.fit.linear import LinearFit, fit_linear
from flexspline.fit.names import (
    Bounds,
    Constraints,
    ShapeParameter,
    coefficient_names,
    constraints_of,
    shapes_of,
)
from flexspline.fit.noise_model import noise_model
from flexspline.fit.problem import Problem, Run
from flexspline.fit.robust import huber_weights
from flexspline.fit.shapes import ShapeFit, fit_shapes
from flexspline.fit.tangent import Tangent

__all__ = ["Estimate", "Given", "estimate"]

Array = NDArray[np.float64]

ROBUST_ROUNDS = 30
ROBUST_STANDS = 1e-5


@dataclass(frozen=True)
class Given:
    """What is known or wanted of the parameters beforehand, by name, in their units."""

    fixed: Mapping[str, float]
    bounds: Mapping[str, Bounds]
    priors: Mapping[str, tuple[float, float]]
    robust: bool


@dataclass(frozen=True)
class Estimate:
    """The solution and what it was found with.

    `names`: of the coefficients (P,). `fitted`: numbers of the coefficients that are neither
    fixed nor at a bound. `free_shapes`: shapes fitted and not at a bound; `shapes`: all.
    `tangent`: rows of `fitted` and `free_shapes` at the solution. `basis`: the directions of
    these that data and priors determine.
    """

    names: list[str]
    linear: LinearFit
    constraints: Constraints
    searched: ShapeFit
    shapes: tuple[ShapeParameter, ...]
    fitted: NDArray[np.intp]
    free_shapes: tuple[ShapeParameter, ...]
    tangent: Tangent
    basis: Array

    @property
    def prior_rows(self) -> Array:
        """(m, F + S), rows that priors add to the tangent."""
        keep = np.searchsorted(self.constraints.free, self.fitted)
        rows = self.linear.prior_rows[:, keep]
        return np.hstack([rows, np.zeros((len(rows), len(self.free_shapes)))])


def estimate(
    problem: Problem, effects: Sequence[Effect], given: Given, tick: Callable[[], object]
) -> Estimate:
    """Fit coefficients and shapes.

    With priors the fit is made twice: the first gives the long-run variance of the noise, which
    the second weighs the priors by.

    Raises
    ------
    InputError
        For a name that is no parameter, or bounds that leave nothing.
    """
    runs = [run.log.name for run in problem.runs] if problem.offset_per_run else []
    names = coefficient_names(effects, runs)
    shapes = shapes_of(effects)
    fixed, fixed_shapes = _split(given.fixed, shapes)
    bounds, shape_bounds = _split(given.bounds, shapes)
    for shape in shapes:
        if shape.name in fixed_shapes:
            effects = shape.set(effects, fixed_shapes[shape.name])
    constraints = constraints_of(names, fixed, bounds, given.priors)
    search = _Search(
        problem,
        tuple(effects),
        constraints,
        [shape for shape in shapes if shape.name not in fixed_shapes],
        {s.name: _limits(s, shape_bounds[s.name]) for s in shapes if s.name in shape_bounds},
        given.robust,
        tick,
    )
    made = _finished(names, shapes, search, 1.0)
    if constraints.informed:
        noise = noise_model(made.tangent, made.basis, decimation=problem.decimation)
        made = _finished(names, shapes, search, noise.long_run_variance)
    return made


@dataclass(frozen=True)
class _Search:
    problem: Problem
    effects: tuple[Effect, ...]
    constraints: Constraints
    free: list[ShapeParameter]
    limits: dict[str, tuple[float, float]]
    robust: bool
    tick: Callable[[], object]

    def run(self, variance: float, weights: list[Array] | None, exact: bool) -> ShapeFit:
        def solve(effects: tuple[Effect, ...], start: Array | None) -> LinearFit:
            return fit_linear(
                self.problem, effects, self.constraints, start=start, weights=weights,
                noise_variance=variance, exact=exact,
            )

        return fit_shapes(self.effects, self.free, solve, self.limits, self.tick)

    def run_robust(self, variance: float) -> tuple[ShapeFit, list[Array] | None]:
        """Search again with the weights of the last residuals until the coefficients stand."""
        found, weights = self.run(variance, None, False), None
        for _ in range(ROBUST_ROUNDS if self.robust else 0):
            linear = found.linear
            residuals = residuals_of(self.problem, linear)
            counted = [counts_of(run) for run in self.problem.runs]
            weights = huber_weights(residuals, counted)
            found = self.run(variance, weights, linear.exact)
            change = np.abs(found.linear.coefficients - linear.coefficients)
            if (change <= ROBUST_STANDS * np.abs(linear.coefficients).max(initial=1e-12)).all():
                break
        return found, weights


def residuals_of(problem: Problem, linear: LinearFit) -> list[Array]:
    """Measured minus predicted, (N,) for each run."""
    predicted = problem.predict(linear.effects, linear.coefficients)
    return [run.target - p for run, p in zip(problem.runs, predicted, strict=True)]


def counts_of(run: Run) -> NDArray[np.bool_]:
    """Rows of a run that count, (N,)."""
    mask = np.zeros(len(run), dtype=bool)
    for first, last in run.stretches:
        mask[first:last] = True
    return mask


def _finished(
    names: list[str], shapes: Sequence[ShapeParameter], search: _Search, variance: float
) -> Estimate:
    searched, weights = search.run_robust(variance)
    linear = searched.linear
    free = search.constraints.free
    fitted = free[linear.at_bound[free] == 0]
    active = tuple(s for s in search.free if searched.at_bound.get(s.name) == 0)
    tangent = Tangent(
        search.problem, linear.effects, linear.coefficients, fitted, active, weights
    )
    basis = _basis(linear, np.searchsorted(free, fitted), tangent)
    return Estimate(
        names, linear, search.constraints, searched, tuple(shapes), fitted, active, tangent, basis
    )


def _basis(linear: LinearFit, keep: NDArray[np.intp], tangent: Tangent) -> Array:
    """Directions of coefficients and shapes that are determined; rows @ basis ≈ orthonormal."""
    lengths = linear.solution.lengths[keep]
    stacked = np.concatenate([linear.solution.factor, linear.prior_rows])[:, keep] / lengths
    coefficients = np.zeros((len(keep), 0))
    if stacked.size:
        _, singular, right = np.linalg.svd(stacked, full_matrices=False)
        seen = singular > 1e-14 * singular[0]
        coefficients = (right[seen].T / singular[seen]) / lengths[:, None]
    if not tangent.shapes:
        return coefficients
    bends = len(tangent.shapes)
    basis = np.zeros((len(keep) + bends, coefficients.shape[1] + bends))
    basis[: len(keep), : coefficients.shape[1]] = coefficients
    basis[len(keep) :, coefficients.shape[1] :] = np.eye(bends)
    gram = sum(
        (z.T @ (z if c.weights is None else c.weights[:, None] * z))
        for c in tangent()
        for z in [c.rows @ basis]
    )
    scale = np.sqrt(np.diag(gram))
    scale = np.where(scale > 0.0, scale, 1.0)
    values, vectors = np.linalg.eigh(gram / np.outer(scale, scale))
    seen = values > 1e-12 * values[-1]
    return np.asarray(basis @ (vectors[:, seen] / np.sqrt(values[seen]) / scale[:, None]))


def _split(
    options: Mapping[str, Any], shapes: Sequence[ShapeParameter]
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Split options by name into those of coefficients and those of shapes (by full name)."""
    known = [shape.name for shape in shapes]
    coefficients: dict[str, Any] = {}
    found: dict[str, Any] = {}
    for name, value in options.items():
        matches = [full for full in known if full == name or full.split(".")[-1] == name]
        if len(matches) == 1:
            found[matches[0]] = value
        else:
            coefficients[name] = value
    return coefficients, found


def _limits(shape: ShapeParameter, bounds: Bounds) -> tuple[float, float]:
    low = max(shape.info.lower, shape.info.lower if bounds[0] is None else bounds[0])
    high = min(shape.info.upper, shape.info.upper if bounds[1] is None else bounds[1])
    if not low < high:
        raise InputError(
            f"bounds: {shape.name} from {bounds[0]} to {bounds[1]} leaves nothing of "
            f"{shape.info.lower} to {shape.info.upper} {shape.info.unit}; give a wider range"
        )
    return low, high
