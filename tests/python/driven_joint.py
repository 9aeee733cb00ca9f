"""A drive that moves a joint in sharp strokes or in waves, behind an encoder, late or not."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexspline.logs import Log

Array = NDArray[np.float64]


def driven(
    angle: Array, late: float, inertia: float, presliding: float = 0.0, *,
    bits: int = 19, seed: int = 11, every: int = 20, noisy: bool = True,
) -> Log:  # fmt: skip
    """A drive over an angle (N,) rad at 5 kHz, late by so many s, in rows at 250 Hz.

    4 Nm of Coulomb friction that slips, or gives over `presliding` [rad]; 6 Nm·s/rad, 5 Nm of
    gravity; `inertia` in kg·m², an encoder of so many `bits`, 0.2 Nm of white noise or none.
    """
    time = np.arange(len(angle)) / 5000.0
    speed = np.gradient(angle, time)
    slip = np.tanh(speed / 0.005)
    if presliding:
        slip = np.zeros_like(angle)
        for k in range(1, len(angle)):  # elastic until it slips
            slip[k] = np.clip(slip[k - 1] + (angle[k] - angle[k - 1]) / presliding, -1.0, 1.0)
    torque = 4.0 * slip + 6.0 * speed + inertia * np.gradient(speed, time) + 5.0 * np.sin(angle)
    torque = np.interp(time - late, time, torque)[::every]
    torque += 0.2 * noisy * np.random.default_rng(seed).normal(size=len(torque))
    step = 2.0 * np.pi / 2**bits
    return Log.from_arrays(
        time=time[::every], output_position=np.round(angle[::every] / step) * step,
        motor_torque=torque / 80.0, facts={"gear_ratio": 80.0, "name": "drive"},
    )  # fmt: skip


def strokes(turn: float = 5.0) -> Array:
    """Trapezoids to and fro at five speeds in turn, rad, with so many rad/s² at their ends."""
    time, speed, start = np.arange(200_000) / 5000.0, np.zeros(200_000), 0.0
    while start < time[-1]:
        for usual in (0.5, 0.1, 1.5, 0.25, 1.0):
            for way in (1.0, -1.0):
                ramp, length = usual / turn, min(1.2, 2.5 * usual + 0.1) / usual
                since = time - start
                up, down = (
                    np.clip(since / ramp, 0, 1),
                    np.clip((since - ramp - length) / ramp, 0, 1),
                )
                speed += way * usual * (up - down)
                start += 2.0 * ramp + length + 0.1
    return np.asarray(np.cumsum(speed) / 5000.0)


def waves() -> Array:
    time = np.arange(200_000) / 5000.0
    turns = ((0.4, 0.3, 0.2), (0.3, 0.7, 1.1), (0.2, 1.4, 2.5), (0.15, 2.3, 0.4), (0.1, 3.9, 4.1))
    return np.asarray(sum(a * np.sin(w * time + p) for a, w, p in turns))
