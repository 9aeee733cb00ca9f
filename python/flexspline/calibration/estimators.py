"""From coefficients in volts to the estimators that run on the joint, and what they read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexspline import _core
from flexspline.calibration.parameters import Asked, torque_coefficients
from flexspline.calibration.regression import Regression
from flexspline.calibration.runs import CalibrationRun, why_unexcited
from flexspline.estimators import Calibration, TemperatureCompensation, Thermistor
from flexspline.model import Model

__all__ = ["Estimators", "compensation_torque", "estimators_of"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Estimators:
    """What a calibration makes; None where the runs cannot give it.

    `full_scale`: Nm. `full_scale_source`: "given", "model" or "reference", the largest one.
    """

    calibration: Calibration | None
    compensation: TemperatureCompensation | None
    thermistor: Thermistor | None
    full_scale: float | None
    full_scale_source: str


def estimators_of(
    runs: Sequence[CalibrationRun],
    made: Regression,
    sensitivity: float | None,
    asked: Asked,
    into: Model | None,
) -> Estimators:
    """Return the estimators; none in volts alone, for without a sensitivity there is no torque."""
    full_scale, source = _full_scale(runs, asked, into)
    if sensitivity is None:
        return Estimators(None, None, None, full_scale, source)
    values = torque_coefficients(made, sensitivity)
    shape = made.shape
    calibration = Calibration(
        sensitivity,
        float(values[1]),
        _voltages(runs, made, into),
        full_scale,
    )
    if shape.degree == 0:
        return Estimators(calibration, None, None, full_scale, source)
    compensation = TemperatureCompensation(
        tuple(values[2 : 2 + shape.degree].tolist()),
        shape.reference_temperature,
        float(values[-1]) if shape.gradient else shape.held_gradient,
        shape.lag,
        _range([run.temperature for run in runs if run.temperature is not None]),
    )
    used = any("temperature" not in run.log for run in runs)
    return Estimators(
        calibration, compensation, asked.thermistor if used else None, full_scale, source
    )


def _full_scale(
    runs: Sequence[CalibrationRun], asked: Asked, into: Model | None
) -> tuple[float | None, str]:
    """The full scale given, else that of the model, else the largest reference, Nm."""
    if asked.full_scale is not None:
        return asked.full_scale, "given"
    known = None if into is None else into.estimators.get("calibration")
    largest = max(float(np.abs(run.torque).max()) for run in runs)
    largest = 0.0 if why_unexcited(runs) else largest
    if isinstance(known, Calibration) and (known.full_scale or 0.0) >= largest:
        return known.full_scale, "model"
    return largest or None, "reference"


def _voltages(
    runs: Sequence[CalibrationRun], made: Regression, into: Model | None
) -> tuple[float, float] | None:
    """Range of the voltage; a drift's alone says nothing of where the line holds."""
    if made.shape.sensitivity:
        return _range([run.voltage for run in runs])
    known = None if into is None else into.estimators.get("calibration")
    return known.voltage_range if isinstance(known, Calibration) else None


def _range(columns: Sequence[Array]) -> tuple[float, float]:
    return min(float(c.min()) for c in columns), max(float(c.max()) for c in columns)


def compensation_torque(
    compensation: TemperatureCompensation | None, time: Array, temperature: Array | None
) -> Array:
    """(N,), Nm: what the compensation adds."""
    if compensation is None or temperature is None:
        return np.zeros(len(time))
    return np.asarray(
        _core.temperature_compensation(
            time,
            temperature,
            coefficients=compensation.coefficients,
            reference_temperature=compensation.reference_temperature,
            gradient=compensation.gradient,
            thermal_lag=compensation.thermal_lag,
        )
    )
