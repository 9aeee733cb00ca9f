"""A candidate model: effects, their shapes and coefficients, its fit and its score.

Near the solution a shape s is one more column,

    ∂(prediction) / ∂(ln s),

so a candidate beside a model is judged after the model's columns *and* shapes are projected out,
without a search for each.

The fit is by least squares (Gauss–Newton) on filtered rows. Its score is held out: each fold is
predicted by the fit to all others. Folds are whole runs, or blocks where there are fewer than four.

Both are measured by a noise that is found in two steps. A hidden effect that is slow looks like
slow noise to a model of the base's residual, and would be filtered away with it. So the first noise
is that of a residual from which everything known was taken out, and too white; the second is the
restricted likelihood's (`least_squares/noise_model.py`) beside whatever a first look with the first
has found.

Many recorders smooth what they record. Little is left of it at high frequencies, and noise without
a floor would weigh that little above all else: a form that is off by a thousandth there would count
for more than half of the friction at a reversal. So some of what is left is white in any case.

And what lasts about as long as a run is no noise but a cause: beside offsets and drifts the
restricted likelihood of so slow a noise hardly falls, whatever its size, and it may claim more than
the target holds. Then the residual itself tells what is noise.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise, product

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz

from flexspline.effects import Effect, ShapeInfo
from flexspline.least_squares.noise_model import Chunk, noise_model
from flexspline.least_squares.options import (
    SHARED,
    ShapeParameter,
    coefficient_names,
    resolve,
    shapes_of,
)
from flexspline.least_squares.problem import Problem, Run
from flexspline.regression.gram import (
    SINGULAR,
    TINY,
    ColumnAssembly,
    Given,
    Shares,
    Table,
    Whitening,
    edges_of,
    gain_of,
    solved,
    tabulated,
)

__all__ = [
    "CandidateModel",
    "Fold",
    "HeldOut",
    "candidate_model_of",
    "fall_of",
    "first_whitening",
    "held_out",
    "mixed",
    "plain_rows",
    "refitted",
    "restricted_whitening",
    "rmse_error",
    "rmse_of",
    "shaped",
    "solved_at",
    "started",
]

Array = NDArray[np.float64]

STEP = 1e-3  # of a shape's logarithm, for the central difference

LOAD_ROUNDS = 3  # solves at most until the load that inertia and gravity make stands
LOAD_STANDS = 1e-6  # of it, by which a further solve would change it
FARTHEST = float(np.log(2.0))  # of a shape's logarithm in one step
SCANNED = 6  # values of each shape, before the first step
STEPS, HALVINGS = 20, 4  # at most
ENOUGH = 0.01  # χ²: what a further step gains at least
TOLD = 3.0  # χ² for the first step: shapes that the rows do not tell stay where they are
ROUNDING = SINGULAR * np.sqrt(SINGULAR)  # of squares: a difference's own

LAGS = 16  # of a noise with memory, at most
WHITE = 0.01  # of what is left, that is white: no form is exact to less
READ = 1_000_000  # rows, about, that the likelihood reads of longer logs


@dataclass(frozen=True, eq=False)
class CandidateModel:
    """Effects with their shapes, and the coefficients of the last solve.

    `coefficients`: (P,). `held`: (P,) coefficients that are not fitted. `searched`: shapes that
    are. `base`: how many of the effects were there at the start; the others were named. `fixed`:
    values by name that the user holds.
    """

    effects: tuple[Effect, ...]
    coefficients: Array
    held: NDArray[np.bool_]
    searched: tuple[ShapeParameter, ...]
    base: int
    fixed: Mapping[str, float]

    @property
    def free(self) -> NDArray[np.intp]:
        """Numbers of the coefficients that are fitted."""
        return np.flatnonzero(~self.held)

    @property
    def named(self) -> tuple[Effect, ...]:
        """What was added to the base, in the order of discovery."""
        return self.effects[self.base :]

    @property
    def logarithms(self) -> Array:
        """Of the searched shapes, (S,)."""
        return np.log([shape.value(self.effects) for shape in self.searched])

    @property
    def bound(self) -> list[int]:
        """Numbers of the searched shapes that stand at one of their bounds."""
        values = [shape.value(self.effects) for shape in self.searched]
        return [
            number
            for number, (shape, value) in enumerate(zip(self.searched, values, strict=True))
            if np.isclose(value, (shape.info.lower, shape.info.upper), rtol=SINGULAR).any()
        ]

    @property
    def effect_of(self) -> NDArray[np.str_]:
        """Name of the effect behind each coefficient, (P,)."""
        return np.array([e.name for e in self.effects for _ in e.terms], dtype=str)

    def values(self, name: str) -> Array:
        """Return the coefficients of one of the effects, (K,); none where it is not there."""
        return np.asarray(self.coefficients[self.effect_of == name])

    def owners(self) -> list[str]:
        """Effect behind each free coefficient, then behind each searched shape."""
        shapes = [self.effects[s.effects[0]].name for s in self.searched]
        return [*self.effect_of[self.free].tolist(), *shapes]

    def at(self, logarithms: Array) -> CandidateModel:
        """Return the model with other shapes, within their bounds."""
        effects = self.effects
        for shape, value in zip(self.searched, np.exp(logarithms), strict=True):
            limited = float(np.clip(value, shape.info.lower, shape.info.upper))
            effects = shape.set(effects, limited)
        return replace(self, effects=effects)

    def having(self, effects: Sequence[Effect]) -> CandidateModel:
        """Return a model of other effects that keeps the coefficients of those in both."""
        old = dict(zip(coefficient_names(self.effects), self.coefficients, strict=True))
        lost = {e.name for e in self.effects} - {e.name for e in effects}
        gone = {*old} - {*coefficient_names(effects)}
        fixed = {
            n: v for n, v in self.fixed.items() if n.split(".")[0] not in lost and n not in gone
        }
        made = candidate_model_of(effects, self.base, fixed)
        values = [old.get(n, v) for n, v in zip(_names(effects), made.coefficients, strict=True)]
        kept = np.where(made.held, made.coefficients, values)
        return replace(made, coefficients=kept)

    def without(self, *names: str) -> CandidateModel:
        """Return the model without some of its effects."""
        base = sum(effect.name not in names for effect in self.effects[: self.base])
        return replace(self, base=base).having([e for e in self.effects if e.name not in names])

    def with_effects(self, *effects: Effect) -> CandidateModel:
        """Return the model with more effects behind its own."""
        return self.having([*self.effects, *effects])

    def holding(self, name: str, value: float) -> CandidateModel:
        """Return the model with one coefficient more that is not fitted."""
        return replace(self, fixed={**self.fixed, name: value}).having(self.effects)

    def assembly(
        self,
        *,
        bends: bool = True,
        beside: Sequence[Effect] = (),
        given: Given | None = None,
    ) -> ColumnAssembly:
        """Columns of free coefficients and searched shapes, (F + S), and of what is beside them.

        `beside`: effects whose load is the model's own inertia and gravity. The target is what the
        held coefficients leave. Without `bends` there are no columns of shapes.
        """
        own = sum(len(effect.terms) for effect in self.effects)
        parts, shapes = list(self.effects), []
        for number in range(len(self.searched) if bends else 0):
            moved, shares = self._bend(number, sum(len(e.terms) for e in parts))
            parts += moved
            shapes.append(shares)
        first = sum(len(effect.terms) for effect in parts)
        count = sum(len(effect.terms) for effect in beside)
        padding = np.zeros(first + count - own)
        return ColumnAssembly(
            (*parts, *beside),
            np.concatenate([self.coefficients, padding]),
            (
                *([(int(k), 1.0)] for k in self.free),
                *shapes,
                *([(first + k, 1.0)] for k in range(count)),
            ),
            np.concatenate([np.where(self.held, self.coefficients, 0.0), padding]),
            given,
        )

    def opened(self) -> tuple[ColumnAssembly, Array]:
        """Columns of free coefficients, and of all that the shapes' columns are mixed from.

        Returns
        -------
        The assembly, (F + M) columns; and slopes (M, S, P): times the coefficients (P,), they are
        the weights of the M columns in those of the S shapes.
        """
        first = sum(len(effect.terms) for effect in self.effects)
        moved, slopes = list[Effect](), list[Array]()
        for number in range(len(self.searched)):
            effects, terms, signs = self._sides(number)
            moved += effects
            for term, sign in zip(terms, signs, strict=True):
                slope = np.zeros((len(self.searched), first))
                slope[number, term] = sign
                slopes.append(slope)
        padding = np.zeros(len(slopes))
        assembly = ColumnAssembly(
            (*self.effects, *moved),
            np.concatenate([self.coefficients, padding]),
            tuple([(int(k), 1.0)] for k in (*self.free, *range(first, first + len(slopes)))),
            np.concatenate([np.where(self.held, self.coefficients, 0.0), padding]),
        )
        return assembly, np.array(slopes)

    @property
    def reads_load(self) -> bool:
        """Whether any effect reads the load, of which the model may make a part."""
        return any("load" in effect.reads for effect in self.effects)

    def rows(self, problem: Problem, number: int, *, bends: bool = True) -> tuple[Array, Array]:
        """Columns (N, F + S) of a whole run, see `assembly`; and the target, (N,)."""
        return self.assembly(bends=bends).rows(problem, number)

    def predict(self, problem: Problem, number: int) -> Array:
        """Rows times coefficients of a run, (N,)."""
        return problem.predict_run(self.effects, self.coefficients, number)

    def _bend(self, shape: int, first: int) -> tuple[list[Effect], Shares]:
        """Effects with a shape to either side, from part `first` on, and the slope between."""
        moved, terms, signs = self._sides(shape)
        weights = self.coefficients[terms] * signs
        return moved, [(first + k, float(weight)) for k, weight in enumerate(weights)]

    def _sides(self, shape: int) -> tuple[list[Effect], list[int], Array]:
        """Effects with a shape to either side, the term behind each part, and ±1 / (2 step)."""
        searched = self.searched[shape]
        middle = float(self.logarithms[shape])
        limits = np.log([searched.info.lower, searched.info.upper])
        both = np.clip([middle - STEP, middle + STEP], *limits)
        ends = np.cumsum([0, *(len(e.terms) for e in self.effects)])
        moved: list[Effect] = []
        terms: list[int] = []
        for end in both:
            value = float(np.clip(np.exp(end), searched.info.lower, searched.info.upper))
            for at in searched.effects:
                moved.append(self.effects[at].with_shapes(**{searched.info.name: value}))
                terms += range(int(ends[at]), int(ends[at + 1]))
        signs = np.repeat([-1.0, 1.0], len(terms) // 2) / (both[1] - both[0])
        return moved, terms, signs


def candidate_model_of(
    effects: Sequence[Effect], base: int, fixed: Mapping[str, float]
) -> CandidateModel:
    """Return the model of effects with zero coefficients, but those that are `fixed` by name."""
    effects, names, shapes = tuple(effects), _names(effects), shapes_of(effects)
    known = [shape.name for shape in shapes]
    values, held = np.zeros(len(names)), np.zeros(len(names), dtype=bool)
    fixed_shapes = set()
    for name, value in fixed.items():
        match = [s for s in shapes if name in (s.name, s.name.split(".")[-1])]
        if len(match) == 1:
            effects = match[0].set(effects, value)
            fixed_shapes.add(match[0].name)
            continue
        at = resolve(name, names, "fixed", known)
        values[at], held[at] = value, True
    searched = tuple(s for s in shapes if s.name not in fixed_shapes)
    return CandidateModel(effects, values, held, searched, base, fixed)


def _names(effects: Sequence[Effect]) -> list[str]:
    return coefficient_names(effects)


def started(
    problem: Problem,
    work: CandidateModel,
    whitening: Whitening,
    numbers: Sequence[int] | None = None,
) -> tuple[CandidateModel, float]:
    """Return the model at its optimum, from the best point of a scan along each shape in turn.

    A shape that these rows do not tell stays where it is, not at whichever bound rounding prefers.
    `numbers`: of the searched shapes that are scanned; None for all.
    """
    told = TOLD / max(sum(run.counted for run in problem.runs), 1)
    for number in range(len(work.searched)) if numbers is None else numbers:
        shape = work.searched[number]
        ends = np.log([shape.info.lower, shape.info.upper])
        here = work.logarithms
        trials = []
        for value in (here[number], *np.linspace(ends[0], ends[1], SCANNED)):
            moved = here.copy()
            moved[number] = value
            made, squares = solved_at(problem, work.at(moved), whitening)
            trials.append((squares, made))
        best = min(trials, key=lambda trial: trial[0])
        work = best[1] if best[0] < (1.0 - told) * trials[0][0] else trials[0][1]
    return refitted(problem, work, whitening)


SEEN = (0.5, 2.0)  # of an order's largest frequency: a resonance beyond bends nothing that is seen
OUTERMOST = 0.005  # of the values of a channel at either end, that tell nothing of its size
UNIT_CHANNELS = {
    "rad/s": ("output_velocity",),
    "Nm": ("known_load",),
    "rad": ("output_position", "motor_position"),
}


def shaped(
    effect: Effect, model: tuple[Effect, ...], problem: Problem, points: int = SCANNED
) -> list[Effect]:
    """Return the effect with each combination of shapes that is worth screening.

    A Stribeck speed lies among the speeds of the runs, the width of a loop among its turns, a time
    constant between two samples and half a run, a resonance among the orders times the speeds;
    where nothing tells, the bounds of the catalogue do. `points`: values of a single shape.
    """
    known = {name: e.shapes[name] for e in model for name in SHARED if name in e.shapes}
    own = {name: value for name, value in known.items() if name in effect.shapes}
    effect = effect.with_shapes(**own)
    free = [s for s in effect.fitted_shapes if s.name not in own]
    count = max(points - 2 * max(len(free) - 1, 0), 2)
    grids = [_grid(effect, shape, problem, count) for shape in free]
    names = [shape.name for shape in free]
    return [
        effect.with_shapes(**dict(zip(names, values, strict=True))) for values in product(*grids)
    ]


def _grid(effect: Effect, shape: ShapeInfo, problem: Problem, count: int) -> list[float]:
    key = ("range", effect.name, effect.reads, effect.harmonics, shape.name)
    low, high = problem.once(key, lambda: _range(effect, shape, problem))
    low, high = max(low, shape.lower), min(high, shape.upper)
    if not low < high:
        return [float(np.clip(shape.default, shape.lower, shape.upper))]
    inside = np.clip(np.geomspace(low, high, count), shape.lower, shape.upper)
    return [float(value) for value in inside]


def _range(effect: Effect, shape: ShapeInfo, problem: Problem) -> tuple[float, float]:
    if shape.unit == "s":
        step = min(1.0 / run.log.rate for run in problem.runs)
        return 2.0 * step, 0.5 * max(run.log.duration for run in problem.runs)
    wanted = UNIT_CHANNELS.get(shape.unit, ())
    reads = ("known_load" if name == "load" else name for name in effect.reads)
    for name in (name for name in reads if name in wanted):
        found = [run.channels[name] for run in problem.runs if name in run.channels]
        sizes = [_size(values, shape.unit) for values in found]
        if sizes and max(sizes) > 0.0:
            if effect.ripple:
                return _resonance(effect, max(sizes))
            return OUTERMOST * max(sizes), max(sizes)
    return shape.lower, shape.upper


def _resonance(effect: Effect, speed: float) -> tuple[float, float]:
    """Where a resonance bends one of the orders at one of the speeds, in order × rad/s."""
    orders = [order for order, _ in effect.harmonics] or [1]
    return SEEN[0] * min(orders) * speed, SEEN[1] * max(orders) * speed


def _size(values: Array, unit: str) -> float:
    """The largest without the outermost per cent; of angles half the way from end to end."""
    if unit != "rad":
        return float(np.quantile(np.abs(values), 1.0 - OUTERMOST))
    low, high = np.quantile(values, (OUTERMOST, 1.0 - OUTERMOST))
    return float(max(high - low, 0.0)) / 2.0


def refitted(
    problem: Problem, work: CandidateModel, whitening: Whitening
) -> tuple[CandidateModel, float]:
    """Return the model at its optimum, and its squares over σ².

    A shape is moved along the tangent as far as that lowers the squares; one that stands at its
    bound or bends nothing stays where it is.
    """
    work, squares, step = coefficients_of(problem, work, whitening)
    for _ in range(STEPS if len(work.searched) else 0):
        if not step.any():
            break
        before = squares
        move = np.clip(step, -FARTHEST, FARTHEST)
        for _ in range(HALVINGS):
            trial = work.at(work.logarithms + move)
            if np.allclose(trial.logarithms, work.logarithms, rtol=0.0, atol=SINGULAR):
                break
            made, reached, ahead = coefficients_of(problem, trial, whitening)
            if reached < squares:
                work, squares, step = made, reached, ahead
                break
            move = 0.5 * move
        if before - squares < ENOUGH:
            break
    return work, squares


def coefficients_of(
    problem: Problem, work: CandidateModel, whitening: Whitening
) -> tuple[CandidateModel, float, Array]:
    """Solve for the coefficients at these shapes.

    Returns
    -------
    The model with its coefficients, the squares over σ² that it leaves, and the step (S,) of the
    shapes' logarithms that the tangent suggests; 0 where that promises next to nothing.
    """
    count = len(work.searched)
    if not count:
        return *solved_at(problem, work, whitening), np.zeros(0)
    if work.reads_load:
        work, _ = solved_at(problem, work, whitening, LOAD_ROUNDS - 1)
    assembly, slopes = work.opened()
    total = tabulated(problem, assembly, whitening).total
    work, squares = _solved(work, total)
    if not np.any(work.coefficients):
        return work, squares, np.zeros(count)
    full = mixed(total, slopes @ work.coefficients)
    both = solved(full, np.arange(len(full) - 1))
    ahead = squares - float(full[-1, -1] - full[:-1, -1] @ both)
    return work, squares, both[len(work.free) :] * (ahead >= ENOUGH)


def mixed(total: Array, weights: Array) -> Array:
    """Products of [columns, M parts of shapes, y] with the parts mixed to columns of shapes.

    A difference of parts that is no more than rounding is none.
    """
    parts, shapes = weights.shape
    linear = len(total) - 1 - parts
    mix = np.zeros((len(total), linear + shapes + 1))
    mix[:linear, :linear] = np.eye(linear)
    mix[linear:-1, linear:-1] = weights
    mix[-1, -1] = 1.0
    size = np.abs(mix).T @ np.sqrt(np.maximum(np.diag(total), 0.0))
    full = mix.T @ total @ mix
    mix[:, np.diag(full) <= ROUNDING * size**2] = 0.0
    return np.asarray(mix.T @ total @ mix)


def solved_at(
    problem: Problem, work: CandidateModel, whitening: Whitening, rounds: int = LOAD_ROUNDS
) -> tuple[CandidateModel, float]:
    """Return the model with its coefficients at these shapes, and the squares over σ²."""
    squares = 0.0
    for _ in range(rounds):
        before = work
        total = tabulated(problem, work.assembly(bends=False), whitening).total
        work, squares = _solved(work, total)
        if _stands(before, work):
            break
    return work, squares


def _solved(work: CandidateModel, total: Array) -> tuple[CandidateModel, float]:
    """Solve for the free coefficients, whose columns come first, the target last."""
    linear = np.arange(len(work.free))
    beta = solved(total, linear)
    values = work.coefficients.copy()
    values[work.free] = beta
    return replace(work, coefficients=values), float(total[-1, -1] - total[linear, -1] @ beta)


def _stands(before: CandidateModel, after: CandidateModel) -> bool:
    """Whether the load that rows read is the same by both sets of coefficients."""
    if not after.reads_load:
        return True
    carries = np.array([e.info.carries_load for e in after.effects for _ in e.terms])
    made, load = after.coefficients[carries], before.coefficients[carries]
    largest = float(np.abs(made).max(initial=0.0))
    return bool(np.abs(made - load).max(initial=0.0) <= LOAD_STANDS * largest)


@dataclass(frozen=True, eq=False)
class Fold:
    """Rows [first, last) of a run, and the coefficients (P,) of the fit that never saw them."""

    run: int
    first: int
    last: int
    coefficients: Array


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Fits to all folds but one, and what they leave of that one.

    `betas`: coefficients (C,) of the columns of `assembly` without each fold. `squares`: what is
    left over σ² once filtered as the noise is, in χ².
    """

    problem: Problem
    work: CandidateModel
    assembly: ColumnAssembly
    betas: tuple[Array, ...]
    squares: float

    @cached_property
    def residuals(self) -> tuple[Array, ...]:
        """(N,) of each run, NaN where a row does not count."""
        return tuple(self.assembly.left_over(self.problem, self.betas))

    @cached_property
    def folds(self) -> tuple[Fold, ...]:
        """The folds, in order, each with the fit that never saw it."""
        return tuple(_folds(self.problem, self.work, self.betas))

    @property
    def rmse(self) -> float:
        """In the unit of the target, of all rows that count."""
        return rmse_of(self.residuals)


