"""The thermistor beside the strain gauges, read through a voltage divider."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from flexspline.errors import InputError
from flexspline.estimators.checks import ABSOLUTE_ZERO, above_zero, from_fields, number, to_fields

__all__ = ["Thermistor"]


@dataclass(frozen=True)
class Thermistor:
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

    def to_json(self) -> dict[str, Any]:
        """Return the entry of `model.json`."""
        return to_fields(self)

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> Thermistor:
        """Return the estimator of an entry of `model.json`."""
        return from_fields(cls, content, cls.key)
