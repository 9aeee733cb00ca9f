"""What stands between a joint and its log: quanta, noise, delays, filters, uneven clocks.

Every setting is drawn for each case from the ranges below. The motion, load and temperature are
known on a fine grid; a recorder looks at them at its own times.

    lab      both encoders, a drive's filtered velocity, perhaps an acceleration, a load cell that
             is noisy and late, a slow thermistor; its time stamps are those of its samples
    robot    one encoder, velocity by differences of its quanta, a current in quanta, no load cell
             and no temperature; rows are missing, time stamps are whole milliseconds
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import bessel, lfilter

from hidden.cases import Case
from hidden.rig import JOINTS, LOAD, Array, Scene
from hidden.shapes import lagged

__all__ = [
    "FINE",
    "MARGIN",
    "RANGES",
    "Recorder",
    "Taken",
    "quantised",
    "recorder_of",
    "sampled",
    "taken",
]

FINE = 2000.0  # Hz of the motion before it is recorded
MARGIN = 0.1  # s of motion before the first sample and after the last
ROWS = 40_000  # of all runs that are fitted; at high rates runs are shorter for it
CAPACITY = 10.0  # Nm of the load cell, either way: noise is a share of it, quanta of both ways
CURRENT = 4.0  # full scale of a robot's current, as a multiple of what gravity needs
FIRST_ORDER, SECOND_ORDER = 1, 2

RANGES: dict[str, dict[str, tuple[float, ...]]] = {
    "lab": {
        "rate": (200.0, 250.0, 400.0, 500.0, 1000.0),
        "jitter": (0.01, 0.1),  # of a step, either way
        "output_bits": (18, 23),
        "motor_bits": (13, 20),
        "velocity_cutoff": (50.0, 500.0),  # Hz
        "velocity_noise": (3e-4, 3e-3),  # rad/s behind the filter
        "velocity_delay": (0.0, 2e-3),  # s
        "acceleration_noise": (0.02, 0.1),  # rad/s²
        "load_noise": (2e-4, 2e-3),  # of the capacity
        "load_bits": (12, 16),
        "load_delay": (0.0, 2e-3),  # s
        "temperature_noise": (0.02, 0.1),  # K
        "temperature_lag": (0.2, 1.0),  # s
        "motor_noise": (2e-4, 2e-3),  # Nm at the motor, where that is no target
        "one_way": (0.05, 0.2),  # by which viscous friction differs between directions
    },
    "robot": {
        "rate": (100.0, 125.0, 200.0, 250.0, 500.0),
        "jitter": (0.01, 0.1),
        "output_bits": (12, 17),
        "current_bits": (10, 14),
        "one_way": (0.05, 0.2),
    },
}
"""Lowest and highest; of rates, those that there are."""

MISSING = 1e-3  # of a robot's rows
MILLISECOND = 1e-3


@dataclass(frozen=True)
class Recorder:
    """The settings of one case, in SI units; quanta and noise are those of the channel itself.

    A quantum, noise or delay of 0: there is none. `acceleration_noise`: None without the channel.
    `one_way`: by which share viscous friction is higher forward than on average, or lower if < 0.
    """

    kind: str
    rate: float
    seconds: float
    jitter: float
    output_quantum: float
    motor_quantum: float = 0.0
    velocity_cutoff: float = 0.0
    velocity_order: int = 0
    velocity_noise: float = 0.0
    velocity_delay: float = 0.0
    acceleration_noise: float | None = None
    load_noise: float = 0.0
    load_quantum: float = 0.0
    load_delay: float = 0.0
    temperature_noise: float = 0.0
    temperature_lag: float = 0.0
    motor_noise: float = 0.0
    current_quantum: float = 0.0
    one_way: float = 0.0


@dataclass(frozen=True)
class Taken:
    """One run as a recorder saw it, arrays (N,).

    `truth`: the scene at the times of the samples. `stamps`: the times that the log states.
    `columns`: channels beside the target. `kept`: rows that reached the log.
    """

    truth: Scene
    stamps: Array
    columns: dict[str, Array]
    kept: Array


def recorder_of(case: Case, runs: int) -> Recorder:
    """Draw the settings of a case with so many runs to fit."""
    generator = np.random.default_rng([20261122, case.seed, 0, 0, 5])
    drawn = _Draws(generator, RANGES[case.recorder])
    rate = float(generator.choice(RANGES[case.recorder]["rate"]))
    seconds = min(20.0, ROWS / (runs * rate))
    sided = bool(generator.integers(2)) * drawn.even("one_way") / 2.0 * generator.choice((-1, 1))
    made = Recorder(case.recorder, rate, seconds, drawn.ratio("jitter"),
                    drawn.turn("output_bits"), one_way=float(sided) or 0.0)  # fmt: skip
    if case.recorder == "robot":
        joint = JOINTS[case.joint]
        scale = 2.0 * CURRENT * joint.link / joint.drive
        return replace(made, current_quantum=scale / 2 ** drawn.bits("current_bits"))
    made = replace(
        made,
        motor_quantum=drawn.turn("motor_bits"),
        velocity_cutoff=drawn.ratio("velocity_cutoff"),
        velocity_order=int(generator.choice((FIRST_ORDER, SECOND_ORDER))),
        velocity_noise=drawn.ratio("velocity_noise"),
        velocity_delay=drawn.even("velocity_delay"),
        acceleration_noise=drawn.ratio("acceleration_noise") if generator.integers(2) else None,
        load_noise=CAPACITY * drawn.ratio("load_noise"),
        load_quantum=2.0 * CAPACITY / 2 ** drawn.bits("load_bits"),
        load_delay=drawn.even("load_delay"),
        temperature_noise=drawn.ratio("temperature_noise"),
        temperature_lag=drawn.ratio("temperature_lag"),
        motor_noise=drawn.ratio("motor_noise"),
    )
    return replace(made, motor_noise=0.0) if case.target == "motor_torque" else made


@dataclass(frozen=True)
class _Draws:
    generator: np.random.Generator
    ranges: dict[str, tuple[float, ...]]

    def even(self, name: str) -> float:
        return float(self.generator.uniform(*self.ranges[name]))

    def ratio(self, name: str) -> float:
        """Evenly in the logarithm."""
        return float(np.exp(self.generator.uniform(*np.log(self.ranges[name]))))

    def bits(self, name: str) -> int:
        low, high = self.ranges[name]
        return int(self.generator.integers(int(low), int(high) + 1))

    def turn(self, name: str) -> float:
        return float(2.0 * np.pi / 2 ** self.bits(name))


def sampled(s: Scene, at: Array, rate: float) -> Scene:
    """A fine scene at other times."""
    q, v, a, load, temperature, motor = (
        np.interp(at, s.time, x) for x in (s.q, s.v, s.a, s.load, s.temperature, s.motor_torque)
    )
    return Scene(s.joint, at, q, v, a, load, temperature, motor, v, rate)


def taken(
    recorder: Recorder, fine: Scene, seed: int, number: int, draw: int, load_at_sensor: float = 0.0
) -> Taken:
    """Record run `number` once; the times of its samples are the same in every draw.

    `load_at_sensor`: s by which all that the joint itself sees of the load is late.
    """
    clock = np.random.default_rng([20261122, seed, number, 0, 4])
    rows = round(recorder.rate * recorder.seconds)
    steps = np.arange(rows) + recorder.jitter * clock.uniform(-1.0, 1.0, rows)
    at = MARGIN + steps / recorder.rate
    kept = np.arange(rows)
    if recorder.kind == "robot":
        kept = np.delete(kept, clock.choice(rows, round(MISSING * rows), replace=False))
    truth = sampled(fine, at, recorder.rate)
    late = np.interp(at - load_at_sensor, fine.time, fine.load)
    truth = replace(truth, load=late)
    noise = np.random.default_rng([20261122, seed, number, draw, 1])
    if recorder.kind == "robot":
        return _robot(recorder, truth, noise, kept)
    return _lab(recorder, fine, truth, noise, kept)


def _lab(r: Recorder, fine: Scene, truth: Scene, noise: np.random.Generator, kept: Array) -> Taken:
    at = truth.time
    velocity = fine.v + _noise_of(r, noise, len(fine.time))
    columns = {
        "output_position": quantised(truth.q, r.output_quantum, noise),
        "motor_position": quantised(truth.theta, r.motor_quantum, noise),
        "output_velocity": np.interp(at - r.velocity_delay, fine.time, _filtered(r, velocity)),
        "temperature": np.interp(at, fine.time, lagged(fine.temperature, r.temperature_lag, FINE))
        + noise.normal(size=len(at)) * r.temperature_noise,
        "motor_torque": truth.motor_torque + noise.normal(size=len(at)) * r.motor_noise,
        LOAD: quantised(
            np.interp(at - r.load_delay, fine.time, fine.load)
            + noise.normal(size=len(at)) * r.load_noise,
            r.load_quantum,
            noise,
        ),
    }
    if r.acceleration_noise is not None:
        jolts = noise.normal(size=len(at)) * r.acceleration_noise
        columns["output_acceleration"] = truth.a + jolts
    return Taken(truth, at, columns, kept)


def _filtered(r: Recorder, values: Array) -> Array:
    """Values on the fine grid behind the drive's low pass, settled before the first."""
    b, a = bessel(r.velocity_order, r.velocity_cutoff, fs=FINE, norm="mag")
    return np.asarray(lfilter(b, a, values - values[0]) + values[0])


def _noise_of(r: Recorder, noise: np.random.Generator, rows: int) -> Array:
    """White noise before the filter, whose deviation behind it is the one that is stated."""
    impulse = np.zeros(rows)
    impulse[0] = 1.0
    b, a = bessel(r.velocity_order, r.velocity_cutoff, fs=FINE, norm="mag")
    return noise.normal(size=rows) * r.velocity_noise / np.linalg.norm(lfilter(b, a, impulse))


def _robot(r: Recorder, truth: Scene, noise: np.random.Generator, kept: Array) -> Taken:
    q = quantised(truth.q, r.output_quantum, noise)
    stamps = np.round(truth.time / MILLISECOND) * MILLISECOND
    columns = {"output_position": q, "output_velocity": np.diff(q, prepend=q[:1]) * r.rate}
    return Taken(truth, stamps, columns, kept)


def quantised(values: Array, quantum: float, noise: np.random.Generator) -> Array:
    """Values in steps, whose zero lies anywhere."""
    zero = noise.uniform(0.0, quantum)
    return np.asarray(quantum * np.round((values - zero) / quantum) + zero)