def held_out(
    problem: Problem, work: CandidateModel, whitening: Whitening, beside: Given | None = None
) -> HeldOut:
    """Leave out one fold after the other and fit the coefficients to the rest; shapes stay.

    Columns that no other fold sees contribute nothing, and what the other folds do not tell from
    the base is the base's: a spring that slips all the time there is Coulomb friction. Many
    functions beside a model would go anywhere in places that few rows of the rest have seen: they
    are shrunk (`_ridge`).
    """
    assembly = work.assembly(bends=False, given=beside)
    table = tabulated(problem, assembly, whitening)
    every = np.arange(len(table.total) - 1)
    ridge = _ridge(table, len(work.free))
    given = {effect.name for effect in work.effects[: work.base]}
    base = sum(owner in given for owner in work.owners()[: len(work.free)])
    betas = tuple(solved(table.total - fold + ridge, every, base) for fold in table.folds)
    squares = sum(_squares(fold, beta) for fold, beta in zip(table.folds, betas, strict=True))
    return HeldOut(problem, work, assembly, betas, squares)


def _ridge(table: Table, own: int) -> Array:
    """What is added to the products, (C + 1, C + 1), for columns behind the model's own.

    Ridge regression by empirical Bayes [Hoerl1975]: of m columns that explain
    χ² together, each explains (χ² − m) / m beyond chance, and is that size times a normal number.
    """
    columns, raw = np.arange(own, len(table.total) - 1), np.diag(table.total)
    ridge = np.zeros_like(raw)
    if len(columns):
        gain, seen = gain_of(table.without(np.arange(own)), columns, raw)
        ridge[columns] = raw[columns] * seen / max(gain - seen, 1.0)
    return np.diag(ridge)


