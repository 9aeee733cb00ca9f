"""The true motion of a simulation, and the log that encoders and sensors make of it."""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from flexspline import _core
from flexspline.errors import InputError, did_you_mean, listed
from flexspline.logs.log import Log
from flexspline.simulation.parts import Harmonic, Start, above, at_least, require_limits, whole

if TYPE_CHECKING:
    from flexspline.simulation import Joint

__all__ = [
    "CHANNELS",
    "Encoder",
    "Instruments",
    "Noise",
    "TorqueSensor",
    "Trajectory",
    "measured",
]

Array = NDArray[np.float64]

CHANNELS: Mapping[str, str] = MappingProxyType(
    {
        "output_position": "rad",
        "output_velocity": "rad/s",
        "output_acceleration": "rad/s²",
        "motor_position": "rad",
        "motor_velocity": "rad/s",
        "motor_torque": "Nm at the motor side, current ripple included",
        "wave_generator_torque": "Nm at the motor side, through the gear's spring",
        "transmitted_torque": "Nm, from the gear to the output side: spring, hysteresis, damping",
        "link_torque": "Nm, from the sensor to the link: load, gravity, inertia of the link",
        "load_torque": "Nm, what the joint pushes on outside, obstacle included",
        "contact_torque": "Nm, on the obstacle",
        "gravity_torque": "Nm, that the joint needs against gravity",
        "motor_friction": "Nm at the motor side, against motion; what holds it where it sticks",
        "output_friction": "Nm; of a rigid gear the friction of both sides",
        "hysteresis_torque": "Nm, of all slip elements",
        "motor_temperature": "°C",
        "body_temperature": "°C, of the joint's body and its sensor",
        "motor_stuck": "0/1",
        "output_stuck": "0/1",
        "stopped": "0/1, the motor was stopped",
        "kinetic_energy": "J",
        "elastic_energy": "J, in gear, slip elements and obstacle",
        "gravity_energy": "J, 0 where the link hangs",
        "motor_work": "J since the start, put in by the motor, less cogging",
        "load_work": "J since the start, given to the load torque and the ripple",
        "motor_friction_heat": "J since the start",
        "output_friction_heat": "J since the start",
        "gear_heat": "J since the start: hysteresis, presliding and structural damping",
        "obstacle_heat": "J since the start",
        "copper_heat": "J since the start",
    }
)

