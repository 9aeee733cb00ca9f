"""What is asked of each joint of a fleet by itself: `flexspline.fleet.compare` and `discover`.

Each joint is looked at as a task, by `flexspline.compare` or `flexspline.discover`; the search is
the same, and what one joint shows does not lead that of another. Of a comparison errors are pooled
afterwards, RMS over all rows, and the worst joint stands beside them. Of a discovery names are
counted. Of J joints a name is found in k: of all joints of that kind, a share within Jeffreys'
interval, the 2.5 and 97.5 % points of Beta(k + ½, J − k + ½) [Brown2001], has it.

A name that all joints have is surer in each, and one that a single joint has is less sure: with the
confidence c of the joint by itself, at even odds beforehand, and the share π = (k + ½)/(J + 1),

    pooled confidence = c π / (c π + (1 − c)(1 − π))
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from scipy.stats import beta

from flexspline.effects import Effect
from flexspline.errors import InputError, did_you_mean, listed
from flexspline.fleet import Folders, sessions_from
from flexspline.fleet.cluster import Workers, done, require_some, split_failed
from flexspline.fleet.result import FleetResult
from flexspline.fleet.sessions import Session, Sessions, readable
from flexspline.model import Model
from flexspline.progress import Progress

if TYPE_CHECKING:
    import pandas
    from distributed import Client

    from flexspline.model import Model

__all__ = [
    "FleetComparison",
    "FleetDiscovery",
    "NameInFleet",
    "UnitComparison",
    "UnitDiscovery",
    "compare",
    "discover",
    "pooled_confidence",
]


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
class FleetComparison(FleetResult):
    """The result of `flexspline.fleet.compare`.

    Parameters
    ----------
    target, unit : what is compared.
    units : joints by name.
    failed : (joint, why) of what was left out.
    remarks : sentences about the folders.
    """

    _kind: ClassVar = "fleet_comparison"

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
        content = {
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
        }
        return self._file(content)

    def __repr__(self) -> str:
        return (
            f"<FleetComparison of {self.target}: {len(self.units)} joints, RMSE {self.rmse:.4g} "
            f"{self.unit}, noise floor {self.noise_floor:.4g} {self.unit}, worst {self.worst.name}>"
        )


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
    units, lost = split_failed([its[0].unit for its, _ in tasks], made)
    failed += lost
    require_some(units, failed, "no other joint can be compared")
    failed += [each for unit in units for each in unit.failed]
    first = units[0].content
    return FleetComparison(
        str(first["target"]), str(first["unit"]), tuple(units), tuple(failed), sessions.remarks
    )


def _compared(task: tuple[Sequence[Session], Model], how: Mapping[str, Any]) -> UnitComparison:
    from flexspline.comparison import compare as compare_runs

    sessions, model = task
    logs = []
    read, failed = readable(sessions)
    for log in read:
        missing = {key: value for key, value in model.facts.items() if key not in log.facts}
        logs.append(log.with_facts(missing) if missing else log)
    made = compare_runs(model, logs, **how)
    runs = tuple(log.name for log in logs)
    return UnitComparison(sessions[0].unit, runs, json.loads(made.to_json()), tuple(failed))


@dataclass(frozen=True)
class UnitDiscovery:
    """What one joint lacks: `content` is its `discovery.json`, `model` the extended model.

    `failed`: (run, why) of runs that could not be read.
    """

    name: str
    runs: tuple[str, ...]
    content: Mapping[str, Any]
    model: Model
    failed: tuple[tuple[str, str], ...] = ()

    @property
    def found(self) -> dict[str, float]:
        """Confidence of each name, in the order of discovery."""
        return {one["effect"]: float(one["confidence"]) for one in self.content["found"]}

    @property
    def confused(self) -> set[str]:
        """Names that the joint's runs do not tell from others."""
        return {one["effect"] for one in self.content["found"] if one["indistinguishable_from"]}

    @property
    def rmse(self) -> tuple[float, float, float]:
        """Of the base, of the extended model, and the noise floor; held out."""
        sizes = self.content["rmse"]
        return float(sizes["base"]), float(sizes["final"]), float(sizes["noise_floor"])