def _squares(products: Array, beta: Array) -> float:
    """What is left of the target of products [columns, y] by coefficients."""
    both = np.append(-beta, 1.0)
    return float(both @ products @ both)


def plain_rows(problem: Problem, work: CandidateModel) -> Whitening:
    """Rows as `fit` takes them, for what users see; σ² is what this model leaves."""
    rows = Whitening(np.ones(1), 1.0, problem.decimation)
    _, squares = solved_at(problem, work, rows)
    count = sum(len(at) for run in problem.runs for at in rows.taken(run))
    whole = sum(float(run.target @ run.target) for run in problem.runs)
    return replace(rows, variance=max(squares, SINGULAR**2 * whole, TINY) / max(count, 1))


def _folds(problem: Problem, work: CandidateModel, betas: Sequence[Array]) -> Iterator[Fold]:
    """Each fold with all coefficients of the model that never saw it."""
    count, solutions = len(work.free), iter(betas)
    for number in range(len(problem.runs)):
        for first, last in pairwise(edges_of(problem, number)):
            values = work.coefficients.copy()
            values[work.free] = next(solutions)[:count]
            yield Fold(number, int(first), int(last), values)


def rmse_of(residuals: Sequence[Array]) -> float:
    """Return the RMSE of residuals (N,) of each run; NaN where a row does not count."""
    counted = (np.isfinite(part) for part in residuals)
    parts = [part if c.all() else part[c] for part, c in zip(residuals, counted, strict=True)]
    squares = sum(float(part @ part) for part in parts)
    return float(np.sqrt(squares / sum(map(len, parts))))


