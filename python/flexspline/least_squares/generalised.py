"""Generalised least squares where the model is adequate, and errors of either kind of estimate.

In autocorrelated noise, e = A⁻¹ w, plain least squares treats slow noise as independent samples.
Filtered by A rows and target have white noise, and least squares on them is the best there
is ([Aitken1936]; A from the residual: [CochraneOrcutt1949]),

    β_g = (X̃ᵀX̃)⁻¹ X̃ᵀỹ,     cov β_g = σ² (X̃ᵀX̃)⁻¹,     X̃ = A X

if the model is right. If it lacks something, both are biased, each in its own way, and the plain
fit is the one that predicts. The distance between them tells [Hausman1978]:

    H = (β_g − β)ᵀ (cov β − cov β_g)⁺ (β_g − β)     χ² with the rank's degrees of freedom

over the directions that generalised least squares knows better. So do held-out rows, which a wrong
model fitted to fast changes predicts worse. The test alone lets many wrong models pass, whose
misfit looks like slow noise; the held-out rows do not.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from flexspline.errors import InputError
from flexspline.least_squares.estimate import Estimate, newton, noise_of, read_of
from flexspline.least_squares.late_load import Beside, basis_beside
from flexspline.least_squares.noise_model import Chunk, Chunks, noise_beside_own, noise_model
from flexspline.least_squares.problem import Problem, Run
from flexspline.least_squares.shapes import Tangent, filtered
from flexspline.least_squares.uncertainty import Prior, Uncertainty, parameter_uncertainty
from flexspline.least_squares.validation import cross_validate

__all__ = [
    "generalised",
    "uncertainty_of",
]

Array = NDArray[np.float64]

MOST_ROWS = 1_000_000  # above, what slow noise costs a fit is little
APART = 0.01  # share of right models that the test holds for wrong
WORSE = 1.03  # times the plain fit's error on held-out rows at most; in slow noise both vary
ADDED = 0.3  # of a direction's variance, that it may seem to add: what starts a filter is lost
TOLD = 0.02  # of a direction's variance, that generalised least squares takes off it at least


def generalised(made: Estimate) -> Estimate | None:
    """Return the estimate by generalised least squares; None where the plain one is to stay.

    That is where the noise has no memory, where rows are weighed otherwise (low pass, robust,
    priors), where logs are long or so short that their noise is not known, where a bound is in the
    way, where nothing is gained, and where the two are too far apart for a right model or the plain
    one predicts better.
    """
    problem, tangent = made.tangent.problem, made.tangent
    rows = sum(run.counted for run in problem.runs)
    weighed = problem.lowpass is not None or tangent.weights is not None or len(made.prior_rows)
    if weighed or rows > MOST_ROWS or not made.basis.size:
        return None
    plain = made.uncertainty
    if not plain.noise.order:
        return None
    best = newton(replace(made, denominator=plain.noise.denominator))
    try:
        if best is None or not _same(made, best, plain, best.uncertainty):
            return None
        return best if _left_out(best) <= WORSE * _left_out(made) else None
    except InputError:  # too few rows are left once filters have started
        return None


def _same(plain: Estimate, other: Estimate, of_plain: Uncertainty, of_other: Uncertainty) -> bool:
    """Whether two estimates are as near to each other as those of a right model (Hausman)."""
    step = np.linalg.pinv(plain.basis) @ (_values(other) - _values(plain))
    values, vectors = np.linalg.eigh(of_plain.core)
    seen = values > 1e-12 * values[-1]
    to_one = vectors[:, seen] / np.sqrt(values[seen])
    gained, ways = np.linalg.eigh(to_one.T @ (of_plain.core - of_other.core) @ to_one)
    told = gained > TOLD
    if not told.any() or (gained < -ADDED).any():
        return False
    apart = ways[:, told].T @ (to_one.T @ step)
    return bool(np.sum(apart**2 / gained[told]) <= chi2.isf(APART, int(told.sum())))


def _left_out(made: Estimate) -> float:
    """RMS of what a fit to the others leaves of each fold."""
    residuals = np.concatenate(cross_validate(made).residuals)
    return float(np.sqrt(np.nanmean(residuals**2)))


def _values(made: Estimate) -> Array:
    """Of fitted coefficients and free shapes, in this order."""
    shapes = [shape.value(made.linear.effects) for shape in made.free_shapes]
    return np.concatenate([made.linear.coefficients[made.fitted], shapes])


def uncertainty_of(made: Estimate, columns: Sequence[Array] | None = None) -> Uncertainty:
    """Return the errors of fitted coefficients and free shapes, in this order.

    `columns`: one of each run, (N,), beside which the estimate was made; its error comes last.
    """
    if made.denominator is not None:
        return _generalised(made, made.denominator)
    every, basis, known = read_of(made), made.basis, made.prior_rows
    tangent: Tangent | Beside = made.tangent
    if columns is not None:
        tangent = Beside(made.tangent, tuple(columns))
        basis = basis_beside(made, columns)
        known = np.hstack([known, np.zeros((len(known), 1))])
    problem, chunks = made.tangent.problem, tangent.some(every)
    if problem.projected:
        noise = noise_beside_own(tangent, problem, basis)
    else:
        noise = noise_model(chunks, basis, decimation=problem.decimation, offsets=problem.centred)
    prior = None
    if len(known):  # weighed against every row, while the noise model may skip some
        scale = np.sqrt(noise.decimation)
        errors = np.full(len(known), np.sqrt(made.noise_variance) / scale)
        prior = Prior(known / scale, errors)
    rows = sum(run.counted for run in problem.runs) // noise.decimation
    if every > 1:
        return parameter_uncertainty(chunks, basis, noise, prior, rows)
    left_out = sum(last - first for run in problem.runs for first, last in _rows_left_out(run))
    chunks = _going_on(tangent, problem) if left_out else chunks
    left_out //= noise.decimation
    return parameter_uncertainty(chunks, basis, noise, prior, left_out=left_out)


def _rows_left_out(run: Run) -> list[tuple[int, int]]:
    """Row ranges [first, last) between rows that count, through which the recording goes on."""
    return [
        (end, start)
        for (_, end), (start, _) in pairwise(run.stretches)
        if start > end and any(a < end and start < b for a, b in run.whole or ())
    ]


def _going_on(tangent: Tangent | Beside, problem: Problem) -> Chunks:
    """The rows of a fit, and rows of nothing where some inside a run do not count.

    Noise goes on while rows are left out, and couples what stands on both sides.
    """

    def chunks() -> Iterator[Chunk]:
        gaps = [{start: start - end for end, start in _rows_left_out(run)} for run in problem.runs]
        for number, rows, chunk in tangent.pieces():
            gap = gaps[number].get(rows.start, 0)
            if gap:
                nothing = np.zeros(gap)
                on = np.zeros(gap, dtype=bool)
                yield Chunk(np.zeros((gap, chunk.rows.shape[1])), nothing, on)
                chunk = replace(chunk, starts=np.zeros(len(chunk.residual), dtype=bool))
            yield chunk

    return chunks


def _generalised(made: Estimate, denominator: Array) -> Uncertainty:
    """Errors on the filtered rows; what else is told of the noise is that of the rows as such."""
    noise = noise_of(made)
    plain = parameter_uncertainty(made.tangent, made.basis, noise)
    chunks = filtered(made.tangent, denominator)
    found = parameter_uncertainty(chunks, made.basis, noise_model(chunks, made.basis))
    freedom = np.minimum(found.degrees_of_freedom, plain.degrees_of_freedom)
    return replace(plain, core=found.core, degrees_of_freedom=freedom)
