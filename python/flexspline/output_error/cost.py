"""The distance between simulated and measured motion, and its minimisation from several starts.

Numbers are searched in coordinates of their own. What is above zero by its nature (an inertia, a
shape, a torque constant) is searched by its logarithm, θ = e^z. A friction level, which may be
none, and what may have either sign are searched in units of their scale, θ = s z, the level from
zero up.

Descents are least squares by trust regions [Branch1999]. A fold of the runs is held out in turn,
or of each run where there are few.

A servo reads its encoder in counts, so its simulated motion is a staircase over the numbers: a
thousandth of a coordinate moves the error of twelve measured runs by up to 0.05 %, at random, and a
difference over such a step has a slope of its own. Slopes are therefore those of the same loop with
an exact encoder, which is what the staircase follows; errors are those of the counts.

One start comes from multiple shooting [Bock1983], without the conditions that join the segments:
runs are cut into short segments, each started anew from the measured state. The effect of a wrong
parameter on a motion grows with time, and with it the number of local minima; over a segment the
error is nearly linear in the parameters. Where the error over segments is least is a better start
than the regression.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from flexspline.errors import InputError, listed
from flexspline.forward import DriveInputs
from flexspline.forward.servo import PositionServo
from flexspline.least_squares.options import Bounds, pair_of, resolve, shapes_of
from flexspline.least_squares.result import Parameter
from flexspline.part import Part

__all__ = [
    "UNSEEN",
    "Cost",
    "Descent",
    "Folds",
    "Searched",
    "Space",
    "best_of",
    "by_pieces",
    "descend",
    "drawn_starts",
    "folds_of",
    "refitted",
    "space_of",
]

Array = NDArray[np.float64]

STEP = 8e-3
"""Of a coordinate, for differences. Where a joint sticks one row longer, its motion jumps a little:
a step must be wide enough to see the slope behind such jumps."""
NO_COUNTS = {"encoder_step": 0.0}  # of a servo's law, for slopes
FAR = 10.0  # rad: what counts for a motion that runs away

WIDTH = 0.5  # standard deviation of the starts, in coordinates: a factor of 1.6 either way
DRAWS_A_START = 6
TOLERANCE = 1e-3
"""Relative, of cost and coordinates: an encoder's counts move the cost by as much."""
INSIDE = 1e-9  # a start on a bound is moved in by this share of its coordinate

Mask = NDArray[np.bool_]

SECONDS = 0.5

UNSEEN = "direction_width"  # the simulation sticks truly: a direction has no width
LOGARITHMIC = ("inertia.inertia",)
NATURAL = {
    "inertia.inertia": (0.0, np.inf),
    "coulomb_friction.level": (0.0, np.inf),
    "viscous_friction.viscosity": (0.0, np.inf),
    "load_dependent_friction.factor": (0.0, 0.99),
}
"""Below zero, each of these would give energy or be no mass; a load's friction that exceeds its
load locks the joint."""
FREE_OF_A_LAW = ("torque", "back_emf")
WIDEST = 1e3  # how far from its start a logarithm may take a number, as a factor
SMALL = 0.05  # of the error of a regression that went the wrong way: where a positive number starts
ERRORS_WIDE = 5.0  # scale of a number of either sign, in standard errors of the regression


@dataclass(frozen=True)
class Searched:
    """One number that is searched.

    `kind`: "coefficient", "shape" or "controller". `start`: where the regression left it, in
    `unit`. `logarithmic`: searched as z = log θ, else as z = θ / `scale`. `lower`, `upper`: of θ.
    """

    name: str
    kind: str
    unit: str
    start: float
    logarithmic: bool
    scale: float
    lower: float
    upper: float

    def coordinate(self, value: float) -> float:
        return float(np.log(value)) if self.logarithmic else value / self.scale

    def value(self, coordinate: float) -> float:
        raw = float(np.exp(coordinate)) if self.logarithmic else coordinate * self.scale
        return min(max(raw, self.lower), self.upper)

    def slope(self, coordinate: float) -> float:
        """dθ/dz, which carries an error from one to the other."""
        return self.value(coordinate) if self.logarithmic else self.scale


