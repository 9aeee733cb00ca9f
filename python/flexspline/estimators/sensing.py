"""The stages that make a torque of readings: those checked and derived, the sensor undone.

Readings are checked, and derived from the angle. The sensor's temperature comes from a thermistor,
its voltage becomes a torque, its drift is undone.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar

from flexspline.errors import InputError, above_zero, number, numbers
from flexspline.estimators.checks import (
    ABSOLUTE_ZERO,
    Entry,
    Estimators,
    Parts,
    choice,
    json_record,
    span,
)

__all__ = [
    "DERIVED",
    "HIGHEST_DEGREE",
    "Calibration",
    "Differentiator",
    "ReadingChecks",
    "TemperatureCompensation",
    "Thermistor",
]


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
class ReadingChecks(Entry):
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

    def require(self, estimators: Estimators, parts: Parts) -> None:
        """Refuse a model that lacks what this reads."""
        made: Differentiator | None = estimators.get("differentiator")
        if made is None or DERIVED[0] not in made.channels:
            return
        for name in ("way", "most_acceleration"):
            if getattr(self, name) is not None:
                raise InputError(
                    f"reading_checks: {name} is of a velocity that is read, but the differentiator "
                    "makes it from the angle itself; leave it out and give most_speed or twist"
                )


DERIVED = ("output_velocity", "output_acceleration")


@dataclass(frozen=True)
class Differentiator(Entry):
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


@dataclass(frozen=True)
class Thermistor(Entry):
    """Temperature from the voltage of a thermistor's divider.

        R = R_d V / (V_cc − V),    1 / T = 1 / T_N + ln(R / R_N) / B    (T in K)

    A voltage at or beyond the supply's ends (an open or shorted thermistor) gives no
    temperature and is flagged. Source: zhang_disturbance_elimination (6), (7).

    Parameters
    ----------
    supply_voltage : V_cc, V.
    divider_resistance : R_d, Ω; the fixed resistor of the divider.
    nominal_resistance : R_N, Ω; the thermistor at the nominal temperature.
    beta : B, K.
    nominal_temperature : T_N, °C.

    Raises
    ------
    InputError
        Where a value is not finite, not above zero, or below absolute zero.
    """

    key: ClassVar[str] = "thermistor"

    supply_voltage: float
    divider_resistance: float
    nominal_resistance: float
    beta: float
    nominal_temperature: float = 25.0

    def __post_init__(self) -> None:
        units = {"supply_voltage": "V", "divider_resistance": "Ω", "nominal_resistance": "Ω"}
        for name, unit in {**units, "beta": "K"}.items():
            value = above_zero(getattr(self, name), f"thermistor: {name}", unit)
            object.__setattr__(self, name, value)
        nominal = number(self.nominal_temperature, "thermistor: nominal_temperature", "°C")
        if nominal <= ABSOLUTE_ZERO:
            raise InputError(
                f"thermistor: nominal_temperature = {nominal:g} °C is below absolute zero; "
                "give it in °C"
            )
        object.__setattr__(self, "nominal_temperature", nominal)


HIGHEST_DEGREE = 6


@dataclass(frozen=True)
class TemperatureCompensation(Entry):
    """Torque to add to the calibrated reading so that temperature leaves no trace.

        τ = Σ_k c_k (T_b − T_0)^k + g (T − T_b),    k = 1 … degree

    T_b is the temperature of the elastic body: the measured T, late by a first-order lag. The
    polynomial alone is the paper's; lag and gradient are the step beyond it.
    Source: zhang_disturbance_elimination (8)–(11), (24).

    Parameters
    ----------
    coefficients : c_k, Nm/°C^k, from k = 1; at most six.
    reference_temperature : T_0, °C; there the compensation is zero.
    gradient : g, Nm/K, for a body that is not evenly warm.
    thermal_lag : s; zero for none.
    temperature_range : (low, high) of the logs of the fit, °C; outside, estimates are flagged as
        extrapolated. None where it is not known.
    record : what the fit knew beside the values; kept as it is.

    Raises
    ------
    InputError
        Where a value is not finite, the lag is negative, or there are no coefficients or too many.
    """

    key: ClassVar[str] = "temperature_compensation"

    coefficients: tuple[float, ...]
    reference_temperature: float = 25.0
    gradient: float = 0.0
    thermal_lag: float = 0.0
    temperature_range: tuple[float, float] | None = None
    record: Mapping[str, Any] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        say = "temperature_compensation: "
        coefficients = numbers(self.coefficients, f"{say}coefficients", "Nm/°C^k")
        if not 1 <= len(coefficients) <= HIGHEST_DEGREE:
            raise InputError(
                f"{say}{len(coefficients)} coefficients are given; "
                f"give one for each degree from 1 to at most {HIGHEST_DEGREE}"
            )
        reference = number(self.reference_temperature, f"{say}reference_temperature", "°C")
        lag = above_zero(self.thermal_lag, f"{say}thermal_lag", "s", or_zero=True)
        made = {
            "coefficients": coefficients,
            "reference_temperature": reference,
            "gradient": number(self.gradient, f"{say}gradient", "Nm/K"),
            "thermal_lag": lag,
            "temperature_range": span(self.temperature_range, f"{say}temperature_range", "°C"),
            "record": json_record(self.record, self.key),
        }
        for name, value in made.items():
            object.__setattr__(self, name, value)


@dataclass(frozen=True)
class Calibration(Entry):
    """Torque from the bridge's voltage; the temperature compensation is added to it.

        τ_s = sensitivity · V + zero + compensation(T)

    Source: zhang_disturbance_elimination (10), (25): 62.738 Nm/V and 2.1835 Nm.

    Parameters
    ----------
    sensitivity : Nm/V, not zero.
    zero : Nm, the torque that zero volts stand for.
    voltage_range : (low, high) of the logs of the calibration, V; outside, estimates are flagged
        as extrapolated. None where it is not known.
    full_scale : Nm, what %FS are percent of; None where it is not known.
    record : parameters with errors, non-linearity, hysteresis and repeatability, logs with their
        SHA-256; kept as it is.

    Raises
    ------
    InputError
        Where a value is not finite, or the sensitivity is zero.
    """

    key: ClassVar[str] = "calibration"

    sensitivity: float
    zero: float
    voltage_range: tuple[float, float] | None = None
    full_scale: float | None = None
    record: Mapping[str, Any] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        sensitivity = number(self.sensitivity, "calibration: sensitivity", "Nm/V")
        if sensitivity == 0.0:
            raise InputError(
                "calibration: sensitivity is zero, so the sensor reads nothing; "
                "calibrate with loads that differ"
            )
        full = self.full_scale
        if full is not None:
            full = above_zero(full, "calibration: full_scale", "Nm")
        made = {
            "sensitivity": sensitivity,
            "zero": number(self.zero, "calibration: zero", "Nm"),
            "voltage_range": span(self.voltage_range, "calibration: voltage_range", "V"),
            "full_scale": full,
            "record": json_record(self.record, self.key),
        }
        for name, value in made.items():
            object.__setattr__(self, name, value)
