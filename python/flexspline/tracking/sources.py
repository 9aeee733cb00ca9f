"""From models or runs of one joint to its history: a date, estimates and a temperature each.

Runs are fitted one by one, with the same effects and orders and with the same shapes held: a shape
that is free takes with it what it shares with a coefficient, and that would look like wear.
"""

from __future__ import annotations

import csv
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from flexspline.effects import Effect
from flexspline.errors import InputError, listed
from flexspline.fitting import fit, with_orders
from flexspline.fleet.sessions import Session, date_in, mean_temperature, sessions_of
from flexspline.least_squares.options import FitOptions, shapes_of
from flexspline.logs.log import Log
from flexspline.model import Model, Part
from flexspline.progress import Progress
from flexspline.tracking.history import History

__all__ = ["history_of", "is_model"]

Array = NDArray[np.float64]

DATE, TEMPERATURE = "date", "temperature"
WARMTHS: Final = ("temperature", "motor_temperature")
DEPTH: Final = 3  # folders above a model in whose names a date is looked for
DIFFERENT: Final = 0.01
"""Of a shape's value: models whose shapes differ by more are said to. Runs of one joint that hold
their shapes have none; half or double of it changes nothing there."""


@dataclass(frozen=True)
class _Estimates:
    """Of one session: parameters by name with unit and value, and their covariance (P, P)."""

    label: str
    date: datetime
    names: tuple[str, ...]
    units: tuple[str, ...]
    values: Array
    covariance: Array
    temperature: float
    shapes: Mapping[str, float]


@dataclass(frozen=True)
class _Given:
    """A run that is read already, as a `Session` is."""

    log: Log

    @property
    def run(self) -> str:
        return self.log.name

    @property
    def path(self) -> str:
        return f"log '{self.log.name}'"

    @property
    def date(self) -> datetime | None:
        return date_in(str(self.log.facts.get(DATE, "")))

    def read(self) -> Log:
        return self.log

    def dated(self, log: Log) -> _Given:
        return self


def is_model(path: str | os.PathLike[str]) -> bool:
    """Whether a path is a `model.json`, by its suffix and how it begins."""
    if Path(path).suffix.lower() != ".json" or not Path(path).is_file():
        return False
    with Path(path).open("rb") as file:
        return b'"flexspline-model"' in file.read(4096)


def history_of(
    paths: str | os.PathLike[str] | Log | Iterable[str | os.PathLike[str] | Log],
    *,
    target: str | None = None,
    model: Model | None = None,
    effects: str | Effect | Iterable[str | Effect] | None = None,
    orders: Mapping[str, Sequence[int]] | None = None,
    fixed: Mapping[str, float] | None = None,
    known_load: str | None = None,
    bandwidth: float | None = None,
    dates: str | os.PathLike[str] | None = None,
    columns: str | os.PathLike[str] | None = None,
    threads: int = 1,
    progress: bool = False,
    **reading: Any,
) -> History:
    """Return the parameters of one joint over its sessions.

    Parameters
    ----------
    paths : `model.json` of each session, or its runs, or a folder of these. A run may be a `Log`
        with its date as the fact `date`.
    target : which part of the models, or what is explained of the runs.
    model : of runs: its effects and orders are fitted to each, with its shapes held.
    effects : of runs, in the place of a model; the shapes that the first run tells are held.
    orders, fixed, known_load, bandwidth, threads : as for `fit`.
    dates : a CSV table with the columns `run` (or the name of a model's file or folder), `date`
        and, of models, `temperature` [°C]. Without it dates are those in the names of files or
        folders, or the fact `date` of a run.
    columns : a column map of the runs.
    progress : show what is being done on standard error.
    **reading : every other argument of `read_log`.

    Returns
    -------
    History

    Raises
    ------
    InputError
        Where a session has no date, models and runs are mixed, targets or units differ, effects are
        missing, or no session can be fitted.
    """
    given = [paths] if isinstance(paths, (str, os.PathLike, Log)) else list(paths)
    logs = [each for each in given if isinstance(each, Log)]
    files = [Path(each) for each in given if not isinstance(each, Log)]
    models = [path for each in files for path in _models_in(each)]
    runs = [each for each in files if not _models_in(each)]
    if models and (runs or logs):
        raise InputError(
            f"{[*runs, *logs][0]}: is no model, and {models[0]} is one; give the models of a "
            "joint, or its runs"
        )
    if not given:
        raise InputError("there is no session to track; give models or runs of one joint")
    if models:
        table = {} if dates is None else _table(Path(dates))
        made = [_of_model(path, target, table) for path in models]
        return _joined(made, _joint_of([Model.load(path).facts for path in models]), ())
    part = None if model is None else model.part(target)
    if (part is None) == (effects is None):
        raise InputError("runs are fitted: give either a model or effects, to all the same")
    if part is None and target is None:
        raise InputError("runs are fitted: say which target is explained")
    sessions: list[Session | _Given] = [_Given(log) for log in logs]
    if runs:
        found = sessions_of(runs, columns=columns, dates=dates, **reading)
        sessions += _of_one_joint(runs, found)
    how = FitOptions(threads=threads, bandwidth=bandwidth)
    shared: dict[str, Any] = {"known_load": known_load, "options": how}
    if part is not None:
        asked: Sequence[str | Effect] = part.effects
        shared |= {"fixed": {**_shapes(part), **(fixed or {})}}
        shared |= {} if known_load is not None else {"known_load": part.known_load}
    else:
        assert effects is not None
        asked = with_orders(effects, orders or {})
        shared |= {"fixed": fixed or {}}
    return _fitted(sessions, asked, part.target if part is not None else str(target), shared,
                   {} if model is None else model.facts, progress)  # fmt: skip


