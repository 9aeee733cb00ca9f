"""The Gaussian likelihood of a fit under its autocorrelated noise, and AIC and BIC from it.

The noise of a fit is autoregressive of order p (`noise_model.py`): e = A⁻¹ w. The first rows of a
stretch are predicted by the lower orders that follow from A by Levinson's recursion downwards, so
that no row is lost and models with noise of other orders are judged by the same rows. With ε_t the
error of that prediction and s_t its variance in units of σ² (1 from row p on),

    −2 ln L = N ln(2π σ²) + Σ ln s_t + Σ ε_t² / (s_t σ²)

At its maximum over σ² and over the parameters β, which is that of generalised least squares,

    −2 ln L = N (ln(2π S / N) + 1) + Σ ln s_t,     S = min over β of Σ ε_t² / s_t

The minimum is one Gauss–Newton step away from the estimate, on its tangent rows: exact where the
model is linear. Least squares that treat slow noise as white would else be charged for what they
do not know of it, in each model differently. With k the effective number of parameters,

    AIC = −2 ln L + 2 k,     BIC = −2 ln L + k ln N

k counts directions that the data determine, (X̃ᵀX̃ + R)⁻¹ X̃ᵀX̃ by its trace where priors add R,
the p coefficients of the noise, and σ². Sources: [Akaike1974], [Schwarz1978]; the whitening is that
of [Aitken1936].
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import groupby
from math import inf, log, pi
from operator import itemgetter
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.signal import lfilter

from flexspline.errors import InputError
from flexspline.least_squares.late_load import Beside, basis_beside
from flexspline.least_squares.noise_model import Chunks, NoiseModel, beside_own, pieces

if TYPE_CHECKING:
    from flexspline.least_squares.estimate import Estimate
    from flexspline.least_squares.result import Fit

__all__ = ["Likelihood", "likelihood_of", "why_none"]

Array = NDArray[np.float64]

DEPENDENT = 1e-13  # of the largest eigenvalue of the scaled products: directions that are none


@dataclass(frozen=True)
class Likelihood:
    """How likely the target is under a fit and its noise.

    Parameters
    ----------
    log_likelihood : natural logarithm of the density of the N rows; its unit depends on that of the
        target, so only differences between fits to the same rows of one target mean something.
    parameters : effective number, with those of the noise.
    noise_order : p, of the autoregressive noise.
    rows : N, that the likelihood is of; every n-th of a fit with a low pass.
    of_noise_in_all : whether the noise was read in all runs. Where terms of each of many runs are
        taken out it is read in some of them (`noise_model.py`), and ln L is some tens below its
        maximum (9 to 17 in 18 simulated runs): to be compared with that of such fits alone.
    """

    log_likelihood: float
    parameters: float
    noise_order: int
    rows: int
    of_noise_in_all: bool = True

    @property
    def aic(self) -> float:
        """Akaike's criterion; the lower of two is of the model that predicts better."""
        return -2.0 * self.log_likelihood + 2.0 * self.parameters

    @property
    def bic(self) -> float:
        """Schwarz's criterion; the lower of two is of the more probable model."""
        return -2.0 * self.log_likelihood + self.parameters * log(self.rows)


def likelihood_of(fit: Fit) -> Likelihood:
    """Return the likelihood of a fit under its noise.

    Raises
    ------
    InputError
        Where it has none, see `why_none`.
    """
    made, reason = fit.solved, why_none(fit)
    if made is None or reason:
        raise InputError(f"the fit has no likelihood, AIC or BIC: {reason}")
    noise = fit.uncertainty.noise
    sums = _summed(fit, made, noise)
    left, used = _minimum(sums.products, *_prior(made, noise, len(sums.products) - 1))
    used += sums.offsets + noise.order + 1
    everywhere = not made.tangent.problem.projected
    if not left > 0.0:
        return Likelihood(inf, used, noise.order, sums.rows, everywhere)
    twice = sums.rows * (log(2.0 * pi * left / sums.rows) + 1.0) + sums.logarithms
    return Likelihood(-0.5 * twice, used, noise.order, sums.rows, everywhere)


def why_none(fit: Fit) -> str:
    """Return why a fit has no Gaussian likelihood of its target, "" where it has one."""
    if fit.simulation is not None:
        return "it is a fit of the motion, which does not maximise the target's likelihood"
    if fit.solved is None:
        return "it does not hold the rows that it was made from; fit the runs again"
    if fit.solved.tangent.weights is not None:
        return "robust weights are no Gaussian noise; fit without robust"
    return ""


@dataclass(eq=False)
class _Sums:
    """Products of whitened [rows @ basis, residual], (K + 1, K + 1), Σ ln s, N, offsets."""

    products: Array
    logarithms: float = 0.0
    rows: int = 0
    offsets: int = 0


