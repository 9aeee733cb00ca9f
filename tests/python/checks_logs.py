"""Simulated logs of a sound joint, for the tests of the checks."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexspline.logs import Log

Array = NDArray[np.float64]


def sound_log(seed: int, duration: float = 20.0) -> Log:
    """A joint of ratio 51 to 161 with friction, inertia, gravity, ripple and sensor noise.

    Motion, rate, sizes and noises follow from the seed; nothing in it is a fault of the data.
    """
    rng = np.random.default_rng(seed)
    rate = float(rng.choice([100.0, 200.0, 500.0, 1000.0]))
    time = np.arange(int(duration * rate)) / rate
    kind = ("sines", "triangle", "sweep")[seed % 3]
    q, v, a = motion(rng, time, kind)
    ratio, circular = float(rng.integers(50, 161)), bool(rng.integers(2))
    whole = ratio + circular
    load = rng.uniform(0, 5) * a + rng.uniform(-20, 20) * np.sin(q + rng.uniform(0, 6))
    slip = np.tanh(v / 0.005)
    friction = rng.uniform(2, 8) * slip + rng.uniform(0.5, 5) * v
    friction += rng.uniform(0, 3) * slip * np.exp(-((v / 0.1) ** 2))
    ripple = rng.uniform(0, 0.3) * np.sin(2 * whole * q + 1) + rng.uniform(0, 0.2) * np.sin(2 * q)
    encoder, torque = 10 ** rng.uniform(-6, -4.5), 10 ** rng.uniform(-2.5, -1)
    noise = rng.standard_normal
    n = len(time)
    tm = (load + friction + ripple + torque * 10 * noise(n)) / whole
    return Log.from_arrays(
        time=time,
        output_position=q + encoder * noise(n),
        output_velocity=v + 30 * encoder * noise(n),
        motor_position=whole * q + 0.02 * np.sin(2 * whole * q) + 0.001 * noise(n),
        motor_torque=tm,
        motor_current=tm / 0.1,
        sensor_torque=load + 0.2 * slip + ripple + torque * noise(n),
        temperature=25 + 5 * time / duration + 0.05 * noise(n),
        facts={
            "gear_ratio": ratio,
            "output_spline": "circular" if circular else "flex",
            "name": f"sound {seed}",
            "pole_pairs": 7,
        },
    )


def motion(rng: np.random.Generator, time: Array, kind: str) -> tuple[Array, Array, Array]:
    """Position [rad], velocity and acceleration of sines, a rounded triangle or a sweep."""
    if kind == "sines":
        f, size, phase = rng.uniform(0.1, 1, 4), rng.uniform(0.2, 1, 4), rng.uniform(0, 6, 4)
        w = 2 * np.pi * f[:, None]
        x = w * time + phase[:, None]
        return size @ np.sin(x), size @ (w * np.cos(x)), -size @ (w**2 * np.sin(x))
    if kind == "sweep":
        size, f0, f1 = rng.uniform(0.5, 2), 0.1, rng.uniform(0.5, 1.5)
        slope = (f1 - f0) / time[-1]
        x, w = 2 * np.pi * (f0 * time + 0.5 * slope * time**2), 2 * np.pi * (f0 + slope * time)
        return (
            size * np.sin(x),
            size * w * np.cos(x),
            size * (2 * np.pi * slope * np.cos(x) - w**2 * np.sin(x)),
        )
    speed, w = rng.uniform(0.2, 1), 2 * np.pi / rng.uniform(2, 8)
    edge = 0.98
    v = speed * np.arcsin(edge * np.cos(w * time)) / np.arcsin(edge)
    a = -speed * w * edge * np.sin(w * time) / np.arcsin(edge)
    a /= np.sqrt(1 - (edge * np.cos(w * time)) ** 2)
    q = np.concatenate(([0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(time))))
    return q, v, a
