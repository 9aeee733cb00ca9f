"""Edges of bins that people can read: round numbers, with enough rows between them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

__all__ = ["even_edges", "growing_edges", "in_bins", "labels_of"]

Array = NDArray[np.float64]

_ROUND_GROWING = np.array([1.0, 1.5, 2.0, 3.0, 5.0, 7.0])
_ROUND_STEPS = np.array([1.0, 2.0, 2.5, 5.0, 10.0])
_SAMPLED = 200_000
_DECADES = 4  # below the largest value that growing bins go


def growing_edges(values: Array, least: int, first: float) -> Array:
    """Return edges from 0 that grow by about a half each, the last one infinite.

    Parameters
    ----------
    values : (N,), at least 0, any unit; rows not finite are left out.
    least : rows that a bin must hold.
    first : the smallest edge above 0: what is nearer cannot be told apart.
    """
    known, weight = _sampled(values)
    if not len(known) or not known[-1] > 0.0:
        return np.array([0.0, np.inf])
    top = float(np.floor(np.log10(known[-1])))
    marks = np.concatenate([_ROUND_GROWING * 10.0**k for k in np.arange(top - _DECADES, top + 1)])
    marks = marks[(marks < known[-1]) & (marks >= first)]
    return _merged(np.concatenate([[0.0], marks, [np.inf]]), known, weight, least)


def even_edges(values: Array, least: int, bins: int) -> Array:
    """Return about `bins` even bins between the 1 and 99 % points, open at both ends."""
    known, weight = _sampled(values)
    if len(known) < 2:
        return np.array([-np.inf, np.inf])
    low, high = np.quantile(known, [0.01, 0.99])
    rough = max(high - low, 1e-9 * max(abs(high), abs(low))) / bins
    if not rough > 0.0:
        return np.array([-np.inf, np.inf])
    scale = 10.0 ** np.floor(np.log10(rough))
    step = scale * _ROUND_STEPS[np.searchsorted(_ROUND_STEPS, rough / scale - 1e-9)]
    inner = step * np.arange(np.ceil(low / step), np.floor(high / step) + 1)
    return _merged(np.concatenate([[-np.inf], inner, [np.inf]]), known, weight, least)


def in_bins(values: Array, edges: Array) -> NDArray[np.int32]:
    """Return the bin of each value, (N,); -1 where it is not finite."""
    place = np.clip(np.searchsorted(edges[1:-1], values, side="right"), 0, len(edges) - 2)
    return np.where(np.isfinite(values), place, -1).astype(np.int32)


def labels_of(edges: Array, unit: str) -> tuple[str, ...]:
    """Return what each bin is called, such as "0.1 to 0.2 rad/s"."""
    return tuple(_label(low, high, unit) for low, high in pairwise(edges.tolist()))


def _label(low: float, high: float, unit: str) -> str:
    if low in (0.0, -np.inf) and high == np.inf:
        return "all"
    if low in (0.0, -np.inf):
        return f"below {high:.3g} {unit}"
    return f"above {low:.3g} {unit}" if high == np.inf else f"{low:.3g} to {high:.3g} {unit}"


def _sampled(values: Array) -> tuple[Array, float]:
    """Sorted finite values, thinned, and how many rows each stands for."""
    step = max(1, len(values) // _SAMPLED)
    known = values[::step]
    return np.sort(known[np.isfinite(known)]), float(step)


def _merged(edges: Array, known: Array, weight: float, least: int) -> Array:
    """Drop edges until each bin holds `least` rows."""
    below = weight * np.searchsorted(known, edges)
    kept = [0]
    for k in range(1, len(edges) - 1):
        if below[k] - below[kept[-1]] >= least and below[-1] - below[k] >= least:
            kept.append(k)
    return np.asarray(edges[[*kept, len(edges) - 1]])