def rmse_error(residuals: Sequence[Array], rows: int) -> float:
    """Return the standard error of `rmse_of`; blocks of so many rows are independent."""
    sums, counts = list[float](), list[int]()
    for left in residuals:
        squares = left[np.isfinite(left)] ** 2
        blocks = np.array_split(squares, max(1, round(len(squares) / rows)))
        sums += [float(block.sum()) for block in blocks]
        counts += [len(block) for block in blocks]
    if len(sums) < 2 or not sum(sums) > 0.0:
        return float("nan")
    mean = sum(sums) / sum(counts)
    off = np.array(sums) - mean * np.array(counts)
    spread = np.sqrt(len(sums) / (len(sums) - 1)) * np.linalg.norm(off) / sum(counts)
    return float(spread / (2.0 * np.sqrt(mean)))


def fall_of(before: Sequence[Array], after: Sequence[Array], rows: int) -> tuple[float, float]:
    """Return how much the mean square of residuals (N,) falls, and its standard error.

    NaN where a row does not count; `rows`: of a block.

    With s the difference of both predictions and e what is left after, s² + 2 s e is the fall of a
    row. Chance is in the second term alone: its sums over blocks, longer than the memory of e, are
    independent and have no mean of their own.
    """
    total, sums, count = 0.0, list[float](), 0
    for old, new in zip(before, after, strict=True):
        both = np.isfinite(old) & np.isfinite(new)
        gain, left = old[both] - new[both], new[both]
        total += float(gain @ (gain + 2.0 * left))
        blocks = np.array_split(2.0 * gain * left, max(1, round(len(gain) / rows)))
        sums += [float(block.sum()) for block in blocks if len(block)]
        count += len(gain)
    chance = float(np.linalg.norm(sums)) if len(sums) > 1 else np.inf
    return total / max(count, 1), chance / max(count, 1)


