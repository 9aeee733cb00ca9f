"""`flexspline.fleet.compare`: where a model and the runs of every joint disagree.

Each joint is compared by itself, by `flexspline.compare`, as a task. Over the fleet errors are
pooled, RMS over all rows, and the worst joint stands beside them.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from flexspline.about import __version__
from flexspline.errors import InputError
from flexspline.files import atomic_write
from flexspline.fleet.cluster import Failed, Workers, done
from flexspline.fleet.fitting import Folders, sessions_from
from flexspline.fleet.sessions import Session, Sessions, readable
from flexspline.lazy import render
from flexspline.progress import Progress
from flexspline.schema import checked_json

if TYPE_CHECKING:
    import pandas
    from distributed import Client

    from flexspline.model import Model

__all__ = ["FleetComparison", "UnitComparison", "compare"]


@dataclass(frozen=True)
class UnitComparison:
    """Where a model and the runs of one joint disagree: `content` is its `comparison.json`.

    `failed`: (run, why) of runs that could not be read.
    """

    name: str
    runs: tuple[str, ...]
    content: Mapping[str, Any]
    failed: tuple[tuple[str, str], ...] = ()

    @property
    def rows(self) -> int:
        """Rows that were compared."""
        return int(self.content["overall"]["rows"])

    @property
    def rmse(self) -> float:
        """Of measured less modelled."""
        return float(self.content["overall"]["rmse"])

    @property
    def noise_floor(self) -> float:
        """RMS of what no channel explains."""
        return float(self.content["overall"]["noise_floor"])

    @property
    def excess(self) -> float:
        """RMS above the floor."""
        return float(self.content["overall"]["excess"])

    @property
    def follows(self) -> dict[str, float]:
        """What the gap follows, in words, with its share of the gap's square."""
        return {one["words"]: float(one["share"]) for one in self.content["follows"]}


