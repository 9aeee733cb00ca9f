"""Rows and residuals of a fit filtered by A, so that noise e = A⁻¹ w is white in them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from flexspline.least_squares.noise_model import Chunk, Chunks
from flexspline.least_squares.tangent import Tangent

__all__ = ["filtered", "filtered_pieces"]

Array = NDArray[np.float64]


def filtered(tangent: Tangent, denominator: Array) -> Chunks:
    """Return what gives the rows and residuals of a fit filtered by A, stretch by stretch."""
    return lambda: (chunk for _, _, chunk in filtered_pieces(tangent, denominator))


def filtered_pieces(tangent: Tangent, denominator: Array) -> Iterator[tuple[int, slice, Chunk]]:
    """Give run number, rows and filtered chunk of each piece, without what starts the filter."""
    order, tail, begins = len(denominator) - 1, np.empty((0, 0)), True
    for number, rows, chunk in tangent.pieces():
        both = np.column_stack([chunk.rows, chunk.residual])
        begins = begins or bool(chunk.starts[0])
        both = both if chunk.starts[0] or not tail.size else np.concatenate([tail, both])
        made = lfilter(denominator, [1.0], both, axis=0)[order:]
        tail = both[max(0, len(both) - order) :]
        if len(made):
            starts = np.zeros(len(made), dtype=bool)
            starts[0], begins = begins, False
            counted = slice(rows.stop - len(made), rows.stop)
            yield number, counted, Chunk(made[:, :-1], made[:, -1], starts, None)