@dataclass(frozen=True)
class Space:
    """The search of a drive's numbers and of its servo's.

    `part`: with everything that is not searched. `names`: of its coefficients.
    """

    part: Part
    names: tuple[str, ...]
    searched: tuple[Searched, ...]

    @property
    def start(self) -> Array:
        return np.array([one.coordinate(one.start) for one in self.searched])

    @property
    def bounds(self) -> tuple[Array, Array]:
        """(low, high) of the coordinates."""
        ends = np.array([self._ends(one) for one in self.searched]).reshape(-1, 2)
        return ends[:, 0], ends[:, 1]

    def values(self, point: Array) -> Array:
        return np.array([s.value(z) for s, z in zip(self.searched, point, strict=True)])

    def slopes(self, point: Array) -> Array:
        return np.array([s.slope(z) for s, z in zip(self.searched, point, strict=True)])

    def at(self, point: Array) -> tuple[Part, dict[str, float]]:
        """Return the drive at a point of the search, and what of the law's fields is searched."""
        values = self.values(point)
        coefficients = self.part.coefficients.copy()
        effects, law = self.part.effects, {}
        shapes = {shape.name: shape for shape in shapes_of(effects)}
        for one, value in zip(self.searched, values.tolist(), strict=True):
            if one.kind == "coefficient":
                coefficients[self.names.index(one.name)] = value
            elif one.kind == "shape":
                effects = shapes[one.name].set(effects, value)
            else:
                law[one.name.removeprefix("controller.")] = value
        return replace(self.part, effects=effects, coefficients=coefficients), law

    @staticmethod
    def _ends(one: Searched) -> tuple[float, float]:
        with np.errstate(divide="ignore"):
            if one.logarithmic:
                return float(np.log(one.lower)), float(np.log(one.upper))
        return one.lower / one.scale, one.upper / one.scale


def space_of(
    part: Part,
    law: PositionServo | None,
    regressed: Sequence[Parameter],
    bounds: Mapping[str, Bounds],
    free: Sequence[str],
) -> Space:
    """Return the search that starts from a regression.

    Parameters
    ----------
    part : as the regression left it.
    law : the servo's, or None.
    regressed : its parameters; what is fixed there stays.
    bounds : by name of a parameter.
    free : fields of the law to search, of `FREE_OF_A_LAW`.

    Raises
    ------
    InputError
        For a bound of an unknown parameter, and where nothing is left to search.
    """
    names = [p.name for p in regressed if p.kind == "coefficient"]
    shapes = {shape.name: shape.info for shape in shapes_of(part.effects)}
    found = []
    limits = _limits([p.name for p in regressed], bounds)
    for p in regressed:
        if p.state == "fixed" or p.name == UNSEEN:
            continue
        low, high = limits.get(p.name, (None, None))
        if p.kind == "shape":
            info = shapes[p.name]
            found.append(_positive(p.name, "shape", p.unit, p.value, low or info.lower,
                                   high or info.upper))  # fmt: skip
            continue
        ends = NATURAL.get(p.name, (-np.inf, np.inf))
        low, high = ends[0] if low is None else low, ends[1] if high is None else high
        if p.name in LOGARITHMIC:
            start = p.value if p.value > 0.0 else SMALL * _error(p)
            found.append(_positive(p.name, "coefficient", p.unit, start, max(low, 0.0), high))
        else:
            found.append(_signed(p, low, high))
    found += [_of_law(law, name, part.unit) for name in free if law is not None]
    if not found:
        raise InputError("every parameter is fixed; leave one at least to be fitted")
    return Space(part, tuple(names), tuple(found))


def _limits(names: Sequence[str], bounds: Mapping[str, Bounds]) -> dict[str, Bounds]:
    return {
        names[resolve(name, names, "bounds")]: pair_of(ends, f"bounds: {name}", "(low, high)")
        for name, ends in bounds.items()
    }


