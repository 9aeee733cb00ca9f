"""Loops, lags and bends that several hidden forms share; none is computed as the core does it."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from scipy.signal import lfilter

from hidden.rig import RATE, Array, Scene

__all__ = ["bouc_wen", "lagged", "passing", "slope"]


def passing(s: Scene) -> Array:
    """The change of direction by an algebraic bend, where the catalogue has a tanh."""
    return np.asarray(s.v / np.sqrt(s.v**2 + (0.9 * s.joint.width) ** 2))


def bouc_wen(path: Array, width: float) -> Array:
    """z of dz = (du − (|du| z + du |z|) / 2) / width along a path (N,), solved between its turns.

    On the way up z follows a line until 0 and then 1 − exp(−u / width); on the way down mirrored.
    """
    z = np.zeros(len(path))
    turns = np.flatnonzero(np.diff(np.sign(np.diff(path)))) + 1
    for first, last in pairwise([0, *turns.tolist(), len(path) - 1]):
        way = (path[first : last + 1] - path[first]) / width
        sign = 1.0 if way[-1] > 0.0 else -1.0
        z[first : last + 1] = sign * _rising(sign * way, sign * float(z[first]))
    return z


def _rising(way: Array, start: float) -> Array:
    line = start + way
    bend = 1.0 - (1.0 - max(start, 0.0)) * np.exp(-np.maximum(way + min(start, 0.0), 0.0))
    return np.asarray(np.where(line < 0.0, line, bend))


def lagged(values: Array, seconds: float, rate: float = RATE) -> Array:
    """Values (N,) at a rate [Hz] behind a first-order lag that had settled before the first."""
    share = -np.expm1(-1.0 / (rate * seconds))
    start = [(1.0 - share) * values[0]]
    return np.asarray(lfilter([share], [1.0, share - 1.0], values, zi=start)[0])


def slope(values: Array) -> Array:
    """Derivative in time, (N,)."""
    return np.gradient(values, 1.0 / RATE)
