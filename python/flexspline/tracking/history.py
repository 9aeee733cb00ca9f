"""The parameters of one joint, session by session: what `track` works on.

An order has cosine and sine, a and b, whose share depends on where an angle is zero. With the phase
ψ of the first sessions they become what grows and what turns:

    amplitude = a cos ψ + b sin ψ,        quadrature = b cos ψ − a sin ψ

The amplitude is the order as it was at first; the quadrature is zero there, and grows where the
order turns against it. An order that the first sessions do not tell from zero has no phase, and
keeps its cosine and sine.

`history_of` makes it of models or of runs. Runs are fitted one by one, with the same effects and
orders and with the same shapes held: a shape that is free takes with it what it shares with a
coefficient, and that would look like wear.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexspline.effects import Effect
from flexspline.errors import InputError, listed
from flexspline.fitting import fit, with_orders
from flexspline.fleet.sessions import Session, date_in, mean_temperature, rows_of_dates, sessions_of
from flexspline.least_squares.options import FitOptions, shapes_of
from flexspline.logs.log import Log
from flexspline.model import Model, Part
from flexspline.progress import Progress
from flexspline.tracking.changes import Series

__all__ = [
    "DAY",
    "FIRST",
    "History",
    "cause_of",
    "history_of",
    "is_model",
    "ranges_by_channel",
]

Array = NDArray[np.float64]

DAY: Final = 86400.0  # s
FIRST: Final = 12
"""Sessions that are the beginning: a phase and what parameters have in common are taken from them.
Half of it doubles the error of a phase; twice as many let early wear into the beginning."""
TOLD: Final = 3.0  # standard errors by which an amplitude is told from zero
COSINE, SINE = "cosine", "sine"
AMPLITUDE, QUADRATURE = "amplitude", "quadrature"

DATE, TEMPERATURE = "date", "temperature"
WARMTHS: Final = ("temperature", "motor_temperature")
DEPTH: Final = 3  # folders above a model in whose names a date is looked for
DIFFERENT: Final = 0.01
"""Of a shape's value: models whose shapes differ by more are said to. Runs of one joint that hold
their shapes have none; half or double of it changes nothing there."""


@dataclass(frozen=True, eq=False)
class History:
    """Estimates of one joint's parameters over calendar time, by date.

    Parameters
    ----------
    dates : (S,) datetime64; in any order, and equal ones are allowed.
    names : of the P parameters, "effect.term".
    units : of them.
    values : (S, P), NaN where a session does not determine one.
    covariance : (S, P, P) of what was measured, or standard errors (S, P).
    temperatures : (S,) mean of each session in °C, NaN where it is not known; by default of none.
    labels : names of the sessions.
    joint : its name.
    remarks : what was left out, in sentences.
    among : joints that are looked at together: of many, one shows more by chance.
    ranges : by channel that the effects read, (S, 2): lowest and highest value of each session, NaN
        where it is not known.
    target : what the parameters explain, or "".

    Raises
    ------
    InputError
        Where shapes do not fit, there is no session or no parameter, a date is missing, or a
        variance is negative.
    """

    dates: NDArray[np.datetime64]
    names: tuple[str, ...]
    units: tuple[str, ...]
    values: Array
    covariance: Array
    temperatures: Array = field(default_factory=lambda: np.empty(0))
    labels: tuple[str, ...] = ()
    joint: str = ""
    remarks: tuple[str, ...] = field(default=())
    among: int = 1
    ranges: Mapping[str, Array] = field(default_factory=dict)
    target: str = ""

    def __post_init__(self) -> None:
        dates = np.asarray(self.dates, dtype="datetime64[s]")
        values = _numbers(self.values, "values")
        count, width = len(dates), len(self.names)
        if not count or not width:
            raise InputError("a history needs a session and a parameter; give at least one of each")
        if np.isnat(dates).any():
            at = int(np.flatnonzero(np.isnat(dates))[0])
            raise InputError(f"session {at + 1} of the history has no date; give one or leave it")
        covariance = _numbers(self.covariance, "covariance")
        if covariance.shape == (count, width):
            covariance = covariance[:, :, None] ** 2 * np.eye(width)
        warm = _numbers(self.temperatures, "temperatures")
        warm = warm if warm.size else np.full(count, np.nan)
        labels = self.labels or tuple(f"session {k}" for k in range(1, count + 1))
        for what, has, is_to in (
            ("values", values.shape, (count, width)),
            ("covariance", covariance.shape, (count, width, width)),
            ("temperatures", warm.shape, (count,)),
            ("units", (len(self.units),), (width,)),
            ("labels", (len(labels),), (count,)),
            *((f"ranges of {n}", np.shape(ends), (count, 2)) for n, ends in self.ranges.items()),
        ):
            if has != is_to:
                raise InputError(
                    f"{what} of the history are of shape {has}; with {count} sessions and {width} "
                    f"parameters give {is_to}"
                )
        variances = np.einsum("spp->sp", covariance)
        if (variances < 0.0).any():
            raise InputError("a variance of the history is negative; give a covariance")
        if len(set(self.names)) < width:
            raise InputError("two parameters of the history have one name; give each its own")
        order = np.argsort(dates, kind="stable")
        for name, made in (
            ("dates", dates[order]),
            ("values", values[order]),
            ("covariance", covariance[order]),
            ("temperatures", warm[order]),
            ("labels", tuple(labels[k] for k in order)),
            ("ranges", {name: ends[order] for name, ends in self.ranges.items()}),
        ):
            object.__setattr__(self, name, made)

    def __len__(self) -> int:
        return len(self.dates)

    def __repr__(self) -> str:
        joint = f" of {self.joint}" if self.joint else ""
        ends = f"{self.dates[0].astype('M8[D]')} to {self.dates[-1].astype('M8[D]')}"
        return f"<History{joint}: {len(self)} sessions, {ends}, {len(self.names)} parameters>"

    @property
    def days(self) -> Array:
        """(S,) days since the first session."""
        seconds = (self.dates - self.dates[0]).astype("timedelta64[s]").astype(np.float64)
        return np.asarray(seconds / DAY)

    @property
    def looked_at(self) -> int:
        """How many series are looked at for a change: parameters, of all joints."""
        return len(self.names) * self.among

    @property
    def years(self) -> float:
        """From the first session to the last."""
        return float(self.days[-1] / 365.25)

    @property
    def knows_temperature(self) -> NDArray[np.bool_] | None:
        """(S,) which sessions tell it, where more than half do; None: it is not accounted for."""
        told = np.isfinite(self.temperatures)
        return told if 2 * told.sum() > len(told) else None

    @property
    def errors(self) -> Array:
        """(S, P) standard errors of what was measured."""
        return np.asarray(np.sqrt(np.einsum("spp->sp", self.covariance)))

    def date(self, days: float) -> datetime:
        """The date so many days after the first session."""
        when: datetime = (self.dates[0] + np.timedelta64(round(days * DAY), "s")).astype(datetime)
        return when

    def since(self, when: str | datetime | np.datetime64) -> History:
        """Return the sessions from a date on: those of a joint that was serviced then.

        Raises
        ------
        InputError
            Where it is no date, or no session is left.
        """
        try:
            first = np.datetime64(str(when).replace(" ", "T"), "s")
        except ValueError:
            raise InputError(f"'{when}' is no date; write it as 2027-03-14") from None
        kept = self.dates >= first
        if not kept.any():
            raise InputError(
                f"no session is from {first.astype('M8[D]')} on; the last is of "
                f"{self.dates[-1].astype('M8[D]')}: give an earlier date"
            )
        return self.sessions(kept)

    def sessions(self, which: NDArray[Any]) -> History:
        """Return some of the sessions."""
        at = np.flatnonzero(which) if which.dtype == bool else which
        return replace(
            self,
            dates=self.dates[at],
            values=self.values[at],
            covariance=self.covariance[at],
            temperatures=self.temperatures[at],
            labels=tuple(self.labels[k] for k in at),
            ranges={name: ends[at] for name, ends in self.ranges.items()},
        )

    def only(self, which: Sequence[int]) -> History:
        """Return some of the parameters."""
        at = list(which)
        return replace(
            self,
            names=tuple(self.names[k] for k in at),
            units=tuple(self.units[k] for k in at),
            values=self.values[:, at],
            covariance=self.covariance[:, at][:, :, at],
        )

    def series(self, weights: Array) -> tuple[Series, NDArray[np.intp]]:
        """Return a weighted sum of parameters, `weights` (P,), over the sessions that tell it.

        Sessions of unknown temperature are left out where others tell it. The numbers of the
        sessions that are left come beside it.
        """
        used = np.flatnonzero(weights)
        values = self.values[:, used] @ weights[used]
        inner = self.covariance[:, used][:, :, used]
        variances = np.einsum("sij,i,j->s", inner, weights[used], weights[used])
        told = np.isfinite(values) & np.isfinite(variances)
        warm = self.knows_temperature
        if warm is not None:
            told &= warm
        at = np.flatnonzero(told)
        temperatures = None if warm is None else self.temperatures[at]
        return Series(self.days[at], values[at], variances[at], temperatures), at

    def turned(self) -> History:
        """Return the history with amplitude and quadrature of each order that has a phase."""
        names, turn = list(self.names), np.eye(len(self.names))
        for cosine, sine, rest in self._orders():
            first = [*self._first((cosine, sine))]
            if len(first) < 4:
                continue
            both = self.values[first][:, [cosine, sine]]
            mean = np.median(both, axis=0)
            size = float(np.hypot(*mean))
            if not size > 0.0:
                continue
            along = mean / size
            spread = 1.4826 * np.median(np.abs(both @ along - size)) / np.sqrt(len(first))
            known = self.covariance[first][:, [cosine, sine]][:, :, [cosine, sine]]
            error = np.sqrt(np.mean(np.einsum("sij,i,j->s", known, along, along)) / len(first))
            if size < TOLD * float(np.hypot(spread, error)):
                continue
            turn[np.ix_([cosine, sine], [cosine, sine])] = [
                [along[0], along[1]], [-along[1], along[0]]
            ]  # fmt: skip
            names[cosine], names[sine] = (
                f"{names[cosine].split('.')[0]}.{word}{rest}" for word in (AMPLITUDE, QUADRATURE)
            )
        values = np.full_like(self.values, np.nan)
        for p, row in enumerate(turn):
            used = np.flatnonzero(row)
            values[:, p] = self.values[:, used] @ row[used]
        covariance = np.where(np.isfinite(self.covariance), self.covariance, 0.0)
        covariance = turn @ covariance @ turn.T
        known = np.isfinite(np.einsum("spp->sp", self.covariance))
        unknown = np.any(~known[:, None, :] & (turn != 0.0), axis=2) | ~np.isfinite(values)
        covariance[unknown[:, :, None] | unknown[:, None, :]] = np.nan
        return replace(self, names=tuple(names), values=values, covariance=covariance)

    def _orders(self) -> Iterator[tuple[int, int, str]]:
        """Numbers of cosine and sine of each order, and what stands behind these words."""
        for cosine, name in enumerate(self.names):
            effect, _, term = name.partition(".")
            word, _, rest = term.partition(" ")
            rest = f" {rest}" if rest else ""
            other = f"{effect}.{SINE}{rest}"
            if word == COSINE and other in self.names:
                yield cosine, self.names.index(other), rest

    def _first(self, parameters: Sequence[int]) -> NDArray[np.intp]:
        """The first sessions that tell these parameters."""
        told = np.isfinite(self.values[:, list(parameters)]).all(axis=1)
        return np.flatnonzero(told)[:FIRST]


def cause_of(name: str) -> str:
    """Return what a parameter belongs to: its effect, or one order of it.

    Several parameters of one cause change together, such as amplitude and quadrature.
    """
    effect, _, term = name.partition(".")
    word, _, rest = term.partition(" ")
    if word in (COSINE, SINE, AMPLITUDE, QUADRATURE):
        return f"{effect}, order {rest}" if rest else effect
    return name if word else effect


def ranges_by_channel(sessions: Sequence[Mapping[str, Sequence[float]]]) -> dict[str, Array]:
    """Return the ranges (S, 2) of each channel that a session tells."""
    unknown = (np.nan, np.nan)
    names = sorted({name for each in sessions for name in each})
    return {name: np.array([each.get(name, unknown) for each in sessions]) for name in names}


def _numbers(given: ArrayLike, what: str) -> Array:
    try:
        return np.array(given, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{what} of the history are no numbers; give an array of them") from None


@dataclass(frozen=True, eq=False)
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
    ranges: Mapping[str, Sequence[float]]
    target: str


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
        with its date as the fact `date`. A file that cannot be read is left out, as is a run that
        cannot be fitted, and a session that is given again (the same file, or the same rows of
        the same date) counts once: the remarks of the history say so.
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
        Where a session has no date, models and runs are mixed, targets or units differ, a run is of
        another gear than the model, effects are missing, or no session can be read and fitted.
    """
    given = [paths] if isinstance(paths, (str, os.PathLike, Log)) else list(paths)
    logs = [each for each in given if isinstance(each, Log)]
    files = [Path(each) for each in given if not isinstance(each, Log)]
    models = [path for each in files for path in _models_in(each)]
    empty = [path for path in files if models and _is_empty(path)]
    runs = [each for each in files if not _models_in(each) and each not in empty]
    if models and (runs or logs):
        raise InputError(
            f"{[*runs, *logs][0]}: is no model, and {models[0]} is one; give the models of a "
            "joint, or its runs"
        )
    if not given:
        raise InputError("there is no session to track; give models or runs of one joint")
    if models:
        table = {} if dates is None else _table(Path(dates))
        return _of_models([*models, *empty], target, table)
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
        shared |= {"into": model} if part.carried is not None else {}
        shared |= {} if known_load is not None else {"known_load": part.known_load}
    else:
        assert effects is not None
        asked = with_orders(effects, orders or {})
        shared |= {"fixed": fixed or {}}
    whose = part.target if part is not None else str(target)
    return _fitted(sessions, asked, whose, shared, model, progress)


