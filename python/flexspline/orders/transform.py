"""Fourier sums over angles that are not evenly spaced, for very many orders at once.

    F(k) = Σ_n  y_n · exp(-i k φ_n),      k = j / P,   j = 0 … K·P

The samples are spread on a fine even grid of angle with a short smooth kernel, one FFT
turns the grid into orders, and the kernel's own transform is divided out. The angle is
folded after P turns, which changes nothing at orders that are multiples of 1/P.
Source: [Barnett2019] (kernel "exponential of semicircle"): with
width 6 and twofold grid the error is about 1e-5 of Σ|y|.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import fft
from scipy.interpolate import CubicSpline

__all__ = ["fourier_sums"]

_WIDTH = 6
_SHAPE = 2.30 * _WIDTH
_CHUNK = 1 << 18


def fourier_sums(
    angle: NDArray[np.float64], values: NDArray[np.float64], turns: int, highest: float
) -> NDArray[np.complex128]:
    """Return F at the orders 0, 1/turns, …, up to `highest`.

    Parameters
    ----------
    angle : array, shape (rows,)
        Angle [rad], in any order, over any number of turns.
    values : array, shape (rows,)
        What is transformed, in any unit.
    turns : int
        P: the step of order is 1/P.
    highest : float
        K, the last order.

    Returns
    -------
    array of complex, shape (floor(highest · turns) + 1,)
        In the unit of `values`.
    """
    last = int(np.floor(highest * turns + 1e-9))
    size = int(fft.next_fast_len(max(4 * last + 4, 4 * _WIDTH), real=True))
    grid = np.zeros(size)
    for first in range(0, len(angle), _CHUNK):
        part = slice(first, first + _CHUNK)
        place = np.mod(angle[part] / (2 * np.pi * turns), 1.0) * size
        left = np.ceil(place - _WIDTH / 2).astype(np.int64)
        for step in range(_WIDTH):
            cell = left + step
            weight = _kernel((cell - place) / (_WIDTH / 2)) * values[part]
            cell %= size
            low = int(cell.min())
            summed = np.bincount(cell - low, weights=weight)
            grid[low : low + len(summed)] += summed
    spectrum: NDArray[np.complex128] = fft.rfft(grid)[: last + 1]
    return spectrum / _kernel_transform(last, size)


def _kernel(x: NDArray[np.float64]) -> NDArray[np.float64]:
    inside = np.clip(1.0 - x * x, 0.0, None)
    value: NDArray[np.float64] = np.exp(_SHAPE * (np.sqrt(inside) - 1.0))
    return value


@lru_cache(maxsize=4)
def _kernel_transform(last: int, size: int) -> NDArray[np.float64]:
    """Return ∫ kernel(2x/W) · exp(-2πi f x) dx for f = 0 … last/size cycles per grid cell."""
    node, weight = np.polynomial.legendre.leggauss(40)
    half = _WIDTH / 2
    knots = np.linspace(0.0, 0.26, 513)
    value = half * np.cos(2 * np.pi * half * knots[:, None] * node) @ (weight * _kernel(node))
    smooth: NDArray[np.float64] = CubicSpline(knots, value)(np.arange(last + 1) / size)
    return smooth
