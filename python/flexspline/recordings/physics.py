"""What the numbers of columns say: one is another's derivative, turns N times as far, or wraps.

A velocity is compared with a position by its integral, which neither noise nor quanta of either
hurt much: p = f · ∫v dt + p₀, and f is the ratio of their units.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

__all__ = ["EXPLAINED", "Ratio", "modulus", "ratio_of", "ratio_to_integral", "step_of", "unwrapped"]

Array = NDArray[np.float64]

EXPLAINED: Final = 0.98
"""Share of a column's variance from which it is taken for a multiple of the other: a position and
the integral of its own velocity share 0.999 in the measured logs, those of two joints 0 to 0.9."""

TURNS: Final = (2 * math.pi, 360.0, 1.0)  # rad, deg, rev
JUMP: Final = 0.9  # of the modulus: no step of a motion is as large


@dataclass(frozen=True)
class Ratio:
    """A column as a multiple of another, with the share of its variance that this explains."""

    factor: float
    explained: float

    @property
    def told(self) -> bool:
        """Whether the one is the other's multiple."""
        return self.explained >= EXPLAINED


def ratio_to_integral(time: Array, velocity: Array, position: Array) -> Ratio:
    """Return f of p = f · ∫v dt + p₀: rows without a value are left out, the trapezoid goes on."""
    there = np.isfinite(time) & np.isfinite(velocity) & np.isfinite(position)
    t, v, p = time[there], velocity[there], position[there]
    if len(t) < 3:
        return Ratio(math.nan, 0.0)
    travelled = np.concatenate([[0.0], np.cumsum(np.diff(t) * (v[1:] + v[:-1]) / 2)])
    return ratio_of(travelled, p)


def ratio_of(x: Array, y: Array) -> Ratio:
    """Return f of y = f · x + y₀ by least squares."""
    there = np.isfinite(x) & np.isfinite(y)
    x, y = x[there] - np.mean(x[there]), y[there] - np.mean(y[there])
    power, own = float(x @ x), float(y @ y)
    if not (power > 0 and own > 0 and math.isfinite(power) and math.isfinite(own)):
        return Ratio(math.nan, 0.0)
    factor = float(x @ y) / power
    return Ratio(factor, factor * float(x @ y) / own)


def modulus(values: Array) -> float | None:
    """Return the turn at which a position wraps, in its own unit, or None where it does not.

    A wrap is a step of nearly the whole range. The turn is 2π, 360, 1 or a power of two (of an
    encoder's counts) that is as large as the range.
    """
    there = values[np.isfinite(values)]
    if len(there) < 3:
        return None
    span = float(np.ptp(there))
    steps = np.abs(np.diff(there))
    if span <= 0 or not np.any(steps > JUMP * span) or np.mean(steps > 0.5 * span) > 0.05:
        return None
    counts = [2.0**bits for bits in range(8, 33)]
    near = [turn for turn in (*TURNS, *counts) if JUMP * turn < span < 1.02 * turn]
    return near[0] if near else None


def unwrapped(values: Array, turn: float | None) -> Array:
    """Return a position without the jumps at its modulus, NaN where it has none."""
    if turn is None:
        return values
    there = np.isfinite(values)
    whole = values.copy()
    whole[there] = np.unwrap(values[there], period=turn)
    return whole


def step_of(time: Array) -> float:
    """Return the median step between rows, or NaN where fewer than 90 % of the steps go forward."""
    steps = np.diff(time[np.isfinite(time)])
    if len(steps) < 2 or np.mean(steps > 0) < 0.9:
        return math.nan
    return float(np.median(steps[steps > 0]))