@dataclass(frozen=True, eq=False, repr=False)
class FleetComparison:
    """The result of `flexspline.fleet.compare`.

    Parameters
    ----------
    target, unit : what is compared.
    units : joints by name.
    failed : (joint, why) of what was left out.
    remarks : sentences about the folders.
    """

    target: str
    unit: str
    units: tuple[UnitComparison, ...]
    failed: tuple[tuple[str, str], ...]
    remarks: tuple[str, ...]

    def _pooled(self, which: str) -> float:
        rows = np.array([unit.rows for unit in self.units], dtype=float)
        sizes = np.array([getattr(unit, which) for unit in self.units])
        return float(np.sqrt(np.sum(rows * sizes**2) / np.sum(rows)))

    @property
    def rmse(self) -> float:
        """Over all rows of all joints."""
        return self._pooled("rmse")

    @property
    def noise_floor(self) -> float:
        """Over all rows of all joints."""
        return self._pooled("noise_floor")

    @property
    def excess(self) -> float:
        """Over all rows of all joints."""
        return self._pooled("excess")

    @property
    def worst(self) -> UnitComparison:
        """The joint with the largest excess."""
        return max(self.units, key=lambda unit: (unit.excess, unit.rmse))

    @property
    def follows(self) -> dict[str, tuple[str, ...]]:
        """What the gap follows, in words, with the joints in which it does; most first."""
        found: dict[str, list[str]] = {}
        for unit in self.units:
            for words in unit.follows:
                found.setdefault(words, []).append(unit.name)
        order = sorted(found, key=lambda words: (-len(found[words]), words))
        return {words: tuple(found[words]) for words in order}

    def to_frame(self) -> pandas.DataFrame:
        """Return a table with a row for each joint."""
        import pandas

        return pandas.DataFrame(
            [
                {
                    "joint": unit.name,
                    "rows": unit.rows,
                    "rmse": unit.rmse,
                    "noise_floor": unit.noise_floor,
                    "excess": unit.excess,
                    "follows": ", ".join(unit.follows),
                }
                for unit in self.units
            ]
        )

    def to_json(self) -> dict[str, Any]:
        """Return it as `fleet_comparison.json` holds it."""
        return {
            "format": "flexspline-fleet-comparison",
            "version": 1,
            "made_by": f"flexspline {__version__}",
            "target": self.target,
            "unit": self.unit,
            "rmse": self.rmse,
            "noise_floor": self.noise_floor,
            "excess": self.excess,
            "worst": self.worst.name,
            "follows": {words: list(joints) for words, joints in self.follows.items()},
            "joints": [
                {"name": unit.name, "runs": list(unit.runs), "comparison": dict(unit.content)}
                for unit in self.units
            ],
            "failed": [{"what": what, "why": why} for what, why in self.failed],
            "remarks": list(self.remarks),
        }

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write `fleet_comparison.json`, whole or not at all.

        Raises
        ------
        InputError
            Where the file cannot be written.
        """
        atomic_write(path, checked_json(self.to_json(), "fleet_comparison"))

    def report(self, folder: str | os.PathLike[str]) -> None:
        """Write `report.html`, a page for the fleet, and `units/NAME.html`, one for each joint."""
        render("fleet comparison", "report", self, folder)

    def __str__(self) -> str:
        return render("fleet comparison", "text", self)

    def __repr__(self) -> str:
        return (
            f"<FleetComparison of {self.target}: {len(self.units)} joints, RMSE {self.rmse:.4g} "
            f"{self.unit}, noise floor {self.noise_floor:.4g} {self.unit}, worst {self.worst.name}>"
        )

    def _repr_html_(self) -> str:
        return render("fleet comparison", "html", self)


def compare(
    model: Model | Callable[[str], Model],
    folders: Folders | Sessions,
    *,
    target: str | None = None,
    lowpass: float | None = None,
    bandwidth: float | None = None,
    speed_above: float | None = None,
    scheduler: str | Client | None = None,
    workers: int | None = None,
    progress: bool = False,
    **reading: Any,
) -> FleetComparison:
    """Say where a model and the runs of the joints of a fleet disagree. Nothing is fitted.

    Parameters
    ----------
    model : one for all joints; or what returns the model of a joint by its name, such as
        `FleetFit.model`.
    folders : as for `flexspline.fleet.fit`.
    target, lowpass, bandwidth, speed_above : as for `flexspline.compare`.
    scheduler, workers, progress, **reading : as for `flexspline.fleet.fit`.

    Returns
    -------
    FleetComparison

    Raises
    ------
    InputError
        Where folders or options are wrong, or no joint can be compared.
    """
    sessions = sessions_from(folders, reading)
    how = {
        "target": target,
        "lowpass": lowpass,
        "bandwidth": bandwidth,
        "speed_above": speed_above,
    }
    tasks, failed = [], []
    for name in sessions.units:
        try:
            tasks.append((sessions.of(name), model(name) if callable(model) else model))
        except InputError as error:
            failed.append((name, str(error)))
    with Progress("joints", progress, total=len(tasks), unit="joint") as bar:
        made = done(partial(_compared, how=how), tasks, Workers(scheduler, workers), bar)
    units = [each for each in made if isinstance(each, UnitComparison)]
    failed += [
        (its[0].unit, each.why)
        for (its, _), each in zip(tasks, made, strict=True)
        if isinstance(each, Failed)
    ]
    if not units:
        raise InputError(f"{failed[0][0]}: {failed[0][1]} (and no other joint can be compared)")
    failed += [each for unit in units for each in unit.failed]
    first = units[0].content
    return FleetComparison(
        str(first["target"]), str(first["unit"]), tuple(units), tuple(failed), sessions.remarks
    )


def _compared(task: tuple[Sequence[Session], Model], how: Mapping[str, Any]) -> UnitComparison:
    from flexspline.comparison.comparing import compare as compare_runs

    sessions, model = task
    logs = []
    read, failed = readable(sessions)
    for log in read:
        missing = {key: value for key, value in model.facts.items() if key not in log.facts}
        logs.append(log.with_facts(missing) if missing else log)
    made = compare_runs(model, logs, **how)
    runs = tuple(log.name for log in logs)
    return UnitComparison(sessions[0].unit, runs, json.loads(made.to_json()), tuple(failed))
