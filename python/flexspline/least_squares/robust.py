"""Weights that keep outliers and pushes from pulling a fit (Huber).

    w = min(1, k s / |r|),   k = 1.345,   s = 1.4826 · median |r − median r|

95 % efficient on normal noise. Source: [HuberRonchetti2009], Robust Statistics.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

__all__ = ["huber_weights"]

Array = NDArray[np.float64]

THRESHOLD = 1.345
NORMAL = 1.4826


def huber_weights(residuals: Sequence[Array], counted: Sequence[NDArray[np.bool_]]) -> list[Array]:
    """Return weights (N,) for each run from residuals (N,) and the rows that count."""
    rows = np.concatenate([r[c] for r, c in zip(residuals, counted, strict=True)])
    scale = NORMAL * float(np.median(np.abs(rows - np.median(rows))))
    if scale == 0.0:
        return [np.ones(len(r)) for r in residuals]
    limit = THRESHOLD * scale
    return [limit / np.maximum(np.abs(r), limit) for r in residuals]
