"""A joint that turns, stops and is pushed, read by bridges of several placements."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from flexspline.logs import Log
from flexspline.sensor import Bridge, cancelling_bridge, common_bridge

Array = NDArray[np.float64]

FACTS: dict[str, str | float | int] = {"gear_ratio": 100.0, "output_spline": "circular"}
RATE = 1000.0
NOISE = 2e-3  # Nm, what the budget of the paper's electronics says
ENCODER = 2.0 * np.pi / 2**14  # rad, of the motor
GROWTH = 0.02  # of the ripple per Nm of load: more than any method under test knows
BONDED = np.radians([0.3, -0.2, 0.4, 0.1, -0.3, 0.2, -0.1, -0.4])


def motion(seconds: float = 12.0, *, speed: float = 0.6136) -> tuple[Array, Array]:
    """Time and output angle: 35.16 °/s with stops of one second, forward and back."""
    time = np.arange(round(seconds * RATE)) / RATE
    phase = time % 3.0
    shape = np.clip(np.minimum(phase / 0.05, (2.0 - phase) / 0.05), 0.0, 1.0)
    direction = np.where(time < 6.0, 1.0, -1.0)
    velocity = speed * direction * shape
    return time, np.asarray(cumulative_trapezoid(velocity, time, initial=0.0) + 0.1)


def load(time: Array) -> Array:
    """Gravity-like torque, and pushes in motion and at rest."""
    slow = 2.0 * np.sin(0.7 * time)
    pushed = 3.0 * ((time % 3.0 > 2.3) & (time % 3.0 < 2.6)) + 1.5 * ((time > 4.0) & (time < 4.4))
    return np.asarray(slow + pushed)


def reading(bridge: Bridge, angle: Array, torque: Array, seed: int) -> Array:
    noise = np.random.default_rng(seed).normal(0.0, NOISE, len(angle))
    ripple = bridge.reading(angle, 0.0)
    return torque + (1.0 + GROWTH * np.abs(torque)) * ripple + noise


def run(name: str, torque: Array, bridge: Bridge | None = None, seed: int = 1) -> Log:
    """A log of the common placement, or of another."""
    time, position = motion(len(torque) / RATE)
    motor = 101.0 * position
    seen = np.round(motor / ENCODER) * ENCODER
    return Log.from_arrays(
        facts={**FACTS, "name": name},
        time=time,
        output_position=position,
        motor_position=seen,
        sensor_torque=reading(bridge or common_bridge(), motor, torque, seed),
        reference_torque=torque,
    )


def compared() -> tuple[Log, Log, Array, tuple[Array, Array]]:
    """A log, a run without load to train on, and what other placements read of the log."""
    time, position = motion()
    torque = load(time)
    motor = 101.0 * position
    eight = cancelling_bridge(8).with_errors(angle=BONDED)
    gains = (1.003, 0.998)  # of the two circuits
    pairs = [
        gain * reading(common_bridge(waves=eight.waves), motor - turn, torque, seed)
        for gain, turn, seed in zip(gains, (0.0, np.pi / 2), (5, 6), strict=True)
    ]
    return (
        run("test", torque),
        run("training", np.zeros_like(time), seed=2),
        reading(eight, motor, torque, 4),
        (pairs[0], pairs[1]),
    )
