"""Noise floor of a spectrum, local in order, and how surprising a peak over it is.

Measured noise is correlated, so its power changes with the order. Where only noise is, the
power at one order follows an exponential law around the local floor F, whatever the noise's
colour. F is the median over a block of orders (a few lines in it do no harm) divided by ln 2,
joined between blocks along straight lines in the logarithms. Estimated from M_e effective
orders, power / F follows an F(2, 2 M_e) law, so that

    P(power > z F) = (1 + z / M_e)^(-M_e),    surprise x = M_e ln(1 + z / M_e)

is again unit exponential. A sum of G surprises follows a gamma law of shape G. Over a scan of
C independent orders the largest passes x about C sqrt(π x / 3) e^(-x) times: what is oversampled
adds to the chances. Sources: [Scargle1982]; [Davies1987] and [Baluev2008] (the crossing rate),
[Trunk1978] (smallest of).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy import special

__all__ = [
    "EFFECTIVE",
    "NEIGHBOURS",
    "Floor",
    "block_floor",
    "chance_in_scan",
    "neighbours",
    "surprise",
]

EFFECTIVE = 0.48  # orders that a median of exponential powers is worth: ln(2)² for the mean
_NEAR, _FAR = 1.5, 8.0  # independent orders
_LEAKAGE = 0.01  # twice the mean of sinc² over 1.5 to 8
NEIGHBOURS = _FAR - _NEAR
_FIRST, _LARGEST, _GROWTH = 16.0, 64.0, 1.3  # independent orders in a block


@dataclass(frozen=True)
class Floor:
    """Floor over blocks of orders: their centres, levels and effective number of orders."""

    centres: NDArray[np.float64]
    levels: NDArray[np.float64]
    counts: NDArray[np.float64]

    def level(self, order: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return F at `order`; below the first block it goes on rising as between the first two."""
        x, known, levels = np.log(order), np.log(self.centres), np.log(self.levels)
        value = np.interp(x, known, levels)
        if len(known) > 1:
            slope = min((levels[1] - levels[0]) / (known[1] - known[0]), 0.0)
            value = value + np.where(x < known[0], slope * (x - known[0]), 0.0)
        return np.asarray(np.exp(value), dtype=np.float64)

    def support(self, order: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return M_e at `order`."""
        return np.asarray(np.interp(np.log(order), np.log(self.centres), self.counts))


def neighbours(power: NDArray[np.float64], cell: float) -> NDArray[np.float64]:
    """Return the smaller of the mean powers 1.5 to 8 independent orders below and above.

    What a line at the order itself leaks there over its span, and twice that, is taken off.
    `cell` is the number of entries of `power`, shape (orders,), for one independent order.
    """
    near, far = max(1, round(_NEAR * cell)), max(2, round(_FAR * cell))
    total = np.concatenate([[0.0], np.cumsum(power)])
    at, size = np.arange(len(power)), len(power)

    def mean(first: NDArray[np.intp], last: NDArray[np.intp]) -> NDArray[np.float64]:
        first, last = np.clip(first, 0, size), np.clip(last, 0, size)
        full = last - first >= 0.75 * (far - near)
        value = (total[last] - total[first]) / np.maximum(last - first, 1)
        return np.asarray(np.where(full, value, np.inf))

    around = np.minimum(mean(at - far, at - near), mean(at + near + 1, at + far + 1))
    least = np.where(np.isfinite(around), around, 0.0) - _LEAKAGE * power
    return np.asarray(np.maximum(least, 0.0))


def block_floor(
    order: NDArray[np.float64], power: NDArray[np.float64], turns: float, taken: Sequence[float]
) -> Floor | None:
    """Return the floor of `power` over the evenly spaced `order`, None where too few are seen.

    Parameters
    ----------
    order, power : array, shape (orders,)
        Orders per output turn, > 0, and power in any unit.
    turns : float
        Span of the data: 1/turns is the distance of independent orders.
    taken : sequence of float
        Orders of lines already fitted and taken out, whose neighbourhood is too quiet.
    """
    free = power > 0
    for line in taken:
        free &= np.abs(order - line) > 0.6 / turns
    cells = (order[-1] - order[0]) * turns
    if cells < 12 or np.count_nonzero(free) < 12:
        return None
    edges, width = [0.0], _FIRST
    while edges[-1] < cells:
        edges.append(edges[-1] + width)
        width = min(width * _GROWTH, _LARGEST)
    if len(edges) > 2 and cells - edges[-2] < _FIRST:
        del edges[-2]
    marks = np.searchsorted((order - order[0]) * turns, edges)
    step = (order[1] - order[0]) * turns
    centres, levels, support = [], [], []
    for first, last in pairwise(marks):
        inside = first + np.flatnonzero(free[first:last])
        if len(inside) * step >= 6:
            centres.append(float(np.exp(np.mean(np.log(order[inside])))))
            levels.append(float(np.median(power[inside])) / np.log(2))
            support.append(len(inside) * step)
    if not centres:
        return None
    return Floor(np.array(centres), np.array(levels), EFFECTIVE * np.array(support))


def surprise(ratio: NDArray[np.float64], support: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return x = M ln(1 + z / M), unit exponential for noise alone, 0 at M = 0; as `ratio`."""
    known = np.where(support > 0.0, support, 1.0)
    return np.where(support > 0.0, known * np.log1p(ratio / known), 0.0)


def chance_in_scan(
    x: NDArray[np.float64], shape: NDArray[np.float64], cells: float
) -> NDArray[np.float64]:
    """Return the probability that noise alone passes `x` somewhere in a scan.

    Parameters
    ----------
    x, shape : array, shape (peaks,)
        Sum of surprises and how many were summed.
    cells : float
        Number of independent orders scanned.
    """
    single = special.gammaincc(shape, x)
    tail = -np.log(np.maximum(single, 1e-300))
    often = np.maximum(1.0, np.sqrt(np.pi * tail / 3)) * cells * single
    return np.asarray(-np.expm1(-often), dtype=np.float64)
