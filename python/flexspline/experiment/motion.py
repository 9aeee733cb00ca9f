"""Paths of the output angle that start and end at rest, with velocity and acceleration.

A path of pulses is made of accelerations a(s) = A sin²(π s / T), one behind the other:

    v(s) = A (s/2 − T/4π sin 2πs/T),     q(s) = A (s²/4 + T²/8π² (cos 2πs/T − 1))

so that a pulse changes the speed by A T / 2, and the jerk is bounded. A = 0 is a rest or a
stretch at constant speed. A path of sines is a sum of them in a window that rises as
6x⁵ − 15x⁴ + 10x³ at both ends. Both are twice continuously differentiable.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "Path",
    "Pulses",
    "Sines",
    "moved",
    "ramp_to",
    "reach",
    "reached",
    "rested",
    "smoothstep",
]

Array = NDArray[np.float64]
SHORTEST_RAMP = 0.1  # s

Path = Callable[[Array], Array]
"""From times (N,) [s] to angle, velocity and acceleration, (N, 3)."""
Pulse = tuple[float, float]
"""Length [s] and largest acceleration [rad/s²]."""


def moved(distance: float, speed: float, acceleration: float) -> list[Pulse]:
    """Pulses of a move from rest to rest, no faster than `speed`; no move where it is none."""
    far = abs(distance)
    if not far > 0.0:
        return []
    speed, ramp = reached(far, speed, acceleration)
    size = float(np.copysign(2.0 * speed / ramp, distance))
    return [(ramp, size), (max(far / speed - ramp, 0.0), 0.0), (ramp, -size)]


def reached(far: float, speed: float, acceleration: float) -> tuple[float, float]:
    """Highest speed [rad/s] of a move from rest to rest, and the time [s] to get there."""
    speed = min(speed, float(np.sqrt(0.5 * far * acceleration)))
    ramp = ramp_to(speed, acceleration)
    return min(speed, far / ramp), ramp


def ramp_to(speed: float, acceleration: float) -> float:
    """Time [s] to get to a speed: never a jolt."""
    return max(2.0 * speed / acceleration, SHORTEST_RAMP)


def reach(seconds: float, speed: float, acceleration: float) -> float:
    """How far a move from rest to rest gets in a time [rad]."""
    speed = min(speed, 0.25 * acceleration * seconds)
    return max(speed * (seconds - ramp_to(speed, acceleration)), 0.0)


def rested(seconds: float) -> list[Pulse]:
    return [(seconds, 0.0)]


@dataclass(frozen=True)
class Pulses:
    """Path of pulses from an angle; before and behind them it rests."""

    start: float
    pulses: Sequence[Pulse]

    @property
    def seconds(self) -> float:
        return float(sum(length for length, _ in self.pulses))

    def __call__(self, time: Array) -> Array:
        length, size = np.array([(0.0, 0.0), *self.pulses, (0.0, 0.0)]).T
        begins = np.concatenate([[0.0], np.cumsum(length)[:-1]])
        gained = 0.5 * size * length
        speed = np.concatenate([[0.0], np.cumsum(gained)[:-1]])
        gone = speed * length + 0.25 * size * length**2
        angle = self.start + np.concatenate([[0.0], np.cumsum(gone)[:-1]])
        speed[-1] = 0.0  # what rounding leaves
        at = np.maximum(np.searchsorted(begins, time, side="right") - 1, 0)
        since, lasts = time - begins[at], np.where(length[at] > 0.0, length[at], 1.0)
        turn = 2.0 * np.pi * since / lasts
        half = lasts / (2.0 * np.pi)
        a = size[at] * np.sin(0.5 * turn) ** 2
        v = speed[at] + 0.5 * size[at] * (since - half * np.sin(turn))
        q = angle[at] + speed[at] * since
        q = q + 0.5 * size[at] * (0.5 * since**2 + half**2 * (np.cos(turn) - 1.0))
        return np.column_stack([q, v, a])


@dataclass(frozen=True)
class Sines:
    """Path c + w(t) Σ a sin(ω t + φ), at rest at the centre c at both ends of its duration."""

    centre: float
    amplitudes: Array
    rates: Array
    phases: Array
    duration: float
    edge: float

    def __call__(self, time: Array) -> Array:
        phase = np.outer(time, self.rates) + self.phases
        s = np.sin(phase) @ self.amplitudes
        ds = np.cos(phase) @ (self.amplitudes * self.rates)
        dds = -np.sin(phase) @ (self.amplitudes * self.rates**2)
        up, down = smoothstep(time / self.edge), smoothstep((self.duration - time) / self.edge)
        w = up[:, 0] * down[:, 0]
        dw = (up[:, 1] * down[:, 0] - up[:, 0] * down[:, 1]) / self.edge
        ddw = up[:, 2] * down[:, 0] - 2.0 * up[:, 1] * down[:, 1] + up[:, 0] * down[:, 2]
        ddw = ddw / self.edge**2
        q = self.centre + w * s
        return np.column_stack([q, w * ds + dw * s, w * dds + 2.0 * dw * ds + ddw * s])


def smoothstep(x: Array) -> Array:
    """6x⁵ − 15x⁴ + 10x³ with its two derivatives, (N, 3); 0 below 0 and 1 above 1."""
    x = np.clip(x, 0.0, 1.0)
    return np.column_stack(
        [
            x**3 * (10.0 + x * (6.0 * x - 15.0)),
            30.0 * x**2 * (1.0 - x) ** 2,
            60.0 * x * (1.0 - x) * (1.0 - 2.0 * x),
        ]
    )
