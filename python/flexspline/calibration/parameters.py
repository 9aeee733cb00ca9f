"""From volts to torque: the parameters that people read, with errors carried along.

    k = 1/s,   zero = −v₀/s,   c_k = −d_k/s,   g = −h/s

to first order, from the covariance of (s, v₀, d_k, h, lag): all of them lean on s, and their
errors are correlated through it. In volts, zhang_disturbance_elimination (11):
A′₀ … A′_n, the drift as a polynomial in T itself, is a linear map of (v₀, d_k) about T₀.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import comb

import numpy as np
from numpy.typing import NDArray

from flexspline.calibration.drift import Shape
from flexspline.calibration.regression import Regression
from flexspline.estimators import Thermistor
from flexspline.least_squares.identifiability import Confounded, confounded_groups
from flexspline.least_squares.result import Parameter
from flexspline.least_squares.uncertainty import Uncertainty

__all__ = [
    "Asked",
    "confounded",
    "drift_polynomial",
    "sensitivity_determined",
    "torque_coefficients",
    "torque_parameters",
    "voltage_parameters",
]

Array = NDArray[np.float64]

RESOLVED = 10.0  # standard errors from zero below which a sensitivity is not determined


@dataclass(frozen=True)
class Asked:
    """What the caller wants. Lag in s, gradient in Nm/K, sensitivity in Nm/V; None: to be fitted.

    `sensitivity` is None where it is to be fitted, else known.
    """

    reference: str | None
    degree: int
    reference_temperature: float
    thermal_lag: float | None
    gradient: float | None
    sensitivity: float | None
    full_scale: float | None
    thermistor: Thermistor | None


def _powers(unit: str, degree: int) -> str:
    return f"{unit}/K" if degree == 1 else f"{unit}/K{'⁰¹²³⁴⁵⁶'[degree]}"


def units_of(shape: Shape, unit: str) -> list[str]:
    """Units of the columns' coefficients, in V or in Nm."""
    drift = [_powers(unit, k) for k in range(1, shape.degree + 1)]
    slope = ["V/Nm" if unit == "V" else "Nm/V"] if shape.sensitivity else []
    return [*slope, unit, *drift, *([f"{unit}/K"] if shape.gradient else [])]


def confounded(made: Regression) -> list[Confounded]:
    """Coefficients that the runs cannot tell apart, in volts."""
    extra = 1 if made.lag_free else 0

    def errors_of(directions: Array) -> Array:
        zeros = np.zeros((len(directions), extra))
        return made.uncertainty.errors_of(np.hstack([directions, zeros]))

    return confounded_groups(
        made.solution,
        made.shape.names,
        units_of(made.shape, "V"),
        made.coefficients,
        errors_of,
        np.zeros((0, len(made.coefficients))),
    )


def sensitivity_determined(made: Regression, groups: Sequence[Confounded]) -> bool:
    """Whether s stands well above its error, and no other column could take its place."""
    if not made.shape.sensitivity or any(g.exact and "sensitivity" in g.names for g in groups):
        return False
    error = made.uncertainty.standard_errors[0]
    return bool(abs(made.coefficients[0]) > 0.0 and abs(made.coefficients[0]) >= RESOLVED * error)


def voltage_parameters(made: Regression, hidden: set[str]) -> tuple[Parameter, ...]:
    """The coefficients in volts, and the lag."""
    names = [*made.shape.names]
    units = units_of(made.shape, "V")
    values = list(made.coefficients)
    if made.lag_free:
        names, units, values = [*names, "thermal_lag"], [*units, "s"], [*values, made.shape.lag]
    return _parameters(names, units, np.array(values), made.uncertainty, hidden) + _held_lag(made)


def torque_coefficients(made: Regression, sensitivity: float) -> Array:
    """k, zero, c_k and g of volts per column, (P,) or (P + 1,) where k is held."""
    own = made.coefficients[1:] if made.shape.sensitivity else made.coefficients
    return np.concatenate([[sensitivity], -sensitivity * own])


