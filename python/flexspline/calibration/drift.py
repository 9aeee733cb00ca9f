"""The rows of the regression: what the bridge's voltage is made of.

    V = s τ + v₀ + Σ_k d_k (T_b − T₀)^k + h (T − T_b),      k = 1 … degree

This is zhang_disturbance_elimination (10) solved for V, and (11) where τ = 0. The drift's columns
come from the core's compensation, fed with one coefficient at a time, so that what is fitted is
what runs on the joint.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexspline import _core
from flexspline.calibration.runs import CalibrationRun

__all__ = ["Shape", "drift_columns", "rows_of", "target_of"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Shape:
    """What is regressed on what.

    `degree`: of the drift, 0 for none. `reference_temperature`: T₀, °C. `lag`: s, of T_b behind T,
    0 for T_b = T. `gradient`: whether h is fitted; `held_gradient`: Nm/K, taken off the reference
    beforehand. `sensitivity`: whether s is fitted; `held_sensitivity`: Nm/V, known, or None.
    """

    degree: int
    reference_temperature: float
    lag: float
    gradient: bool
    held_gradient: float
    sensitivity: bool
    held_sensitivity: float | None

    @property
    def names(self) -> list[str]:
        """Of the columns, in order."""
        drift = [f"drift_{k}" for k in range(1, self.degree + 1)]
        return [
            *(["sensitivity"] if self.sensitivity else []),
            "zero",
            *drift,
            *(["gradient"] if self.gradient else []),
        ]


def drift_columns(run: CalibrationRun, shape: Shape) -> Array:
    """(N, degree + 1): (T_b − T₀)^k, and T − T_b last; units K^k."""
    if run.temperature is None:
        return np.zeros((len(run), 1))
    ones = np.eye(max(shape.degree, 1))
    fed = [(tuple(row), 0.0) for row in ones[: shape.degree]] + [((0.0,), 1.0)]
    columns = [
        _core.temperature_compensation(
            run.log["time"],
            run.temperature,
            coefficients=coefficients,
            reference_temperature=shape.reference_temperature,
            gradient=gradient,
            thermal_lag=shape.lag,
        )
        for coefficients, gradient in fed
    ]
    return np.column_stack(columns)


def rows_of(run: CalibrationRun, shape: Shape, drift: Array | None = None) -> Array:
    """(N, P), columns as in `shape.names`. `drift`: of `drift_columns`, if they are there."""
    drift = drift_columns(run, shape) if drift is None else drift
    columns = [np.ones((len(run), 1)), drift[:, : shape.degree]]
    if shape.sensitivity:
        columns.insert(0, _torque(run, shape, drift)[:, None])
    if shape.gradient:
        columns.append(drift[:, -1:])
    return np.asfortranarray(np.hstack(columns))


def target_of(run: CalibrationRun, shape: Shape, drift: Array | None = None) -> Array:
    """(N,), V: the voltage, less what a known sensitivity says of it."""
    if shape.held_sensitivity is None:
        return run.voltage
    drift = drift_columns(run, shape) if drift is None else drift
    return np.asarray(run.voltage - _torque(run, shape, drift) / shape.held_sensitivity)


def _torque(run: CalibrationRun, shape: Shape, drift: Array) -> Array:
    if shape.held_gradient == 0.0:
        return run.torque
    return np.asarray(run.torque - shape.held_gradient * drift[:, -1])
