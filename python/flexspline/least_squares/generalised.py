"""Generalised least squares: rows and target as slow noise sees them, where the model allows it.

In noise with memory, e = A⁻¹ w, plain least squares counts the slow part of the noise over and
over. Filtered by A rows and target have white noise, and least squares on them is the best there
is ([Aitken1936]; A from the residual: [CochraneOrcutt1949]),

    β_g = (X̃ᵀX̃)⁻¹ X̃ᵀỹ,     cov β_g = σ² (X̃ᵀX̃)⁻¹,     X̃ = A X

if the model is right. If it lacks something, both miss it, each in its own way, and the plain fit
is the one that predicts. Whether that is so shows in how far they are apart [Hausman1978]:

    H = (β_g − β)ᵀ (cov β − cov β_g)⁺ (β_g − β)     χ² with the rank's degrees of freedom

over the directions that generalised least squares knows better, and in rows that neither has seen,
which a wrong model fitted to fast changes foretells worse. The test alone lets many wrong models
pass, whose misfit looks like slow noise; the left-out rows do not.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from flexspline.errors import InputError
from flexspline.least_squares.estimate import Estimate, newton
from flexspline.least_squares.uncertainty import Uncertainty
from flexspline.least_squares.validation import cross_validate

__all__ = ["generalised"]

Array = NDArray[np.float64]

MOST_ROWS = 1_000_000  # above, what slow noise costs a fit is little
APART = 0.01  # share of right models that the test holds for wrong
FORETELLS = 1.03  # times the plain fit's error on left-out rows at most; in slow noise both vary
ADDED = 0.3  # of a direction's variance, that it may seem to add: what starts a filter is lost
TOLD = 0.02  # of a direction's variance, that generalised least squares takes off it at least


def generalised(made: Estimate) -> Estimate | None:
    """Return the estimate by generalised least squares; None where the plain one is to stay.

    That is where the noise has no memory, where rows are weighed otherwise (low pass, robust,
    priors), where logs are long or so short that their noise is not known, where a bound is in the
    way, where nothing is gained, and where the two are too far apart for a right model or the plain
    one foretells more.
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
        return best if _left_out(best) <= FORETELLS * _left_out(made) else None
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
