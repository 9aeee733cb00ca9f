"""Columns of effects, prewhitened, and their Gram matrices, fold by fold.

With autoregressive noise, e_t = Σ φ_k e_{t−k} + w_t, least squares on rows and target filtered by
A = 1 − Σ φ_k z^−k weighs evidence as it is: sums of squares over the innovation variance σ² are
χ², and slow noise is not treated as independent samples [CochraneOrcutt1949].

A run of an hour has millions of rows, and model and candidates together more than a hundred
columns. Sums of products need a few rows at a time only, so the core makes these, filters them,
and adds them up. A column is kept here as its mixture of rows of effects:

    column k = Σ_p mix_pk · part_p,      target = y − Σ_p held_p · part_p

with the parts: rows of effects, then given columns. The derivative of a prediction by a shape is
the difference of two parts. One pass adds up, for each fold, the products of [columns, y] over σ².
With G their sum and m the columns of a model,

    explained(m) = bᵀ G_mm⁻¹ b,     b = G_my        (a χ² of the columns' number where nothing is)
    G − G_·m G_mm⁻¹ G_m·                            the remainder of every candidate beside m

Long runs are represented by short segments, spread evenly over them. Effects with memory are
computed from some rows before each segment on, as their state before these is a guess.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import pairwise
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from flexspline import _core
from flexspline.effects import Effect
from flexspline.least_squares.problem import Problem, Run
from flexspline.least_squares.result import SINGULAR, TINY
from flexspline.least_squares.validation import RUNS_NEEDED, run_edges
from flexspline.logs.local_fit import LocalFit
from flexspline.logs.segments import runs as unbroken_runs
from flexspline.own import OwnEffect, core_design, is_own
from flexspline.parallel import in_order

__all__ = [
    "SINGULAR",
    "TINY",
    "ColumnAssembly",
    "Columns",
    "Given",
    "Shares",
    "Stretch",
    "Table",
    "Whitening",
    "by_runs",
    "edges_of",
    "fold_blocks",
    "gain_of",
    "gains_of",
    "left_by",
    "pieces_of",
    "rows_of",
    "scaled_products",
    "solved",
    "tabulated",
    "thinned",
]

Array = NDArray[np.float64]
Stretch = tuple[int, int, Array]
"""Rows [first, last), and the weights (2h + 1,) of the low pass around each; none: (0,)."""

SLIVER = 1e-7  # of its squares, that a column keeps beside a model, to be seen
CHUNK = 20_000  # rows of which given columns are made at once

Shares = list[tuple[int, float]]

Columns = NDArray[np.intp]


def by_runs(problem: Problem) -> bool:
    """Whether whole runs are left out, else blocks of them."""
    return len(problem.runs) >= RUNS_NEEDED


def edges_of(problem: Problem, number: int) -> list[int]:
    """Rows at which the folds of a run begin, and its end."""
    return run_edges(problem, number, by_runs(problem))


def fold_blocks(problem: Problem, number: int, rows: NDArray[np.intp]) -> list[tuple[int, int]]:
    """Ranges of the filtered rows of a run that lie in each of its folds."""
    edges = np.searchsorted(rows, edges_of(problem, number))
    return [(int(first), int(last)) for first, last in pairwise(edges.tolist())]


def stretches_of(problem: Problem, number: int, whitening: Whitening) -> list[Stretch]:
    """Rows [first, last) that are long enough for the filter, and the low pass around them."""
    run = problem.runs[number]
    kernels = kernels_of(problem, number) or {}
    none = np.empty(0)
    return [
        (first, last, kernels.get(first, none))
        for first, last in run.stretches
        if whitening.long_enough(last - first)
    ]


def pieces_of(stretch: Stretch, whitening: Whitening) -> Iterator[Stretch]:
    """Cut a stretch; each piece begins as early as its filter needs."""
    first, last, kernel = stretch
    history = whitening.order * whitening.decimation
    step = max(CHUNK // whitening.decimation, 1) * whitening.decimation
    for start in range(first, last - history, step):
        yield start, min(start + step + history, last), kernel


def kernels_of(problem: Problem, number: int) -> dict[int, Array] | None:
    """Low pass of each stretch, by its first row; None where its steps are not even."""
    if problem.lowpass is None:
        return {}
    run = problem.runs[number]
    kept: dict[Any, Any] = problem.kept
    key = ("kernels", number, run.stretches)
    if key not in kept:
        fit, time = LocalFit(problem.lowpass), run.log["time"]
        whole = unbroken_runs(time)
        made = {}
        for first, _ in run.stretches:
            a, b = next((int(a), int(b)) for a, b in whole if a <= first < b)
            made[first] = fit.kernel_of(time[a:b])
        kept[key] = None if any(kernel is None for kernel in made.values()) else made
    found: dict[int, Array] | None = kept[key]
    return found


@dataclass(frozen=True, eq=False)
class Whitening:
    """A = [1, −φ_1, …], the innovation variance σ², and one row of how many is news."""

    denominator: Array
    variance: float
    decimation: int

    @property
    def order(self) -> int:
        return len(self.denominator) - 1

    def long_enough(self, rows: int) -> bool:
        """Whether a stretch of so many rows leaves more than what starts the filter."""
        return -(-rows // self.decimation) > 2 * self.order + 2

    def counted(self, first: int, last: int, edges: Sequence[int]) -> NDArray[np.int64]:
        """Filtered rows of a stretch [first, last) in each fold between `edges`, (F,)."""
        start = first + self.order * self.decimation
        before = [max(0, -(-(min(e, last) - start) // self.decimation)) for e in edges]
        rows = np.diff(before) if self.long_enough(last - first) else np.zeros(len(edges) - 1)
        return np.asarray(rows, dtype=np.int64)

    def taken(self, run: Run) -> list[NDArray[np.intp]]:
        """Rows of each stretch that are filtered; those that only start the filter included."""
        pieces = [np.arange(first, last, self.decimation) for first, last in run.stretches]
        return [rows for rows in pieces if len(rows) and self.long_enough(rows[-1] + 1 - rows[0])]

    def __call__(self, columns: Array, run: Run) -> tuple[Array, NDArray[np.intp]]:
        """Filter columns (N, C) of a run; return what is left and the rows it belongs to."""
        made = (((first, last), columns[first:last]) for first, last in run.stretches)
        return self.stretches(made, columns.shape[1])

    def stretches(
        self, made: Iterable[tuple[tuple[int, int], Array]], width: int
    ) -> tuple[Array, NDArray[np.intp]]:
        """Filter columns (n, width) of stretches [first, last); return also their rows."""
        kept = [(*ends, values) for ends, values in made if self.long_enough(ends[1] - ends[0])]
        rows = [np.arange(a, b, self.decimation)[self.order :] for a, b, _ in kept]
        ends = np.cumsum([0, *map(len, rows)])
        out = np.empty((ends[-1], width), order="F")
        for (_, _, values), first, last in zip(kept, ends, ends[1:], strict=False):
            _core.whiten(values, self.denominator, self.decimation, out[first:last])
        return out, np.concatenate([np.empty(0, dtype=np.intp), *rows])


class Given(Protocol):
    """Columns that no effect makes, such as functions of channels."""

    @property
    def count(self) -> int: ...

    def rows(self, problem: Problem, number: int, rows: slice) -> Array:
        """Return some rows of a run, (n, count)."""
        ...


@dataclass(frozen=True, eq=False)
class ColumnAssembly:
    """Columns of all runs.

    `effects`: whose rows are parts, (E,) of them. `load`: coefficients of these rows, of which the
    load is made. `columns`: parts and weights of each column. `held`: (E,) coefficients whose
    torque is taken off the target. `given`: columns behind those of the effects.
    """

    effects: tuple[Effect, ...]
    load: Array
    columns: tuple[Shares, ...]
    held: Array
    given: Given | None = None

    @property
    def width(self) -> int:
        """How many columns there are, without the target."""
        return len(self.columns) + (self.given.count if self.given else 0)

    def products(self, problem: Problem, whitening: Whitening) -> Array:
        """Sums of products of filtered [columns, target], (F, C + 1, C + 1), by fold."""
        screen = self._screen(problem)
        edges = [edges_of(problem, number) for number in range(len(problem.runs))]
        firsts = np.cumsum([0, *(len(e) - 1 for e in edges)])
        total = np.zeros((firsts[-1], self.width + 1, self.width + 1))
        columns, held = self._mixtures, self._placed(_shares(self.held))

        def summed(part: Callable[[], tuple[list[int], list[Any]]]) -> tuple[list[int], Array]:
            numbers, posed = part()
            made = screen.products(
                posed, columns, held, whitening.denominator, whitening.decimation, problem.threads
            )
            return numbers, made

        parts = self._posed(problem, whitening)
        for numbers, made in in_order(problem.threads if self._brings else 1, summed, parts):
            at = np.concatenate([np.arange(firsts[k], firsts[k + 1]) for k in numbers])
            total[at] += made
        return total

    def left_over(self, problem: Problem, betas: Sequence[Array]) -> list[Array]:
        """Target less columns @ beta, one beta (C,) for each fold, in order: (N,) for each run.

        NaN where a row does not count.
        """
        edges = [edges_of(problem, number) for number in range(len(problem.runs))]
        firsts = np.cumsum([0, *(len(e) - 1 for e in edges)])
        left = [np.full(len(run), np.nan) for run in problem.runs]
        if self._brings or not self.even(problem):
            for number, out in enumerate(left):
                those = np.array(betas[firsts[number] : firsts[number + 1]])
                self._leave(problem, number, those, out)
            return left
        numbers, held = range(len(left)), [_shares(self._parts_of(beta)) for beta in betas]
        plain = Whitening(np.ones(1), 1.0, 1)
        posed = [_run(problem, k, stretches_of(problem, k, plain)) for k in numbers]
        return self._screen(problem).left_over(posed, held, problem.threads)

    def _leave(self, problem: Problem, number: int, betas: Array, out: Array) -> None:
        """The same for one run, with the columns of a stretch all there."""
        edges = edges_of(problem, number)
        for (first, last), made in self.stretches(problem, number, cut=True):
            fold = np.searchsorted(edges[1:-1], np.arange(first, last), side="right")
            out[first:last] = made[:, -1] - np.einsum("nc,nc->n", made[:, :-1], betas[fold])

    def pieces(self, problem: Problem) -> Iterator[tuple[bool, Array]]:
        """[Columns, target] of all rows that count, (n, C + 1), a few at a time.

        Whether a piece begins a stretch comes first.
        """
        for number in range(len(problem.runs)):
            begins = {first for first, _ in problem.runs[number].stretches}
            for (first, _), made in self.stretches(problem, number, cut=True):
                yield first in begins, made

    def stretches(
        self, problem: Problem, number: int, *, cut: bool = False
    ) -> Iterator[tuple[tuple[int, int], Array]]:
        """Each stretch [first, last) of a run, and [columns, target] of its rows, (n, C + 1).

        `cut`: in pieces of at most `CHUNK` rows.
        """
        run = problem.runs[number]
        if not self.even(problem):
            whole = np.column_stack(self.rows(problem, number))
            yield from (((first, last), whole[first:last]) for first, last in run.stretches)
            return
        screen, held = self._screen(problem), self._placed(_shares(self.held))
        plain, columns = Whitening(np.ones(1), 1.0, 1), self._mixtures

        def made(piece: Stretch) -> tuple[tuple[int, int], Array]:
            if self.given and not self.effects and not len(piece[2]):  # nothing for the core
                first, last, _ = piece
                own = self.given.rows(problem, number, slice(first, last))
                return piece[:2], np.column_stack([own, run.target[first:last]])
            posed = _run(problem, number, [piece], *self._made(problem, number, piece))
            return piece[:2], np.asarray(screen.rows(posed, columns, held))

        unbroken = stretches_of(problem, number, plain)
        pieces = (piece for s in unbroken for piece in (pieces_of(s, plain) if cut else [s]))
        yield from in_order(problem.threads if cut else 1, made, pieces)

    def white(
        self, problem: Problem, whitening: Whitening, number: int
    ) -> tuple[Array, NDArray[np.intp]]:
        """Filtered [columns, target] of a run, (n, C + 1), and the rows that they belong to."""
        return whitening.stretches(self.stretches(problem, number), self.width + 1)

    def rows(self, problem: Problem, number: int) -> tuple[Array, Array]:
        """Columns (N, C) and target (N,) of a whole run, low-passed, all there at once."""
        run = problem.runs[number]
        parts = np.asarray(problem.design(self.effects).rows(run.channels, len(run), self.load))
        made = [_mixed(parts, shares) for shares in self.columns]
        given = [self.given.rows(problem, number, slice(0, len(run)))] if self.given else []
        columns = np.column_stack([np.empty((len(run), 0)), *made, *given])
        both = problem.smooth(run, np.column_stack([columns, parts @ self.held]))
        return both[:, :-1], run.target - both[:, -1]

    def even(self, problem: Problem) -> bool:
        """Whether the core can make the columns: with a low pass it needs even steps."""
        return problem.lowpass is None or all(
            kernels_of(problem, number) is not None for number in range(len(problem.runs))
        )

    @property
    def _given_parts(self) -> range:
        count = sum(len(effect.terms) for effect in self.effects)
        return range(count, count + self.width - len(self.columns))

    def _parts_of(self, beta: Array) -> Array:
        """Weight of each part in columns @ beta and in what is held."""
        own = len(self.columns)
        parts = np.concatenate([self.held, beta[own:]])
        for shares, value in zip(self.columns, beta[:own], strict=True):
            for part, weight in shares:
                parts[part] += weight * value
        return parts

    @property
    def _brings(self) -> bool:
        """Whether some columns are not the core's: given ones, and those of the user's effects."""
        return bool(self.given) or bool(self._own)

    @cached_property
    def _own(self) -> list[OwnEffect]:
        return [effect for effect in self.effects if isinstance(effect, OwnEffect)]

    @property
    def _mixtures(self) -> list[Shares]:
        """Parts of the screen and weights of each column, given ones behind the others."""
        own = [*self.columns, *([(p, 1.0)] for p in self._given_parts)]
        return [self._placed(shares) for shares in own]

    def _placed(self, shares: Shares) -> Shares:
        """Shares by the parts of the screen: own effects stand behind the core's, given last."""
        if not self._own:
            return shares
        own = is_own(self.effects)
        place = np.argsort(np.concatenate([np.flatnonzero(~own), np.flatnonzero(own)]))
        count = len(place)
        return [(int(place[p]) if p < count else p, weight) for p, weight in shares]

    def _screen(self, problem: Problem) -> _core.Screen:
        design = core_design([e for e in self.effects if not e.own], problem.gear)
        load, brought = self.load, len(self._given_parts)
        if self._own:
            own = is_own(self.effects)
            load, brought = load[~own] if load.size else load, brought + int(own.sum())
        return _core.Screen(design, load, brought, problem.remembered)

    def _posed(
        self, problem: Problem, whitening: Whitening
    ) -> Iterator[Callable[[], tuple[list[int], list[Any]]]]:
        """Runs as the core takes them: all, or a piece at a time where columns are given."""
        numbers = range(len(problem.runs))
        stretches = [stretches_of(problem, number, whitening) for number in numbers]
        if not self._brings:
            yield lambda: (list(numbers), [_run(problem, k, stretches[k]) for k in numbers])
            return

        def alone(number: int, piece: Stretch) -> tuple[list[int], list[Any]]:
            made = self._made(problem, number, piece)
            return [number], [_run(problem, number, [piece], *made)]

        for number in numbers:
            for stretch in stretches[number]:
                for piece in pieces_of(stretch, whitening):
                    yield partial(alone, number, piece)

    def _made(self, problem: Problem, number: int, piece: Stretch) -> tuple[Array | None, int]:
        """Columns that the core does not make around rows [first, last), and where they begin."""
        if not self._brings:
            return None, 0
        first, last, kernel = piece
        low, high = first - len(kernel) // 2, last + len(kernel) // 2
        given = [self.given.rows(problem, number, slice(low, high))] if self.given else []
        if not self._own:
            return given[0], low
        channels = problem.runs[number].channels.items()
        near = {name: values[low:high] for name, values in channels}
        own = [effect.columns(near, high - low) for effect in self._own]
        return np.asfortranarray(np.column_stack([*own, *given])), low


