"""Small numeric parts: low passes, quanta, noise, the turn of friction, and loops with a memory."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.special import erf

__all__ = [
    "TURNS",
    "Array",
    "bouc_wen",
    "coloured",
    "dahl",
    "lagged",
    "levels",
    "low_passed",
    "quantised",
]

Array = NDArray[np.float64]


def lagged(values: Array, seconds: float, step: float) -> Array:
    """Values behind a first-order lag that rests on the first of them."""
    return np.asarray(values[0] + _behind(values - values[0], 1 - np.exp(-step / seconds)))


def low_passed(values: Array, cutoff: float, step: float) -> Array:
    """Values behind two first-order lags with a cutoff in Hz, at rest on the first of them."""
    share = 1 - np.exp(-2 * np.pi * cutoff * step)
    return np.asarray(values[0] + _behind(_behind(values - values[0], share), share))


def _behind(values: Array, share: float) -> Array:
    """Values behind a lag that closes a share of the distance in each step, from 0."""
    return np.asarray(lfilter([share], [1, share - 1], values))


def quantised(values: Array, quantum: float) -> Array:
    return np.asarray(np.round(values / quantum) * quantum)


def coloured(rng: np.random.Generator, rows: int, step: float, seconds: float) -> Array:
    """Noise of deviation 1 whose autocorrelation falls to 1/e in so many seconds."""
    kept = np.exp(-step / seconds)
    white = rng.normal(size=rows + int(6 * seconds / step))
    return np.asarray(lfilter([np.sqrt(1 - kept * kept)], [1, -kept], white)[-rows:])


def levels(
    rng: np.random.Generator, low: float, high: float, rows: int, step: float, seconds: float
) -> Array:
    """Random levels, each held for so many seconds."""
    drawn = rng.uniform(low, high, size=int(rows * step / seconds) + 2)
    return np.repeat(drawn, int(seconds / step) + 1)[:rows]


TURNS: tuple[Callable[[Array, float], Array], ...] = (
    lambda v, width: np.asarray(v / np.sqrt(v * v + width * width)),
    lambda v, width: np.asarray(erf(v / width)),
    lambda v, width: np.asarray(v / np.cbrt(np.abs(v) ** 3 + width**3)),
)
"""Forms in which Coulomb friction turns from -1 to 1 with the velocity, of a width in rad/s."""


def dahl(angle: Array, width: float, power: int, start: float) -> Array:
    """Return Dahl's friction as a share z of its limit, from `start`.

    dz/dx = (1 - z sgn dx)^power / width with a power of 1 or 2, solved exactly in each step.
    """
    steps = np.diff(angle)
    sides, sizes = np.where(steps > 0, 1.0, -1.0), np.abs(steps) / width
    shares = np.empty(len(angle))
    shares[0] = z = start
    kept = np.exp(-sizes) if power == 1 else sizes
    for row, (side, size) in enumerate(zip(sides.tolist(), kept.tolist(), strict=True)):
        if power == 1:
            z = side + (z - side) * size
        else:
            left = 1 - side * z
            z = side * (1 - left / (1 + size * left))
        shares[row + 1] = z
    return shares


def bouc_wen(values: Array, width: float, power: float, beta: float) -> Array:
    """Return Bouc and Wen's loop z over values whose scale is `width`, by Euler's steps from 0.

    dz = du - β |du| |z|^(power-1) z - (1 - β) du |z|^power
    """
    loop = np.zeros(len(values))
    z = 0.0
    for row, du in enumerate((np.diff(values) / width).tolist()):
        bent = beta * abs(du) * abs(z) ** (power - 1) * z + (1 - beta) * du * abs(z) ** power
        z += du - bent
        loop[row + 1] = z
    return loop
