"""Runs of a fleet, read where they lie: a tree of folders to sessions, each a run of one joint.

    DIR/UNIT/RUN.csv        a folder for each joint, its runs in it, however deep
    DIR/RUN.csv             a folder without folders is one joint
    DIR/map.toml            column map of all below; DIR/UNIT/map.toml of one joint goes before it

Several DIRs may hold runs of the same joint, such as a folder for each month: UNIT is its name.
Of a robot's files, which have columns of several joints, each joint is a unit: UNIT.JOINT.

The date of a session is from, in this order, a table of dates, an ISO date in the name of the file
(of its folder below UNIT, where the file's has none), or the fact `date` of its column map or its
file. It is never taken from the file system, where copying changes it.
"""

from __future__ import annotations

import csv
import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime, timezone
from pathlib import Path
from typing import Any, Final

import numpy as np

from flexspline.errors import InputError, listed
from flexspline.logs.formats import format_named
from flexspline.logs.log import Log
from flexspline.logs.packed import PACKED
from flexspline.logs.read import (
    joints_of,
    map_arguments,
    read_log,
    read_pieces,
    refuse_split,
    run_name,
)

__all__ = [
    "Session",
    "Sessions",
    "date_in",
    "mean_temperature",
    "readable",
    "rows_of_dates",
    "sessions_of",
]

MAP: Final = "map.toml"
TEXT: Final = (".csv", ".tsv", ".txt", ".dat", ".asc", ".log")
NO_RUNS: Final = ("dates.csv", "joints.csv", "next_experiment.csv", "package.json", "tsconfig.json")
RESULTS: Final = ("model", "discovery", "comparison", "fleet", "track", "cert")
"""JSON files that commands of flexspline write, which are no runs."""
ALL: Final = "all"
DATE: Final = "date"
EARLIEST, LATEST = 1970, 2200  # years: other numbers of eight digits are no dates

_DAY = r"(?<!\d)(\d{4})(-?)(\d{2})\2(\d{2})"
_TIME = r"(?:[T_ .-]?(?:(?<=[T_ .-])(\d{2})[:h-]?(\d{2})(?:[:m-]?(\d{2}))?)Z?)?(?!\d)"
_ISO = re.compile(_DAY + _TIME)


@dataclass(frozen=True)
class Session:
    """One run of one joint, not read yet.

    Parameters
    ----------
    unit : name of the joint.
    run : name of the run, one of a kind among those of the joint.
    path : of the file.
    date : when it was recorded, where that is known; one with a time zone is turned into UTC.
    dated_by : "table", "name", "map" or "log": who says so; "" where nobody does.
    arguments : how `read_log` reads it.
    """

    unit: str
    run: str
    path: Path
    date: datetime | None = None
    dated_by: str = ""
    arguments: Mapping[str, Any] = field(default_factory=dict)

    @property
    def label(self) -> str:
        """UNIT/RUN, as results call the session."""
        return f"{self.unit}/{self.run}"

    @property
    def size(self) -> int:
        """Bytes of the file."""
        return self.path.stat().st_size

    def read(self) -> Log:
        """Return the run.

        Raises
        ------
        InputError
            As `read_log`.
        """
        return read_log(self.path, **{**self.arguments, "name": self.run})

    def pieces(self, rows: int) -> Iterator[Log]:
        """Return the run piece by piece, `rows` in each, for one that is larger than memory.

        Raises
        ------
        InputError
            As `read_pieces`: repairs need the whole run.
        """
        return read_pieces(self.path, rows=rows, **{**self.arguments, "name": self.run})

    def dated(self, log: Log) -> Session:
        """Return the session with the date that its log has as a fact, where none is known yet.

        Raises
        ------
        InputError
            Where that fact is no date.
        """
        if self.date is not None or DATE not in log.facts:
            return self
        when = _parsed(str(log.facts[DATE]), f"{self.path}: the fact '{DATE}'")
        return replace(self, date=when, dated_by="log")


@dataclass(frozen=True)
class Sessions:
    """The sessions of a fleet, by unit and run, and sentences about files that are none."""

    sessions: tuple[Session, ...]
    remarks: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.sessions)

    def __iter__(self) -> Iterator[Session]:
        return iter(self.sessions)

    @property
    def units(self) -> tuple[str, ...]:
        """Names of the joints, in order."""
        return tuple(dict.fromkeys(session.unit for session in self.sessions))

    def of(self, unit: str) -> tuple[Session, ...]:
        """Sessions of one joint: by date where all of them have one, else by name."""
        its = [session for session in self.sessions if session.unit == unit]
        dates = [session.date for session in its if session.date is not None]
        if len(dates) < len(its):
            return tuple(its)
        return tuple(its[k] for k in np.argsort(np.array(dates, dtype="M8[us]"), kind="stable"))