SOURCES: Mapping[str, str] = {
    "output_position": "output_position",
    "output_velocity": "output_velocity",
    "output_acceleration": "output_acceleration",
    "motor_position": "motor_position",
    "motor_velocity": "motor_velocity",
    "motor_torque": "motor_torque",
    "motor_current": "motor_torque",
    "sensor_torque": "",
    "temperature": "body_temperature",
    "motor_temperature": "motor_temperature",
    "reference_torque": "load_torque",
}


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory:
    """What truly happened.

    Parameters
    ----------
    joint : what was simulated.
    time : (N,), s.
    columns : arrays (N,) by the names and units of `CHANNELS`.
    end : where it ended; `Joint.simulate(start=trajectory.end)` goes on.
    longest_step : s, of the inner steps.
    """

    joint: Joint
    time: Array
    columns: Mapping[str, Array]
    end: Start
    longest_step: float

    @classmethod
    def of(cls, joint: Joint, time: Array, result: Mapping[str, Any]) -> Trajectory:
        """Return the trajectory of a result of the core."""
        columns = {name: result["columns"][name] for name in result["columns"]}
        for column in columns.values():
            column.flags.writeable = False
        return cls(
            joint,
            time,
            MappingProxyType(columns),
            Start(**result["end"]),
            float(result["longest_step"]),
        )

    def __getitem__(self, name: str) -> Array:
        if name == "time":
            return self.time
        if name not in self.columns:
            raise InputError(
                f"trajectory: no channel '{name}'{did_you_mean(name, self.columns)}; "
                f"it has {listed(self.columns, 40)}"
            )
        return self.columns[name]

    def __len__(self) -> int:
        return len(self.time)

    def __repr__(self) -> str:
        return (
            f"<Trajectory of '{self.joint.name}': {len(self)} rows, "
            f"{self.time[-1] - self.time[0]:.6g} s, steps of {self.longest_step:.3g} s>"
        )

    @property
    def torsion(self) -> Array:
        """Δθ = q Ñ − θ, rad at the motor side; negative where the joint pushes outward. (11)"""
        ratio = self.joint.effective_ratio
        return self["output_position"] * ratio - self["motor_position"]

    @property
    def wave_generator_on_flexspline(self) -> Array:
        """Angle of the wave generator against the flexspline, rad: where the gauges sit."""
        turns = 1.0 if self.joint.gear.output_spline == "flex" else 0.0
        return self["motor_position"] + turns * self["output_position"]

    @property
    def energy(self) -> Array:
        """Kinetic, elastic and gravity energy together, J."""
        return self["kinetic_energy"] + self["elastic_energy"] + self["gravity_energy"]

    @property
    def balance(self) -> Array:
        """Energy stored and lost less energy put in, since the start, J: zero but for the steps.

        Ripple and cogging count as work of load and motor. Second order in the step.
        """
        lost = sum(self[f"{part}_heat"] for part in ("motor_friction", "output_friction", "gear"))
        given = self["motor_work"] - self["load_work"]
        change = self.energy - self.energy[0]
        return np.asarray(change + lost + self["obstacle_heat"] - given)

    def log(
        self,
        *,
        name: str = "simulated",
        rate: float | None = None,
        output_encoder: Encoder | None = None,
        motor_encoder: Encoder | None = None,
        sensor: TorqueSensor | None = None,
        noise: Mapping[str, Noise] | None = None,
        seed: int = 0,
        channels: Sequence[str] | None = None,
        facts: Mapping[str, str | float | int] | None = None,
    ) -> Log:
        """Return what a rig would have written down; see `measure.measured` for parameters."""

        instruments = Instruments(output_encoder, motor_encoder, sensor, noise or {}, seed)
        return measured(self, instruments, name=name, rate=rate, channels=channels, facts=facts)


if tuple(CHANNELS) != tuple(_core.simulation_columns):
    raise ImportError("flexspline: the core was built from other sources; build it again")


@dataclass(frozen=True)
class Encoder:
    """An encoder: what it reads is the angle plus its eccentricity, late, rounded down.

    Parameters
    ----------
    bits : per turn of its own side; 0 is exact.
    eccentricity : harmonics of its own angle, rad; `pair` is not read.
    delay : s.
    """

    bits: int = whole(0, 40, 0)
    eccentricity: Sequence[Harmonic] = ()
    delay: float = at_least(0.0)

    def __post_init__(self) -> None:
        require_limits(self)

    def read(self, time: Array, angle: Array) -> Array:
        """Return the readings, rad, of true angles (N,)."""
        seen = angle + sum(
            (h.amplitude * np.cos(h.order * angle + h.phase) for h in self.eccentricity), 0.0
        )
        seen = _late(time, seen, self.delay)
        if self.bits == 0:
            return seen
        step = 2.0 * np.pi / 2**self.bits
        return np.asarray(step * np.floor(seen / step))


