"""The distance between simulated and measured motion, and how it changes with what is searched."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexspline.forward.drive import DriveInputs
from flexspline.output_error.space import Space
from flexspline.part import Part

__all__ = ["Cost"]

Array = NDArray[np.float64]

STEP = 8e-3
"""Of a coordinate, for differences. Where a joint sticks one row longer, its motion jumps a little:
a step must be wide enough to see the slope behind such jumps."""
FAR = 10.0  # rad: what counts for a motion that runs away


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
        """(N, P), by differences to one side, or to both (twice the cost, and more exact)."""
        low, high = self.space.bounds
        pairs = []
        for k in range(len(point)):
            side = STEP if point[k] + STEP <= high[k] else -STEP
            first, last = point.copy(), point.copy()
            first[k] = np.clip(point[k] - side, low[k], high[k]) if central else point[k]
            last[k] = np.clip(point[k] + side, low[k], high[k])
            pairs.append((first, last))
        ends = [end for pair in pairs for end in pair] if central else [p[1] for p in pairs]
        made = self._together(ends if central else [point, *ends])
        columns = []
        for k, (first, last) in enumerate(pairs):
            before, after = (made[2 * k], made[2 * k + 1]) if central else (made[0], made[k + 1])
            width = last[k] - first[k]
            columns.append((after - before) / width if width else np.zeros(len(before)))
        return np.stack(columns, axis=1)

    def by_run(self, point: Array) -> list[Array]:
        """Simulated − measured of every row, (N,) for each run."""
        return self._pool([point])

    def only(self, counts: Sequence[NDArray[np.bool_]]) -> Cost:
        """Return the cost of other rows; a run of which none counts is not driven."""
        kept = [(run, count) for run, count in zip(self.runs, counts, strict=True) if count.any()]
        return replace(self, runs=[run for run, _ in kept], counts=[count for _, count in kept])

    def _together(self, points: Sequence[Array]) -> list[Array]:
        made = self._pool(points)
        size = len(self.runs)
        found = []
        for k in range(len(points)):
            pieces = zip(made[k * size : (k + 1) * size], self.counts, strict=True)
            found.append(np.concatenate([piece[count] for piece, count in pieces]))
        return found

    def _pool(self, points: Sequence[Array]) -> list[Array]:
        tasks = [
            (part, law, number)
            for part, law in map(self.space.at, points)
            for number in range(len(self.runs))
        ]
        self.tick()
        if self.threads == 1:
            return [self._missed(*task) for task in tasks]
        with ThreadPoolExecutor(self.threads) as pool:
            return list(pool.map(lambda task: self._missed(*task), tasks))

    def _missed(self, part: Part, law: Mapping[str, float], number: int) -> Array:
        run = self.runs[number]
        servo = None if run.servo is None else run.servo.with_fields(law)
        rest = run.run(part, self.steps, servo=servo)["position"] - run.measured
        far = ~np.isfinite(rest) & np.isfinite(run.measured)
        return np.where(far, FAR, np.clip(rest, -FAR, FAR))