def sessions_of(
    folders: str | os.PathLike[str] | Iterable[str | os.PathLike[str]],
    *,
    columns: str | os.PathLike[str] | None = None,
    dates: str | os.PathLike[str] | None = None,
    joints: str | Sequence[str] = (),
    **how: Any,
) -> Sessions:
    """Return the sessions that lie in folders; no run is read.

    Parameters
    ----------
    folders : trees of folders, or single files, which are runs of the joint whose folder they are
        in.
    columns : a column map for all runs; by default `map.toml` in the folder of a joint, else in
        the tree's.
    dates : a CSV table with the columns `run` and `date`: the name of a run, or UNIT/RUN, and an
        ISO date.
    joints : of a robot's files: names, or "all"; each is a unit of its own.
    **how : every other argument of `read_log`; these overrule the maps.

    Raises
    ------
    InputError
        Where a folder is not there, holds no run or both runs and folders of runs, a map or the
        table of dates is wrong, or says the date of a run that is not there.
    """
    given = [folders] if isinstance(folders, (str, os.PathLike)) else list(folders)
    if not given:
        raise InputError("there is no folder with runs; give at least one")
    files, remarks = _files_of([Path(each) for each in given])
    maps: dict[Path | None, dict[str, Any]] = {}
    found = []
    for file in files:
        place = Path(columns) if columns is not None else file.map
        found += _of_joints(file, _arguments(place, how, maps), joints, place, how)
    found = _named_apart(sorted(found, key=lambda s: (s.unit, s.run, str(s.path))))
    table = {} if dates is None else _table_of_dates(Path(dates), found)
    dated = [_dated(session, table) for session in found]
    return Sessions(tuple(dated), tuple(remarks))


def mean_temperature(log: Log) -> float | None:
    """Return the mean of the temperature of a run [°C], of the motor's where it has no other."""
    for channel in ("temperature", "motor_temperature"):
        if channel in log and np.isfinite(log[channel]).any():
            return float(np.nanmean(log[channel]))
    return None


def readable(sessions: Sequence[Session]) -> tuple[list[Log], list[tuple[str, str]]]:
    """Return the runs that can be read, and (UNIT/RUN, why) of those that cannot.

    Raises
    ------
    InputError
        Where none can be read: the first of these sentences.
    """
    logs, failed = [], []
    for session in sessions:
        try:
            logs.append(session.read())
        except InputError as error:
            failed.append((session.label, str(error)))
    if not logs:
        raise InputError(failed[0][1])
    return logs, failed


def date_in(text: str) -> datetime | None:
    """Return the last ISO date in a text, such as 2026-11-28 or 20261128T0915; None without one."""
    for match in reversed(list(_ISO.finditer(text))):
        year, _, *rest = match.groups()
        month, day, hour, minute, second = (int(part or 0) for part in rest)
        try:
            when = datetime(int(year), month, day, hour, minute, second)
        except ValueError:
            continue
        if EARLIEST <= when.year < LATEST:
            return when
    return None


@dataclass(frozen=True)
class _File:
    """A file of a joint: the folder of the joint, and the map that is for it."""

    unit: str
    path: Path
    within: Path
    map: Path | None

    @property
    def run(self) -> str:
        """Name of the run: folders below the joint's count."""
        inside = self.path.relative_to(self.within)
        return str((inside.parent / run_name(inside)).as_posix())


def _files_of(trees: Sequence[Path]) -> tuple[list[_File], list[str]]:
    files, others = dict[Path, _File](), list[Path]()
    for tree in trees:
        if not tree.exists():
            raise InputError(f"{tree}: is not there; give a folder with runs of joints")
        here = [_single(tree)] if tree.is_file() else _files_in(tree, others)
        if not here:
            raise InputError(
                f"{tree}: holds no run; give a folder with a folder for each joint and its runs "
                "in it"
            )
        for file in here:
            files.setdefault(file.path.resolve(), file)
    said = [f"{listed(others, 5)}: no runs by their names, not read"] if others else []
    return list(files.values()), said


def _single(path: Path) -> _File:
    return _File(_name_of(path.parent), path, path.parent, _map_in(path.parent))


def _name_of(folder: Path) -> str:
    return folder.resolve().name or "joint"


def _files_in(tree: Path, others: list[Path]) -> list[_File]:
    """Runs in a tree; what has no name of a run goes to `others`."""
    direct: list[_File] = []
    inside: list[_File] = []
    for path in sorted(tree.rglob("*")):
        parts = path.relative_to(tree).parts
        if not path.is_file() or any(part.startswith(".") for part in parts) or _is_ours(path):
            continue
        if not _is_run(path):
            others.append(path)
            continue
        unit, within = (parts[0], tree / parts[0]) if len(parts) > 1 else (_name_of(tree), tree)
        own = _map_in(within) or _map_in(tree)
        (inside if len(parts) > 1 else direct).append(_File(unit, path, within, own))
    if direct and inside:
        raise InputError(
            f"{tree}: holds runs, such as {direct[0].path.name}, beside folders of joints, such as "
            f"{inside[0].unit}; move them into the folder of their joint"
        )
    return direct or inside


