"""The load that a model makes by itself, where its rounds go back and forth: Anderson's mixing.

A round maps a load x to the load g(x) of the coefficients that it leads to. Where x ← g(x) does not
settle, the last few rounds tell how the miss f = g − x follows x, and the next load is where that
straight line has no miss: x = g − (ΔX + ΔF) w, with w the least squares solution of ΔF w = f.
Source: [WalkerNi2011], Anderson acceleration for fixed-point iterations.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["Settling"]

Array = NDArray[np.float64]

PLAIN = 6  # rounds before; most loads settle in three


class Settling:
    """The loads tried so far, (C,) each, and what each of them missed."""

    def __init__(self) -> None:
        self._loads: list[Array] = []
        self._misses: list[Array] = []

    def next(self, load: Array, made: Array) -> Array:
        """Return the load to try after one that led to another, (C,)."""
        self._loads.append(load)
        self._misses.append(made - load)
        if len(self._loads) <= PLAIN:
            return made
        last = slice(-len(load) - 1, None)
        moved, changed = (np.diff(rows[last], axis=0).T for rows in (self._loads, self._misses))
        weights = np.linalg.lstsq(changed, self._misses[-1], rcond=None)[0]
        return np.asarray(made - (moved + changed) @ weights)