def _models_in(path: Path) -> list[Path]:
    """The path itself, or the models in the folder that it is."""
    if path.is_dir():
        return sorted(each for each in path.rglob("*.json") if is_model(each))
    return [path] if is_model(path) else []


def _of_one_joint(paths: Sequence[Path], found: Iterable[Session]) -> list[Session]:
    """Sessions in order; folders of several joints are refused."""
    sessions = list(found)
    units = list(dict.fromkeys(session.unit for session in sessions))
    folders = any(path.is_dir() for path in paths)
    if folders and len(units) > 1 and any(date_in(unit) is None for unit in units):
        raise InputError(
            f"these folders hold runs of {len(units)} joints ({listed(units, 5)}); give one of them"
        )
    return sessions


def _fitted(
    sessions: Sequence[Session | _Given],
    effects: Sequence[str | Effect],
    target: str,
    shared: dict[str, Any],
    facts: Mapping[str, Any],
    progress: bool,
) -> History:
    """Fit each run; one that cannot be fitted is left out and said to be."""
    made: list[_Estimates] = []
    remarks, joints, first = [], [], None
    with Progress("fitting", progress, total=len(sessions), unit="run") as bar:
        for session in sessions:
            log = session.read()
            log = log.with_facts({k: v for k, v in facts.items() if k not in log.facts})
            when = session.dated(log).date
            if when is None:
                raise InputError(
                    f"{session.path}: has no date; put it into the file's name as 2027-03-14, or "
                    "give a table of dates"
                )
            try:
                fitted = fit(effects, log, target, **shared)
            except InputError as error:
                first = first or error
                remarks.append(f"{session.run} is left out: {error}")
                bar.step()
                continue
            held = _shapes(fitted.part)
            if first is None and not made and held:
                effects = fitted.part.effects
                shared = {**shared, "fixed": {**held, **shared["fixed"]}}
                fitted = fit(effects, log, target, **shared)
            joints.append(log.facts)
            made.append(_of_part(session.run, when, fitted.part, _warmth(log)))
            bar.step()
    if not made:
        raise first or InputError("there is no run to fit; give at least one")
    return _joined(made, _joint_of(joints), remarks)


def _shapes(part: Part) -> dict[str, float]:
    return {shape.name: shape.value(part.effects) for shape in shapes_of(part.effects)}


def _warmth(log: Log) -> float:
    found = mean_temperature(log)
    return np.nan if found is None else found


def _of_model(
    path: Path, target: str | None, table: Mapping[str, tuple[datetime, float]]
) -> _Estimates:
    """What a model.json tells of its session."""
    model = Model.load(path)
    part = model.part(target)
    if "covariance" not in part.record:
        raise InputError(f"{path}: holds no errors; give a model that fit has made")
    names = [path.name, path.stem, *(folder.name for folder in path.resolve().parents)][: DEPTH + 2]
    said = next((table[name] for name in (str(path), *names) if name in table), None)
    when = said[0] if said else next(filter(None, map(date_in, names)), None)
    if when is None and DATE in model.facts:
        when = date_in(str(model.facts[DATE]))
    if when is None:
        raise InputError(
            f"{path}: has no date; put it into the name of the file or its folder as 2027-03-14, "
            "or give a table of dates"
        )
    warm = said[1] if said else np.nan
    if not np.isfinite(warm):
        ranges = part.record.get("validity", {})
        warm = next((float(np.mean(ranges[name])) for name in WARMTHS if name in ranges), np.nan)
    label = path.parent.name if path.stem == "model" and path.parent.name else path.stem
    return _of_part(label, when, part, warm)


