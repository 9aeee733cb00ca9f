"""Parameters of a calibration with standard errors, the joint's estimators, and lost sensitivity.

The regression is in volts (`calibration/regression.py`); in torque

    k = 1/s,   zero = −v₀/s,   c_k = −d_k/s,   g = −h/s

to first order, with errors from the covariance of (s, v₀, d_k, h, lag): all of them depend on s,
which correlates their errors. In volts, zhang_disturbance_elimination (11): A′₀ … A′_n, the drift
as a polynomial in T itself, is a linear map of (v₀, d_k) about T₀.

Noise of the reference and of the thermometer takes from the sensitivity.

Least squares takes the rows X for exact. With errors U of their own in them, independent from row
to row, coefficients β come out beside the truth by

    −(XᵀX − S)⁻¹ S β,      S = E[UᵀU] = Σ_t σ_τ² e_s e_sᵀ + σ_T² j_t j_tᵀ,     j_t = ∂(row t)/∂T

([Carroll2006], chapter 3). In the basis B of the rows, XB orthonormal, the eigenvalues λ of BᵀSB
are the shares of noise in the directions that the runs determine, and each is off by λ/(1 − λ).
Where load and temperature change together, what is left of the load beside the columns of the drift
is small, and noise that is nothing beside the load is much beside that: a sensitivity may then be
wrong by many standard errors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import comb

import numpy as np
from numpy.typing import NDArray

from flexspline import _core
from flexspline.calibration.regression import Regression, Shape, drift_columns
from flexspline.calibration.runs import CalibrationRun, why_unexcited
from flexspline.calibration.thermal import SAME_TEMPERATURE
from flexspline.estimators import Calibration, TemperatureCompensation, Thermistor
from flexspline.least_squares.identifiability import Confounded, confounded_groups
from flexspline.least_squares.result import Parameter
from flexspline.least_squares.uncertainty import Uncertainty
from flexspline.logs.quantisation import quantum, white_noise
from flexspline.model import Model

__all__ = [
    "PART_OF_ERROR",
    "Asked",
    "Estimators",
    "compensation_torque",
    "confounded",
    "drift_polynomial",
    "estimators_of",
    "lost_to_noise",
    "lost_to_reference",
    "sensitivity_determined",
    "torque_parameters",
    "voltage_parameters",
]

Array = NDArray[np.float64]

RESOLVED = 10.0  # standard errors from zero below which a sensitivity is not determined

PART_OF_ERROR = 0.5
"""Of the standard error, that a bias may have: intervals of 95 % then cover 92 %."""

MOST_NOISE = 0.99  # share that is reckoned with: all of a direction may be noise


@dataclass(frozen=True)
class Asked:
    """What the caller wants. Lag in s, gradient in Nm/K, sensitivity in Nm/V; None: to be fitted.

    `sensitivity` is None where it is to be fitted, else known. `zero_per_run`: a zero for each run.
    """

    reference: str | None
    degree: int
    reference_temperature: float
    thermal_lag: float | None
    gradient: float | None
    sensitivity: float | None
    full_scale: float | None
    thermistor: Thermistor | None
    zero_per_run: bool


def _powers(unit: str, degree: int) -> str:
    return f"{unit}/K" if degree == 1 else f"{unit}/K{'⁰¹²³⁴⁵⁶'[degree]}"


def units_of(shape: Shape, unit: str) -> list[str]:
    """Units of the columns' coefficients, in V or in Nm."""
    drift = [_powers(unit, k) for k in range(1, shape.degree + 1)]
    slope = ["V/Nm" if unit == "V" else "Nm/V"] if shape.sensitivity else []
    return [
        *slope,
        unit,
        *drift,
        *([f"{unit}/K"] if shape.gradient else []),
        *[unit] * len(shape.contrasts),
    ]


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
    """The coefficients in volts that all runs share, and the lag."""
    shared, known = made.shape.shared, made.uncertainty
    names = made.shape.names[:shared]
    units = units_of(made.shape, "V")[:shared]
    values = list(made.coefficients[:shared])
    if made.shape.contrasts:
        kept = [*range(shared), *([len(made.coefficients)] if made.lag_free else [])]
        known = replace(
            known, basis=known.basis[kept], degrees_of_freedom=known.degrees_of_freedom[kept]
        )
    if made.lag_free:
        names, units, values = [*names, "thermal_lag"], [*units, "s"], [*values, made.shape.lag]
    return _parameters(names, units, np.array(values), known, hidden) + _held_lag(made)


