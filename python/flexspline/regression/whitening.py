"""The noise that evidence is measured by, in two steps.

A hidden effect that is slow looks like slow noise to a model of the base's residual, and would be
filtered away with it. So the first noise is that of a residual from which everything known was
taken out, and too white; the second is the restricted likelihood's (`least_squares/noise_model.py`)
beside whatever a first look with the first has found.

Many recorders smooth what they record. Little is left of it at high frequencies, and noise without
a floor would weigh that little above all else: a form that is off by a thousandth there would count
for more than half of the friction at a reversal. So some of what is left is white in any case.

And what lasts about as long as a run is no noise but a cause: beside offsets and drifts the
restricted likelihood of so slow a noise hardly falls, whatever its size, and it may claim more than
the target holds. Then the residual itself tells what is noise.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz

from flexspline.least_squares.noise_model import Chunk, noise_model
from flexspline.least_squares.problem import Problem, Run
from flexspline.regression.candidate_model import Working
from flexspline.regression.gram import (
    SINGULAR,
    TINY,
    Given,
    Sheet,
    Whitening,
    solved,
    tabulated,
)

__all__ = ["first_whitening", "restricted_whitening"]

Array = NDArray[np.float64]

LAGS = 16  # of a noise with memory, at most
WHITE = 0.01  # of what is left, that is white: no form is exact to less
READ = 1_000_000  # rows, about, that the likelihood reads of longer logs


def first_whitening(problem: Problem, sheet: Sheet) -> Whitening:
    """Noise of what all columns leave of the target."""
    plain = Whitening(np.ones(1), 1.0, problem.decimation)
    table = tabulated(problem, sheet, plain)
    beta = solved(table.total, np.arange(sheet.width))
    residuals = sheet.left_over(problem, [beta] * len(table.folds))
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


def restricted_whitening(problem: Problem, work: Working, beside: Given | None = None) -> Whitening:
    """Noise beside a model and a flexible basis, what both swallow of it accounted for.

    It starts from the residual of plain least squares beside all of them: from the model's own
    residual, what only the functions explain would begin as slow noise, and remain it. Not so
    where the target was low-passed: what the functions leave there is a narrow band, whose inverse
    lifts what the low pass has left above its cut-off over all else.
    """
    sheet = work.sheet(given=beside)
    plain = Whitening(np.ones(1), 1.0, problem.decimation)
    solved_beside = sheet if problem.lowpass is None else work.sheet()
    beta = np.zeros(sheet.width)
    own = np.arange(solved_beside.width)
    table = tabulated(problem, solved_beside, plain)
    beta[own] = solved(table.total, own)

    def chunks() -> Iterator[Chunk]:
        for starts, made in sheet.pieces(problem):
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
        residuals = sheet.left_over(problem, [beta] * len(table.folds))
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