def _of_part(label: str, when: datetime, part: Part, temperature: float) -> _Estimates:
    """The coefficients that a part determined, with their covariance."""
    record = part.record["covariance"]
    matrix, known = np.array(record["matrix"], dtype=np.float64), list(record["names"])
    kept = [
        p
        for p in part.record["parameters"]
        if p["kind"] == "coefficient" and p["state"] != "fixed" and p["name"] in known
    ]
    at = [known.index(p["name"]) for p in kept]
    told = np.array([bool(p["determined"]) and p["state"] == "fitted" for p in kept], dtype=bool)
    values = np.array([p["value"] for p in kept], dtype=np.float64)
    covariance = matrix[np.ix_(at, at)] if at else np.zeros((0, 0))
    told &= np.isfinite(np.diag(covariance))
    values[~told] = np.nan
    covariance[~told], covariance[:, ~told] = np.nan, np.nan
    return _Estimates(
        label,
        when,
        tuple(p["name"] for p in kept),
        tuple(p["unit"] for p in kept),
        values,
        covariance,
        temperature,
        _shapes(part),
    )


def _joined(made: Sequence[_Estimates], joint: str, remarks: Sequence[str]) -> History:
    """One history of all sessions; a parameter that some have not is not told by them."""
    units: dict[str, str] = {}
    for each in made:
        for name, unit in zip(each.names, each.units, strict=True):
            if units.setdefault(name, unit) != unit:
                raise InputError(
                    f"{each.label}: {name} is in {unit}, in other sessions in {units[name]}; give "
                    "sessions of one target"
                )
    if not units:
        raise InputError("the sessions determine no parameter; give longer runs or fewer effects")
    names = list(units)
    values = np.full((len(made), len(names)), np.nan)
    covariance = np.full((len(made), len(names), len(names)), np.nan)
    for s, each in enumerate(made):
        at = [names.index(name) for name in each.names]
        values[s, at] = each.values
        covariance[np.ix_([s], at, at)] = each.covariance
    said = list(remarks)
    some = [n for k, n in enumerate(names) if not np.isfinite(values[:, k]).all()]
    if some:
        said.append(f"Not all sessions tell {listed(some)}: left out where they do not.")
    said += _of_shapes(made)
    return History(
        np.array([each.date for each in made], dtype="datetime64[s]"),
        tuple(names),
        tuple(units.values()),
        values,
        covariance,
        np.array([each.temperature for each in made]),
        tuple(each.label for each in made),
        joint,
        tuple(said),
    )


def _of_shapes(made: Sequence[_Estimates]) -> list[str]:
    """A sentence where shapes differ between sessions."""
    moved = []
    for name in made[0].shapes:
        values = np.array([each.shapes[name] for each in made if name in each.shapes])
        if np.ptp(values) > DIFFERENT * float(np.max(np.abs(values))):
            moved.append(name)
    if not moved:
        return []
    return [
        f"{listed(moved)} differ{'s' if len(moved) == 1 else ''} between the sessions, and what a "
        "shape takes from a coefficient looks like wear; give the runs with one model, whose "
        "shapes are held."
    ]


def _joint_of(facts: Sequence[Mapping[str, Any]]) -> str:
    """The joint's name, where sessions tell one.

    Raises
    ------
    InputError
        Where they tell several.
    """
    names = list(dict.fromkeys(str(each["joint"]) for each in facts if each.get("joint")))
    if len(names) > 1:
        raise InputError(f"the sessions are of {len(names)} joints ({listed(names, 5)}); give one")
    return names[0] if names else ""


def _table(path: Path) -> dict[str, tuple[datetime, float]]:
    """Date and temperature by name, of a CSV."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            rows = list(csv.DictReader(file))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(
            f"{path}: the table of dates cannot be read ({error}); give a CSV with the columns run "
            "and date"
        ) from error
    found = {}
    for number, row in enumerate(rows, 2):
        name, when = (row.get("run") or "").strip(), date_in(row.get(DATE) or "")
        if not name or when is None:
            raise InputError(
                f"{path}, line {number}: has no run or no date; write them as in m3,2027-03-14"
            )
        text = (row.get(TEMPERATURE) or "").strip()
        try:
            found[name] = (when, float(text) if text else np.nan)
        except ValueError:
            raise InputError(
                f"{path}, line {number}: the temperature is '{text}'; give °C, or nothing"
            ) from None
    return found
