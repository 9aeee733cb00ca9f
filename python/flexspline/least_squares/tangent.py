"""The fit seen from close by: rows, and how the prediction bends with the shapes.

Near its optimum a fit with shapes is a linear one with a column more for each shape,
∂(prediction)/∂shape. Errors, cross-validation and robust weights all use these rows, a piece of a
log at a time.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby, islice
from operator import itemgetter

import numpy as np
from numpy.typing import NDArray

from flexspline.effects import Effect
from flexspline.least_squares.names import ShapeParameter
from flexspline.least_squares.noise_model import Chunk, Chunks
from flexspline.least_squares.problem import Problem
from flexspline.parallel import in_order

__all__ = ["Tangent"]

Array = NDArray[np.float64]

STEP = 1e-4  # of a shape, relative: the central difference is good to 1e-8


@dataclass(frozen=True)
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
        low = max(value * (1.0 - STEP), shape.info.lower)
        high = min(value * (1.0 + STEP), shape.info.upper)
        ends = [
            self.problem.design(shape.set(self.effects, at)).predict(channels, size, coefficients)
            for at in (low, high)
        ]
        return np.asarray((ends[1] - ends[0]) / (high - low))

    @property
    def _whole_runs(self) -> bool:
        """Whether rows need all rows before them: filters and memory do."""
        remembers = any(effect.info.remembers for effect in self.effects)
        return remembers or self.problem.lowpass is not None or self.problem.centred

    def whole(self, number: int) -> Array:
        """Columns of `_rows` of a whole run, low-passed as the target is."""
        run = self.problem.runs[number]
        return self.problem.smooth(run, self._rows(number, 0, len(run)))

    def _whole_run(self, number: int) -> Array:
        run, rows = self.problem.runs[number], self.whole(number)
        if not self.problem.centred:
            return rows
        rows = run.centred(rows)
        rows[:, -1] += run.mean(run.target)
        return rows
