"""Drift models that the first paper cites: linear with the calibration, and kernel regression."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexspline.errors import InputError, listed
from flexspline.logs.log import Log

__all__ = ["KernelDrift", "LinearDrift", "kernel_drift", "linear_drift"]

Array = NDArray[np.float64]

CHANNELS = ("sensor_voltage", "temperature", "reference_torque")
MOST_ROWS = 1500  # a kernel matrix is rows by rows
FOLDS = 5


@dataclass(frozen=True)
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
    ridge, search, folds = _scikit()
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


def _scikit() -> tuple[Any, Any, Any]:
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
    runs = [logs] if isinstance(logs, Log) else list(logs)
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
