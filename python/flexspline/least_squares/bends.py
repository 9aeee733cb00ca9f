"""How a linear fit bends with its shapes: the step of Gauss and Newton, from sums alone.

Beside the columns X of a fit stands, for each shape s, what its prediction gains with ln s,

    B_s = Σ_k β_k ∂X_k / ∂(ln s)          (difference of rows with s to either side)

With Q the columns X made orthonormal and r the residual, the logarithms of the shapes go by

    (BᵀB − BᵀQ QᵀB)⁻¹ Bᵀr

and the coefficients follow ([Kaufman1975], a variable projection method for solving separable
nonlinear least squares problems). The load that a model makes by itself is held for the step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexspline.effects import Effect
from flexspline.least_squares.linear import LinearFit, load_of
from flexspline.least_squares.names import Constraints, ShapeParameter
from flexspline.least_squares.problem import Problem

__all__ = ["Bent", "bent"]

Array = NDArray[np.float64]

STEP = 1e-3  # of a shape's logarithm, to either side
UNSEEN = 1e-10  # of a bend's squares: what the columns leave of it, at which it is one of them


@dataclass(frozen=True)
class Bent:
    """Products of the bends, (S, S), what the columns leave of them, and Bᵀr, (S,)."""

    products: Array
    left: Array
    pull: Array

    def step(self, point: Array, limits: Array) -> Array:
        """Step of the logarithms (S,) at `point`, within `limits` (S, 2); 0 of one that is held."""
        below = (point <= limits[:, 0]) & (self.pull < 0.0)
        above = (point >= limits[:, 1]) & (self.pull > 0.0)
        seen = np.diag(self.left) > UNSEEN * np.diag(self.products)
        free = np.flatnonzero(seen & ~below & ~above)
        step = np.zeros(len(point))
        scale = np.sqrt(np.diag(self.left)[free])
        inside = self.left[np.ix_(free, free)] / np.outer(scale, scale)
        values, vectors = np.linalg.eigh(inside)
        values = np.maximum(values, UNSEEN)
        along = vectors.T @ (self.pull[free] / scale)
        step[free] = (vectors @ (along / values)) / scale
        return step


def bent(
    problem: Problem,
    found: LinearFit,
    constraints: Constraints,
    shapes: Sequence[ShapeParameter],
    weights: Sequence[Array] | None,
) -> Bent:
    """Return how a fit bends with shapes."""
    count, runs = problem.parameters(found.effects), _own_offsets(problem, found.effects)
    sides = [_sides(found, problem, shape) for shape in shapes]
    moved = [effect for side in sides for effect in side[0]]
    every = (*found.effects, *moved)
    width = problem.parameters(every)
    own = np.concatenate([np.arange(count - runs), np.arange(width - runs, width)])
    mixed = np.zeros((width + 1, len(shapes)))
    first = count - runs
    for number, (_, shares) in enumerate(sides):
        mixed[first : first + len(shares), number] = shares
        first += len(shares)
    held = np.nan_to_num(constraints.held)
    load = load_of(found.effects, found.coefficients)
    total, _ = problem.sums(
        every,
        _at(own, width, load) if load.size else load,
        held=_at(own, width, held),
        weights=weights,
    ).total()
    left = np.append(_at(own, width, held - found.coefficients), 1.0)  # residual = [X, y] @ left
    towards = found.solution.basis.T @ (total @ mixed)[own[found.fitted]]
    products = mixed.T @ total @ mixed
    return Bent(products, products - towards.T @ towards, mixed.T @ total @ left)


def _sides(found: LinearFit, problem: Problem, shape: ShapeParameter) -> tuple[list[Effect], Array]:
    """Effects with a shape to either side, and the weights of their columns in the bend."""
    place = problem.place(found.effects, 0)
    ends = np.cumsum([0, *(len(effect.terms) for effect in found.effects)])
    middle = shape.value(found.effects)
    both = np.clip(middle * np.exp([-STEP, STEP]), shape.info.lower, shape.info.upper)
    moved, shares = [], []
    for value, sign in zip(both, (-1.0, 1.0), strict=True):
        for at in shape.effects:
            moved.append(found.effects[at].with_shapes(**{shape.info.name: float(value)}))
            own = found.coefficients[place[ends[at] : ends[at + 1]]]
            shares.append(sign * own / np.log(both[1] / both[0]))
    return moved, np.concatenate(shares)


def _own_offsets(problem: Problem, effects: Sequence[Effect]) -> int:
    """How many offsets stand behind all other parameters, one for each run."""
    alone = problem.offset_per_run and any(effect.name == "offset" for effect in effects)
    return len(problem.runs) if alone else 0


def _at(places: NDArray[np.intp], width: int, values: Array) -> Array:
    out = np.zeros(width)
    out[places] = values
    return out
