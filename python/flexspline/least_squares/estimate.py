"""The estimate of a fit: coefficients and shapes, robust weights, and generalised least squares.

Huber weights limit the influence of outliers and pushes:

    w = min(1, k s / |r|),   k = 1.345,   s = 1.4826 · median |r − median r|

95 % efficient on normal noise. Source: [HuberRonchetti2009], Robust Statistics.

Generalised least squares moves an estimate to the minimum on filtered rows by Gauss–Newton. Rows
depend on shapes, and on coefficients where the load is the model's own, so steps are repeated until
they converge; a step that raises the squares is not taken.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from flexspline.effects import Effect
from flexspline.least_squares.linear import LinearFit, fit_linear
from flexspline.least_squares.noise_model import NoiseModel, noise_beside_own, noise_model
from flexspline.least_squares.options import (
    Constraints,
    Given,
    ShapeParameter,
    coefficient_names,
    given_of,
    shapes_of,
)
from flexspline.least_squares.problem import Problem, Run
from flexspline.least_squares.shapes import Bent, ShapeFit, Tangent, bent, filtered, fit_shapes

if TYPE_CHECKING:
    from flexspline.least_squares.uncertainty import Uncertainty
    from flexspline.least_squares.validation import Validation

__all__ = [
    "Estimate",
    "Given",
    "estimate",
    "estimate_holding",
    "huber_weights",
    "newton",
]

Array = NDArray[np.float64]

LONG = 1_000_000  # rows from which the noise model reads one chunk of several
ROBUST_ROUNDS = 30
ROBUST_STANDS = 1e-5
UNSEEN = 1e-12

ROUNDS = 15
SHORTER = (1.0, 0.4, 0.16)  # parts of a step that are tried
FARTHEST = 0.7  # of a shape's logarithm in one step
STANDS = 1e-3  # of the noise's variance, by which the squares may still fall

THRESHOLD = 1.345
NORMAL = 1.4826


@dataclass(frozen=True, eq=False)
class Estimate:
    """The solution and what it was found with.

    `names`: of the coefficients (P,). `free_shapes`: shapes fitted and not at a bound; `shapes`:
    all. `tangent`: rows of `fitted` and `free_shapes` at the solution. `basis`: the directions of
    these that data and priors determine. `noise_variance`: what priors were weighed by.
    `denominator`: A, by which rows were filtered (`assemble.py`); None of a plain fit.
    `limits`: of shapes that were bounded closer than the catalogue does, by name.
    """

    names: list[str]
    linear: LinearFit
    constraints: Constraints
    searched: ShapeFit
    shapes: tuple[ShapeParameter, ...]
    free_shapes: tuple[ShapeParameter, ...]
    tangent: Tangent
    basis: Array
    noise_variance: float
    denominator: Array | None = None
    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def fitted(self) -> NDArray[np.intp]:
        """Numbers of the coefficients that are neither fixed nor at a bound."""
        return self.linear.fitted

    @cached_property
    def uncertainty(self) -> Uncertainty:
        """Errors of fitted coefficients and free shapes, in this order; made once."""
        from flexspline.least_squares.assemble import uncertainty_of

        return uncertainty_of(self)

    @cached_property
    def validation(self) -> Validation:
        """What fits to the other folds leave of each; made once."""
        from flexspline.least_squares.validation import cross_validate

        return cross_validate(self)

    def bare(self) -> Estimate:
        """Return the estimate without what was kept to search faster."""
        return replace(self, tangent=replace(self.tangent, problem=self.tangent.problem.bare()))

    @property
    def prior_rows(self) -> Array:
        """(m, F + S), rows that priors add to the tangent."""
        return _beside_shapes(self.linear.prior_rows, len(self.free_shapes))


def estimate(
    problem: Problem,
    effects: Sequence[Effect],
    given: Given,
    tick: Callable[[], object],
    *,
    near: bool = False,
) -> Estimate:
    """Fit coefficients and shapes.

    With priors the fit is made twice: the first, without them, gives the long-run variance of the
    noise, which the second weighs the priors by. `near`: whether the effects' shapes lie in the
    right valley, so that the search need not look for others.

    Raises
    ------
    InputError
        For a name that is no parameter, or bounds that leave nothing.
    """
    runs, own = [run.log.name for run in problem.runs], () if problem.projected else problem.own
    names = coefficient_names(effects, runs, own)
    shapes = shapes_of(effects)
    constraints, held, limits = given_of(names, shapes, given)
    for shape in shapes:
        if shape.name in held:
            effects = shape.set(effects, held[shape.name])
    search = _Search(
        problem,
        tuple(effects),
        constraints,
        [shape for shape in shapes if shape.name not in held],
        limits,
        given.robust,
        tick,
        near,
    )
    made = _finished(names, shapes, search, 0.0)
    if constraints.informed:
        noise = noise_of(made)
        made = _finished(names, shapes, search, noise.long_run_variance * noise.decimation)
    return made


def estimate_holding(
    made: Estimate, held: Mapping[str, float], start: Sequence[Effect]
) -> LinearFit:
    """Fit the same rows again with some parameters held, all others as in an estimate.

    Parameters
    ----------
    made : the estimate; what is fixed, bounded, weighed or known there stays so.
    held : values by full name.
    start : effects with shapes in the valley to look in.
    """
    shapes, limits = {shape.name: shape for shape in made.shapes}, made.constraints.held.copy()
    effects = tuple(start)
    for name, value in held.items():
        if name in shapes:
            effects = shapes[name].set(effects, value)
        else:
            limits[made.names.index(name)] = value
    free = [s for s in made.shapes if s.name in made.searched.at_bound and s.name not in held]
    constraints = replace(made.constraints, held=limits)
    problem, weights = made.tangent.problem, made.tangent.weights
    search = _Search(
        problem, effects, constraints, free, dict(made.limits), False, lambda: None, True
    )
    kept = None if weights is None else list(weights)
    return search.run(made.noise_variance, kept, made.linear.exact).linear


def noise_of(made: Estimate) -> NoiseModel:
    """Return the model of the noise around an estimate."""
    decimation = made.tangent.problem.decimation
    problem = made.tangent.problem
    if problem.projected:
        return noise_beside_own(made.tangent, problem, made.basis)
    chunks = made.tangent.some(read_of(made))
    return noise_model(chunks, made.basis, decimation=decimation, offsets=problem.centred)


def read_of(made: Estimate) -> int:
    """One chunk of how many tells of the noise: of long logs some are enough."""
    return max(1, sum(run.counted for run in made.tangent.problem.runs) // LONG)


@dataclass(frozen=True)
class _Search:
    problem: Problem
    effects: tuple[Effect, ...]
    constraints: Constraints
    free: list[ShapeParameter]
    limits: dict[str, tuple[float, float]]
    robust: bool
    tick: Callable[[], object]
    near: bool

    def run(self, variance: float, weights: list[Array] | None, exact: bool) -> ShapeFit:
        def solve(effects: tuple[Effect, ...], start: Array | None) -> LinearFit:
            return fit_linear(
                self.problem,
                effects,
                self.constraints,
                start=start,
                weights=weights,
                noise_variance=variance,
                exact=exact,
            )

        def bend(found: LinearFit, shapes: Sequence[ShapeParameter]) -> Bent:
            return bent(self.problem, found, self.constraints, shapes, weights)

        rows = float(max(1, sum(run.counted for run in self.problem.runs)))
        return fit_shapes(
            self.effects,
            self.free,
            solve,
            self.limits,
            bend,
            self.tick,
            near=self.near,
            rows=rows,
        )

    def run_robust(self, variance: float) -> tuple[ShapeFit, list[Array] | None]:
        """Search again with the weights of the last residuals until the coefficients stand."""
        found, weights = self.run(variance, None, False), None
        for _ in range(ROBUST_ROUNDS if self.robust else 0):
            linear = found.linear
            residuals = residuals_of(self.problem, linear)
            counted = [counts_of(run) for run in self.problem.runs]
            weights = huber_weights(residuals, counted)
            near = replace(self, effects=linear.effects, near=True)
            found = near.run(variance, weights, linear.exact)
            if _stands(found.linear, linear):
                break
        return found, weights


def _stands(now: LinearFit, before: LinearFit) -> bool:
    """Whether no contribution has moved by more than a small share of the largest one."""
    lengths = now.solution.lengths
    moved = (now.coefficients - before.coefficients)[now.fitted] * lengths
    largest = np.abs(now.coefficients[now.fitted] * lengths).max(initial=0.0)
    return bool((np.abs(moved) <= ROBUST_STANDS * largest).all())


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
    active = tuple(s for s in search.free if searched.at_bound.get(s.name) == 0)
    tangent = Tangent(
        search.problem, linear.effects, linear.coefficients, linear.fitted, active, weights
    )
    basis = _basis(linear, tangent)
    return Estimate(
        names,
        linear,
        search.constraints,
        searched,
        tuple(shapes),
        active,
        tangent,
        basis,
        variance,
        limits=search.limits,
    )


def _basis(linear: LinearFit, tangent: Tangent) -> Array:
    """Directions of coefficients and shapes that are determined; rows @ basis ≈ orthonormal."""
    coefficients = linear.solution.basis
    bends = len(tangent.shapes)
    if not bends:
        return coefficients
    basis = block_diag(coefficients, np.eye(bends))
    known = _beside_shapes(linear.prior_rows, bends) @ basis
    gram = known.T @ known
    for chunk in tangent():
        rows = chunk.rows @ basis
        gram += rows.T @ (rows if chunk.weights is None else chunk.weights[:, None] * rows)
    scale = np.sqrt(np.diag(gram))
    scale = np.where(scale > 0.0, scale, 1.0)
    values, vectors = np.linalg.eigh(gram / np.outer(scale, scale))
    seen = values > UNSEEN * values[-1]
    return np.asarray(basis @ (vectors[:, seen] / np.sqrt(values[seen]) / scale[:, None]))


def _beside_shapes(rows: Array, shapes: int) -> Array:
    """Rows over coefficients (m, F), with zeros for the shapes."""
    return np.hstack([rows, np.zeros((len(rows), shapes))])


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


def huber_weights(residuals: Sequence[Array], counted: Sequence[NDArray[np.bool_]]) -> list[Array]:
    """Return weights (N,) for each run from residuals (N,) and the rows that count."""
    rows = np.concatenate([r[c] for r, c in zip(residuals, counted, strict=True)])
    scale = NORMAL * float(np.median(np.abs(rows - np.median(rows))))
    if scale == 0.0:
        return [np.ones(len(r)) for r in residuals]
    limit = THRESHOLD * scale
    return [limit / np.maximum(np.abs(r), limit) for r in residuals]
