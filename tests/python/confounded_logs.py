"""Rigs in whose recorded runs two causes cannot be told apart, made without the core.

Forms differ from the catalogue's in part. A rig records any commanded motion, load and temperature.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from fit_logs import autoregressive
from numpy.typing import NDArray

from flexspline.logs.log import Log

RATE = 100.0
RATIO = 101.0
FACTS = {"gear_ratio": 100.0, "output_spline": "circular"}
LOAD = "reference_torque"
WIDTH = 0.05
SIZE = 0.02  # Nm, innovations of the noise

Array = NDArray[np.float64]
Channels = dict[str, Array]


def direction(c: Channels) -> Array:
    """The change of direction."""
    return np.tanh(c["output_velocity"] / WIDTH)


def friction(c: Channels) -> Array:
    return np.asarray(-0.1 + 0.4 * direction(c) + 0.2 * c["output_velocity"])


@dataclass(frozen=True)
class Rig:
    """`base` is known of it, `hidden` with `rival` confounded; `cause` the torque that is hidden.

    `tied` makes the load and temperature of its recorded runs from their motion.
    """

    base: tuple[str, ...]
    hidden: str
    rival: str
    cause: Callable[[Channels], Array]
    tied: Callable[[Channels], Channels]
    swing: float = 0.6
    hertz: float = 0.11

    def recorded(self, number: int, rows: int = 2000) -> Log:
        """One of the runs that confound the two."""
        time = np.arange(rows) / RATE
        q, v, a = np.zeros((3, rows))
        draw = np.random.default_rng([number, 71])
        for hertz, share in ((self.hertz, 1.0), (2.3 * self.hertz, 0.4)):
            rate = 2 * np.pi * hertz * draw.uniform(0.9, 1.1)
            phase, size = draw.uniform(0, 2 * np.pi), self.swing * share
            q += size * np.sin(rate * time + phase)
            v += size * rate * np.cos(rate * time + phase)
            a -= size * rate**2 * np.sin(rate * time + phase)
        motion = {"time": time, "output_position": q, "output_velocity": v,
                  "output_acceleration": a}  # fmt: skip
        return self.record({**motion, **self.tied({**motion, "number": np.array(number)})}, number)

    def record(self, commanded: Channels, seed: int) -> Log:
        """What the rig reads when it is told this motion, load and temperature."""
        c = dict(commanded)
        c.setdefault(LOAD, np.zeros(len(c["time"])))
        drive = c[LOAD] + 0.8 * c["output_acceleration"] + friction(c)
        c["motor_torque"] = drive / RATIO
        noise = autoregressive(np.random.default_rng([seed, 73]), len(c["time"]), 0.6, SIZE)
        c["sensor_torque"] = c[LOAD] + friction(c) + self.cause(c) + noise
        return Log.from_arrays(facts={**FACTS, "name": f"run {seed}"}, **c)


def _by_angle(c: Channels) -> Channels:
    """A load that a weight on a lever makes: one for each angle."""
    return {LOAD: 8.0 + 5.0 * np.cos(c["output_position"])}


def _slowly(c: Channels) -> Channels:
    """A load that rises and falls in its own time."""
    return {LOAD: 6.0 * np.sin(0.3 * c["time"] + float(c["number"]))}


def _warming(c: Channels) -> Channels:
    """Each run starts cold and warms up the same way."""
    return {**_slowly(c), "temperature": 22.0 + 0.4 * c["time"] + 0.004 * c["time"] ** 2}


FRICTION = ("offset", "coulomb_friction", "viscous_friction")
RIGS = {
    "a load tied to the angle": Rig(
        FRICTION, "load_dependent_friction", "position_dependent_friction",
        lambda c: 0.03 * np.abs(c[LOAD]) * direction(c), _by_angle),
    "a motor that follows the load": Rig(
        FRICTION, "gain_error", "motor_crosstalk", lambda c: 0.03 * c[LOAD], _slowly, hertz=0.03),
    "a warm-up that follows the clock": Rig(
        FRICTION, "temperature_drift", "time_drift",
        lambda c: 0.05 * (c["temperature"] - 25.0), _warming),
    "a weight of its own": Rig(
        FRICTION, "gravity", "output_ripple",
        lambda c: 0.6 * np.sin(c["output_position"] - 0.3), _slowly, swing=1.5),
}  # fmt: skip