def torque_coefficients(made: Regression, sensitivity: float) -> Array:
    """k, zero, c_k and g of volts per column that all runs share; k first where it is held too."""
    own = made.coefficients[: made.shape.shared]
    own = own[1:] if made.shape.sensitivity else own
    return np.concatenate([[sensitivity], -sensitivity * own])


def torque_parameters(
    made: Regression, sensitivity: float, hidden: set[str]
) -> tuple[Parameter, ...]:
    """k, zero, c_k, g and the lag, in Nm. A held k is known without error."""
    values = torque_coefficients(made, sensitivity)
    shared, free = made.shape.shared, made.coefficients.size
    names = ["sensitivity", *[n for n in made.shape.names[:shared] if n != "sensitivity"]]
    jacobian = np.zeros((len(values), free))
    others = slice(1 if made.shape.sensitivity else 0, shared)
    jacobian[1:, others] = -sensitivity * np.eye(len(values) - 1)
    if made.shape.sensitivity:
        jacobian[:, 0] = -sensitivity * values
    own = replace(made.shape, sensitivity=True, contrasts=())
    units, leading = units_of(own, "Nm"), list(range(shared))
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
                float(uncertainty.degrees_of_freedom[k]),
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


def lost_to_reference(runs: Sequence[CalibrationRun], made: Regression) -> float:
    """Share of V per Nm that noise of the reference takes off; it adds as much to Nm per V."""
    loaded = [run for run in runs if run.loaded]
    noise = max(white_noise(run.torque) for run in loaded)
    inverse = float(made.solution.basis[0] @ made.solution.basis[0])
    return noise**2 * sum(len(run) for run in loaded) * inverse


def lost_to_noise(runs: Sequence[CalibrationRun], made: Regression) -> float:
    """What noise of reference and thermometer together make of V per Nm, less the truth, V/Nm."""
    solution = made.solution
    squares = np.zeros((len(made.coefficients), len(made.coefficients)))
    for run in runs:
        squares += _noise_squares(run, made)
    basis = solution.basis
    share, turned = np.linalg.eigh(basis.T @ squares @ basis)
    share = np.minimum(share, MOST_NOISE)
    lengths = solution.lengths
    told = np.linalg.lstsq(basis * lengths[:, None], made.coefficients * lengths, rcond=None)[0]
    off = turned @ (share / (1.0 - share) * (turned.T @ told))
    return -float(basis[0] @ off)


def _noise_squares(run: CalibrationRun, made: Regression) -> Array:
    """(P, P), this run's share of S."""
    shape = made.shape
    squares = np.zeros((len(made.coefficients), len(made.coefficients)))
    if run.loaded:
        squares[0, 0] = len(run) * white_noise(run.torque) ** 2
    if run.temperature is None or not shape.degree:
        return squares
    powers = np.column_stack([np.ones(len(run)), drift_columns(run, shape)[:, : shape.degree - 1]])
    slopes = powers * np.arange(1, shape.degree + 1)
    own = slice(2, 2 + shape.degree)
    squares[own, own] = _error_of(run.temperature) ** 2 * (slopes.T @ slopes)
    return squares


def _error_of(temperature: Array) -> float:
    """Noise of a thermometer or of its rounding, K; a coarser step is a list of temperatures."""
    step = quantum(temperature)
    rounding = step / np.sqrt(12.0) if step < SAME_TEMPERATURE else 0.0
    return max(white_noise(temperature), float(rounding))