def first_whitening(problem: Problem, assembly: ColumnAssembly) -> Whitening:
    """Noise of what all columns leave of the target."""
    plain = Whitening(np.ones(1), 1.0, problem.decimation)
    table = tabulated(problem, assembly, plain)
    beta = solved(table.total, np.arange(assembly.width))
    residuals = assembly.left_over(problem, [beta] * len(table.folds))
    return _above_rounding(problem, _rough_whitening(residuals, problem.runs, problem.decimation))


def _rough_whitening(
    residuals: Sequence[Array], runs: Sequence[Run], decimation: int, white: float = SINGULAR
) -> Whitening:
    """Fit the noise to residuals, (N,) for each run, by Yule and Walker; order by AICc.

    A first guess, from a residual that everything was taken out of. `white`: share of it that is
    white in any case.
    """
    lags, rows = np.zeros(LAGS + 1), 0
    plain = Whitening(np.ones(1), 1.0, decimation)
    for residual, run in zip(residuals, runs, strict=True):
        for at in plain.taken(run):
            part = residual[at]
            lags += [float(part[k:] @ part[: max(len(part) - k, 0)]) for k in range(len(lags))]
            rows += len(part)
    lags = lags / max(rows, 1)
    lags[0] = max(lags[0] * (1.0 + white), TINY)
    best = (np.inf, np.ones(1), lags[0])
    for order in range(LAGS + 1):
        phi = solve_toeplitz(lags[:order], lags[1 : order + 1]) if order else np.empty(0)
        variance = max(float(lags[0] - phi @ lags[1 : order + 1]), SINGULAR * lags[0])
        score = rows * np.log(variance) + 2.0 * (order + 1) * rows / max(rows - order - 2, 1)
        if score < best[0]:
            best = (score, np.append(1.0, -phi), variance)
    return Whitening(best[1], float(best[2]), decimation)