@dataclass(frozen=True)
class TorqueSensor:
    """A torque sensor: gain · torque + offset + ripple + drift, through a lag, late, rounded.

    Parameters
    ----------
    location : "link" reads what goes to the link (load, gravity, inertia of the link), "gear" what
        the gear gives to the output side, its bearing's friction included.
    gain : 1. offset : Nm.
    ripple : harmonics in Nm of any pair of parts.
    drift : Nm/K, Nm/K², … per kelvin above 25 °C of the joint body.
    time_constant : s, of its first-order lag; 0 for none.
    delay : s.
    resolution : Nm; 0 is exact.
    """

    location: str = "link"
    gain: float = 1.0
    offset: float = 0.0
    ripple: Sequence[Harmonic] = ()
    drift: Sequence[float] = ()
    time_constant: float = at_least(0.0)
    delay: float = at_least(0.0)
    resolution: float = at_least(0.0)

    def __post_init__(self) -> None:
        require_limits(self)
        if self.location not in ("link", "gear"):
            raise InputError(
                f"simulation: TorqueSensor.location is '{self.location}'; give 'link' or 'gear'"
            )

    def true(self, trajectory: Trajectory) -> Array:
        """Return the torque at its place, Nm."""
        return trajectory["link_torque" if self.location == "link" else "transmitted_torque"]

    def read(self, trajectory: Trajectory, noise: Array | float = 0.0) -> Array:
        """Return the readings, Nm; `noise` is added before they are rounded."""
        torque = self.gain * self.true(trajectory) + self.offset
        for h in self.ripple:
            torque = torque + h.amplitude * np.cos(h.order * _angle(trajectory, h.pair) + h.phase)
        above_25 = trajectory["body_temperature"] - 25.0
        for degree, factor in enumerate(self.drift, start=1):
            torque = torque + factor * above_25**degree
        torque = _lagged(trajectory.time, torque, self.time_constant)
        torque = _late(trajectory.time, torque, self.delay) + noise
        if self.resolution == 0:
            return np.asarray(torque)
        return np.asarray(self.resolution * np.round(torque / self.resolution))


@dataclass(frozen=True)
class Noise:
    """Coloured noise, AR(1).

    Parameters
    ----------
    deviation : standard deviation, in the unit of its channel.
    memory : s, in which its correlation falls to 1/e; 0 is white.
    """

    deviation: float = above(0.0, 1.0)
    memory: float = at_least(0.0)

    def __post_init__(self) -> None:
        require_limits(self)

    def draw(self, rows: int, period: float, rng: np.random.Generator) -> Array:
        """Return `rows` values, `period` seconds apart."""
        keep = float(np.exp(-period / self.memory)) if self.memory > 0 else 0.0
        white = rng.normal(0.0, self.deviation, rows)
        white[1:] *= np.sqrt(1.0 - keep**2)
        return np.asarray(lfilter([1.0], [1.0, -keep], white))


@dataclass(frozen=True)
class Instruments:
    """What reads a rig: encoders and sensor (None: exact), noise by channel, and its seed."""

    output_encoder: Encoder | None = None
    motor_encoder: Encoder | None = None
    sensor: TorqueSensor | None = None
    noise: Mapping[str, Noise] = field(default_factory=dict)
    seed: int = 0

    def __post_init__(self) -> None:
        for name in self.noise:
            _require_channel(name)

    def noise_of(self, name: str, time: Array) -> Array | float:
        """Return the noise of a channel; it does not depend on which other channels have any."""
        if name not in self.noise:
            return 0.0
        rng = np.random.default_rng([self.seed, zlib.crc32(name.encode())])
        return self.noise[name].draw(len(time), float(np.median(np.diff(time))), rng)

    def read(self, trajectory: Trajectory, name: str) -> Array:
        """Return a channel of the log."""
        time = trajectory.time
        noise = self.noise_of(name, time)
        if name == "sensor_torque":
            return (self.sensor or TorqueSensor()).read(trajectory, noise)
        true = trajectory[SOURCES[name]] + 0.0
        encoder = {"output_position": self.output_encoder, "motor_position": self.motor_encoder}
        if encoder.get(name) is not None:
            return (encoder[name] or Encoder()).read(time, true + noise)
        if name == "motor_current":
            true = true / trajectory.joint.motor.torque_constant
        return np.asarray(true + noise)


