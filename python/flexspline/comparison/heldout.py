"""What is left of the residual on rows that a table of cells never saw.

The noise's memory must be fitted to something that neither holds the structure that is looked for
(it would pass for memory) nor lacks the noise that a fit swallows (memory would be too short). So
cells are learned on seven eighths of each run, in short blocks, and taken out of the rest, one
covariate after the other, as long as that makes the rows that were left out quieter. Cells that
hold nothing but noise make them louder and are not used.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flexspline.comparison.covariates import Covariate
from flexspline.comparison.rows import Rows
from flexspline.comparison.turning import Turning

__all__ = ["held_out_rest"]

Array = NDArray[np.float64]

FOLDS = 8
BLOCKS = 40  # of a run, dealt to the folds in turn
WORTH_IT = 0.02  # of the mean square: what a covariate has to take off
MOST_ROUNDS = 8


def held_out_rest(rows: Rows, covariates: Sequence[Covariate], turning: Turning) -> Array:
    """Return the residual without what cells and orders explain of rows never seen, (N,).

    Only rows of `rows.looked_at` are worked on; the others stay as they are.
    """
    at = np.concatenate([np.arange(*piece) for piece in rows.looked_at])
    fold, rest = _folds(rows.run[at]), rows.residual[at]
    turning = replace(turning, angle=turning.angle[at], direction=turning.direction[at])
    cells = [(covariate.cells[at], covariate.count) for covariate in covariates]
    for _ in range(MOST_ROUNDS):
        left = float(rest @ rest)
        tries = [_without(rest, *each, fold) for each in cells]
        if turning.found:
            tries.append(rest - turning.explained(rest)[0])
        best = min(tries, key=lambda made: float(made @ made))
        if float(best @ best) > (1.0 - WORTH_IT) * left:
            break
        rest = best
    made = rows.residual.copy()
    made[at] = rest
    return made


def _folds(run: NDArray[np.int32]) -> NDArray[np.int64]:
    sizes = np.bincount(run)
    first = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    place = np.arange(len(run)) - first[run]
    return np.asarray(place * BLOCKS // np.maximum(sizes[run], 1) % FOLDS)


def _without(rest: Array, cells: NDArray[np.integer], last: int, fold: NDArray[np.int64]) -> Array:
    """Take off each row the mean of its cell in the other folds."""
    both = fold * (last + 1) + np.where(cells < 0, last, cells)
    size = FOLDS * (last + 1)
    total = np.bincount(both, weights=rest, minlength=size).reshape(FOLDS, -1)
    count = np.bincount(both, minlength=size).reshape(FOLDS, -1)
    others = (total.sum(axis=0) - total) / np.maximum(count.sum(axis=0) - count, 1)
    others[:, -1] = 0.0
    return np.asarray(rest - others.ravel()[both])