def _models_in(path: Path) -> list[Path]:
    """The path itself, or the models in the folder that it is, empty files among them."""
    if path.is_dir():
        found = sorted(each for each in path.rglob("*.json") if is_model(each) or _is_empty(each))
        return found if any(map(is_model, found)) else []
    return [path] if is_model(path) else []


def _is_empty(path: Path) -> bool:
    """Whether a path is a JSON file without a byte, as a copy that was cut off leaves it."""
    return path.suffix.lower() == ".json" and path.is_file() and not path.stat().st_size


class _Seen:
    """What was said of sessions that are left out, and the names of those that count."""

    def __init__(self) -> None:
        self.remarks: list[str] = []
        self.errors: list[InputError] = []
        self._names: dict[Hashable, str] = {}

    def leave_out(self, name: str, error: InputError) -> None:
        self.remarks.append(f"{name} is left out: {error}")
        self.errors.append(error)

    def again(self, name: str, marks: Sequence[Hashable]) -> bool:
        """Whether a session with one of these marks was there before; it is left out and told."""
        other = next((self._names[mark] for mark in marks if mark in self._names), None)
        if other is None:
            self._names.update(dict.fromkeys(marks, name))
            return False
        self.remarks.append(
            f"{name} is left out: it holds the same as the session {other}, and a session counts "
            "once; give the right file if it was another one"
        )
        return True


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
    model: Model | None,
    progress: bool,
) -> History:
    """Fit each run; one that cannot be fitted is left out and said to be.

    Raises
    ------
    InputError
        Where a run has no date, is of another gear than the model, or none can be fitted.
    """
    made: list[_Estimates] = []
    joints, seen = [], _Seen()
    with Progress("fitting", progress, total=len(sessions), unit="run") as bar:
        for session, log, when in _read(sessions, target, model, bar, seen):
            try:
                fitted = fit(effects, log, target, **shared)
            except InputError as error:
                seen.leave_out(session.run, error)
                continue
            held = _shapes(fitted.part)
            if not made and held:
                effects = fitted.part.effects
                shared = {**shared, "fixed": {**held, **shared["fixed"]}}
                fitted = fit(effects, log, target, **shared)
            joints.append(log.facts)
            made.append(_of_part(session.run, when, fitted.part, _warmth(log)))
    if not made:
        raise next(iter(seen.errors), InputError("there is no run to fit; give at least one"))
    return _joined(made, _joint_of(joints), seen.remarks)