def _summed(fit: Fit, made: Estimate, noise: NoiseModel) -> _Sums:
    problem, basis = made.tangent.problem, made.basis
    tangent = made.tangent if fit.late is None else Beside(made.tangent, fit.late.columns)
    if fit.late is not None:
        basis = basis_beside(made, fit.late.columns)
    whitener = _Whitener(noise)
    width = basis.shape[1] + 1
    sums = _Sums(np.zeros((width, width)))
    every = beside_own(tangent.pieces(), problem) if problem.projected else tangent.pieces()
    for number, group in groupby(every, key=itemgetter(0)):
        chunks: Chunks = partial(map, itemgetter(2), group)
        if problem.projected:
            many = problem.own_basis(number).rows.shape[1]
            beside = pieces(chunks, block_diag(basis, np.eye(many)), noise.decimation)
            _add_beside_own(sums, beside, whitener)
            sums.offsets += many
            continue
        offset = np.zeros(width + 1)  # products of the run's own constant with all others
        for starts, rows, residual, _ in pieces(chunks, basis, noise.decimation):
            z = np.column_stack([rows, residual, np.ones(len(rows))])
            white, logarithms = whitener(starts, z)
            own = white[:, :-1]
            sums.products += own.T @ own
            sums.logarithms += logarithms
            sums.rows += len(z)
            offset += white.T @ white[:, -1]
        if problem.centred:  # an offset of each run is a parameter that stands in no row
            sums.products -= np.outer(offset[:-1], offset[:-1]) / offset[-1]
            sums.offsets += 1
    return sums


def _add_beside_own(
    sums: _Sums, blocks: Iterable[tuple[bool, Array, Array, Array]], whitener: _Whitener
) -> None:
    """Add the rows of one run beside terms of its own, whose columns stand behind all others."""
    width, found = len(sums.products), []
    for starts, rows, residual, _ in blocks:
        z = np.column_stack([rows[:, : width - 1], residual, rows[:, width - 1 :]])
        white, logarithms = whitener(starts, z)
        found.append(white.T @ white)
        sums.logarithms += logarithms
        sums.rows += len(z)
    whole = np.sum(found, axis=0)
    shared, own = slice(None, width), slice(width, None)
    inverse = np.linalg.pinv(whole[own, own], hermitian=True)
    sums.products += whole[shared, shared] - whole[shared, own] @ inverse @ whole[own, shared]


class _Whitener:
    """Filters rows so that autoregressive noise becomes white with the variance σ²."""

    def __init__(self, noise: NoiseModel) -> None:
        self._predictors = list(_predictors(noise.denominator))
        self._order = noise.order
        self._position, self._tail = 0, np.empty((0, 0))

    def __call__(self, starts: bool, z: Array) -> tuple[Array, float]:
        """Rows (n, K) filtered, and Σ ln s of these."""
        if starts:
            self._position, self._tail = 0, np.empty((0, z.shape[1]))
        both = np.concatenate([self._tail, z])
        before, order = len(self._tail), self._order
        white = lfilter(self._predictors[-1][0], [1.0], both, axis=0)[before:]
        logarithms = 0.0
        for k in range(self._position, min(order, self._position + len(z))):
            predictor, variance = self._predictors[k]
            at = before + k - self._position
            white[k - self._position] = predictor @ both[at - k : at + 1][::-1] / variance**0.5
            logarithms += log(variance)
        self._position += len(z)
        self._tail = both[max(0, len(both) - order) :]
        return white, logarithms


def _predictors(denominator: Array) -> Iterator[tuple[Array, float]]:
    """Prediction errors [1, −φ] of order 0 to p, and their variances in units of σ²."""
    a, variance = denominator, 1.0
    found = [(a, variance)]
    while len(a) > 1:
        kept = 1.0 - a[-1] ** 2
        a, variance = (a - a[-1] * a[::-1])[:-1] / kept, variance / float(kept)
        found.append((a, variance))
    return reversed(found)


def _prior(made: Estimate, noise: NoiseModel, width: int) -> tuple[Array, Array]:
    """What priors add to the products, (K, K), and to those with the residual, (K,)."""
    known = made.prior_rows @ made.basis
    if not len(known):
        return np.zeros((width, width)), np.zeros(width)
    limits, fitted = made.constraints, made.fitted
    at = np.isfinite(limits.prior[fitted])
    missed = (limits.prior - made.linear.coefficients)[fitted][at] / limits.prior_error[fitted][at]
    scale = noise.innovation_variance**0.5
    known = np.pad(known, ((0, 0), (0, width - known.shape[1])))  # the delay of a load has none
    rows = scale / made.noise_variance**0.5 * known
    return rows.T @ rows, rows.T @ (scale * missed)


def _minimum(products: Array, prior: Array, pull: Array) -> tuple[float, float]:
    """Least squares that the rows leave, and how many parameters that takes."""
    rows, across, squares = products[:-1, :-1], products[:-1, -1], float(products[-1, -1])
    if not len(rows):
        return squares, 0.0
    whole = rows + prior
    lengths = np.sqrt(np.diag(whole))
    lengths = np.where(lengths > 0.0, lengths, 1.0)
    values, vectors = np.linalg.eigh(whole / np.outer(lengths, lengths))
    seen = values > DEPENDENT * values[-1]
    inverse = vectors[:, seen] / lengths[:, None] / np.sqrt(values[seen])
    step = inverse @ (inverse.T @ (across + pull))
    left = squares - 2.0 * float(step @ across) + float(step @ rows @ step)
    return left, float(np.trace(inverse.T @ rows @ inverse))
