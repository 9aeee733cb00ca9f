"""What temperature adds to the sensor's torque."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

from flexspline.errors import InputError
from flexspline.estimators.checks import (
    above_zero,
    from_fields,
    json_record,
    number,
    numbers,
    span,
    to_fields,
)

__all__ = ["HIGHEST_DEGREE", "TemperatureCompensation"]

HIGHEST_DEGREE = 6


@dataclass(frozen=True)
class TemperatureCompensation:
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

    def to_json(self) -> dict[str, Any]:
        """Return the entry of `model.json`."""
        return to_fields(self)

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> TemperatureCompensation:
        """Return the estimator of an entry of `model.json`."""
        return from_fields(cls, content, cls.key)