@dataclass(frozen=True)
class NameInFleet:
    """One name over the joints.

    Parameters
    ----------
    effect : its name.
    joints : in which it is found; `confidences` : of each by itself, `pooled` : given the others,
        which add nothing where none of them tells it from what explains as much.
    seen : joints in which it is real but too small to matter.
    indistinguishable : other joints, in which it explains the runs as well as a name that is found.
    share, share_low, share_high : of joints of this kind that have it, with its 95 % interval.
    """

    effect: str
    joints: tuple[str, ...]
    confidences: tuple[float, ...]
    pooled: tuple[float, ...]
    seen: tuple[str, ...]
    indistinguishable: tuple[str, ...]
    share: float
    share_low: float
    share_high: float


@dataclass(frozen=True, eq=False, repr=False)
class FleetDiscovery(FleetResult):
    """The result of `flexspline.fleet.discover`.

    Parameters
    ----------
    target, unit : what is explained.
    units : joints by name.
    names : effects found in any joint, those of most joints first.
    failed : (joint, why) of what was left out.
    remarks : sentences about the folders.
    """

    _kind: ClassVar = "fleet_discovery"

    target: str
    unit: str
    units: tuple[UnitDiscovery, ...]
    names: tuple[NameInFleet, ...]
    failed: tuple[tuple[str, str], ...]
    remarks: tuple[str, ...]

    @property
    def unexplained(self) -> tuple[str, ...]:
        """Joints in which structure is left that no effect explains."""
        return tuple(unit.name for unit in self.units if unit.content["unexplained"])

    @property
    def rmse(self) -> tuple[float, float, float]:
        """Of base, extended models and noise floor, RMS over joints."""
        sizes = np.array([unit.rmse for unit in self.units])
        base, final, floor = np.sqrt(np.mean(sizes**2, axis=0)).tolist()
        return base, final, floor

    def __getitem__(self, joint: str) -> UnitDiscovery:
        """Return a joint by its name."""
        names = [unit.name for unit in self.units]
        if joint not in names:
            raise InputError(
                f"there is no joint '{joint}'{did_you_mean(joint, names)}; there are "
                f"{listed(names)}"
            )
        return self.units[names.index(joint)]

    def to_frame(self) -> pandas.DataFrame:
        """Return a table of names by joints: the confidence, NaN where a name is not found."""
        import pandas

        rows = {
            unit.name: {name.effect: unit.found.get(name.effect, np.nan) for name in self.names}
            for unit in self.units
        }
        return pandas.DataFrame.from_dict(rows, orient="index")

    def to_json(self) -> dict[str, Any]:
        """Return it as `fleet_discovery.json` holds it."""
        base, final, floor = self.rmse
        content = {
            "target": self.target,
            "unit": self.unit,
            "names": [asdict(name) for name in self.names],
            "rmse": {"base": base, "final": final, "noise_floor": floor},
            "unexplained": list(self.unexplained),
            "joints": [
                {"name": unit.name, "runs": list(unit.runs), "discovery": dict(unit.content)}
                for unit in self.units
            ],
        }
        return self._file(content)

    def __repr__(self) -> str:
        found = ", ".join(f"{n.effect} in {len(n.joints)}" for n in self.names) or "nothing"
        return f"<FleetDiscovery in {self.target}, {len(self.units)} joints: {found}>"


