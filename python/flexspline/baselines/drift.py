"""Drift models that the first paper cites: linear with the calibration, and kernel regression.

A table says what each leaves on a run that it was not fitted to.
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexspline import _core
from flexspline.errors import InputError, listed
from flexspline.logs.log import Log
from flexspline.logs.read import as_logs

if TYPE_CHECKING:
    import pandas

    from flexspline.estimators import Estimator

__all__ = [
    "KernelDrift",
    "LinearDrift",
    "compare_drift_methods",
    "kernel_drift",
    "linear_drift",
    "require_scikit",
]

Array = NDArray[np.float64]

CHANNELS = ("sensor_voltage", "temperature", "reference_torque")
MOST_ROWS = 1500  # a kernel matrix is rows by rows
FOLDS = 5

REPEATS = 3  # of which the quickest counts
NEEDED = ("sensor_voltage", "temperature", "reference_torque")


@dataclass(frozen=True, eq=False)
class LinearDrift:
    """τ = sensitivity · V + zero + slope · (T − reference_temperature).

    Nm/V, Nm, Nm/K and °C; `covariance` (3, 3) of the first three, as if errors were white.
    """

    sensitivity: float
    zero: float
    slope: float
    reference_temperature: float
    covariance: Array

    def torque(self, voltage: ArrayLike, temperature: ArrayLike) -> Array:
        """Return the torque [Nm] of voltages [V] at temperatures [°C]."""
        warmer = np.asarray(temperature, float) - self.reference_temperature
        return self.sensitivity * np.asarray(voltage, float) + self.zero + self.slope * warmer


def linear_drift(logs: Log | Sequence[Log], *, reference_temperature: float = 25.0) -> LinearDrift:
    """Fit drift linear in temperature together with the calibration.

    Parameters
    ----------
    logs : with sensor_voltage [V], temperature [°C] and reference_torque [Nm].
    reference_temperature : where the drift counts as none, °C.

    Raises
    ------
    InputError
        Where a channel is missing, or torque or temperature do not vary enough to tell the
        three coefficients apart.

    References
    ----------
    Ref. 16 of zhang_disturbance_elimination (a six-axis sensor; here one axis).
    """
    voltage, temperature, torque = _rows(logs, CHANNELS)
    rows = np.column_stack([voltage, np.ones_like(voltage), temperature - reference_temperature])
    size = np.linalg.norm(rows, axis=0)
    if len(rows) < 4 or np.linalg.cond(rows / np.where(size > 0.0, size, 1.0)) > 1e8:
        raise InputError(
            "linear drift: voltage and temperature do not vary enough to tell sensitivity, zero "
            "and drift apart; give several torques and temperatures"
        )
    found, *_ = np.linalg.lstsq(rows, torque, rcond=None)
    left = torque - rows @ found
    variance = float(left @ left) / (len(rows) - 3)
    covariance = variance * np.linalg.inv(rows.T @ rows)
    sensitivity, zero, slope = found.tolist()
    return LinearDrift(sensitivity, zero, slope, reference_temperature, covariance)


@dataclass(frozen=True)
class KernelDrift:
    """τ = sensitivity · V + drift(T), the drift by kernel regression of scikit-learn.

    `sensitivity` in Nm/V, `range` of temperatures that it was fitted in [°C], `width` of the
    kernel [K] and `penalty` as cross-validation chose them.
    """

    sensitivity: float
    range: tuple[float, float]
    width: float
    penalty: float
    regressor: Any
    centre: float
    offset: float

    def drift(self, temperature: ArrayLike) -> Array:
        """Return what is added to sensitivity · V [Nm]; outside `range` it is NaN."""
        given = np.asarray(temperature, float)
        inside = (given >= self.range[0]) & (given <= self.range[1])
        held = np.where(inside, given, self.centre)
        found = self.regressor.predict(((held - self.centre) / self.width).reshape(-1, 1))
        return np.where(inside, self.offset + found.reshape(given.shape), np.nan)

    def torque(self, voltage: ArrayLike, temperature: ArrayLike) -> Array:
        """Return the torque [Nm] of voltages [V] at temperatures [°C]."""
        return self.sensitivity * np.asarray(voltage, float) + self.drift(temperature)


def kernel_drift(logs: Log | Sequence[Log], *, seed: int = 1) -> KernelDrift:
    """Fit the drift over temperature by kernel ridge regression, beside a linear sensitivity.

    The sensitivity is fitted first, with drift as a polynomial; then the kernel takes what it
    leaves. Least-squares support vectors are ridge regression with a kernel and an offset
    [Suykens2002]; the paper's particle swarm is replaced by cross-validation over a grid.

    Parameters
    ----------
    logs : with sensor_voltage [V], temperature [°C] and reference_torque [Nm].
    seed : which rows are kept of a long log (1500 of them), and of the folds.

    Raises
    ------
    InputError
        Where scikit-learn is not installed, a channel is missing, or there are fewer than 20 rows
        or no more than one temperature.

    References
    ----------
    Ref. 17 of zhang_disturbance_elimination.
    """
    ridge, search, folds = require_scikit()
    voltage, temperature, torque = _rows(logs, CHANNELS)
    if len(torque) < 20 or np.ptp(temperature) == 0.0:
        raise InputError(
            f"kernel drift: {len(torque)} rows with {len(np.unique(temperature))} temperatures; "
            "give at least 20 rows over a range of temperatures"
        )
    rng = np.random.default_rng(seed)
    kept = np.sort(rng.permutation(len(torque))[:MOST_ROWS])
    voltage, temperature, torque = voltage[kept], temperature[kept], torque[kept]
    centre = float(temperature.mean())
    width = float(temperature.std())
    x = (temperature - centre) / width
    rows = np.column_stack([voltage, np.ones_like(x), x, x**2])
    sensitivity = float(np.linalg.lstsq(rows, torque, rcond=None)[0][0])
    drift = torque - sensitivity * voltage
    offset = float(drift.mean())
    grid = {"alpha": np.geomspace(1e-4, 1.0, 5), "gamma": np.geomspace(0.03, 3.0, 5)}
    found = search(ridge(kernel="rbf"), grid, cv=folds(FOLDS, shuffle=True, random_state=seed))
    found.fit(x.reshape(-1, 1), drift - offset)
    chosen = found.best_params_
    edges = float(temperature.min()), float(temperature.max())
    return KernelDrift(
        sensitivity,
        edges,
        width,
        float(chosen["alpha"]),
        found.best_estimator_,
        centre,
        offset,
    )


def require_scikit() -> tuple[Any, Any, Any]:
    """Return what kernel regression takes from scikit-learn, or say how to install that.

    Raises
    ------
    InputError
        Where it is not installed.
    """
    try:
        from sklearn.kernel_ridge import KernelRidge
        from sklearn.model_selection import GridSearchCV, KFold
    except ImportError as error:
        raise InputError(
            "kernel drift: scikit-learn is not installed; run pip install 'flexspline[baselines]'"
        ) from error
    return KernelRidge, GridSearchCV, KFold


def _rows(logs: Log | Sequence[Log], channels: Sequence[str]) -> tuple[Array, ...]:
    """The finite rows of these channels over all logs."""
    runs = as_logs(logs)
    if not runs:
        raise InputError("drift: there is no log; give at least one")
    for log in runs:
        missing = [name for name in channels if name not in log]
        if missing:
            raise InputError(
                f"log '{log.name}': drift needs the channel {missing[0]}; it has "
                f"{listed(log.channels)}"
            )
    joined = [np.concatenate([log[name] for log in runs]) for name in channels]
    good = np.all(np.isfinite(joined), axis=0)
    return tuple(values[good] for values in joined)


def compare_drift_methods(
    training: Log | Sequence[Log], validation: Log, *, degree: int = 2, seed: int = 1
) -> pandas.DataFrame:
    """Return what is left of the drift by each model, fitted to the same runs.

    A row each: no drift at all (a line through volts), linear in temperature fitted together with
    the calibration (ref. 16), the paper's polynomial (`flexspline.calibrate`), kernel regression
    (ref. 17). Columns: RMSE and largest error [Nm], rows without an answer [%] (outside of the
    temperatures fitted, where a kernel knows nothing), and cost [ns per sample] on this machine.

    Parameters
    ----------
    training : with sensor_voltage [V], temperature [°C] and reference_torque [Nm].
    validation : a run that no model saw, with the same channels.
    degree : of the polynomial.
    seed : of the kernel's rows and folds.

    Raises
    ------
    InputError
        Where the validation lacks a channel, or as `linear_drift`, `kernel_drift` and
        `flexspline.calibrate`.

    References
    ----------
    zhang_disturbance_elimination (8)–(11) and its refs. 16, 17.
    """
    import pandas

    from flexspline.calibration import calibrate
    from flexspline.estimators import Calibration, TemperatureCompensation

    for name in NEEDED:
        if name not in validation:
            raise InputError(
                f"log '{validation.name}': the drift methods need the channel {name}; map it"
            )
    runs = as_logs(training)
    linear, kernel = linear_drift(runs), kernel_drift(runs, seed=seed)
    line, curve = (calibrate(runs, degree=its).model.estimators for its in (0, degree))
    volts, warmth = validation["sensor_voltage"], validation["temperature"]

    def calibrated(found: Mapping[str, Estimator]) -> Array:
        own = found["calibration"]
        assert isinstance(own, Calibration)
        return np.asarray(own.sensitivity * volts + own.zero)

    def compensated() -> Array:
        law = curve["temperature_compensation"]
        assert isinstance(law, TemperatureCompensation)
        drift = _core.temperature_compensation(
            validation["time"],
            warmth,
            coefficients=list(law.coefficients),
            reference_temperature=law.reference_temperature,
            gradient=law.gradient,
            thermal_lag=law.thermal_lag,
        )
        return calibrated(curve) + drift

    ways: dict[str, Callable[[], Array]] = {
        "none": lambda: calibrated(line),
        "linear, with the calibration": lambda: linear.torque(volts, warmth),
        f"polynomial of degree {degree}": compensated,
        "kernel regression": lambda: kernel.torque(volts, warmth),
    }
    truth = validation["reference_torque"]
    rows = {name: _score(way, truth) for name, way in ways.items()}
    return pandas.DataFrame.from_dict(rows, orient="index").rename_axis("drift model")


def _score(way: Callable[[], Array], truth: Array) -> dict[str, float]:
    spent = np.inf
    for _ in range(REPEATS):
        before = clock.perf_counter()
        found = way()
        spent = min(spent, clock.perf_counter() - before)
    error = found - truth
    known = error[np.isfinite(error)]
    return {
        "RMSE [Nm]": float(np.sqrt(np.mean(known**2))) if known.size else float("nan"),
        "largest [Nm]": float(np.abs(known).max()) if known.size else float("nan"),
        "no answer [%]": 100.0 * (1.0 - known.size / error.size),
        "cost [ns per sample]": 1e9 * spent / error.size,
    }
