"""A joint with a torque sensor, driven without load, and its recorder. The reading is

    τ_s = Σ effects of the catalogue (evaluated by the core along the true motion)
          + presliding: an elastic-plastic element, σ (q − p), that slips at its level
          + coloured noise, AR(1)

and the log holds the motion only as encoders read it. `Truth` keeps what went in. The recorder adds

    angle        rounded to the encoder's quantum, 2π / 2^bits
    velocity     low-pass of first order in the drive, causal, plus white noise
    torque       white noise of the amplifier, rounded to its quantum
    temperature  white noise, rounded to its quantum

Rows are stamped at even times and taken up to a jitter later or earlier.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.ndimage import convolve1d
from scipy.signal import butter, lfilter, lfilter_zi
from scipy.signal.windows import hann

from flexspline.effects import effect
from flexspline.errors import InputError
from flexspline.logs.derive import differentiate
from flexspline.logs.log import Log
from flexspline.logs.segments import play
from flexspline.model import Model, Part

__all__ = [
    "FACTS",
    "Recorder",
    "Rig",
    "Truth",
    "sensor_rig",
]

Array = NDArray[np.float64]

FACTS: Mapping[str, str | float | int] = MappingProxyType(
    {"joint": "simulated joint", "gear_ratio": 100.0, "output_spline": "circular"}
)
SPEEDS = (0.02, 0.05, 0.1, 0.25, 0.5, 1.0)  # rad/s, forward in one order, backward in another
RAMP = 0.05  # share of a stretch of constant speed that its ramp takes
AT_REST = 0.5  # s before and after the motion
JERK_SECONDS = 0.08  # the servo rounds its ramps over this time
OUTPUT_BITS, MOTOR_BITS = 20, 14  # per turn
SENSOR_STEP = 1e-3  # Nm
VELOCITY_BANDWIDTH = 25.0  # Hz, zero phase
THERMAL_SECONDS = 20.0
COLD, WARM = 20.0, 38.0  # °C


@dataclass(frozen=True)
class Truth:
    """What a simulated rig was made of.

    Parameters
    ----------
    model : the effects of the catalogue with their true coefficients and shapes.
    presliding_level, presliding_stiffness : Nm, Nm/rad at the output.
    noise : standard deviation of the coloured noise, Nm.
    noise_memory : its AR(1) coefficient from one row to the next.
    """

    model: Model
    presliding_level: float
    presliding_stiffness: float
    noise: float
    noise_memory: float

    def value(self, name: str) -> float:
        """Return a true coefficient or shape, by the name that a fit gives it; NaN for others."""
        part = self.model.part("sensor_torque")
        terms = [f"{e.name}.{term.name}" for e in part.effects for term in e.terms]
        known = dict(zip(terms, part.coefficients.tolist(), strict=True))
        for e in part.effects:
            for shape, number in e.shapes.items():
                known[shape if shape == "direction_width" else f"{e.name}.{shape}"] = number
        return float(known.get(name, np.nan))


@dataclass(frozen=True)
class Rig:
    """Runs of a simulated joint and the truth behind them."""

    logs: tuple[Log, ...]
    truth: Truth


def sensor_rig(
    runs: int = 6,
    *,
    duration: float = 24.0,
    rate: float = 500.0,
    seed: int = 1,
    recorder: Recorder | None = None,
) -> Rig:
    """Return a rig with a torque sensor, without load, driven both ways at several speeds.

    Parameters
    ----------
    runs : how many, each from another angle and warming up or cooling down.
    duration : of one run, s.
    rate : samples per second, Hz.
    seed : of noise, angles, temperatures and the order of speeds; the same seed gives the same rig.
    recorder : what takes the runs; None: encoders, and their zero-phase derivative for velocity.

    Returns
    -------
    Rig
        Logs with time, output_position, output_velocity (zero phase, from the encoder),
        motor_position, temperature and sensor_torque, in SI units.

    Raises
    ------
    InputError
        For no runs, runs too short to show each speed, or a rate that aliases the ripple.
    """
    if runs < 1 or duration < 6.0 or rate < 200.0:
        raise InputError(
            f"rig: runs {runs}, duration {duration:g} s, rate {rate:g} Hz; give at least one run "
            "of 6 s at 200 Hz"
        )
    truth = _truth()
    generators = np.random.default_rng(seed).spawn(runs)
    return Rig(
        tuple(_run(k, truth, duration, rate, rng, recorder) for k, rng in enumerate(generators)),
        truth,
    )


def _truth() -> Truth:
    """The joint: levels of the size that the second paper reads on its own."""
    effects = [
        (effect("offset"), (-0.12,)),
        (effect("coulomb_friction", direction_width=0.01), (0.18,)),
        (effect("viscous_friction"), (0.11,)),
        (effect("stribeck_friction", stribeck_velocity=0.12, direction_width=0.01), (0.16,)),
        (effect("inertia"), (0.0192,)),
        (effect("output_ripple", orders=[1, 2]), (0.05, 0.03, 0.02, -0.04)),
        (effect("wave_generator_ripple", orders=[2]), (0.04, 0.02)),
        (effect("temperature_drift"), (0.008, 0.0)),
    ]
    part = Part(
        "sensor_torque",
        tuple(e for e, _ in effects),
        np.array([value for _, values in effects for value in values]),
    )
    return Truth(Model({"sensor": part}, dict(FACTS)), 0.02, 400.0, 0.015, 0.9)


def _run(
    number: int,
    truth: Truth,
    duration: float,
    rate: float,
    rng: np.random.Generator,
    recorder: Recorder | None,
) -> Log:
    time = np.arange(round(duration * rate)) / rate
    velocity = _velocity(time, rng)
    position = cumulative_trapezoid(velocity, time, initial=0.0) + rng.uniform(0.0, 2 * np.pi)
    first, last = rng.uniform(COLD, WARM, 2)
    ratio = float(FACTS["gear_ratio"]) + 1.0
    motion = Log.from_arrays(
        facts={**FACTS, "name": f"run{number + 1}"},
        time=time,
        output_position=position,
        output_velocity=velocity,
        output_acceleration=np.gradient(velocity, time),
        motor_position=ratio * position,
        temperature=last + (first - last) * np.exp(-time / THERMAL_SECONDS),
    )
    torque = truth.model.predict(motion).predicted
    slip = truth.presliding_level / truth.presliding_stiffness
    torque = torque + truth.presliding_stiffness * (position - play(position, slip))
    torque = torque + _noise(truth, len(time), rng)
    return (
        _measured(motion, torque, rng) if recorder is None else recorder.record(motion, torque, rng)
    )


def _measured(motion: Log, torque: Array, rng: np.random.Generator) -> Log:
    """What encoders, thermometer and amplifier make of the motion and the torque."""
    columns = {
        "time": motion["time"],
        "output_position": _rounded(motion["output_position"], 2 * np.pi / 2**OUTPUT_BITS),
        "motor_position": _rounded(motion["motor_position"], 2 * np.pi / 2**MOTOR_BITS),
        "sensor_torque": _rounded(torque, SENSOR_STEP),
        "temperature": _rounded(motion["temperature"] + rng.normal(0.0, 0.02, len(torque)), 0.01),
    }
    log = Log(columns, motion.facts, ("simulated by flexspline.rigs",))
    return differentiate(log, bandwidth=VELOCITY_BANDWIDTH, channels=("output_velocity",))


def _velocity(time: Array, rng: np.random.Generator) -> Array:
    """Trapezoids at each speed, all forward, then all back, with ramps and rounded corners."""
    levels = np.concatenate([rng.permutation(SPEEDS), -rng.permutation(SPEEDS)])
    edges = np.linspace(AT_REST, time[-1] - AT_REST, len(levels) + 1)
    starts, ends = edges[:-1], edges[1:]
    ramp = np.maximum(RAMP * (ends - starts), 0.05)
    knots = np.column_stack([starts, starts + ramp, ends - ramp, ends]).ravel()
    heights = np.column_stack([0 * levels, levels, levels, 0 * levels]).ravel()
    window = hann(max(3, round(JERK_SECONDS / (time[1] - time[0]))) | 1)
    return np.asarray(convolve1d(np.interp(time, knots, heights), window / window.sum()))


def _noise(truth: Truth, rows: int, rng: np.random.Generator) -> Array:
    memory = truth.noise_memory
    white = rng.normal(0.0, truth.noise * np.sqrt(1.0 - memory**2), rows)
    start = rng.normal(0.0, truth.noise) * memory
    return np.asarray(lfilter([1.0], [1.0, -memory], white, zi=[start])[0])


def _rounded(values: Array, step: float) -> Array:
    return step * np.round(values / step)


@dataclass(frozen=True)
class Recorder:
    """Settings of a laboratory's recorder.

    Parameters
    ----------
    output_bits, motor_bits : of the encoders, per turn.
    velocity_bandwidth : of the drive's low-pass, Hz; below half the sampling rate.
    velocity_noise : standard deviation, rad/s at the output.
    torque_noise, torque_step : standard deviation and quantum, Nm.
    temperature_noise, temperature_step : standard deviation and quantum, K.
    jitter : standard deviation of the time at which a row is taken, s.
    """

    output_bits: int = 20
    motor_bits: int = 15
    velocity_bandwidth: float = 80.0
    velocity_noise: float = 0.001
    torque_noise: float = 0.003
    torque_step: float = 0.001
    temperature_noise: float = 0.03
    temperature_step: float = 0.01
    jitter: float = 2e-5

    def record(self, motion: Log, torque: Array, rng: np.random.Generator) -> Log:
        """Return the log of a true motion and the true torque at the sensor, Nm (N,)."""
        time = motion["time"]
        taken = time + self.jitter * rng.standard_normal(len(time))
        white = rng.standard_normal((3, len(time)))

        def at_rows(values: Array) -> Array:
            return np.interp(taken, time, values)

        velocity = at_rows(self._filtered(time, motion["output_velocity"]))
        torque = at_rows(torque) + self.torque_noise * white[1]
        temperature = at_rows(motion["temperature"]) + self.temperature_noise * white[2]
        columns = {
            "time": time,
            "output_position": _rounded(
                at_rows(motion["output_position"]), 2 * np.pi / 2**self.output_bits
            ),
            "motor_position": _rounded(
                at_rows(motion["motor_position"]), 2 * np.pi / 2**self.motor_bits
            ),
            "output_velocity": velocity + self.velocity_noise * white[0],
            "sensor_torque": _rounded(torque, self.torque_step),
            "temperature": _rounded(temperature, self.temperature_step),
        }
        return Log(columns, motion.facts, ("simulated by flexspline.rigs",))

    def _filtered(self, time: Array, velocity: Array) -> Array:
        rate = 1.0 / (time[1] - time[0])
        b, a = butter(1, self.velocity_bandwidth, fs=rate)
        return np.asarray(lfilter(b, a, velocity, zi=velocity[0] * lfilter_zi(b, a))[0])