def measured(
    trajectory: Trajectory,
    instruments: Instruments,
    *,
    name: str,
    rate: float | None = None,
    channels: Sequence[str] | None = None,
    facts: Mapping[str, str | float | int] | None = None,
) -> Log:
    """Return what a rig would have written down.

    Parameters
    ----------
    trajectory : what truly happened.
    instruments : encoders, sensor, noise, seed.
    name : of the run.
    rate : Hz; every k-th row is kept so that the log comes nearest to it. None keeps all.
    channels : names of `SOURCES`; None takes positions, motor torque (and current where the
        motor has a torque constant), sensor torque, temperatures and reference torque. True
        velocities and accelerations have to be asked for by name: a rig has none.
    facts : beside joint, name, gear ratio and output spline.

    Raises
    ------
    InputError
        For a channel that no rig of this joint has.
    """
    wanted = list(channels) if channels is not None else _usual(trajectory)
    for channel in wanted:
        _require_channel(channel)
    if "motor_current" in wanted and trajectory.joint.motor.torque_constant == 0:
        raise InputError(
            "simulation: motor_current needs Motor.torque_constant; give it in Nm/A, or leave the "
            "channel out"
        )
    columns = {channel: instruments.read(trajectory, channel) for channel in wanted}
    every = slice(None, None, _every(trajectory.time, rate))
    return Log(
        {"time": trajectory.time[every], **{k: v[every] for k, v in columns.items()}},
        {**_facts(trajectory), "name": name, **(facts or {})},
        ("simulated by flexspline.simulation",),
    )


def _usual(trajectory: Trajectory) -> list[str]:
    current = trajectory.joint.motor.torque_constant > 0
    left_out = {"output_velocity", "output_acceleration", "motor_velocity"}
    return [c for c in SOURCES if c not in left_out and (current or c != "motor_current")]


def _facts(trajectory: Trajectory) -> dict[str, str | float | int]:
    joint = trajectory.joint
    facts: dict[str, str | float | int] = {"joint": joint.name, "gear_ratio": joint.gear.ratio}
    if joint.gear.output_spline:
        facts["output_spline"] = joint.gear.output_spline
    if joint.motor.torque_constant > 0:
        facts["torque_constant"] = joint.motor.torque_constant
    return facts


def _require_channel(name: str) -> None:
    if name not in SOURCES:
        raise InputError(
            f"simulation: '{name}' is no channel that a trajectory can give"
            f"{did_you_mean(name, SOURCES)}; it gives {listed(SOURCES)}"
        )


def _every(time: Array, rate: float | None) -> int:
    if rate is None:
        return 1
    own = 1.0 / float(np.median(np.diff(time)))
    if not 0 < rate <= own * (1 + 1e-9):
        raise InputError(
            f"simulation: a log at {rate:g} Hz of a trajectory at {own:g} Hz; give a rate above 0 "
            "and not above the trajectory's"
        )
    return max(1, round(own / rate))


def _angle(trajectory: Trajectory, pair: str) -> Array:
    q, theta = trajectory["output_position"], trajectory["motor_position"]
    if pair == "output_on_housing":
        return q
    if pair == "motor_on_stator":
        return theta
    if pair == "wave_generator_on_flexspline":
        return trajectory.wave_generator_on_flexspline
    return theta - q if trajectory.joint.gear.output_spline == "circular" else theta


def _late(time: Array, values: Array, delay: float) -> Array:
    """What was `delay` seconds ago, linear between rows; the first value before the first row."""
    return np.asarray(np.interp(time - delay, time, values)) if delay > 0 else values


def _lagged(time: Array, values: Array, time_constant: float) -> Array:
    """First-order lag, exact for values that change linearly between even rows."""
    if time_constant == 0:
        return values
    x = float(np.median(np.diff(time))) / time_constant
    keep = np.exp(-x)
    new = 1.0 - (1.0 - keep) / x
    weights = [new, (1.0 - keep) - new]
    return np.asarray(lfilter(weights, [1.0, -keep], values - values[0]) + values[0])
