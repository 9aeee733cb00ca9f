"""What a calibration found."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from flexspline.calibration.drift import Shape
from flexspline.calibration.figures import Figure
from flexspline.calibration.legs import Leg, Points
from flexspline.calibration.thermal import Thermal, ThermalLeg
from flexspline.calibration.views import CalibratedRun
from flexspline.errors import InputError, did_you_mean, listed
from flexspline.estimators import Calibration, TemperatureCompensation
from flexspline.least_squares.identifiability import Confounded
from flexspline.least_squares.result import Parameter
from flexspline.least_squares.uncertainty import Uncertainty
from flexspline.model import Model
from flexspline.rendering import render

if TYPE_CHECKING:
    import pandas

__all__ = ["CalibrationResult"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class CalibrationResult:
    """The result of `calibrate`: prints as a verdict, one line for each parameter and figure.

    Parameters
    ----------
    model : with the estimators, ready to save and export.
    calibration, compensation : the estimators; None where the runs cannot give them.
    torque_parameters : k, zero, c_k, g, lag in Nm; empty where the sensitivity is not known.
    voltage_parameters : s = 1/k, v₀, d_k, h, lag in V.
    drift_polynomial : A′_j of zhang_disturbance_elimination (11), b(T) = Σ A′_j T^j in V, T in °C.
    confounded : coefficients in volts that the runs cannot tell apart.
    runs : errors of reading, row by row.
    legs, points : of the reference: rising and falling, plateaus or bins on them.
    thermal_legs, thermal : of the temperature.
    figures : in %FS, see `flexspline.calibration.figures`.
    full_scale : Nm, and `full_scale_source`: "given", "model" or "reference", the largest one.
    sensitivity_reason : why the runs do not determine the sensitivity, "" where they do.
    validated_by : "runs" or "blocks"; `fold_rmses`: of each that was left out, in `unit`.
    uncertainty : covariance and noise model, in volts.
    shape : what was regressed on what.
    warnings : sentences about the runs and the result.
    """

    model: Model
    calibration: Calibration | None
    compensation: TemperatureCompensation | None
    voltage_parameters: tuple[Parameter, ...]
    torque_parameters: tuple[Parameter, ...]
    drift_polynomial: tuple[Parameter, ...]
    confounded: tuple[Confounded, ...]
    runs: tuple[CalibratedRun, ...]
    legs: tuple[Leg, ...]
    points: Points | None
    thermal_legs: tuple[ThermalLeg, ...]
    thermal: Thermal | None
    figures: tuple[Figure, ...]
    full_scale: float | None
    full_scale_source: str
    sensitivity_reason: str
    validated_by: str
    fold_rmses: tuple[float, ...]
    fold_labels: tuple[str, ...]
    uncertainty: Uncertainty
    shape: Shape
    warnings: tuple[str, ...]

    @property
    def unit(self) -> str:
        """Of the errors: Nm, or V where the sensitivity is not known."""
        return "V" if self.calibration is None else "Nm"

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """In Nm where the sensitivity is known, else in V."""
        return self.torque_parameters or self.voltage_parameters

    @cached_property
    def rmse(self) -> float:
        """Root mean square of reading less reference, in `unit`."""
        return _rms([run.error for run in self.runs])

    @cached_property
    def cv_rmse(self) -> float:
        """The same on rows that the regression never saw."""
        return _rms([run.held_out for run in self.runs])

    @property
    def median_fold(self) -> float:
        """Median RMSE of the parts that were left out in turn, in `unit`."""
        return float(np.median(self.fold_rmses))

    @property
    def worst_fold(self) -> float:
        """Largest RMSE of the parts that were left out in turn, in `unit`."""
        return max(self.fold_rmses)

    def __getitem__(self, name: str) -> Parameter:
        """Return a parameter by its name, in Nm where the sensitivity is known."""
        known = {p.name: p for p in self.parameters}
        if name not in known:
            raise InputError(
                f"the calibration has no '{name}'{did_you_mean(name, known)}; it has "
                f"{listed(known)}"
            )
        return known[name]

    def figure(self, name: str) -> Figure:
        """Return a figure by its name, such as "hysteresis"."""
        known = {figure.name: figure for figure in self.figures}
        if name not in known:
            raise InputError(
                f"there is no figure '{name}'{did_you_mean(name, known)}; there are {listed(known)}"
            )
        return known[name]

    def drift_voltage(self, temperature: Sequence[float] | Array) -> tuple[Array, Array]:
        """Return b(T) of (11), the voltage at zero torque, and its standard error, (n,) each, V.

        Parameters
        ----------
        temperature : (n,), °C, of a body that is evenly warm.
        """
        warmer = np.asarray(temperature, dtype=np.float64) - self.shape.reference_temperature
        first, width = int(self.shape.sensitivity), len(self.uncertainty.basis)
        rows = np.zeros((len(warmer), width))
        rows[:, first : first + self.shape.degree + 1] = np.vander(
            warmer, self.shape.degree + 1, increasing=True
        )
        values = np.zeros(width)
        known = [p.value for p in self.voltage_parameters][: self.shape.degree + 1 + first]
        values[: len(known)] = known
        return rows @ values, self.uncertainty.errors_of(rows)

    def to_frame(self) -> pandas.DataFrame:
        """Return the parameters in Nm (or V) as a table."""
        import pandas

        rows = {
            p.name: {
                "value": p.value if p.determined else np.nan,
                "standard_error": p.standard_error if p.determined else np.nan,
                "unit": p.unit,
                "lower": p.interval[0],
                "upper": p.interval[1],
                "state": p.state,
                "determined": p.determined,
                "naive_error": p.naive_error,
            }
            for p in self.parameters
        }
        return pandas.DataFrame(list(rows.values()), index=list(rows)).rename_axis("parameter")

    def figures_frame(self) -> pandas.DataFrame:
        """Return the figures as a table; NaN where the runs cannot show one."""
        from dataclasses import asdict

        import pandas

        return pandas.DataFrame([asdict(figure) for figure in self.figures]).set_index("name")

    def __str__(self) -> str:
        return render("calibration", "text", self)

    def __repr__(self) -> str:
        return (
            f"<CalibrationResult: {len(self.runs)} runs, {len(self.parameters)} parameters, "
            f"RMSE {self.rmse:.4g} {self.unit}, held out {self.cv_rmse:.4g} {self.unit}>"
        )

    def _repr_html_(self) -> str:
        return render("calibration", "html", self)

    def plot(self) -> Any:
        """Return a figure: drift (Fig. 16), before and after (Fig. 17), calibration (Fig. 18)."""
        return render("calibration", "figure", self)

    def report(self, path: str | os.PathLike[str]) -> None:
        """Write a self-contained HTML report, whole or not at all."""
        render("calibration", "report", self, path)


def _rms(columns: Sequence[Array]) -> float:
    return float(np.sqrt(np.mean(np.concatenate(columns) ** 2)))
