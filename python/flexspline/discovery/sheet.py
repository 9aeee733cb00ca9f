"""Columns that are never all there at once: what a model and candidates are made of, and where.

A run of an hour has millions of rows, and model and candidates together more than a hundred
columns. Sums of products need a few rows at a time only, so the core makes these, filters them,
and adds them up. What is kept of a column here is how it is mixed from rows of effects:

    column k = Σ_p mix_pk · part_p,      target = y − Σ_p held_p · part_p

with the parts: rows of effects, then of functions without a name. How a prediction bends with a
shape is the difference of two parts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexspline import _core
from flexspline.discovery.nameless import Nameless
from flexspline.discovery.stretches import (
    Stretch,
    edges_of,
    kernels_of,
    pieces_of,
    stretches_of,
)
from flexspline.discovery.values import values_of
from flexspline.discovery.whitening import Whitening
from flexspline.effects import Effect
from flexspline.fit.problem import Problem
from flexspline.parallel import in_order

__all__ = ["Shares", "Sheet"]

Array = NDArray[np.float64]
Shares = list[tuple[int, float]]


@dataclass(frozen=True, eq=False)
class Sheet:
    """Columns of all runs.

    `effects`: whose rows are parts, (E,) of them. `load`: coefficients of these rows, of which the
    load is made. `columns`: parts and weights of each column. `held`: (E,) coefficients whose
    torque is taken off the target. `given`: functions behind the effects, a column each.
    """

    effects: tuple[Effect, ...]
    load: Array
    columns: tuple[Shares, ...]
    held: Array
    given: tuple[Nameless, ...] = ()

    @property
    def width(self) -> int:
        """How many columns there are, without the target."""
        return len(self.columns) + sum(group.count for group in self.given)

    def products(self, problem: Problem, whitening: Whitening) -> Array:
        """Sums of products of filtered [columns, target], (F, C + 1, C + 1), by fold."""
        screen = self._screen(problem)
        edges = [edges_of(problem, number) for number in range(len(problem.runs))]
        firsts = np.cumsum([0, *(len(e) - 1 for e in edges)])
        total = np.zeros((firsts[-1], self.width + 1, self.width + 1))
        columns = [*self.columns, *([(p, 1.0)] for p in self._given_parts)]
        held = _shares(self.held)

        def summed(part: Callable[[], tuple[list[int], list[Any]]]) -> tuple[list[int], Array]:
            numbers, posed = part()
            made = screen.products(
                posed, columns, held, whitening.denominator, whitening.decimation, problem.threads
            )
            return numbers, made

        parts = self._posed(problem, whitening)
        for numbers, made in in_order(problem.threads if self.given else 1, summed, parts):
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
        if self.given or not self.even(problem):
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
        screen, held = self._screen(problem), _shares(self.held)
        plain = Whitening(np.ones(1), 1.0, 1)
        columns = [*self.columns, *([(p, 1.0)] for p in self._given_parts)]

        def made(piece: Stretch) -> tuple[tuple[int, int], Array]:
            posed = _run(problem, number, [piece], *self._made(problem, number, piece))
            return piece[:2], np.asarray(screen.rows(posed, columns, held))

        unbroken = stretches_of(problem, number, plain)
        pieces = (piece for s in unbroken for piece in (pieces_of(s, plain) if cut else [s]))
        yield from in_order(problem.threads if cut else 1, made, pieces)

    def white(
        self, problem: Problem, whitening: Whitening, number: int
    ) -> tuple[Array, NDArray[np.intp]]:
        """Filtered [columns, target] of a run, (n, C + 1), and the rows that they belong to."""
        order, step = whitening.order, whitening.decimation
        made = [np.empty((0, self.width + 1))]
        at = [np.empty(0, dtype=np.intp)]
        for (first, last), values in self.stretches(problem, number):
            if whitening.long_enough(last - first):
                taken = values[::step]
                made.append(np.empty((len(taken) - order, self.width + 1), order="F"))
                whitening.filter(taken, made[-1])
                at.append(np.arange(first, last, step)[order:])
        return np.concatenate(made), np.concatenate(at)

    def rows(self, problem: Problem, number: int) -> tuple[Array, Array]:
        """Columns (N, C) and target (N,) of a whole run, low-passed, all there at once."""
        run = problem.runs[number]
        parts = np.asarray(problem.design(self.effects).rows(run.channels, len(run), self.load))
        made = [_mixed(parts, shares) for shares in self.columns]
        values = values_of(problem, number, slice(0, len(run))) if self.given else {}
        functions = [group.columns(values) for group in self.given]
        columns = np.column_stack([np.empty((len(run), 0)), *made, *functions])
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

    def _screen(self, problem: Problem) -> _core.Screen:
        design = problem.design(self.effects)
        return _core.Screen(design, self.load, len(self._given_parts), problem.remembered)

    def _posed(
        self, problem: Problem, whitening: Whitening
    ) -> Iterator[Callable[[], tuple[list[int], list[Any]]]]:
        """Runs as the core takes them: all, or a piece at a time where columns are given."""
        numbers = range(len(problem.runs))
        stretches = [stretches_of(problem, number, whitening) for number in numbers]
        if not self.given:
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
        """Functions without a name around rows [first, last), and the row where they begin."""
        if not self.given:
            return None, 0
        first, last, kernel = piece
        low, high = first - len(kernel) // 2, last + len(kernel) // 2
        values = values_of(problem, number, slice(low, high))
        return np.column_stack([group.columns(values) for group in self.given]), low


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
    fortran = None if given is None else np.asfortranarray(given)
    return (
        number,
        run.channels,
        run.target,
        fortran,
        from_row,
        stretches,
        edges_of(problem, number),
    )