def _error(p: Parameter) -> float:
    return p.standard_error if np.isfinite(p.standard_error) else max(abs(p.value), 1.0)


def _positive(name: str, kind: str, unit: str, start: float, low: float, high: float) -> Searched:
    low, high = max(low, start / WIDEST), min(high, start * WIDEST)
    return Searched(name, kind, unit, float(np.clip(start, low, high)), True, 1.0, low, high)


def _signed(p: Parameter, low: float, high: float) -> Searched:
    scale = max(abs(p.value), ERRORS_WIDE * _error(p))
    start = float(np.clip(p.value, low, high))
    return Searched(p.name, "coefficient", p.unit, start, False, scale, low, high)


def _of_law(law: PositionServo, name: str, unit: str) -> Searched:
    if name not in FREE_OF_A_LAW:
        raise InputError(
            f"free_controller: '{name}' cannot be fitted; give of {listed(FREE_OF_A_LAW)}"
        )
    value = float(getattr(law, name))
    if not value > 0.0:
        raise InputError(
            f"the controller's {name} is to be fitted but starts at {value:g}; "
            "give a guess above zero"
        )
    per = f"{unit}·s/rad" if name == "back_emf" else f"{unit}/V" if law.supply else unit
    return _positive(f"controller.{name}", "controller", per, value, 0.0, np.inf)


@dataclass(eq=False)
class Cost:
    """Residuals of all runs, simulated − measured [rad], on the rows that count.

    Parameters
    ----------
    space : what is searched.
    runs : inputs and measured motion.
    counts : (N,) for each run: rows that count. What is driven through is always the whole run.
    steps : from row to row.
    threads : that runs are shared among.
    """

    space: Space
    runs: Sequence[DriveInputs]
    counts: Sequence[NDArray[np.bool_]]
    steps: int
    threads: int
    tick: Callable[[], object] = lambda: None

    def residuals(self, point: Array) -> Array:
        """(N,) over the rows that count of all runs; far off at a point that is no number."""
        if not np.isfinite(point).all():
            return np.full(sum(int(count.sum()) for count in self.counts), FAR)
        return self._together([point])[0]

    def rmse(self, point: Array) -> float:
        """rad"""
        return float(np.sqrt(np.mean(self.residuals(point) ** 2)))

    def rmses(self, points: Sequence[Array]) -> list[float]:
        """The same for several points."""
        return [float(np.sqrt(np.mean(rest**2))) for rest in self._together(points)]

    def jacobian(self, point: Array, *, central: bool = False) -> Array:
        """(N, P), by differences to one side, or to both (twice the cost, and more exact).

        Of a servo whose encoder is exact.
        """
        low, high = self.space.bounds
        pairs = []
        for k in range(len(point)):
            side = STEP if point[k] + STEP <= high[k] else -STEP
            first, last = point.copy(), point.copy()
            first[k] = np.clip(point[k] - side, low[k], high[k]) if central else point[k]
            last[k] = np.clip(point[k] + side, low[k], high[k])
            pairs.append((first, last))
        ends = [end for pair in pairs for end in pair] if central else [p[1] for p in pairs]
        made = self._together(ends if central else [point, *ends], NO_COUNTS)
        columns = []
        for k, (first, last) in enumerate(pairs):
            before, after = (made[2 * k], made[2 * k + 1]) if central else (made[0], made[k + 1])
            width = last[k] - first[k]
            columns.append((after - before) / width if width else np.zeros(len(before)))
        return np.stack(columns, axis=1)

    def by_run(self, point: Array) -> list[Array]:
        """Simulated − measured of every row, (N,) for each run."""
        return self._pool([point], {})

    def only(self, counts: Sequence[NDArray[np.bool_]]) -> Cost:
        """Return the cost of other rows; a run of which none counts is not driven."""
        kept = [(run, count) for run, count in zip(self.runs, counts, strict=True) if count.any()]
        return replace(self, runs=[run for run, _ in kept], counts=[count for _, count in kept])

    def _together(
        self, points: Sequence[Array], law: Mapping[str, float] | None = None
    ) -> list[Array]:
        made = self._pool(points, law or {})
        size = len(self.runs)
        found = []
        for k in range(len(points)):
            pieces = zip(made[k * size : (k + 1) * size], self.counts, strict=True)
            found.append(np.concatenate([piece[count] for piece, count in pieces]))
        return found

    def _pool(self, points: Sequence[Array], law: Mapping[str, float]) -> list[Array]:
        tasks = [
            (part, {**searched, **law}, number)
            for part, searched in map(self.space.at, points)
            for number in range(len(self.runs))
        ]
        self.tick()
        if self.threads == 1:
            return [self._missed(*task) for task in tasks]
        with ThreadPoolExecutor(self.threads) as pool:
            return list(pool.map(lambda task: self._missed(*task), tasks))

    def _missed(self, part: Part, law: Mapping[str, float], number: int) -> Array:
        run = self.runs[number]
        rest = run.run(part, self.steps, law=law)["position"] - run.measured
        far = ~np.isfinite(rest) & np.isfinite(run.measured)
        return np.where(far, FAR, np.clip(rest, -FAR, FAR))


