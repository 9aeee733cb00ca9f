"""What noise of the reference and of the thermometer does to the sensitivity.

Least squares takes the rows X for exact. With errors U of their own in them, independent from row
to row, coefficients β come out beside the truth by

    −(XᵀX − S)⁻¹ S β,      S = E[UᵀU] = Σ_t σ_τ² e_s e_sᵀ + σ_T² j_t j_tᵀ,     j_t = ∂(row t)/∂T

([Carroll2006], chapter 3). In the basis B of the rows, XB orthonormal, the eigenvalues λ of BᵀSB
are the shares of noise in the directions that the runs determine, and each is off by λ/(1 − λ).
Where load and temperature change together, what is left of the load beside the columns of the drift
is small, and noise that is nothing beside the load is much beside that: a sensitivity may then be
wrong by many standard errors.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flexspline.calibration.regression import Regression, drift_columns
from flexspline.calibration.runs import CalibrationRun
from flexspline.calibration.thermal import SAME_TEMPERATURE
from flexspline.logs.quantisation import quantum, white_noise

__all__ = ["PART_OF_ERROR", "lost_to_noise", "lost_to_reference"]

Array = NDArray[np.float64]

PART_OF_ERROR = 0.5
"""Of the standard error, that a bias may have: intervals of 95 % then cover 92 %."""

MOST_NOISE = 0.99  # share that is reckoned with: all of a direction may be noise


def lost_to_reference(runs: Sequence[CalibrationRun], made: Regression) -> float:
    """Share of V per Nm that noise of the reference takes off; it adds as much to Nm per V."""
    loaded = [run for run in runs if run.loaded]
    noise = max(white_noise(run.torque) for run in loaded)
    inverse = float(made.solution.basis[0] @ made.solution.basis[0])
    return noise**2 * sum(len(run) for run in loaded) * inverse


def lost_to_noise(runs: Sequence[CalibrationRun], made: Regression) -> float:
    """What noise of reference and thermometer together make of V per Nm, less the truth, V/Nm."""
    solution = made.solution
    squares = np.zeros((len(made.coefficients), len(made.coefficients)))
    for run in runs:
        squares += _noise_squares(run, made)
    basis = solution.basis
    share, turned = np.linalg.eigh(basis.T @ squares @ basis)
    share = np.minimum(share, MOST_NOISE)
    lengths = solution.lengths
    told = np.linalg.lstsq(basis * lengths[:, None], made.coefficients * lengths, rcond=None)[0]
    off = turned @ (share / (1.0 - share) * (turned.T @ told))
    return -float(basis[0] @ off)


def _noise_squares(run: CalibrationRun, made: Regression) -> Array:
    """(P, P), this run's share of S."""
    shape = made.shape
    squares = np.zeros((len(made.coefficients), len(made.coefficients)))
    if run.loaded:
        squares[0, 0] = len(run) * white_noise(run.torque) ** 2
    if run.temperature is None or not shape.degree:
        return squares
    powers = np.column_stack([np.ones(len(run)), drift_columns(run, shape)[:, : shape.degree - 1]])
    slopes = powers * np.arange(1, shape.degree + 1)
    own = slice(2, 2 + shape.degree)
    squares[own, own] = _error_of(run.temperature) ** 2 * (slopes.T @ slopes)
    return squares


def _error_of(temperature: Array) -> float:
    """Noise of a thermometer or of its rounding, K; a coarser step is a list of temperatures."""
    step = quantum(temperature)
    rounding = step / np.sqrt(12.0) if step < SAME_TEMPERATURE else 0.0
    return max(white_noise(temperature), float(rounding))
