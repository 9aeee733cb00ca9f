"""The result of a fit of a fleet: prints as a table of its parameters, and who stands out."""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from flexspline.about import __version__
from flexspline.errors import InputError, did_you_mean, listed
from flexspline.files import atomic_write
from flexspline.fleet.accumulators import DIFFERENCES, Plan
from flexspline.fleet.estimates import Scored
from flexspline.fleet.population import Population, Shrunken
from flexspline.formatting import Page, short_names
from flexspline.lazy import Rendered, render
from flexspline.logs.log import Fact
from flexspline.model import Model
from flexspline.part import PART_OF, Part
from flexspline.schema import checked_json

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

__all__ = ["FleetFit", "FleetResult", "HeldOut", "Outlying", "RunFit", "UnitFit"]

Array = NDArray[np.float64]


class FleetResult(Rendered, ABC):
    """What a result over a fleet has in common with others: its file, and what was left out.

    Its kind is the name of that file and of the file's schema too.
    """

    failed: tuple[tuple[str, str], ...]
    remarks: tuple[str, ...]

    @abstractmethod
    def to_json(self) -> dict[str, Any]:
        """Return the result as its file holds it."""

    def _file(self, content: Mapping[str, Any]) -> dict[str, Any]:
        """The content of the file, between what made it and what was left out."""
        return {
            "format": f"flexspline-{self._kind.replace('_', '-')}",
            "version": 1,
            "made_by": f"flexspline {__version__}",
            **content,
            "failed": [{"what": what, "why": why} for what, why in self.failed],
            "remarks": list(self.remarks),
        }

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the result as JSON, whole or not at all.

        Raises
        ------
        InputError
            Where the file cannot be written.
        """
        atomic_write(path, checked_json(self.to_json(), self._kind))

    def report(self, folder: str | os.PathLike[str]) -> None:
        """Write `report.html`, a page for the fleet, and `units/NAME.html`, one for each joint.

        Raises
        ------
        InputError
            Where the folder cannot be written.
        """
        super().report(folder)


@dataclass(frozen=True)
class RunFit:
    """One run of a joint: rows that count, the seconds that they span, mean temperature [°C].

    `rmse`: of the least squares of this run alone, in the target's unit; NaN where it is too short
    for a fit of its own.
    """

    run: str
    date: datetime | None
    rows: int
    seconds: float
    temperature: float | None
    rmse: float
    remarks: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class UnitFit:
    """One joint of a fleet.

    Parameters
    ----------
    name : of the joint.
    runs : that it was fitted to.
    own : the estimate of its runs alone, all together, with errors that hold what parameters differ
        by from run to run.
    shrunken : its values given the fleet.
    outlying : (P,), parameters in which it stands out.
    p : (P,), of the test for that; NaN where its runs do not determine a parameter.
    expected, expected_error : (P,), the mean of the others, and how far around it this joint's
        estimate is to be expected.
    facts : of the joint, such as its gear ratio, where its runs have them.
    """

    name: str
    runs: tuple[RunFit, ...]
    own: Scored
    shrunken: Shrunken
    outlying: NDArray[np.bool_]
    p: Array
    expected: Array
    expected_error: Array
    facts: Mapping[str, Fact] = field(default_factory=dict)

    @property
    def rows(self) -> int:
        """Rows that count."""
        return self.own.rows

    @property
    def seconds(self) -> float:
        """Of all runs."""
        return sum(run.seconds for run in self.runs)

    @property
    def rmse(self) -> float:
        """RMS residual of the joint's own fit, in the target's unit."""
        return self.own.rmse


@dataclass(frozen=True)
class Outlying:
    """A parameter in which a joint stands out, in `unit`."""

    joint: str
    parameter: str
    value: float
    error: float
    expected: float
    expected_error: float
    p: float
    unit: str


@dataclass(frozen=True)
class HeldOut:
    """Errors of the model on runs that no fit saw, in the target's unit, each (joints,).

    `rows`: (label, rows, seconds of the other runs, separate, shrunken, mean) for each joint.
    """

    runs: tuple[tuple[str, int, float, float, float, float], ...]

    def _pooled(self, at: int) -> float:
        rows = np.array([run[1] for run in self.runs], dtype=float)
        errors = np.array([run[at] for run in self.runs])
        return float(np.sqrt(np.sum(rows * errors**2) / np.sum(rows)))

    @property
    def separate(self) -> float:
        """RMS error over all held-out rows of each joint's own fit to its other runs."""
        return self._pooled(3)

    @property
    def shrunken(self) -> float:
        """Of its values given the fleet."""
        return self._pooled(4)

    @property
    def mean(self) -> float:
        """Of the fleet's mean."""
        return self._pooled(5)

    @property
    def worst(self) -> tuple[str, float, float, float]:
        """The run with the largest error of shrunken values: label, separate, shrunken, mean."""
        label, _, _, separate, shrunken, mean = max(self.runs, key=lambda run: run[4])
        return label, separate, shrunken, mean