def _shares(weights: Array) -> Shares:
    return [(int(part), float(weights[part])) for part in np.flatnonzero(weights)]


def _mixed(parts: Array, shares: Shares) -> Array:
    return np.asarray(
        sum((weight * parts[:, part] for part, weight in shares), np.zeros(len(parts)))
    )


def _run(
    problem: Problem,
    number: int,
    stretches: Sequence[Stretch],
    given: Array | None = None,
    from_row: int = 0,
) -> Any:
    run = problem.runs[number]
    return (
        number,
        run.channels,
        run.target,
        given,
        from_row,
        stretches,
        edges_of(problem, number),
    )


@dataclass(frozen=True, eq=False)
class Table:
    """Products of [columns, y] over σ², (F, C + 1, C + 1) by fold, and rows (F,) in each."""

    folds: Array
    rows: NDArray[np.int64]

    @cached_property
    def total(self) -> Array:
        """(C + 1, C + 1), over all folds."""
        return np.asarray(self.folds.sum(axis=0))

    def without(self, model: Columns) -> Array:
        """Products of what the model's columns leave of all others, (C + 1, C + 1)."""
        return left_by(self.total, model)

    def gain(self, columns: Columns, model: Columns) -> float:
        """Squares over σ² that some columns explain beside those of a model."""
        if not len(columns):
            return 0.0
        asked = np.concatenate([model, columns, [len(self.total) - 1]])
        products = self.total[np.ix_(asked, asked)]
        left = left_by(products, np.arange(len(model)))
        return gain_of(left, np.arange(len(model), len(asked) - 1), np.diag(products))[0]


