"""What is left out in turn: a fold of the runs, or of each run where there are few."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexspline.output_error.cost import Cost
from flexspline.output_error.search import Descent, best_of, descend

__all__ = ["Folds", "folds_of", "refitted"]

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
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
