"""Errors of an estimate, by plain or by generalised least squares."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flexspline.fit.estimate import Estimate, noise_of, read_of
from flexspline.fit.noise_model import noise_model
from flexspline.fit.prewhitening import filtered
from flexspline.fit.uncertainty import Prior, Uncertainty, parameter_uncertainty

__all__ = ["uncertainty_of"]

Array = NDArray[np.float64]


def uncertainty_of(made: Estimate) -> Uncertainty:
    """Return the errors of fitted coefficients and free shapes, in this order."""
    if made.denominator is not None:
        return _generalised(made, made.denominator)
    noise = noise_of(made)
    prior = None
    if len(made.prior_rows):  # weighed against every row, while the noise model may skip some
        scale = np.sqrt(noise.decimation)
        errors = np.full(len(made.prior_rows), np.sqrt(made.noise_variance) / scale)
        prior = Prior(made.prior_rows / scale, errors)
    every = read_of(made)
    chunks = made.tangent.some(every)
    rows = sum(run.counted for run in made.tangent.problem.runs) // noise.decimation
    return parameter_uncertainty(chunks, made.basis, noise, prior, rows if every > 1 else None)


def _generalised(made: Estimate, denominator: Array) -> Uncertainty:
    """Errors on the filtered rows; what else is told of the noise is that of the rows as such."""
    noise = noise_of(made)
    plain = parameter_uncertainty(made.tangent, made.basis, noise)
    chunks = filtered(made.tangent, denominator)
    found = parameter_uncertainty(chunks, made.basis, noise_model(chunks, made.basis))
    freedom = np.minimum(found.degrees_of_freedom, plain.degrees_of_freedom)
    return replace(plain, core=found.core, degrees_of_freedom=freedom)
