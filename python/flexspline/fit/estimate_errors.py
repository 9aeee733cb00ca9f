"""Errors of an estimate, by plain or by generalised least squares."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flexspline.fit.estimate import Estimate, noise_of, read_of
from flexspline.fit.late_load import Beside, basis_beside
from flexspline.fit.noise_model import noise_model
from flexspline.fit.prewhitening import filtered
from flexspline.fit.uncertainty import Prior, Uncertainty, parameter_uncertainty

__all__ = ["uncertainty_of"]

Array = NDArray[np.float64]


def uncertainty_of(made: Estimate, columns: Sequence[Array] | None = None) -> Uncertainty:
    """Return the errors of fitted coefficients and free shapes, in this order.

    `columns`: one of each run, (N,), beside which the estimate was made; its error comes last.
    """
    if made.denominator is not None:
        return _generalised(made, made.denominator)
    every, basis, known = read_of(made), made.basis, made.prior_rows
    chunks = made.tangent.some(every)
    if columns is not None:
        chunks = Beside(made.tangent, tuple(columns)).some(every)
        basis = basis_beside(made, columns)
        known = np.hstack([known, np.zeros((len(known), 1))])
    problem = made.tangent.problem
    noise = noise_model(chunks, basis, decimation=problem.decimation, offsets=problem.centred)
    prior = None
    if len(known):  # weighed against every row, while the noise model may skip some
        scale = np.sqrt(noise.decimation)
        errors = np.full(len(known), np.sqrt(made.noise_variance) / scale)
        prior = Prior(known / scale, errors)
    rows = sum(run.counted for run in problem.runs) // noise.decimation
    return parameter_uncertainty(chunks, basis, noise, prior, rows if every > 1 else None)


def _generalised(made: Estimate, denominator: Array) -> Uncertainty:
    """Errors on the filtered rows; what else is told of the noise is that of the rows as such."""
    noise = noise_of(made)
    plain = parameter_uncertainty(made.tangent, made.basis, noise)
    chunks = filtered(made.tangent, denominator)
    found = parameter_uncertainty(chunks, made.basis, noise_model(chunks, made.basis))
    freedom = np.minimum(found.degrees_of_freedom, plain.degrees_of_freedom)
    return replace(plain, core=found.core, degrees_of_freedom=freedom)
