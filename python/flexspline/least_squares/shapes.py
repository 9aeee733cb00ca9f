"""The search for shapes around the linear solve (variable projection).

    min over shapes of  min over b of  Σ (y − X(shapes) b)²

The outer function is smooth in the logarithms of the shapes but may have several local minima: a
grid first, one shape after the other, then Gauss–Newton steps (below) from the best point and from
the bottoms of other minima that the grid has seen: a Stribeck speed of 0.14 rad/s and a viscous
line that bends at 0.9 rad/s can look alike on a coarse grid. The width of a loop leaves kinks in
the squares, at which steps get stuck: there a bounded simplex search goes on. A fit that starts
from the result of a search only descends.
Sources: [GolubPereyra1973], variable projection; [Kaufman1975], its Gauss–Newton step.

The step needs sums alone. Beside the columns X of a fit stands, for each shape s, the derivative of
its prediction by ln s,

    B_s = Σ_k β_k ∂X_k / ∂(ln s)          (difference of rows with s to either side)

With Q the columns X made orthonormal and r the residual, the logarithms of the shapes go by

    (BᵀB − BᵀQ QᵀB)⁻¹ Bᵀr

and the coefficients follow ([Kaufman1975], a variable projection method for solving separable
nonlinear least squares problems). The load that a model makes by itself is held for the step.

Near its optimum a fit with shapes is linear, with one more column ∂(prediction)/∂shape for each.
Errors, cross-validation and robust weights use these tangent rows, a segment of a log at a time;
they may be filtered by A, so that noise e = A⁻¹ w is white in them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby, islice
from operator import itemgetter

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.signal import lfilter

from flexspline.effects import Effect
from flexspline.least_squares.linear import LinearFit, UnsettledError, load_of
from flexspline.least_squares.noise_model import Chunk, Chunks
from flexspline.least_squares.options import Constraints, ShapeParameter
from flexspline.least_squares.problem import Problem
from flexspline.parallel import in_order

__all__ = [
    "Bent",
    "ShapeFit",
    "Tangent",
    "bent",
    "filtered",
    "filtered_pieces",
    "fit_shapes",
]

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

CURVATURE_STEP = 1e-3  # of a shape's logarithm, to either side
UNSEEN = 1e-10  # of a bend's squares: what the columns leave of it, at which it is one of them

DIFFERENCE_STEP = 1e-4  # of a shape, relative: the central difference is good to 1e-8


@dataclass(frozen=True, eq=False)
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
    rows: float = np.inf,
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
    rows : that count. A shape at whose every value the squares are within their mean of a row is
        not determined, for all of its range is within one standard error of white noise.
    """
    level = max(FLAT, 1.0 / rows)
    search = _Search(list(shapes), tuple(effects), solve, tick)
    point = np.log([shape.value(effects) for shape in shapes])
    if not len(shapes):
        return ShapeFit(search.at(point), {}, (), 1)
    limits = np.log([bounds.get(s.name, (s.info.lower, s.info.upper)) for s in shapes])
    point = np.clip(point, limits[:, 0], limits[:, 1])
    starts, flat = _here(search, point, bend) if near else _grid(search, point, limits, level)
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


def _grid(
    search: _Search, point: Array, limits: Array, level: float
) -> tuple[list[Array], list[int]]:
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
            if squares.max() <= squares.min() * (1.0 + level) and (turn == 0 or axis in flat):
                flat = [*flat, axis] if turn == 0 else flat
                continue
            flat = [other for other in flat if other != axis]  # beside others that have moved
            bottoms += [trials[i] for i in _minima(squares)]
            if here <= squares.min() * (1.0 + FLAT):
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


def bent(
    problem: Problem,
    found: LinearFit,
    constraints: Constraints,
    shapes: Sequence[ShapeParameter],
    weights: Sequence[Array] | None,
) -> Bent:
    """Return how a fit bends with shapes."""
    count, runs = problem.parameters(found.effects), _own_count(problem, found.effects)
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
    near = middle * np.exp([-CURVATURE_STEP, CURVATURE_STEP])
    both = np.clip(near, shape.info.lower, shape.info.upper)
    moved, shares = [], []
    for value, sign in zip(both, (-1.0, 1.0), strict=True):
        for at in shape.effects:
            moved.append(found.effects[at].with_shapes(**{shape.info.name: float(value)}))
            own = found.coefficients[place[ends[at] : ends[at + 1]]]
            shares.append(sign * own / np.log(both[1] / both[0]))
    return moved, np.concatenate(shares)


def _own_count(problem: Problem, effects: Sequence[Effect]) -> int:
    """How many parameters of single runs stand behind all others."""
    return len(problem.own_columns(effects)) * len(problem.runs)


def _at(places: NDArray[np.intp], width: int, values: Array) -> Array:
    out = np.zeros(width)
    out[places] = values
    return out