def _read(
    sessions: Sequence[Session | _Given],
    target: str,
    model: Model | None,
    bar: Progress,
    seen: _Seen,
) -> Iterator[tuple[Session | _Given, Log, datetime]]:
    """Yield each session that can be read and was not there before, with its run and date."""
    for session in sessions:
        try:
            log = session.read()
        except InputError as error:
            seen.leave_out(session.run, error)
            bar.step()
            continue
        log = log if model is None else _of_the_gear(model, target, log)
        when = session.dated(log).date
        if when is None:
            raise InputError(
                f"{session.path}: has no date; put it into the file's name as 2027-03-14, or "
                "give a table of dates"
            )
        if not seen.again(session.run, _marks(log, when)):
            yield session, log, when
        bar.step()


def _marks(log: Log, when: datetime) -> list[Hashable]:
    """What two sessions share only if they are one: the bytes of their file, or date and rows."""
    rows = hashlib.sha256()
    for name in sorted(log.channels):
        rows.update(name.encode())
        rows.update(log[name].tobytes())
    own = [] if log.source is None else [log.source.sha256]
    return [*own, (when, rows.hexdigest())]


def _of_the_gear(model: Model, target: str, log: Log) -> Log:
    """Add the facts of the model that a log leaves open; refuse one of another gear."""
    model.require_scales(log, model.part(target))
    return log.with_facts({k: v for k, v in model.facts.items() if k not in log.facts})


