"""The steps of a calibration: runs, regression, estimators, figures, and what is wrong."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexspline.calibration.calibrating import require_rows, require_temperatures
from flexspline.calibration.drift import Shape
from flexspline.calibration.estimators import Estimators, estimators_of
from flexspline.calibration.parameters import (
    Asked,
    confounded,
    drift_polynomial,
    sensitivity_determined,
    torque_parameters,
    voltage_parameters,
)
from flexspline.calibration.regression import Regression, regress
from flexspline.calibration.result import CalibrationResult
from flexspline.calibration.runs import CalibrationRun, calibration_runs, why_unexcited
from flexspline.calibration.says import warnings_of
from flexspline.calibration.validation import cross_validate
from flexspline.calibration.views import views_of
from flexspline.estimators import Calibration
from flexspline.least_squares.identifiability import Confounded
from flexspline.least_squares.result import Parameter
from flexspline.logs.log import Log
from flexspline.model import Model
from flexspline.plain import plain_json

__all__ = ["calibrated"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class _Solved:
    """The regression, what it cannot tell apart, and k (None where it is not known)."""

    made: Regression
    groups: list[Confounded]
    sensitivity: float | None
    why_not: str


def calibrated(logs: Sequence[Log], asked: Asked, into: Model | None) -> CalibrationResult:
    """Calibrate; the arguments have been checked."""
    runs, strange = calibration_runs(
        logs, asked.reference, asked.thermistor, temperature_needed=asked.degree > 0
    )
    if asked.degree == 0:
        runs = [replace(run, temperature=None) for run in runs]
    require_temperatures(runs, asked.degree)
    solved = _solved(runs, asked, into)
    validation = cross_validate(runs, solved.made)
    estimators = estimators_of(runs, solved.made, solved.sensitivity, asked, into)
    views = views_of(runs, solved.made, estimators, validation.residuals)
    volts, torques = _parameters(solved)
    result = CalibrationResult(
        model=into or Model({}),
        calibration=estimators.calibration,
        compensation=estimators.compensation,
        voltage_parameters=volts,
        torque_parameters=torques,
        drift_polynomial=drift_polynomial(solved.made),
        confounded=tuple(solved.groups),
        runs=views.runs,
        legs=views.legs,
        points=views.points,
        thermal_legs=views.thermal_legs,
        thermal=views.thermal,
        figures=views.figures,
        full_scale=estimators.full_scale,
        full_scale_source=estimators.full_scale_source,
        sensitivity_reason=solved.why_not,
        validated_by=validation.by,
        fold_rmses=tuple((validation.rmses * (abs(solved.sensitivity or 1.0))).tolist()),
        fold_labels=validation.labels,
        uncertainty=solved.made.uncertainty,
        shape=solved.made.shape,
        warnings=(),
    )
    result = replace(result, warnings=(*strange, *warnings_of(result, runs, solved.made)))
    return replace(result, model=_model(result, estimators, asked, into))


def _solved(runs: Sequence[CalibrationRun], asked: Asked, into: Model | None) -> _Solved:
    """With the sensitivity where the runs determine it, else the drift alone."""
    shape = _shape(asked)
    find_lag = asked.thermal_lag is None
    why_not = why_unexcited(runs)
    if asked.sensitivity is None and not why_not:
        require_rows(runs, len(shape.names) + find_lag)
        made = regress(runs, shape, find_lag=find_lag)
        groups = confounded(made)
        if sensitivity_determined(made, groups):
            return _Solved(made, groups, 1.0 / float(made.coefficients[0]), "")
        why_not = "the voltage does not follow the reference"
        if any(group.exact and "sensitivity" in group.names for group in groups):
            why_not = "load and temperature change together in these runs"
    known = asked.sensitivity if asked.sensitivity is not None else _known(into)
    held = 0.0 if known is None else (asked.gradient or 0.0)
    shape = replace(shape, sensitivity=False, held_sensitivity=known, held_gradient=held)
    require_rows(runs, len(shape.names) + find_lag)
    made = regress(runs, shape, find_lag=find_lag)
    return _Solved(made, confounded(made), known, why_not if asked.sensitivity is None else "")


def _shape(asked: Asked) -> Shape:
    return Shape(
        asked.degree,
        asked.reference_temperature,
        asked.thermal_lag or 0.0,
        asked.gradient is None,
        asked.gradient or 0.0,
        True,
        None,
    )


def _known(into: Model | None) -> float | None:
    found = None if into is None else into.estimators.get("calibration")
    return found.sensitivity if isinstance(found, Calibration) else None


def _parameters(solved: _Solved) -> tuple[tuple[Parameter, ...], tuple[Parameter, ...]]:
    hidden = {name for group in solved.groups for name in group.names}
    volts = voltage_parameters(solved.made, hidden)
    if solved.sensitivity is None:
        return volts, ()
    return volts, torque_parameters(solved.made, solved.sensitivity, hidden)


def _model(
    result: CalibrationResult, estimators: Estimators, asked: Asked, into: Model | None
) -> Model:
    """The model with the estimators and what was known when they were made."""
    model = into or Model({}, _facts(result))
    if estimators.calibration is None:
        return model
    kept = {k: v for k, v in model.estimators.items() if k != "temperature_compensation"}
    record = _record(result, asked)
    made = replace(model, estimators=kept)
    if estimators.thermistor is not None:
        made = made.with_estimator(estimators.thermistor)
    made = made.with_estimator(replace(estimators.calibration, record=record))
    if estimators.compensation is None:
        return made
    return made.with_estimator(estimators.compensation)


def _facts(result: CalibrationResult) -> dict[str, Any]:
    known = ("joint", "gear_ratio", "output_spline", "pole_pairs", "slots", "torque_constant")
    facts = result.runs[0].log.facts
    return {key: facts[key] for key in known if key in facts}


def _record(result: CalibrationResult, asked: Asked) -> dict[str, Any]:
    return dict(
        plain_json(
            {
                "reference": asked.reference,
                "parameters": [asdict(p) for p in result.torque_parameters],
                "volts": [asdict(p) for p in result.voltage_parameters],
                "figures": [asdict(figure) for figure in result.figures],
                "held_out": {
                    "by": result.validated_by,
                    "rmse": result.cv_rmse,
                    "median": result.median_fold,
                    "worst": result.worst_fold,
                },
                "warnings": list(result.warnings),
                "logs": [_log_record(run.log) for run in result.runs],
            }
        )
    )


def _log_record(log: Log) -> dict[str, Any]:
    return {
        "name": log.name,
        "sha256": log.source.sha256 if log.source else None,
        "rows": len(log),
        "history": list(log.history),
    }
