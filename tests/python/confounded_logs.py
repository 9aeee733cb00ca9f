"""Rigs in whose recorded runs two causes cannot be told apart, made without the core.

Forms differ from the catalogue's in part. A rig records any commanded motion, load and temperature.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from fit_logs import autoregressive, rows_of
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from flexspline.effects import Effect, effect
from flexspline.logs.log import Log
from flexspline.logs.segments import runs

RATE = 100.0
RATIO = 101.0
FACTS = {"gear_ratio": 100.0, "output_spline": "circular"}
LOAD = "reference_torque"
WIDTH = 0.05
SIZE, MEMORY = 0.02, 0.6  # Nm, innovations of the noise, and what it keeps from row to row

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

    def follow(self, trajectory: Log, seed: int) -> list[Log]:
        """Record a planned trajectory, as often as it asks for; behind a gap a run of its own."""
        every = []
        for _ in range(int(trajectory.facts["repetitions"])):
            for first, last in runs(trajectory["time"]):
                piece = {name: v[first:last] for name, v in trajectory.columns.items()}
                piece["time"] = piece["time"] - piece["time"][0]
                every.append(self.record(piece, seed + len(every)))
        return every

    def separation(self, logs: Sequence[Log]) -> float:
        """|t| that the true torque keeps beside base and rival: plain least squares, whitened."""
        rows, torque = [], []
        for log in logs:
            rows.append(_white(rows_of([_shaped(n) for n in (*self.base, self.rival)], log, LOAD)))
            torque.append(_white(self.cause(dict(log.columns))))
        matrix, y = np.concatenate(rows), np.concatenate(torque)
        matrix = matrix / np.linalg.norm(matrix, axis=0)
        left = y - matrix @ np.linalg.lstsq(matrix, y, rcond=1e-9)[0]
        return float(np.linalg.norm(left)) / SIZE

    def record(self, commanded: Channels, seed: int) -> Log:
        """What the rig reads when it is told this motion, load and temperature."""
        c = dict(commanded)
        c.setdefault(LOAD, np.zeros(len(c["time"])))
        drive = c[LOAD] + 0.8 * c["output_acceleration"] + friction(c)
        c["motor_torque"] = drive / RATIO
        noise = autoregressive(np.random.default_rng([seed, 73]), len(c["time"]), MEMORY, SIZE)
        c["sensor_torque"] = c[LOAD] + friction(c) + self.cause(c) + noise
        return Log.from_arrays(facts={**FACTS, "name": f"run {seed}"}, **c)


def _white(values: Array) -> Array:
    return np.asarray(values[1:] - MEMORY * values[:-1])


def _shaped(name: str) -> Effect:
    made = effect(name)
    return made.with_shapes(direction_width=WIDTH) if "direction_width" in made.shapes else made


def random_excitation(
    seed: int,
    seconds: float,
    span: tuple[float, float],
    load: tuple[float, float],
    velocity: float,
    acceleration: float,
) -> Channels:
    """Smooth noise in angle and load that fills the same limits, as long as a plan."""
    draw, time = np.random.default_rng([seed, 79]), np.arange(round(seconds * RATE)) / RATE

    def wandering(hertz: float) -> Array:
        return gaussian_filter1d(draw.normal(size=len(time)), RATE / (2 * np.pi * hertz))

    turns = max(draw.uniform(0.3, 1.0) * acceleration / velocity / (2 * np.pi), 2.0 / seconds)
    q = wandering(turns)
    v = np.gradient(q, time)
    a = np.gradient(v, time)
    most = min(
        (span[1] - span[0]) / np.ptp(q), velocity / np.abs(v).max(), acceleration / np.abs(a).max()
    )
    q, v, a = most * q, most * v, most * a
    q += span[0] - q.min() + draw.uniform() * (span[1] - span[0] - np.ptp(q))
    weight = wandering(0.1)
    weight = load[0] + (load[1] - load[0]) * (weight - weight.min()) / np.ptp(weight)
    return {
        "time": time,
        "output_position": q,
        "output_velocity": v,
        "output_acceleration": a,
        LOAD: weight,
    }


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