def torque_parameters(
    made: Regression, sensitivity: float, hidden: set[str]
) -> tuple[Parameter, ...]:
    """k, zero, c_k, g and the lag, in Nm. A held k is known without error."""
    values = torque_coefficients(made, sensitivity)
    names = ["sensitivity", *[n for n in made.shape.names if n != "sensitivity"]]
    free = made.coefficients.size
    jacobian = np.zeros((len(values), free))
    others = slice(1 if made.shape.sensitivity else 0, free)
    jacobian[1:, others] = -sensitivity * np.eye(len(values) - 1)
    if made.shape.sensitivity:
        jacobian[:, 0] = -sensitivity * values
    own = replace(made.shape, sensitivity=True)
    units, leading = units_of(own, "Nm"), list(range(free))
    if not made.shape.sensitivity:
        leading = [0, *leading]
    if made.lag_free:
        names, units = [*names, "thermal_lag"], [*units, "s"]
        values = np.append(values, made.shape.lag)
        jacobian = np.block(
            [[jacobian, np.zeros((len(jacobian), 1))], [np.zeros((1, free)), np.ones((1, 1))]]
        )
        leading.append(free)
    carried = _carried(made.uncertainty, jacobian, leading)
    held = () if made.shape.sensitivity else ("sensitivity",)
    return _parameters(names, units, values, carried, hidden, held) + _held_lag(made)


def drift_polynomial(made: Regression) -> tuple[Parameter, ...]:
    """A′₀ … A′_n, b(T) = Σ A′_j T^j in V with T in °C, without lag and gradient.

    zhang_disturbance_elimination (11); its (24) prints 0.0102 T² − 0.8704 T − 21.39, in mV.
    """
    shape, first = made.shape, 1 if made.shape.sensitivity else 0
    n = shape.degree + 1
    shift = np.zeros((n, len(made.uncertainty.basis)))
    for j in range(n):
        for k in range(j, n):
            shift[j, first + k] = comb(k, j) * (-shape.reference_temperature) ** (k - j)
    values = shift[:, first : first + n] @ made.coefficients[first : first + n]
    carried = _carried(made.uncertainty, shift, list(range(first, first + n)))
    names = [f"A'_{j}" for j in range(n)]
    units = ["V", *[_powers("V", k) for k in range(1, n)]]
    return _parameters(names, units, values, carried, set())


def _carried(uncertainty: Uncertainty, jacobian: Array, leading: Sequence[int]) -> Uncertainty:
    """The uncertainty of jacobian @ β; degrees of freedom are those of the leading parameter."""
    freedom = uncertainty.degrees_of_freedom[list(leading)]
    return replace(uncertainty, basis=jacobian @ uncertainty.basis, degrees_of_freedom=freedom)


def _parameters(
    names: Sequence[str],
    units: Sequence[str],
    values: Array,
    uncertainty: Uncertainty,
    hidden: set[str],
    held: Sequence[str] = (),
) -> tuple[Parameter, ...]:
    errors, naive = uncertainty.standard_errors, uncertainty.naive_standard_errors
    intervals, news = uncertainty.intervals(values), uncertainty.effective_samples_of
    found = []
    for k, name in enumerate(names):
        determined = name not in hidden
        state = "fixed" if name in held else "fitted" if determined else "not determined"
        found.append(
            Parameter(
                name,
                "shape" if name == "thermal_lag" else "coefficient",
                float(values[k]),
                float(errors[k]),
                float(naive[k]),
                (float(intervals[k, 0]), float(intervals[k, 1])),
                units[k],
                state,
                determined,
                None,
                float(news[k]),
            )
        )
    return tuple(found)


def _held_lag(made: Regression) -> tuple[Parameter, ...]:
    """The lag where it was given, or was searched for and not found."""
    if made.lag_free or made.shape.lag == 0.0:
        return ()
    lag, nothing = made.shape.lag, float("nan")
    state = "fixed"
    if made.lag is not None:
        bounds = {-1: "at lower bound", 1: "at upper bound"}
        state = "not determined" if made.lag.flat else bounds[made.lag.bound]
    known = (lag, lag) if state == "fixed" else (nothing, nothing)
    determined = state == "fixed"
    return (
        Parameter(
            "thermal_lag", "shape", lag, nothing, nothing, known, "s", state, determined, None,
            nothing,
        ),
    )  # fmt: skip