def _shapes(part: Part) -> dict[str, float]:
    return {shape.name: shape.value(part.effects) for shape in shapes_of(part.effects)}


def _warmth(log: Log) -> float:
    found = mean_temperature(log)
    return np.nan if found is None else found


def _of_models(
    paths: Sequence[Path], target: str | None, table: Mapping[str, tuple[datetime, float]]
) -> History:
    """The history of models; one that cannot be read is left out and said to be."""
    made, joints, seen = [], [], _Seen()
    for path in paths:
        try:
            model = Model.load(path)
        except InputError as error:
            seen.leave_out(_label(path), error)
            continue
        its = _of_model(path, model, target, table)
        logs = [entry.get("sha256") for entry in model.part(target).record.get("logs", ())]
        marks: list[Hashable] = [hashlib.sha256(path.read_bytes()).hexdigest()]
        marks += [("logs", *logs)] if logs and all(logs) else []
        if np.isfinite(its.values).any():
            marks.append((its.date, its.names, its.values.tobytes(), its.covariance.tobytes()))
        if not seen.again(its.label, marks):
            made.append(its)
            joints.append(model.facts)
    if not made:
        raise seen.errors[0]
    return _joined(made, _joint_of(joints), seen.remarks)


def _label(path: Path) -> str:
    """What the session of a model is called: by its folder, where the file is but model.json."""
    return path.parent.name if path.stem == "model" and path.parent.name else path.stem


def _of_model(
    path: Path, model: Model, target: str | None, table: Mapping[str, tuple[datetime, float]]
) -> _Estimates:
    """What a model.json tells of its session."""
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
    return _of_part(_label(path), when, part, warm)


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
        part.record.get("validity", {}),
        part.target,
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
        ranges=ranges_by_channel([each.ranges for each in made]),
        target=made[0].target,
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
    found = {}
    for number, row in enumerate(rows_of_dates(path), 2):
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
