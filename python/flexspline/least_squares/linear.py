"""The linear part of a fit: coefficients for given shapes, and the load they make.

    min_b Σ w (y − X b)²  subject to what is fixed, bounded or known beforehand

The load in the rows is the known load plus the model's own inertia and gravity, so the solve is
repeated until these converge. Sums are plain doubles where that gives nine digits, else
double-double.

A round maps a load x to the load g(x) of the coefficients that it leads to. Where x ← g(x) does not
converge, Anderson mixing takes over: the last few rounds give the slope of the residual f = g − x
in x, and the next load is its root, x = g − (ΔX + ΔF) w, with w the least squares solution of
ΔF w = f. Source: [WalkerNi2011], Anderson acceleration for fixed-point iterations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from flexspline import _core
from flexspline.effects import Effect
from flexspline.errors import InputError
from flexspline.least_squares.options import Constraints
from flexspline.least_squares.problem import Problem
from flexspline.least_squares.sums import Solution, Sums, solve

__all__ = [
    "LinearFit",
    "Settling",
    "UnsettledError",
    "fit_linear",
    "load_of",
]

Array = NDArray[np.float64]

ROUNDS = 60
STANDS = 1e-9
DEPENDENT = 1e-11
ENOUGH_CONDITION = 1e3
BOUND_ROUNDS = 10

PLAIN = 6  # rounds before; most loads settle in three


class UnsettledError(InputError):
    """The load that a model makes by itself does not settle."""


@dataclass(frozen=True, eq=False)
class LinearFit:
    """Coefficients for given shapes.

    `coefficients`: (P,) with the fixed ones. `fitted`: (F,) numbers of those that are neither fixed
    nor at a bound. `solution`: of their columns, priors included. `squares`: what the search for
    shapes minimises, Σ w (y − X b)² and the priors' share. `exact`: summed in double-double.
    `prior_rows`: (m, F) rows that the priors add. `at_bound`: (P,) −1, 0 or 1.
    """

    effects: tuple[Effect, ...]
    coefficients: Array
    fitted: NDArray[np.intp]
    solution: Solution
    squares: float
    exact: bool
    prior_rows: Array
    at_bound: NDArray[np.int8]


def fit_linear(
    problem: Problem,
    effects: Sequence[Effect],
    constraints: Constraints,
    *,
    start: Array | None = None,
    weights: Sequence[Array] | None = None,
    noise_variance: float = 1.0,
    exact: bool = False,
) -> LinearFit:
    """Solve for the coefficients of effects whose shapes are given.

    Parameters
    ----------
    start : (P,), coefficients that make the first load; None for the known load alone.
    weights : an array (N,) for each run, for a robust fit.
    noise_variance : squared unit of the target; the long-run variance that priors are weighed by,
        0 to leave them out.
    exact : sum in double-double from the start.

    Raises
    ------
    InputError
        Where the load does not settle.
    """
    effects = tuple(effects)
    held = np.nan_to_num(constraints.held)
    free = constraints.free
    moving = _load_moves(effects)
    load = load_of(effects, np.zeros(len(held)) if start is None else start)
    prior_rows, prior_target = _prior(constraints, free, noise_variance)
    carried, settling = _carried(problem, effects), Settling()
    for _ in range(ROUNDS):
        sums = problem.sums(effects, load, held=held, weights=weights, exact=exact)
        sums = sums.columns(free.tolist())
        if len(prior_rows):
            sums = sums + _prior_sums(prior_rows, prior_target, exact)
        solution = solve(*sums.total())
        if not exact and not _double_is_enough(
            problem, effects, free, solution, prior_rows, moving
        ):
            exact = True
            continue
        values, bound = _within_bounds(solution, constraints, free)
        coefficients = held.copy()
        coefficients[free] = values
        if not moving or _stands(load[carried], coefficients[carried]):
            inside = np.flatnonzero(bound == 0)
            squares = _squares(solution, values)
            if len(inside) < len(free):
                solution = solve(*sums.columns(inside.tolist()).total())
            at_bound = np.zeros(len(held), dtype=np.int8)
            at_bound[free] = bound
            return LinearFit(
                effects,
                coefficients,
                free[inside],
                solution,
                squares,
                exact,
                prior_rows[:, inside],
                at_bound,
            )
        made, load = load[carried], coefficients.copy()
        load[carried] = settling.next(made, coefficients[carried])
    raise UnsettledError(
        f"the load of the model does not settle after {ROUNDS} rounds; give a known load, or fix "
        "inertia or gravity"
    )


def load_of(effects: Sequence[Effect], coefficients: Array) -> Array:
    """Coefficients of which the load in the rows is made: (P,), or (0,) where none makes any."""
    return coefficients if _load_moves(effects) else np.empty(0)


def _load_moves(effects: Sequence[Effect]) -> bool:
    """Whether rows read a load that the coefficients make."""
    reads = any("load" in effect.reads for effect in effects)
    return reads and any(effect.info.carries_load for effect in effects)


def _carried(problem: Problem, effects: Sequence[Effect]) -> NDArray[np.intp]:
    """Which coefficients make a load."""
    owners = [effect for effect in effects for _ in effect.terms]
    columns = [k for k, owner in enumerate(owners) if owner.info.carries_load]
    numbers = range(len(problem.runs)) if problem.own_columns(effects) else (0,)
    places = [problem.place(effects, number)[columns] for number in numbers]
    return np.asarray(np.unique(places), dtype=np.intp)


def _stands(load: Array, made: Array) -> bool:
    return bool(np.abs(made - load).max() <= STANDS * np.abs(made).max())


def _double_is_enough(
    problem: Problem,
    effects: Sequence[Effect],
    free: NDArray[np.intp],
    solution: Solution,
    prior_rows: Array,
    moving: bool,
) -> bool:
    """Whether plain sums will do: well conditioned, and what looks dependent is so to the bit."""
    if solution.condition > ENOUGH_CONDITION:
        return False
    if solution.rank == len(free):
        return solution.double_is_enough
    if moving:
        return False
    for combination in solution.null_space.T:
        full = np.zeros(problem.parameters(effects))
        full[free] = combination
        parts = (problem.combined(effects, full, k) for k in range(len(problem.runs)))
        rest = sum(float(part @ part) for part in parts)
        rest += float(np.sum((prior_rows @ combination) ** 2))
        if np.sqrt(rest) > DEPENDENT * np.max(np.abs(combination) * solution.lengths):
            return False
    return True


def _prior(
    constraints: Constraints, free: NDArray[np.intp], noise_variance: float
) -> tuple[Array, Array]:
    """Rows σ/s·e_j and targets σ/s·m_j of what is known of the free coefficients."""
    known = np.flatnonzero(np.isfinite(constraints.prior[free]))
    scale = np.sqrt(noise_variance) / constraints.prior_error[free][known]
    rows = np.zeros((len(known), len(free)))
    rows[np.arange(len(known)), known] = scale
    return rows, scale * constraints.prior[free][known]


def _prior_sums(rows: Array, target: Array, exact: bool) -> Sums:
    """What is known beforehand, as one more block of sums that belongs to no run."""
    blocks = [(0, len(rows))]
    high, low = _core.accumulate_rows(np.asfortranarray(rows), target, blocks, None, exact, 1)
    return Sums(high, low, np.zeros(1, dtype=np.int64), np.full(1, -1, dtype=np.int64))


def _within_bounds(
    solution: Solution, constraints: Constraints, free: NDArray[np.intp]
) -> tuple[Array, NDArray[np.int8]]:
    """Coefficients within their bounds, and at which bound each ended."""
    lower = np.where(np.isnan(constraints.lower), -np.inf, constraints.lower)[free]
    upper = np.where(np.isnan(constraints.upper), np.inf, constraints.upper)[free]
    best = solution.coefficients
    if ((lower < best) & (best < upper)).all():
        return best, np.zeros(len(free), dtype=np.int8)
    result = lsq_linear(
        solution.factor / solution.lengths,
        solution.rotated_target,
        (lower * solution.lengths, upper * solution.lengths),
        method="bvls",
        tol=1e-14,
        max_iter=BOUND_ROUNDS * len(free),
    )
    values = np.asarray(result.x / solution.lengths)
    bound = result.active_mask.astype(np.int8)
    return np.where(bound < 0, lower, np.where(bound > 0, upper, values)), bound


def _squares(solution: Solution, values: Array) -> float:
    missed = solution.factor @ values - solution.rotated_target
    return float(solution.residual_squares + missed @ missed)


class Settling:
    """The loads tried so far, (C,) each, and what each of them missed."""

    def __init__(self) -> None:
        self._loads: list[Array] = []
        self._misses: list[Array] = []

    def next(self, load: Array, made: Array) -> Array:
        """Return the load to try after one that led to another, (C,)."""
        self._loads.append(load)
        self._misses.append(made - load)
        if len(self._loads) <= PLAIN:
            return made
        last = slice(-len(load) - 1, None)
        moved, changed = (np.diff(rows[last], axis=0).T for rows in (self._loads, self._misses))
        weights = np.linalg.lstsq(changed, self._misses[-1], rcond=None)[0]
        return np.asarray(made - (moved + changed) @ weights)