def solved(products: Array, model: Columns, base: int | None = None) -> Array:
    """Coefficients of least squares, (m,), of least norm where columns depend on each other.

    `base`: how many columns come first; what the rows do not tell from these is theirs.
    """
    inverse, scale, blind = _inverse(products, model)
    found = inverse @ (products[model, -1] / scale)
    if base is not None and blind.shape[1]:
        found -= blind @ np.linalg.lstsq(blind[base:], found[base:], rcond=SINGULAR)[0]
    return np.asarray(found / scale)


def left_by(products: Array, model: Columns) -> Array:
    """The Schur complement: products of all columns after `model` is taken out.

    Of several tables (…, C, C), the same columns of each.
    """
    inverse, scale, _ = _inverse(products, model)
    across = products[..., model, :] / scale[..., None]
    return np.asarray(products - np.swapaxes(across, -1, -2) @ inverse @ across)


def gain_of(left: Array, columns: Columns, raw: Array) -> tuple[float, int]:
    """Squares over σ² that columns explain of what the model leaves, and how many are seen."""
    gains, seen = gains_of(left, columns[None], raw)
    return float(gains[0]), int(seen[0])


def gains_of(left: Array, groups: NDArray[np.intp], raw: Array) -> tuple[Array, NDArray[np.intp]]:
    """The same for each of several groups of columns (n, k), and of several tables: (…, n)."""
    products, scale = scaled_products(left, groups, raw)
    values, vectors = np.linalg.eigh(products)
    most = values.max(axis=-1, initial=0.0)[..., None]
    seen = values > np.maximum(SLIVER, SINGULAR * most)
    along = np.einsum("...kj,...k->...j", vectors, left[..., groups, -1] / scale)
    gains = np.where(seen, along**2 / np.where(seen, values, 1.0), 0.0).sum(axis=-1)
    return gains, seen.sum(axis=-1)