@dataclass(frozen=True, eq=False)
class Tangent:
    """Rows of a fit at its solution.

    `free`: numbers of the fitted coefficients; their columns come first, then one for each of
    `shapes`. `weights`: an array (N,) for each run, or None.
    """

    problem: Problem
    effects: tuple[Effect, ...]
    coefficients: Array
    free: NDArray[np.intp]
    shapes: tuple[ShapeParameter, ...]
    weights: Sequence[Array] | None

    def __call__(self) -> Iterator[Chunk]:
        """Give the rows piece by piece, as the noise model reads them."""
        for _, _, chunk in self.pieces():
            yield chunk

    def some(self, every: int) -> Chunks:
        """Return what gives one chunk of `every` to a noise model, each a stretch of its own."""
        return lambda: (chunk for _, _, chunk in self.pieces(every))

    def pieces(self, every: int = 1) -> Iterator[tuple[int, slice, Chunk]]:
        """Run number, rows and chunk of each piece, in order; or of one of `every`."""
        ranges = islice(self.problem.pieces(), 0, None, every)
        if self._whole_runs:
            made = self._cut(ranges)
        else:
            made = in_order(self.problem.threads, lambda piece: self._rows(*piece), ranges)
        for (number, first, last), rows in zip(
            islice(self.problem.pieces(), 0, None, every), made, strict=True
        ):
            run = self.problem.runs[number]
            residual = run.target[first:last] - rows[:, -1]
            starts = np.zeros(last - first, dtype=bool)
            starts[0] = every > 1 or any(first == begin for begin, _ in run.stretches)
            weights = None if self.weights is None else self.weights[number][first:last]
            yield number, slice(first, last), Chunk(rows[:, :-1], residual, starts, weights)

    def _cut(self, ranges: Iterable[tuple[int, int, int]]) -> Iterator[Array]:
        """Rows of pieces, cut from those of whole runs."""
        for number, those in groupby(ranges, key=itemgetter(0)):
            whole = self._whole_run(number)
            for _, first, last in those:
                yield whole[first:last]

    def _rows(self, number: int, first: int, last: int) -> Array:
        """Columns of the free coefficients, of the shapes, and the prediction: (n, F + S + 1)."""
        run = self.problem.runs[number]
        place = self.problem.place(self.effects, number)
        coefficients = self.coefficients[place]
        channels = {name: data[first:last] for name, data in run.channels.items()}
        size = last - first
        design = self.problem.design(self.effects)
        core = np.asarray(design.rows(channels, size, coefficients))
        count = self.problem.parameters(self.effects)
        rows = np.zeros((size, count))
        rows[:, place] = core
        bends = [self._bend(shape, channels, size, coefficients) for shape in self.shapes]
        return np.column_stack([rows[:, self.free], *bends, core @ coefficients])

    def _bend(
        self, shape: ShapeParameter, channels: dict[str, Array], size: int, coefficients: Array
    ) -> Array:
        value = shape.value(self.effects)
        low = max(value * (1.0 - DIFFERENCE_STEP), shape.info.lower)
        high = min(value * (1.0 + DIFFERENCE_STEP), shape.info.upper)
        ends = [
            self.problem.design(shape.set(self.effects, at)).predict(channels, size, coefficients)
            for at in (low, high)
        ]
        return np.asarray((ends[1] - ends[0]) / (high - low))

    @property
    def _whole_runs(self) -> bool:
        """Whether rows need all rows before them: filters and memory do."""
        remembers = any(effect.info.remembers for effect in self.effects)
        return remembers or self.problem.lowpass is not None or self.problem.takes_out

    def whole(self, number: int) -> Array:
        """Columns of `_rows` of a whole run, low-passed as the target is."""
        run = self.problem.runs[number]
        return self.problem.smooth(run, self._rows(number, 0, len(run)))

    def _whole_run(self, number: int) -> Array:
        rows = self.whole(number)
        if not self.problem.takes_out:
            return rows
        rows = self.problem.apart(number, rows)
        rows[:, -1] += self.problem.taken_out(number)
        return rows


def filtered(tangent: Tangent, denominator: Array) -> Chunks:
    """Return what gives the rows and residuals of a fit filtered by A, stretch by stretch."""
    return lambda: (chunk for _, _, chunk in filtered_pieces(tangent, denominator))


def filtered_pieces(tangent: Tangent, denominator: Array) -> Iterator[tuple[int, slice, Chunk]]:
    """Give run number, rows and filtered chunk of each piece, without what starts the filter."""
    order, tail, begins = len(denominator) - 1, np.empty((0, 0)), True
    for number, rows, chunk in tangent.pieces():
        both = np.column_stack([chunk.rows, chunk.residual])
        begins = begins or bool(chunk.starts[0])
        both = both if chunk.starts[0] or not tail.size else np.concatenate([tail, both])
        made = lfilter(denominator, [1.0], both, axis=0)[order:]
        tail = both[max(0, len(both) - order) :]
        if len(made):
            starts = np.zeros(len(made), dtype=bool)
            starts[0], begins = begins, False
            counted = slice(rows.stop - len(made), rows.stop)
            yield number, counted, Chunk(made[:, :-1], made[:, -1], starts, None)
