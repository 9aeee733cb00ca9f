"""An hour of a joint at 1 kHz that hides effects, made by numpy alone.

Nine channels. The base model (offset, Coulomb and viscous friction, inertia) lacks a loop that
follows the load (torque hysteresis), a drift with temperature and a ripple of the wave generator.
The drive moves to and fro for half a minute, at another speed and load each time, and warms up.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

import flexspline

Array = NDArray[np.float64]

RATE, RATIO = 1000.0, 101.0
FACTS = {"gear_ratio": 100.0, "output_spline": "circular"}
BASE = ("offset", "coulomb_friction", "viscous_friction", "inertia")
LOAD, TARGET, WIDTH = "reference_torque", "sensor_torque", 0.03
HIDDEN: dict[str, Callable[[dict[str, Array]], Array]] = {
    "load_dependent_friction": lambda c: (
        0.012 * np.abs(c[LOAD]) * np.tanh(c["output_velocity"] / WIDTH)
    ),
    "temperature_drift": lambda c: 0.004 * (c["temperature"] - 25.0),
    "wave_generator_ripple": lambda c: 0.01 * np.cos(2.0 * c["motor_position"] + 0.4),
}


def log(rows: int, seed: int = 1, hidden: tuple[str, ...] = tuple(HIDDEN)) -> flexspline.Log:
    """A run of so many rows; its noise has a memory of a few samples."""
    generator = np.random.default_rng(seed)
    c = _channels(rows, generator)
    v, a = c["output_velocity"], c["output_acceleration"]
    torque = 0.3 * np.tanh(v / WIDTH) + 0.15 * v + 0.02 * a - 0.12 + c[LOAD]
    for name in hidden:
        torque += HIDDEN[name](c)
    torque += lfilter([0.03], [1.0, -0.8], generator.standard_normal(rows))
    c[TARGET] = torque
    for column in c.values():
        column.flags.writeable = False  # a log takes such arrays as they are
    return flexspline.Log(c, facts={**FACTS, "name": f"run {seed}"})


def _channels(rows: int, generator: np.random.Generator) -> dict[str, Array]:
    time = np.arange(rows) / RATE
    velocity, acceleration, position = np.zeros((3, rows))
    for frequency, size in ((0.13, 1.3), (0.083, 0.8), (0.37, 0.5), (0.0021, 0.3)):
        omega = 2 * np.pi * frequency * generator.uniform(0.9, 1.1)
        phase = omega * time + generator.uniform(0, 2 * np.pi)
        position += size / omega * np.sin(phase)
        velocity += size * np.cos(phase)
        acceleration -= size * omega * np.sin(phase)
    shift = generator.uniform(0, 2 * np.pi, 4)
    load = 5 * np.sin(0.7 * time + shift[0]) + 3 * np.sin(2.9 * time + shift[1])
    warm = 22.0 + 14.0 * -np.expm1(-time / 700.0) + np.sin(0.02 * time + shift[2])
    torque = load / RATIO + 0.1 * np.sin(1.1 * time + shift[3])
    return {
        "time": time,
        "output_position": position,
        "output_velocity": velocity,
        "output_acceleration": acceleration,
        "motor_position": RATIO * position,
        "motor_torque": torque,
        LOAD: load,
        "temperature": warm,
    }
