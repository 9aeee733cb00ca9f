"""The noise that evidence is measured by, in two steps.

A hidden effect that is slow looks like slow noise to a model of the base's residual, and would be
filtered away with it. So the first noise is that of a residual from which everything known was
taken out, and too white; the second is the restricted likelihood's (`fit/noise_model.py`) beside
whatever a lax search with the first has found, among names and among functions without one.

Many recorders smooth what they record. Little is left of it at high frequencies, and noise without
a floor would weigh that little above all else: a form that is off by a thousandth there would count
for more than half of the friction at a reversal. So some of what is left is white in any case.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from flexspline.discovery.nameless import Nameless
from flexspline.discovery.settings import SETTINGS, TINY
from flexspline.discovery.sheet import Sheet
from flexspline.discovery.table import solved, tabulated
from flexspline.discovery.whitening import Whitening, rough_whitening
from flexspline.discovery.working import Working
from flexspline.fit.noise_model import Chunk, noise_model
from flexspline.fit.problem import Problem

__all__ = ["first_whitening", "restricted_whitening"]

Array = NDArray[np.float64]


def first_whitening(problem: Problem, sheet: Sheet) -> Whitening:
    """Noise of what all columns leave of the target."""
    plain = Whitening(np.ones(1), 1.0, problem.decimation)
    table = tabulated(problem, sheet, plain)
    beta = solved(table.total, np.arange(sheet.width))
    residuals = sheet.left_over(problem, [beta] * len(table.folds))
    return _above_rounding(problem, rough_whitening(residuals, problem.runs, problem.decimation))


def restricted_whitening(
    problem: Problem, work: Working, beside: Sequence[Nameless] = ()
) -> Whitening:
    """Noise beside a model and functions without a name, what both swallow of it accounted for.

    It starts from the residual of plain least squares beside all of them: from the model's own
    residual, what only the functions explain would begin as slow noise, and remain it. Not so
    where the target was low-passed: what the functions leave there is a narrow band, whose inverse
    lifts what the low pass has left above its cut-off over all else.
    """
    sheet = work.sheet(functions=beside)
    beta = np.append(work.coefficients[work.free], np.zeros(sheet.width - len(work.free)))
    if problem.lowpass is None:
        plain = Whitening(np.ones(1), 1.0, problem.decimation)
        beta = solved(tabulated(problem, sheet, plain).total, np.arange(sheet.width))

    def chunks() -> Iterator[Chunk]:
        for starts, made in sheet.pieces(problem):
            begun = np.zeros(len(made), dtype=bool)
            begun[0] = starts
            yield Chunk(made[:, :-1], made[:, -1] - made[:, :-1] @ beta, begun, None)

    rows = sum(run.counted for run in problem.runs)
    noise = noise_model(
        chunks,
        _basis(chunks),
        max_order=SETTINGS.lags,
        every=max(1, rows // round(SETTINGS.rows / SETTINGS.negligible)),
        decimation=problem.decimation,
        floor=SETTINGS.negligible,
    )
    made = Whitening(noise.denominator, noise.innovation_variance, problem.decimation)
    return _above_rounding(problem, made)


def _above_rounding(problem: Problem, noise: Whitening) -> Whitening:
    """The noise, or white noise of the size of rounding where there is less than that."""
    squares = [float(run.target @ run.target) for run in problem.runs]
    floor = SETTINGS.singular**2 * sum(squares) / sum(len(run) for run in problem.runs)
    if noise.variance > floor:
        return noise
    return Whitening(np.ones(1), floor, noise.decimation)


def _basis(chunks: Callable[[], Iterator[Chunk]]) -> Array:
    """Directions that the rows determine, (F + S, K), with rows @ basis orthonormal."""
    products = np.asarray(sum(chunk.rows.T @ chunk.rows for chunk in chunks()))
    scale = np.sqrt(np.maximum(np.diag(products), TINY))
    values, vectors = np.linalg.eigh(products / np.outer(scale, scale))
    seen = values > SETTINGS.singular * values[-1]
    return np.asarray(vectors[:, seen] / np.sqrt(values[seen]) / scale[:, None])