@dataclass(frozen=True, eq=False, repr=False)
class FleetFit(FleetResult):
    """The result of `flexspline.fleet.fit`.

    Parameters
    ----------
    plan : effects with the shapes and orders that were held, target, options.
    units : joints, by name.
    population : mean, spread and correlation of the parameters.
    run_spread : (P,), standard deviation of each parameter between runs of one joint; NaN where no
        joint has two runs that tell.
    held_out : errors on runs that no fit saw; None where no joint has two runs.
    failed : (joint or run, why) of what was left out.
    remarks : sentences about the folders.
    """

    _kind: ClassVar = "fleet"

    plan: Plan
    units: tuple[UnitFit, ...]
    population: Population
    run_spread: Array
    held_out: HeldOut | None
    failed: tuple[tuple[str, str], ...]
    remarks: tuple[str, ...]

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters, those of one term by their effect."""
        return tuple(short_names(name) for name in self.plan.names)

    @property
    def outlying(self) -> tuple[Outlying, ...]:
        """Parameters in which joints stand out, the most improbable first."""
        found = [
            Outlying(
                unit.name,
                self.parameters[k],
                float(unit.own.values[k]),
                float(unit.own.errors[k]),
                float(unit.expected[k]),
                float(unit.expected_error[k]),
                float(unit.p[k]),
                self.plan.units[k],
            )
            for unit in self.units
            for k in np.flatnonzero(unit.outlying)
        ]
        return tuple(sorted(found, key=lambda one: (one.p, one.joint, one.parameter)))

    def unit(self, name: str) -> UnitFit:
        """Return a joint by its name.

        Raises
        ------
        InputError
            Where there is none of that name.
        """
        names = [unit.name for unit in self.units]
        if name not in names:
            raise InputError(
                f"there is no joint '{name}'{did_you_mean(name, names)}; there are {listed(names)}"
            )
        return self.units[names.index(name)]

    def model(self, name: str) -> Model:
        """Return the model of a joint with its values given the fleet, to predict and export.

        Terms of single runs, such as zeros, are zero in it.

        Raises
        ------
        InputError
            Where there is no joint of that name, or it and the fleet leave a parameter open.
        """
        values = self.unit(name).shrunken.values
        whole = np.nan_to_num(self.plan.constraints.held)
        names = self._full_names()
        for parameter, value in zip(self.plan.names, values, strict=True):
            whole[names.index(parameter)] = value
        part = Part(self.plan.target, self.plan.effects, whole, self.plan.known_load)
        facts = {"joint": name, **self.unit(name).facts}
        return Model({PART_OF[self.plan.target]: part}, facts)

    def _full_names(self) -> list[str]:
        from flexspline.least_squares.options import coefficient_names

        return coefficient_names(self.plan.effects)

    def to_frame(self, what: str = "population") -> pandas.DataFrame:
        """Return a table.

        Parameters
        ----------
        what : "population": a row for each parameter; "joints": for each joint and parameter;
            "runs": for each run; "outlying": for each parameter in which a joint stands out.

        Raises
        ------
        InputError
            For another table.
        """
        import pandas

        tables: dict[str, Callable[[], list[dict[str, Any]]]] = {
            "population": self._population_rows,
            "joints": self._joint_rows,
            "runs": self._run_rows,
            "outlying": lambda: [vars(one) for one in self.outlying],
        }
        if what not in tables:
            raise InputError(f"there is no table '{what}'; give one of {listed(tables)}")
        return pandas.DataFrame(tables[what]())

    def _population_rows(self) -> list[dict[str, Any]]:
        rows = []
        for k, margin in enumerate(self.population.margins):
            rows.append(
                {
                    "parameter": self.parameters[k],
                    "unit": self.plan.units[k],
                    "mean": margin.mean,
                    "mean_error": margin.mean_error,
                    "mean_low": margin.mean_interval[0],
                    "mean_high": margin.mean_interval[1],
                    "spread": margin.spread,
                    "spread_low": margin.spread_interval[0],
                    "spread_high": margin.spread_interval[1],
                    "between_runs": float(self.run_spread[k]),
                    "joints": margin.units,
                    "outlying": int(sum(unit.outlying[k] for unit in self.units)),
                }
            )
        return rows

    def _joint_rows(self) -> list[dict[str, Any]]:
        return [
            {
                "joint": unit.name,
                "parameter": self.parameters[k],
                "unit": self.plan.units[k],
                "own": float(unit.own.values[k]) if unit.own.determined[k] else np.nan,
                "own_error": float(unit.own.errors[k]),
                "shrunken": float(unit.shrunken.values[k]),
                "shrunken_error": float(unit.shrunken.errors[k]),
                "expected": float(unit.expected[k]),
                "expected_error": float(unit.expected_error[k]),
                "p": float(unit.p[k]),
                "outlying": bool(unit.outlying[k]),
            }
            for unit in self.units
            for k in range(len(self.parameters))
        ]

    def _run_rows(self) -> list[dict[str, Any]]:
        return [
            {
                "joint": unit.name,
                "run": run.run,
                "date": run.date,
                "rows": run.rows,
                "seconds": run.seconds,
                "temperature": run.temperature,
                "rmse": run.rmse,
                "remarks": "; ".join(run.remarks),
            }
            for unit in self.units
            for run in unit.runs
        ]

    def to_json(self) -> dict[str, Any]:
        """Return the fit as `fleet.json` holds it."""
        held = self.held_out
        runs: dict[str, list[dict[str, Any]]] = {}
        for row in self._run_rows():
            runs.setdefault(row.pop("joint"), []).append({**row, "date": _iso(row["date"])})
        values: dict[str, list[dict[str, Any]]] = {}
        for row in self._joint_rows():
            values.setdefault(row.pop("joint"), []).append(row)
        content = {
            "plan": self.plan.to_json(),
            "parameters": self._population_rows(),
            "correlation": self.population.correlation.tolist(),
            "joints": [
                {
                    "name": unit.name,
                    "rows": unit.rows,
                    "seconds": unit.seconds,
                    "rmse": unit.rmse,
                    "values": values[unit.name],
                    "runs": runs[unit.name],
                }
                for unit in self.units
            ],
            "outlying": [vars(one) for one in self.outlying],
            "held_out": None
            if held is None
            else {
                "separate": held.separate,
                "shrunken": held.shrunken,
                "mean": held.mean,
                "runs": [
                    dict(zip(("run", "rows", "seconds_of_others", "separate", "shrunken", "mean"),
                             run, strict=True))
                    for run in held.runs
                ],
            },
        }  # fmt: skip
        return {**self._file(content), "differs_from_fit": list(DIFFERENCES)}

    def plot(self) -> Figure:
        """Return a figure: each joint's values beside the mean and spread of the fleet."""
        return render("fleet", "figure", self)

    def summary(self) -> Page:
        """Return what `print` shows and a table of all joints."""
        return Page(render("fleet", "summary", self))

    def __repr__(self) -> str:
        return (
            f"<FleetFit of {self.plan.target}: {len(self.units)} joints, "
            f"{sum(len(unit.runs) for unit in self.units)} runs, "
            f"{len({one.joint for one in self.outlying})} stand out>"
        )


def _iso(date: datetime | None) -> str | None:
    return None if date is None else date.isoformat()