def _is_ours(path: Path) -> bool:
    """Whether a file belongs to a tree and is no run: a map, a table, a result."""
    result = path.suffix == ".json" and path.stem in RESULTS
    page = path.suffix in (".html", ".toml", ".md", ".png", ".svg", ".hpp")
    return path.name in NO_RUNS or result or page or path.name.endswith(".previous")


def _is_run(path: Path) -> bool:
    plain = path.with_suffix("") if path.suffix.lower() in PACKED else path
    return plain.suffix.lower() in TEXT or format_named(path) is not None


def _map_in(folder: Path) -> Path | None:
    return folder / MAP if (folder / MAP).is_file() else None


def _arguments(
    place: Path | None, how: Mapping[str, Any], maps: dict[Path | None, dict[str, Any]]
) -> dict[str, Any]:
    """How the files below a map are read: what it says, and what the call says over it."""
    if place not in maps:
        said = {} if place is None else map_arguments(place)
        refuse_split(said, f"{place}: a file of a fleet is one run")
        facts = {**said.get("facts", {}), **(how.get("facts") or {})}
        maps[place] = {**said, **how, **({"facts": facts} if facts else {})}
    return maps[place]


def _of_joints(
    file: _File,
    arguments: Mapping[str, Any],
    joints: str | Sequence[str],
    place: Path | None,
    how: Mapping[str, Any],
) -> list[Session]:
    """The session of a file, or one for each joint of a robot's."""
    if not joints:
        return [Session(file.unit, file.run, file.path, arguments=arguments)]
    names = [joints] if isinstance(joints, str) else list(joints)
    if names == [ALL]:
        rest = {key: arguments[key] for key in arguments if key not in ("columns", "repair")}
        names = list(joints_of(file.path, arguments.get("columns"), **rest))
    found = []
    for name in names:
        own = {} if place is None else map_arguments(place, name)
        facts = {**own.get("facts", {}), **(how.get("facts") or {})}
        its = {**arguments, "joint": name, "facts": facts}
        found.append(Session(f"{file.unit}.{name}", file.run, file.path, arguments=its))
    return found


def _named_apart(sessions: Sequence[Session]) -> list[Session]:
    """Sessions of which none is called as another of its unit: those that are get a number."""
    counts: dict[tuple[str, str], int] = {}
    for session in sessions:
        counts[session.unit, session.run] = counts.get((session.unit, session.run), 0) + 1
    seen: dict[tuple[str, str], int] = {}
    made = []
    for session in sessions:
        key = (session.unit, session.run)
        if counts[key] > 1:
            seen[key] = seen.get(key, 0) + 1
            session = replace(session, run=f"{session.run} ({seen[key]})")
        made.append(session)
    return made


def rows_of_dates(path: Path) -> list[dict[str, str]]:
    """Return the rows of a CSV with the columns run and date.

    Raises
    ------
    InputError
        Where the file cannot be read.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            return list(csv.DictReader(file))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(
            f"{path}: the table of dates cannot be read ({error}); give a CSV with the columns run "
            "and date"
        ) from error


def _table_of_dates(path: Path, sessions: Sequence[Session]) -> dict[str, datetime]:
    """Dates by UNIT/RUN."""
    known: dict[str, list[str]] = {}
    for session in sessions:
        for name in {session.label, session.run, session.path.name, _with_suffix(session)}:
            known.setdefault(name, []).append(session.label)
    found: dict[str, datetime] = {}
    for number, row in enumerate(rows_of_dates(path), 2):
        run, date = (row.get("run") or "").strip(), (row.get("date") or "").strip()
        if not run or not date:
            raise InputError(
                f"{path}, line {number}: has no run or no date; give a CSV with the columns run "
                "and date"
            )
        labels = known.get(run, [])
        if len(labels) != 1:
            why = "is no run of these folders" if not labels else f"may be {listed(labels)}"
            raise InputError(f"{path}, line {number}: '{run}' {why}; write UNIT/RUN as it lies")
        found[labels[0]] = _parsed(date, f"{path}, line {number}: the date of {run}")
    return found


def _with_suffix(session: Session) -> str:
    return f"{session.unit}/{session.path.name}"


def _parsed(text: str, what: str) -> datetime:
    try:
        when = datetime.fromisoformat(text.strip().replace("Z", "+00:00"))
    except ValueError:
        whole = date_in(text) if _ISO.fullmatch(text.strip()) else None
        if whole is None:
            raise InputError(
                f"{what} is '{text}'; write it as 2026-11-28 or 2026-11-28T09:15"
            ) from None
        when = whole
    return when if when.tzinfo is None else when.astimezone(timezone.utc).replace(tzinfo=None)


def _dated(session: Session, table: Mapping[str, datetime]) -> Session:
    if session.label in table:
        return replace(session, date=table[session.label], dated_by="table")
    named = date_in(session.path.name) or date_in(session.run)
    if named is not None:
        return replace(session, date=named, dated_by="name")
    fact = (session.arguments.get("facts") or {}).get(DATE)
    if fact is None:
        return session
    return replace(session, date=_parsed(str(fact), f"{session.path}: the date of its map"),
                   dated_by="map")  # fmt: skip
