"""Least squares whose errors hold under noise with a memory: blocks of time are left out."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

BLOCKS = 16


def solve_with_error(design: Array, target: Array) -> tuple[Array, Array]:
    """Coefficients and their standard errors from the jackknife over sixteen blocks of rows.

    Parameters
    ----------
    design : array (N, M), any units
    target : array (N,), any unit

    Returns
    -------
    Coefficients (M,) and errors (M,), in target unit per column unit.
    """
    scale = np.sqrt(np.mean(design**2, axis=0))
    scale[scale == 0] = 1.0
    scaled = design / scale
    edges = np.linspace(0, len(target), BLOCKS + 1).astype(int)
    grams = np.array([scaled[a:b].T @ scaled[a:b] for a, b in pairwise(edges)])
    rights = np.array([scaled[a:b].T @ target[a:b] for a, b in pairwise(edges)])
    whole = _solve(grams.sum(axis=0), rights.sum(axis=0))
    left_out = np.array(
        [
            _solve(grams.sum(axis=0) - g, rights.sum(axis=0) - r)
            for g, r in zip(grams, rights, strict=True)
        ]
    )
    spread = (BLOCKS - 1) / BLOCKS * np.sum((left_out - left_out.mean(axis=0)) ** 2, axis=0)
    return whole / scale, np.sqrt(spread) / scale


def _solve(gram: Array, right: Array) -> Array:
    """Minimum-norm solution: confounded columns share what they cannot tell apart."""
    return np.asarray(np.linalg.pinv(gram, rcond=1e-10, hermitian=True) @ right)