def restricted_whitening(
    problem: Problem, work: CandidateModel, beside: Given | None = None
) -> Whitening:
    """Noise beside a model and a flexible basis, what both swallow of it accounted for.

    It starts from the residual of plain least squares beside all of them: from the model's own
    residual, what only the functions explain would begin as slow noise, and remain it. Not so
    where the target was low-passed: what the functions leave there is a narrow band, whose inverse
    lifts what the low pass has left above its cut-off over all else.
    """
    assembly = work.assembly(given=beside)
    plain = Whitening(np.ones(1), 1.0, problem.decimation)
    solved_beside = assembly if problem.lowpass is None else work.assembly()
    beta = np.zeros(assembly.width)
    own = np.arange(solved_beside.width)
    table = tabulated(problem, solved_beside, plain)
    beta[own] = solved(table.total, own)

    def chunks() -> Iterator[Chunk]:
        for starts, made in assembly.pieces(problem):
            begun = np.zeros(len(made), dtype=bool)
            begun[0] = starts
            yield Chunk(made[:, :-1], made[:, -1] - made[:, :-1] @ beta, begun, None)

    rows = sum(run.counted for run in problem.runs)
    noise = noise_model(
        chunks,
        _basis(chunks),
        max_order=LAGS,
        every=max(1, rows // READ),
        decimation=problem.decimation,
        floor=WHITE,
    )
    made = Whitening(noise.denominator, noise.innovation_variance, problem.decimation)
    length = float(np.median([run.counted for run in problem.runs])) / problem.decimation
    if noise.memory > 0.5 * length:
        residuals = assembly.left_over(problem, [beta] * len(table.folds))
        made = _rough_whitening(residuals, problem.runs, problem.decimation, WHITE)
    return _above_rounding(problem, made)


def _above_rounding(problem: Problem, noise: Whitening) -> Whitening:
    """The noise, or white noise of the size of rounding where there is less than that."""
    squares = [float(run.target @ run.target) for run in problem.runs]
    floor = SINGULAR**2 * sum(squares) / sum(len(run) for run in problem.runs)
    if noise.variance > floor:
        return noise
    return Whitening(np.ones(1), floor, noise.decimation)


def _basis(chunks: Callable[[], Iterator[Chunk]]) -> Array:
    """Directions that the rows determine, (F + S, K), with rows @ basis orthonormal."""
    products = np.asarray(sum(chunk.rows.T @ chunk.rows for chunk in chunks()))
    scale = np.sqrt(np.maximum(np.diag(products), TINY))
    values, vectors = np.linalg.eigh(products / np.outer(scale, scale))
    seen = values > SINGULAR * values[-1]
    return np.asarray(vectors[:, seen] / np.sqrt(values[seen]) / scale[:, None])