def scaled_products(left: Array, groups: NDArray[np.intp], raw: Array) -> tuple[Array, Array]:
    """Products (…, n, k, k) of groups of columns (n, k) in the lengths that they had, (n, k)."""
    scale = np.sqrt(np.maximum(raw[groups], TINY))
    across = left[..., groups[:, :, None], groups[:, None, :]]
    return across / (scale[:, :, None] * scale[:, None, :]), scale


def _inverse(products: Array, model: Columns) -> tuple[Array, Array, Array]:
    """Pseudo-inverse (…, m, m) of the columns' products scaled to length one, the lengths, and of
    one table the directions (m, n) that the rows do not tell."""
    scale = np.sqrt(np.maximum(products[..., model, model], 0.0))
    scale = np.where(scale > 0.0, scale, 1.0)
    own = products[..., model[:, None], model]
    values, vectors = np.linalg.eigh(own / (scale[..., :, None] * scale[..., None, :]))
    most = values.max(axis=-1, initial=0.0)[..., None]
    seen = values > SINGULAR * np.maximum(most, TINY)
    weighed = vectors * np.where(seen, 1.0 / np.where(seen, values, 1.0), 0.0)[..., None, :]
    blind = vectors[:, ~seen] if products.ndim == 2 else vectors[..., :0]
    return weighed @ np.swapaxes(vectors, -1, -2), scale, blind


