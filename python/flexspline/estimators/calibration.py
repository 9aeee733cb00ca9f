"""From the bridge's voltage to torque."""

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
    span,
    to_fields,
)

__all__ = ["Calibration"]


@dataclass(frozen=True)
class Calibration:
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

    def to_json(self) -> dict[str, Any]:
        """Return the entry of `model.json`."""
        return to_fields(self)

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> Calibration:
        """Return the estimator of an entry of `model.json`."""
        return from_fields(cls, content, cls.key)
