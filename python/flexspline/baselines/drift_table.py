"""One table of what each model of the drift leaves on a run that it was not fitted to."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from flexspline import _core
from flexspline.baselines.drift import kernel_drift, linear_drift
from flexspline.errors import InputError
from flexspline.logs.log import Log

if TYPE_CHECKING:
    import pandas

    from flexspline.estimators import Estimator

__all__ = ["compare_drift_methods"]

Array = NDArray[np.float64]

REPEATS = 3  # of which the quickest counts
NEEDED = ("sensor_voltage", "temperature", "reference_torque")


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

    from flexspline.calibration.calibrating import calibrate
    from flexspline.estimators import Calibration, TemperatureCompensation

    for name in NEEDED:
        if name not in validation:
            raise InputError(
                f"log '{validation.name}': the drift methods need the channel {name}; map it"
            )
    runs = [training] if isinstance(training, Log) else list(training)
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