def left_of(
    problem: Problem, effects: tuple[Effect, ...], load: Array, values: Array
) -> list[Array]:
    """Return the target less what coefficients (P,) of effects make of it, (N,) for each run.

    `load`: coefficients of which the load is made. NaN where a row does not count.
    """
    folds = sum(len(edges_of(problem, number)) - 1 for number in range(len(problem.runs)))
    return ColumnAssembly(effects, load, (), values).left_over(problem, [np.empty(0)] * folds)


def tabulated(problem: Problem, assembly: ColumnAssembly, whitening: Whitening) -> Table:
    """Add up the products of the columns of an assembly and the target."""
    if assembly.even(problem):
        folds = assembly.products(problem, whitening)
        return Table(folds / whitening.variance, _rows_of_folds(problem, whitening))
    products = []
    for number, run in enumerate(problem.runs):
        made, at = whitening(np.column_stack(assembly.rows(problem, number)), run)
        blocks = fold_blocks(problem, number, at)
        plain = np.asfortranarray(made[:, :-1])
        high, _ = _core.accumulate_rows(plain, made[:, -1], blocks, None, False, problem.threads)
        products.append(high / whitening.variance)
    return Table(np.concatenate(products), _rows_of_folds(problem, whitening))


def _rows_of_folds(problem: Problem, whitening: Whitening) -> NDArray[np.int64]:
    kept: dict[Any, Any] = problem.kept  # models come and go, the rows stay
    key = "rows of folds", whitening.order, whitening.decimation
    own = [run.stretches for run in problem.runs]
    if key not in kept or kept[key][0] != own:
        made = []
        for number, run in enumerate(problem.runs):
            edges = edges_of(problem, number)
            counts = [whitening.counted(first, last, edges) for first, last in run.stretches]
            made.append(np.sum(counts, axis=0, dtype=np.int64))
        kept[key] = own, np.concatenate(made)
    found: NDArray[np.int64] = kept[key][1]
    return found


def rows_of(problem: Problem) -> int:
    """How many rows count."""
    return sum(run.counted for run in problem.runs)


def thinned(problem: Problem, enough: int, stretch: int, lead: int) -> Problem:
    """Return the problem with about `enough` of its rows, in pieces of about `stretch`.

    `lead`: rows before each, from which effects with memory are followed.

    Itself where it has less than twice as many. Behind a low pass one row of several is news: it
    is these that are counted.
    """
    enough, stretch = enough * problem.decimation, stretch * problem.decimation
    share = rows_of(problem) // enough
    if share < 2:
        return problem
    runs = tuple(replace(run, stretches=_parts(run, share, stretch)) for run in problem.runs)
    return replace(problem, runs=runs, remembered=_core.Remembered(lead))


def _parts(run: Run, share: int, stretch: int) -> tuple[tuple[int, int], ...]:
    """One part of so many of each stretch, from its middle."""
    parts = []
    for first, last in run.stretches:
        count = max(1, round((last - first) / (share * stretch)))
        step = (last - first) / count
        length = round(step / share)
        begins = [first + round((k + 0.5) * step) - length // 2 for k in range(count)]
        parts += [(begin, begin + length) for begin in begins]
    return tuple(parts)
