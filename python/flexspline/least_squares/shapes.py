"""The search for shapes around the linear solve (variable projection).

    min over shapes of  min over b of  Σ (y − X(shapes) b)²

The outer function is smooth in the logarithms of the shapes but may have several valleys: a grid
first, one shape after the other, then Gauss and Newton's steps (`bends.py`) from the best point and
from the bottoms of other valleys that the grid has seen: a Stribeck speed of 0.14 rad/s and a
viscous line that bends at 0.9 rad/s can look alike on a coarse grid. The width of a loop leaves
kinks in the squares, at which steps get stuck: there a bounded simplex search goes on. Who comes
from a search has the valley already and only descends.
Sources: [GolubPereyra1973], variable projection; [Kaufman1975], its Gauss–Newton step.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from flexspline.effects import Effect
from flexspline.least_squares.bends import Bent
from flexspline.least_squares.linear import LinearFit, UnsettledError
from flexspline.least_squares.names import ShapeParameter

__all__ = ["ShapeFit", "fit_shapes"]

Array = NDArray[np.float64]

GRID = 9
TOLERANCE = 1e-5
FLAT = 1e-7
VALLEYS = 3
FAR, NEAR = (0.5 / (GRID - 1), TOLERANCE), (0.03, 1e-3)
NEAR_BOUND = 1e-3
STEPS = 40
FARTHEST = 0.7  # of a logarithm in one step
SHORTER = (1.0, 0.4, 0.16, 0.06, 0.02)  # of a step, until it lowers the squares
STANDS = 1e-11  # of the squares, that a step lowers them at least to be worth another

Solve = Callable[[tuple[Effect, ...], Array | None], LinearFit]
Bend = Callable[[LinearFit, Sequence[ShapeParameter]], Bent]


@dataclass(frozen=True)
class ShapeFit:
    """The best linear fit, and for each shape searched where it ended.

    `at_bound`: −1, 0 or 1 by name. `flat`: names of shapes that the runs say nothing about;
    they keep the value that they came with. `evaluations`: linear solves made.
    """

    linear: LinearFit
    at_bound: Mapping[str, int]
    flat: tuple[str, ...]
    evaluations: int


@dataclass
class _Search:
    """The outer function; the coefficients of the best solve so far are the next one's start.

    Shapes at which the model's load does not settle are no minimum.
    """

    shapes: Sequence[ShapeParameter]
    effects: tuple[Effect, ...]
    solve: Solve
    tick: Callable[[], object]
    best: LinearFit | None = None
    evaluations: int = 0
    seen: dict[tuple[float, ...], LinearFit | None] = field(default_factory=dict)

    def __call__(self, logarithms: Array) -> float:
        found = self._found(logarithms)
        return np.inf if found is None else found.squares

    def at(self, logarithms: Array) -> LinearFit:
        """Return the fit with these shapes.

        Raises
        ------
        UnsettledError
            Where the load does not settle.
        """
        return self._found(logarithms) or self._solved(logarithms)

    def _found(self, logarithms: Array) -> LinearFit | None:
        key = tuple(np.round(logarithms, 12).tolist())
        if key not in self.seen:
            try:
                made = self.seen[key] = self._solved(logarithms)
            except UnsettledError:
                self.seen[key] = None
                return None
            if self.best is None or made.squares < self.best.squares:
                self.best = made
        return self.seen[key]

    def _solved(self, logarithms: Array) -> LinearFit:
        effects = self.effects
        for shape, logarithm in zip(self.shapes, logarithms, strict=True):
            value = float(np.clip(np.exp(logarithm), shape.info.lower, shape.info.upper))
            effects = shape.set(effects, value)
        self.evaluations += 1
        self.tick()
        return self.solve(effects, None if self.best is None else self.best.coefficients)


def fit_shapes(
    effects: Sequence[Effect],
    shapes: Sequence[ShapeParameter],
    solve: Solve,
    bounds: Mapping[str, tuple[float, float]],
    bend: Bend,
    tick: Callable[[], object] = lambda: None,
    *,
    near: bool = False,
) -> ShapeFit:
    """Find the shapes of least squares within their bounds.

    Parameters
    ----------
    effects : with the shapes to start from.
    shapes : those to search; none gives the plain linear fit.
    solve : the linear fit of effects, started from coefficients.
    bounds : by name, narrower than the catalogue's, in the shape's unit.
    bend : how a fit bends with shapes.
    tick : called after each linear fit, for progress.
    near : whether the shapes that `effects` have lie in the right valley: no grid is scanned.
    """
    search = _Search(list(shapes), tuple(effects), solve, tick)
    point = np.log([shape.value(effects) for shape in shapes])
    if not len(shapes):
        return ShapeFit(search.at(point), {}, (), 1)
    limits = np.log([bounds.get(s.name, (s.info.lower, s.info.upper)) for s in shapes])
    point = np.clip(point, limits[:, 0], limits[:, 1])
    starts, flat = _here(search, point, bend) if near else _grid(search, point, limits)
    active = [i for i in range(len(shapes)) if i not in flat]
    kinked = [i for i in active if _kinked(shapes[i], effects)]
    if near or not kinked:
        starts = [_descent(search, start, limits, active, bend) for start in starts]
    if kinked and near:
        starts = [_simplex(search, start, limits, kinked, NEAR) for start in starts]
        starts = [_descent(search, start, limits, active, bend) for start in starts]
    elif kinked:
        starts = [_simplex(search, start, limits, active, FAR) for start in starts]
    point = min(starts, key=search)
    return ShapeFit(
        search.at(point),
        {shapes[i].name: _bound(point[i], limits[i]) for i in active},
        tuple(shapes[i].name for i in flat),
        search.evaluations,
    )


def _kinked(shape: ShapeParameter, effects: Sequence[Effect]) -> bool:
    """Whether a shape is that of a loop; what a lag makes is smooth."""
    return shape.info.unit != "s" and any(effects[k].info.remembers for k in shape.effects)


def _here(search: _Search, point: Array, bend: Bend) -> tuple[list[Array], list[int]]:
    """The point alone, and the shapes without an effect there."""
    squares, found = search(point), search.at(point)
    bent = bend(found, search.shapes)
    return [point], np.flatnonzero(np.diag(bent.products) <= FLAT * squares).tolist()


def _grid(search: _Search, point: Array, limits: Array) -> tuple[list[Array], list[int]]:
    """Best points of a scan along each shape in turn, twice, and the shapes without an effect."""
    flat: list[int] = []
    bottoms: list[Array] = []
    for turn in range(2 if len(point) > 1 else 1):
        bottoms = []
        for axis in range(len(point)):
            scan = np.sort([*np.linspace(limits[axis, 0], limits[axis, 1], GRID), point[axis]])
            trials = [np.where(np.arange(len(point)) == axis, value, point) for value in scan]
            squares = np.array([search(trial) for trial in trials])
            here = search(point)
            bottoms += [trials[i] for i in _minima(squares)]
            if here <= squares.min() * (1.0 + FLAT):
                if turn == 0 and squares.max() <= squares.min() * (1.0 + FLAT):
                    flat.append(axis)
                continue
            point = trials[int(np.argmin(squares))]
    others = [trial for trial in sorted(bottoms, key=search) if not np.array_equal(trial, point)]
    return [point, *others[: VALLEYS - 1]], flat


def _minima(squares: Array) -> list[int]:
    """Where a scan is lower than on both sides."""
    walled = np.concatenate([[np.inf], squares, [np.inf]])
    return np.flatnonzero((squares < walled[:-2]) & (squares <= walled[2:])).tolist()


def _simplex(
    search: _Search, point: Array, limits: Array, active: list[int], how: tuple[float, float]
) -> Array:
    """The lowest point around; `how`: first steps as shares of the limits, and how exact."""
    share, tolerance = how

    def along(values: Array) -> float:
        trial = point.copy()
        trial[active] = values
        return search(trial)

    width = share * (limits[active, 1] - limits[active, 0])
    start = point[active]
    steps = np.where(start + width <= limits[active, 1], width, -width)
    simplex = np.vstack([start, *(start + steps * row for row in np.eye(len(active)))])
    found = minimize(
        along,
        start,
        method="Nelder-Mead",
        bounds=limits[active],
        options={"initial_simplex": simplex, "xatol": tolerance, "fatol": np.inf, "maxfev": 400},
    )
    best = point.copy()
    best[active] = found.x
    return best


def _descent(
    search: _Search, point: Array, limits: Array, active: Sequence[int], bend: Bend
) -> Array:
    """The bottom of the valley that a point lies in; shapes that are not active stay."""
    here, those = search(point), list(active)
    for _ in range(STEPS if those else 0):
        bent = bend(search.at(point), [search.shapes[i] for i in those])
        step = np.zeros(len(point))
        step[those] = np.clip(bent.step(point[those], limits[those]), -FARTHEST, FARTHEST)
        if np.abs(step).max() < TOLERANCE:
            break
        trials = (np.clip(point + share * step, *limits.T) for share in SHORTER)
        lower = next((trial for trial in trials if search(trial) < here), None)
        if lower is None:
            break
        before, here, point = here, search(lower), lower
        if before - here <= STANDS * here:
            break
    return point


def _bound(value: float, limits: Array) -> int:
    if value - limits[0] < NEAR_BOUND:
        return -1
    return 1 if limits[1] - value < NEAR_BOUND else 0
