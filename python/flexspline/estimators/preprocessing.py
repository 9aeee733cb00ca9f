"""What is done to readings before a torque is made of them: checked, and derived from the angle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, ClassVar

from flexspline.errors import InputError
from flexspline.estimators.checks import above_zero, choice, from_fields, span, to_fields

__all__ = ["DERIVED", "Differentiator", "ReadingChecks"]

RANGES = {
    "voltage_range": "V",
    "thermistor_voltage_range": "V",
    "temperature_range": "°C",
}
LIMITS = {
    "most_sensor_torque": "Nm",
    "most_motor_torque": "Nm",
    "most_speed": "rad/s",
    "most_acceleration": "rad/s²",
    "way": "rad",
    "twist": "rad",
    "apart": "Nm",
}


@dataclass(frozen=True)
class ReadingChecks:
    """Readings that cannot be true are taken out before the chain uses them.

        motion      e ← (1 − f T) e + Δq − T q̇,     |e| > way
        encoders    e ← (1 − f T) e + Ñ Δq − Δθ,    |e| > twist

    A stuck or stepping encoder, a velocity of the wrong sign, a converter at its end, a thermistor
    that is open or shorted, and what the joint cannot do. What is taken out counts as missing: the
    stages that read it keep their last good values, and the status says which reading was wrong.
    The chain's first stage, the same on a PC and on the joint; which fault is found after how many
    samples stands in `cpp/firmware/README.md`. Limits that are not given are not checked.

    Parameters
    ----------
    voltage_range : (low, high), V of the bridge, just inside the ends of its converter.
    thermistor_voltage_range : (low, high), V, just above a short and below an open line.
    temperature_range : (low, high), °C, where the temperature is a channel.
    most_sensor_torque : Nm, either way.
    most_motor_torque : Nm at the motor's shaft, either way.
    most_speed : rad/s at the output: of the velocity, and of the angle from sample to sample.
    most_acceleration : rad/s² at the output, between two velocities that are read.
    way : rad at the output, by which an angle may stray from a velocity that is read: above what
        is late and noisy.
    twist : rad at the motor, by which both encoders may differ: above torsion under full load.
    forget : f, 1/s, at which both are forgotten.
    apart : Nm, between the external torques of sensor and observer; takes nothing out, for either
        may be wrong.

    Raises
    ------
    InputError
        Where nothing is to be checked, a range does not rise, or a limit is not above zero.
    """

    key: ClassVar[str] = "reading_checks"

    voltage_range: tuple[float, float] | None = None
    thermistor_voltage_range: tuple[float, float] | None = None
    temperature_range: tuple[float, float] | None = None
    most_sensor_torque: float | None = None
    most_motor_torque: float | None = None
    most_speed: float | None = None
    most_acceleration: float | None = None
    way: float | None = None
    twist: float | None = None
    forget: float = 10.0
    apart: float | None = None

    def __post_init__(self) -> None:
        for name, unit in RANGES.items():
            made = span(getattr(self, name), f"reading_checks: {name}", unit)
            object.__setattr__(self, name, made)
        for name, unit in {**LIMITS, "forget": "1/s"}.items():
            value = getattr(self, name)
            if value is not None:
                limit = above_zero(value, f"reading_checks: {name}", unit)
                object.__setattr__(self, name, limit)
        given = [known.name for known in fields(self) if getattr(self, known.name) is not None]
        if given == ["forget"]:
            raise InputError(
                "reading_checks: there is nothing to check; give a limit, such as most_speed"
            )

    def to_json(self) -> dict[str, Any]:
        """Return the entry of `model.json`."""
        return to_fields(self)

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> ReadingChecks:
        """Return the estimator of an entry of `model.json`."""
        return from_fields(cls, content, cls.key)


DERIVED = ("output_velocity", "output_acceleration")


@dataclass(frozen=True)
class Differentiator:
    """Velocity and acceleration from the output's angle, causal, for what has no channel.

        v ← v + g (Δq / T − v),    a ← a + g (Δv / T − a),    g = 1 − exp(−2π f T)

    Two first-order low passes, −3 dB at f each: late by 1/(2π f) and twice that. The chain's first
    stage behind its checks, and the same on a PC and on the joint: what a log or a device has in
    the place of these channels is not read. The stage is silent, and the status says so, for
    7/(2π f) from a start or a longer gap on and while the angle is missing.

    Parameters
    ----------
    bandwidth : f, Hz; at most a quarter of the rate.
    channels : which of output_velocity and output_acceleration it makes.

    Raises
    ------
    InputError
        Where the bandwidth is not above zero, or a channel is not one of these.
    """

    key: ClassVar[str] = "differentiator"

    bandwidth: float
    channels: tuple[str, ...] = DERIVED

    def __post_init__(self) -> None:
        bandwidth = above_zero(self.bandwidth, "differentiator: bandwidth", "Hz")
        given = (self.channels,) if isinstance(self.channels, str) else tuple(self.channels)
        made = tuple(choice(name, "differentiator: channel", DERIVED) for name in given)
        if not made:
            raise InputError(
                f"differentiator: no channels to make; give {DERIVED[0]}, {DERIVED[1]} or both"
            )
        object.__setattr__(self, "bandwidth", bandwidth)
        object.__setattr__(self, "channels", tuple(name for name in DERIVED if name in made))

    def to_json(self) -> dict[str, Any]:
        """Return the entry of `model.json`."""
        return to_fields(self)

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> Differentiator:
        """Return the estimator of an entry of `model.json`."""
        return from_fields(cls, content, cls.key)
