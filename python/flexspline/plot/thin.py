"""Fewer points that look the same."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["MOST_POINTS", "Bands", "banded", "outline", "spread_evenly"]

Array = NDArray[np.float64]

MOST_POINTS = 20_000
LEAST_IN_BIN = 5


@dataclass(frozen=True)
class Bands:
    """Median and 5 and 95 % points of values in bins, (bins,); NaN in bins with too few."""

    centre: Array
    median: Array
    low: Array
    high: Array


def outline(values: Array, most: int = MOST_POINTS) -> NDArray[np.intp]:
    """Return indices (m,), m ≤ most, that keep the least and largest value of every stretch."""
    count = len(values)
    if count <= most:
        return np.arange(count)
    width = -(-count // (most // 2))
    full = count // width * width
    blocks = np.nan_to_num(values[:full]).reshape(-1, width)
    first = np.arange(0, full, width)
    both = np.stack([first + blocks.argmin(axis=1), first + blocks.argmax(axis=1)], axis=1)
    return np.asarray(np.sort(both, axis=1).ravel())


def spread_evenly(count: int, most: int = MOST_POINTS) -> NDArray[np.intp]:
    """Return at most `most` indices out of `count`, scattered by the golden ratio, not in step.

    They come in no order of time, so that runs do not paint over each other.
    """
    if count <= most:
        return np.argsort(np.modf(np.arange(count) * 0.618033988749895)[0])
    strides = np.modf(np.arange(most) * 0.618033988749895)[0]
    return np.asarray((strides * count).astype(np.intp))


def banded(x: Array, y: Array, bins: int = 60) -> Bands:
    """Return the bands of y in equally wide bins of x; both (N,), rows not finite left out."""
    good = np.isfinite(x) & np.isfinite(y)
    x, y = x[good], y[good]
    empty = np.empty(0)
    if not len(x):
        return Bands(empty, empty, empty, empty)
    edges = np.linspace(x.min(), x.max(), bins + 1)
    place = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, bins - 1)
    order = np.argsort(place, kind="stable")
    groups = np.split(y[order], np.searchsorted(place[order], np.arange(1, bins)))
    nothing = [np.nan] * 3
    points = np.array(
        [np.percentile(g, [5, 50, 95]) if len(g) >= LEAST_IN_BIN else nothing for g in groups]
    )
    return Bands(0.5 * (edges[:-1] + edges[1:]), points[:, 1], points[:, 0], points[:, 2])
