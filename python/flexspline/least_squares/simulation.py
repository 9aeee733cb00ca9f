"""What a fit to the simulation says of itself: its starts, folds, runs and law."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexspline.forward.servo import PositionServo

__all__ = ["RunGap", "SimulationFit", "StartEnd"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RunGap:
    """RMS [rad] of simulated − measured position of one run.

    `rmse`: as fitted. `held_out`: by the fits that never counted the row. `regression`: by the
    parameters of the ordinary regression.
    """

    name: str
    rows: int
    rmse: float
    held_out: float
    regression: float


@dataclass(frozen=True)
class StartEnd:
    """One start: RMS [rad] where it began and where it ended, and the parameters of the end."""

    first_rmse: float
    rmse: float
    evaluations: int
    values: tuple[float, ...]


@dataclass(frozen=True)
class SimulationFit:
    """The record of a fit by simulation, `Fit.simulation`.

    Parameters
    ----------
    runs : gap of each run.
    starts : all of them: from the regression, from short pieces of the runs, then drawn ones.
    names : of the parameters that were searched.
    regressed, fitted : their values, (P,).
    folds : (K, P): values without each fold; `folds_by` says what a fold is.
    controller : the law with its fitted fields, or None where the motor's torque is measured.
    steps_per_sample : of the simulation.
    """

    runs: tuple[RunGap, ...]
    starts: tuple[StartEnd, ...]
    names: tuple[str, ...]
    regressed: tuple[float, ...]
    fitted: tuple[float, ...]
    folds: Array
    folds_by: str
    controller: PositionServo | None
    steps_per_sample: int

    @property
    def rmse(self) -> float:
        """RMS over the rows of all runs, rad."""
        return self._overall("rmse")

    @property
    def held_out(self) -> float:
        """The same by fits that never counted the row."""
        return self._overall("held_out")

    @property
    def regression(self) -> float:
        """The same by the ordinary regression."""
        return self._overall("regression")

    @property
    def best_starts(self) -> int:
        """How many starts ended within 2 % of the best."""
        ends = np.array([start.rmse for start in self.starts])
        return int((ends <= 1.02 * ends.min()).sum())

    @property
    def ends(self) -> str:
        """Where each start ended, in words."""
        ends = ", ".join(_milli(start.rmse) for start in self.starts)
        return f"Starts ended at {ends} mrad, the regression's first."

    @property
    def verdict(self) -> str:
        """How far the simulated motion is off on held-out rows, and what the fit gained."""
        law = "under the servo's law" if self.controller else "by the measured motor"
        return (
            f"Driven {law}, the simulated position is off by {_angle(self.held_out)} RMS on "
            f"{self.folds_by} that a fit did not count, by {_angle(self.rmse)} on those it did; "
            f"with the regression's parameters by {_angle(self.regression)}."
        )

    @property
    def sentences(self) -> list[str]:
        """How far the starts agree, and where the intervals come from."""
        ends = np.array([start.rmse for start in self.starts])
        return [
            f"{len(ends)} starts ended between {_angle(ends.min())} and {_angle(ends.max())}, "
            f"{self.best_starts} of them within 2 % of the best.",
            f"Intervals hold what each of {len(self.folds)} fits without one of the "
            f"{self.folds_by} found, and the spread between runs.",
        ]

    def to_json(self) -> dict[str, Any]:
        """Return the record as `model.json` keeps it."""
        return {
            "method": "least squares of simulated − measured output_position (trust region, "
            "central differences)",
            "rmse": self.rmse,
            "held_out_rmse": self.held_out,
            "regression_rmse": self.regression,
            "runs": [asdict(run) for run in self.runs],
            "names": list(self.names),
            "regressed": list(self.regressed),
            "starts": [asdict(start) for start in self.starts],
            "folds": self.folds.tolist(),
            "folds_by": self.folds_by,
            "controller": None if self.controller is None else asdict(self.controller),
            "steps_per_sample": self.steps_per_sample,
        }

    def table(self) -> list[tuple[str, ...]]:
        """Return a head and a line for each run and for all, in mrad."""
        mean = [float(np.mean([getattr(r, f) for r in self.runs])) for f in _FIELDS]
        lines: list[tuple[str, ...]] = [("run", "fitted", "held out", "regression")]
        for run in self.runs:
            lines.append((run.name, *(_milli(getattr(run, field)) for field in _FIELDS)))
        lines.append(("mean of runs", *map(_milli, mean)))
        overall = (self.rmse, self.held_out, self.regression)
        return [*lines, ("all rows", *map(_milli, overall))]

    def _overall(self, field: str) -> float:
        squares = [run.rows * getattr(run, field) ** 2 for run in self.runs]
        return float(np.sqrt(sum(squares) / sum(run.rows for run in self.runs)))


_FIELDS = ("rmse", "held_out", "regression")


def _angle(value: float) -> str:
    return f"{1e3 * value:.3g} mrad"


def _milli(value: float) -> str:
    return f"{1e3 * value:.3g}"
