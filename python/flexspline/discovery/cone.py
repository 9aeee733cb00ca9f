"""Evidence for coefficients that all have one sign: χ² of a cone.

Springs of a hysteresis all brake, so what they explain lies in the cone that their columns span
with coefficients of one sign. Chance finds less in a cone than in the whole space: with G the
products of the columns and c ~ N(0, G) their pulls where nothing is there,

    P(gain > s) = Σ_j w_j P(χ²_j > s),     w_j: probability that j coefficients are not zero

(chi-bar squared). Columns that are alike span a narrow cone, in which nearly one is free. Source:
Silvapulle & Sen 2005, Constrained Statistical Inference, section 3.4.
"""

from __future__ import annotations

from functools import cache
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, nnls
from scipy.special import chdtrc, chdtri

from flexspline.discovery.settings import SETTINGS, TINY
from flexspline.discovery.table import SINGULAR

__all__ = ["cone_gain", "cone_price"]

Array = NDArray[np.float64]


def cone_gain(products: Array, pulls: Array, either: bool) -> float:
    """Squares that coefficients of one sign explain: the positive one, or `either`.

    `products`: (K, K) of the columns, over σ². `pulls`: (K,), products of columns and target.
    """
    scale = np.sqrt(np.maximum(np.diag(products), TINY))
    values, vectors = np.linalg.eigh(products / np.outer(scale, scale))
    seen = values > SINGULAR * max(float(values.max()), TINY)
    root = np.sqrt(values[seen])[:, None] * vectors[:, seen].T
    along = vectors[:, seen].T @ (pulls / scale) / np.sqrt(values[seen])
    sides = (along, -along) if either else (along,)
    return float(max(along @ along - nnls(root, side)[1] ** 2 for side in sides))


def cone_price(products: Array, share: float, either: bool) -> float:
    """Return the gain that chance exceeds in a share of all logs."""
    weights = _weights(products)
    numbers = np.arange(1, len(weights))
    share = 0.5 * share if either else share

    def above(gain: float) -> float:
        return float(weights[1:] @ chdtrc(numbers, gain)) - share

    highest = float(chdtri(len(products), share))
    return float(brentq(above, 0.0, highest)) if above(highest) < 0.0 < above(0.0) else highest


def _weights(products: Array) -> Array:
    """How often 0, 1, … K of the coefficients are positive where nothing is there, (K + 1,)."""
    count = len(products)
    scale = np.sqrt(np.maximum(np.diag(products), TINY))
    within = products / np.outer(scale, scale) + SINGULAR * np.eye(count)
    values, vectors = np.linalg.eigh(within)
    pulls = (_normal(count) * np.sqrt(np.maximum(values, 0.0))) @ vectors.T
    weights = np.zeros(count + 1)
    for size in range(1, count + 1):
        for chosen in map(list, combinations(range(count), size)):
            beta = np.linalg.solve(within[np.ix_(chosen, chosen)], pulls[:, chosen].T)
            left = pulls.T - within[:, chosen] @ beta
            left[chosen] = 0.0
            weights[size] += np.sum((beta > 0.0).all(axis=0) & (left <= 0.0).all(axis=0))
    weights /= len(pulls)
    weights[0] = max(1.0 - weights.sum(), 0.0)
    return weights


@cache
def _normal(count: int) -> Array:
    return np.random.default_rng(0).normal(size=(round(SETTINGS.little * SETTINGS.rows), count))
