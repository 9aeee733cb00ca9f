"""Calibrated runs, their legs and points, and the figures that follow."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexspline.calibration.drift import drift_columns
from flexspline.calibration.estimators import Estimators, compensation_torque
from flexspline.calibration.figures import Figure, load_figures
from flexspline.calibration.legs import Leg, Points, legs_of, points_on, slack_of
from flexspline.calibration.regression import Regression
from flexspline.calibration.runs import CalibrationRun, why_unexcited
from flexspline.calibration.thermal import (
    Thermal,
    ThermalLeg,
    thermal_figures,
    thermal_legs,
    thermal_means,
)
from flexspline.logs.log import Log

__all__ = ["CalibratedRun", "Views", "views_of"]

Array = NDArray[np.float64]

WHOLE_LEG = 0.5  # of the reference's span


@dataclass(frozen=True)
class CalibratedRun:
    """One run, arrays (N,). `voltage` V, `reference` Nm, `temperature` °C or None.

    `error`: reading less reference with the compensation, `uncompensated`: without, `held_out`:
    of regressions that never saw the row; Nm, or V where the sensitivity is not known.
    """

    log: Log
    voltage: Array
    reference: Array
    temperature: Array | None
    error: Array
    uncompensated: Array
    held_out: Array


@dataclass(frozen=True)
class Views:
    """What a result shows of its runs."""

    runs: tuple[CalibratedRun, ...]
    legs: tuple[Leg, ...]
    points: Points | None
    thermal_legs: tuple[ThermalLeg, ...]
    thermal: Thermal | None
    figures: tuple[Figure, ...]


def views_of(
    runs: Sequence[CalibrationRun],
    made: Regression,
    estimators: Estimators,
    held_out: Sequence[Array],
) -> Views:
    """Apply the estimators to the runs and look at what is left.

    Parameters
    ----------
    held_out : V, an array (N,) for each run.
    """
    seen = [
        _calibrated(run, made, estimators, residual, other)
        for run, residual, other in zip(runs, made.residuals, held_out, strict=True)
    ]
    full_scale = estimators.full_scale if estimators.calibration is not None else None
    long_run = float(np.sqrt(made.uncertainty.noise.long_run_variance))
    legs, points, why = _load(runs, seen, estimators, long_run)
    thermal, told, cold = _warmth(seen, full_scale)
    figures = (
        *load_figures(legs, points, full_scale, why),
        *thermal_figures(thermal, full_scale, cold),
    )
    return Views(tuple(seen), tuple(legs), points, tuple(told), thermal, figures)


def _calibrated(
    run: CalibrationRun,
    made: Regression,
    estimators: Estimators,
    residual: Array,
    held_out: Array,
) -> CalibratedRun:
    calibration = estimators.calibration
    scale = 1.0 if calibration is None else calibration.sensitivity
    error = scale * residual
    if calibration is None:
        first, shape = len(made.coefficients) - made.shape.degree - made.shape.gradient, made.shape
        columns = drift_columns(run, shape)[:, : shape.degree + shape.gradient]
        uncompensated = error + columns @ made.coefficients[first:]
    else:
        added = compensation_torque(estimators.compensation, run.log["time"], run.temperature)
        uncompensated = error - added
    return CalibratedRun(
        run.log,
        run.voltage,
        run.torque,
        run.temperature,
        error,
        np.asarray(uncompensated),
        scale * held_out,
    )


def _load(
    runs: Sequence[CalibrationRun],
    seen: Sequence[CalibratedRun],
    estimators: Estimators,
    long_run: float,
) -> tuple[list[Leg], Points | None, str]:
    """Legs of the reference and points on them; why there are none."""
    why = why_unexcited(runs)
    if why:
        return [], None, why
    if estimators.calibration is None:
        return [], None, "the sensitivity is not determined"
    columns = [run.torque for run in runs]
    span = max(float(c.max()) for c in columns) - min(float(c.min()) for c in columns)
    slack = slack_of([run.torque for run in runs if run.loaded])
    legs = legs_of(columns, slack, WHOLE_LEG * span)
    looked_at = [
        np.column_stack([run.error, run.voltage + (run.error - run.uncompensated)
                         / estimators.calibration.sensitivity])
        for run in seen
    ]  # fmt: skip
    if not legs:
        return legs, None, ""
    slow = (abs(estimators.calibration.sensitivity) * long_run, long_run)
    return legs, points_on(legs, columns, looked_at, slack, slow), ""


def _warmth(
    seen: Sequence[CalibratedRun], full_scale: float | None
) -> tuple[Thermal | None, list[ThermalLeg], str]:
    """Means over temperature, its legs, and why there are none."""
    temperatures = [run.temperature for run in seen if run.temperature is not None]
    if len(temperatures) < len(seen):
        return None, [], "temperature is left out"
    legs = thermal_legs(temperatures)
    errors = [np.column_stack([run.uncompensated, run.error]) for run in seen]
    torques = [run.reference for run in seen]
    thermal = thermal_means(legs, temperatures, torques, errors, full_scale)
    told = [
        ThermalLeg(
            seen[leg.run].log.name,
            leg.rising,
            min(leg.first, leg.last),
            max(leg.first, leg.last),
            float(np.mean(seen[leg.run].error[leg.start : leg.stop])),
            float(np.sqrt(np.mean(seen[leg.run].error[leg.start : leg.stop] ** 2))),
        )
        for leg in legs
    ]
    missing = "" if full_scale is not None else "in %FS it needs a sensitivity and a full scale"
    return thermal, told, missing