@dataclass(frozen=True, eq=False)
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


@dataclass(frozen=True, eq=False)
class Folds:
    """`left_out`: rows of each fold, a mask for each run. `by`: "folds of runs" or "blocks"."""

    left_out: tuple[tuple[Mask, ...], ...]
    by: str

    def __len__(self) -> int:
        return len(self.left_out)

    def kept(self, counts: Sequence[Mask], number: int) -> list[Mask]:
        """Rows that count without this fold."""
        return [c & ~out for c, out in zip(counts, self.left_out[number], strict=True)]


def folds_of(counts: Sequence[Mask], folds: int) -> Folds:
    """Return every `folds`-th run as one fold; of fewer runs, as many blocks of each run.

    A run's rows are driven through also where they do not count, so a block has its past.
    """
    if len(counts) >= folds:
        made = [
            tuple(np.full(len(c), k % folds == fold) for k, c in enumerate(counts))
            for fold in range(folds)
        ]
        return Folds(tuple(made), "folds of runs")
    blocks = [np.arange(len(c)) * folds // len(c) for c in counts]
    return Folds(tuple(tuple(b == fold for b in blocks) for fold in range(folds)), "blocks")


def refitted(cost: Cost, best: Descent, folds: Folds, most: int) -> list[Descent]:
    """Descend without each fold, from the best point of all and from the regression."""
    found = []
    for number in range(len(folds)):
        without = cost.only(folds.kept(cost.counts, number))
        starts = (best.point, cost.space.start)
        found.append(best_of([descend(without, start, most) for start in starts]))
    return found


def by_pieces(cost: Cost, velocities: Sequence[Array]) -> Cost:
    """Return the cost of runs that begin anew every `SECONDS`.

    Parameters
    ----------
    velocities : measured, rad/s, (N,) for each run.
    """
    runs = [_cut(run, v) for run, v in zip(cost.runs, velocities, strict=True)]
    return replace(cost, runs=runs)


def _cut(run: DriveInputs, velocity: Array) -> DriveInputs:
    pieces = []
    for first, last in run.stretches.tolist():
        count = max(1, round((run.time[last - 1] - run.time[first]) / SECONDS))
        edges = np.linspace(first, last, count + 1).astype(int).tolist()
        pieces += [pair for pair in pairwise(edges) if pair[1] - pair[0] >= 2]
    begin = np.array([first for first, _ in pieces])
    start = np.stack((run.measured[begin], velocity[begin]), axis=1)
    if not np.isfinite(start).all():
        return run
    return replace(run, stretches=np.array(pieces), start=start)
