"""How well the other folds foretell one, with how well they can know it counted.

A fold may go where no other fold went: a joint's angle, a temperature. There a fit to the others
says little, and its plain error would condemn every right effect. The density that it foretells,
N(X_f β, σ² (1 + X_f A⁻¹ X_fᵀ)), says how little. With A = G + Λ (products over σ², prior), b = Xᵀy,

    2 ln p(y_f | others) = m(all) − m(all but f),     m = bᵀ A⁻¹ b − ln |A|     (+ y_f alone)

Columns on trial have a prior: in columns of length one their coefficients have the mean square
gain / count. Source: Bishop 2006, Pattern Recognition and Machine Learning, section 3.5.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexspline.discovery.settings import SETTINGS, TINY
from flexspline.discovery.table import Columns, Table

__all__ = ["foretold_gain", "prior_of"]

Array = NDArray[np.float64]

FIRM = SETTINGS.singular
"""Of a column's squares: what keeps columns apart that depend on each other."""


def foretold_gain(table: Table, model: Columns, beside: Columns, gain: float) -> Array:
    """Return the rise (F,) of 2 ln p of each fold by columns beside a model, χ² where all is well.

    `gain`: of these columns beside the model, in χ².
    """
    both = np.concatenate([model, beside])
    ridge = np.append(np.full(len(model), FIRM), np.full(len(beside), prior_of(beside, gain)))
    return _foretold(table, both, ridge) - _foretold(table, model, ridge[: len(model)])


def prior_of(columns: Columns, gain: float) -> float:
    """Return the prior's share of the squares of each column."""
    return max(len(columns) / max(gain, 1.0), FIRM)


def _foretold(table: Table, columns: Columns, ridge: Array) -> Array:
    total = table.total
    picked = np.append(columns, len(total) - 1)
    total, folds = total[np.ix_(picked, picked)], table.folds[:, picked][:, :, picked]
    scale = np.sqrt(np.maximum(np.diag(total)[:-1], TINY))
    whole = _mass(total, scale, ridge)
    return np.array([whole - _mass(total - fold, scale, ridge) for fold in folds])


def _mass(products: Array, scale: Array, ridge: Array) -> float:
    """bᵀ A⁻¹ b − ln |A|."""
    inside = products[:-1, :-1] / np.outer(scale, scale) + np.diag(ridge)
    values, vectors = np.linalg.eigh(inside)
    values = np.maximum(values, SETTINGS.little * FIRM)
    along = vectors.T @ (products[:-1, -1] / scale)
    return float(np.sum(along**2 / values) - np.sum(np.log(values)))