def discover(
    folders: Folders | Sessions,
    target: str | None = None,
    effects: str | Effect | Iterable[str | Effect] | None = None,
    *,
    model: Model | None = None,
    known_load: str | None = None,
    lowpass: float | None = None,
    bandwidth: float | None = None,
    orders: Mapping[str, Sequence[int]] | None = None,
    fixed: Mapping[str, float] | None = None,
    exclude: Iterable[str] = (),
    scheduler: str | Client | None = None,
    workers: int | None = None,
    progress: bool = False,
    **reading: Any,
) -> FleetDiscovery:
    """Find what the joints of a fleet lack, and in how many of them.

    Parameters
    ----------
    folders : as for `flexspline.fleet.fit`.
    target : as for `flexspline.discover`.
    effects : that are known to be there, in every joint; or `model`, to start from.
    known_load, lowpass, bandwidth, orders, fixed, exclude : as for `flexspline.discover`.
    scheduler, workers, progress, **reading : as for `flexspline.fleet.fit`.

    Returns
    -------
    FleetDiscovery

    Raises
    ------
    InputError
        Where folders or options are wrong, or no joint can be looked at.
    """
    sessions = sessions_from(folders, reading)
    if (effects is None) == (model is None):
        raise InputError("give exactly one: the effects that are known, or a model to start from")
    if model is None and target is None:
        raise InputError("what is explained is not said; give the target, such as sensor_torque")
    named = [effects] if isinstance(effects, (str, Effect)) else effects or []
    base: Model | list[str | Effect] = list(named) if model is None else model
    how = {
        "target": target,
        "known_load": known_load,
        "lowpass": lowpass,
        "bandwidth": bandwidth,
        "orders": orders,
        "fixed": fixed,
        "exclude": tuple(exclude),
    }
    tasks = [sessions.of(name) for name in sessions.units]
    with Progress("joints", progress, total=len(tasks), unit="joint") as bar:
        look = partial(_looked_at, base=base, how=how)
        made = done(look, tasks, Workers(scheduler, workers), bar)
    units, failed = split_failed(sessions.units, made)
    require_some(units, failed, "no other joint can be looked at")
    failed += [each for unit in units for each in unit.failed]
    first = units[0].content
    return FleetDiscovery(
        str(first["target"]),
        str(first["unit"]),
        tuple(units),
        _names(units),
        tuple(failed),
        sessions.remarks,
    )


def pooled_confidence(confidence: float, found: int, joints: int) -> float:
    """Return how sure a name of one joint is, given in how many joints it is found."""
    share = (found + 0.5) / (joints + 1.0)
    yes, no = confidence * share, (1.0 - confidence) * (1.0 - share)
    return yes / (yes + no)


def _looked_at(
    sessions: Sequence[Session], base: Model | list[str | Effect], how: Mapping[str, Any]
) -> UnitDiscovery:
    from flexspline.discovery.discovering import discover as look

    logs, failed = readable(sessions)
    made = look(base, logs, **how)
    content = json.loads(made.to_json())
    runs = tuple(log.name for log in logs)
    return UnitDiscovery(sessions[0].unit, runs, content, made.model, tuple(failed))


def _names(units: Sequence[UnitDiscovery]) -> tuple[NameInFleet, ...]:
    """Every name that a joint has, by how many have it."""
    every = list(dict.fromkeys(name for unit in units for name in unit.found))
    made = []
    for name in every:
        its = [unit for unit in units if name in unit.found]
        confidences = tuple(unit.found[name] for unit in its)
        count, total = len(its), len(units)
        told = any(name not in unit.confused for unit in its)
        low, high = beta.ppf([0.025, 0.975], count + 0.5, total - count + 0.5).tolist()
        made.append(
            NameInFleet(
                name,
                tuple(unit.name for unit in its),
                confidences,
                tuple(pooled_confidence(c, count, total) if told else c for c in confidences),
                tuple(unit.name for unit in units if name in _also(unit)),
                tuple(unit.name for unit in units if name in _as_well(unit) - {*unit.found}),
                count / total,
                0.0 if count == 0 else float(low),
                1.0 if count == total else float(high),
            )
        )
    return tuple(sorted(made, key=lambda one: (-len(one.joints), one.effect)))


def _also(unit: UnitDiscovery) -> set[str]:
    return {one["effect"] for one in unit.content["also_seen"]}


def _as_well(unit: UnitDiscovery) -> set[str]:
    return {name for one in unit.content["found"] for name in one["indistinguishable_from"]}
