"""`read_log` and `convert`: a log in SI units from a file or data in memory.

`convert` makes a run of a foreign file and a map in TOML: channels in SI units, facts, one table.
"""

from __future__ import annotations

import inspect
import math
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal, TypeAlias, cast

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import InputError, did_you_mean, listed
from flexspline.files import refuse_special
from flexspline.formatting import documented
from flexspline.logs.columns import ColumnSpec, Picked, picked
from flexspline.logs.formats import Dialect, format_rows, no_source, read_table
from flexspline.logs.frames import is_frame
from flexspline.logs.log import Fact, Log, Source, checked_facts
from flexspline.logs.packed import PACKED
from flexspline.logs.presets import Preset, preset_of
from flexspline.logs.repairs import (
    Repairs,
    move_earlier,
    repaired,
    repairs_of_both,
    repairs_of_source,
)
from flexspline.logs.splitting import (
    Cut,
    Gaps,
    columns_of_joint,
    has_places,
    joints_among,
    parts_of,
)
from flexspline.logs.table import Table
from flexspline.logs.writing import write_log, write_pieces

if TYPE_CHECKING:
    import pandas

__all__ = [
    "Converted",
    "LogLike",
    "as_log",
    "as_logs",
    "convert",
    "convert_in_pieces",
    "cut_runs",
    "is_one",
    "joints_of",
    "map_arguments",
    "read_log",
    "read_map",
    "read_pieces",
    "read_runs",
    "refuse_split",
    "splits",
    "with_motor_torque",
]

PIECE: Final = 1_000_000  # rows
SPLIT: Final = ("split_column", "split_gaps")
"""Arguments of `read_runs` that `read_log` does not take."""
UNCUT: Final = [("split_gaps", False)]
SECTIONS: Final = ("facts", "columns", "read", "joints")
READ_KEYS: Final = (
    "rate",
    "repair",
    "header",
    "separator",
    "decimal",
    "encoding",
    "variable",
    "drop_rows",
    "skip_lines",
    "skip_footer",
    "units_row",
    "max_memory",
    "preset",
    *SPLIT,
)


@documented(format_rows())
def read_log(
    source: str | os.PathLike[str] | NDArray[Any] | Mapping[str, Any] | Any,
    columns: Mapping[str, ColumnSpec] | str | os.PathLike[str] | None = None,
    *,
    gear_ratio: float | None = None,
    output_spline: Literal["circular", "flex"] | None = None,
    pole_pairs: int | None = None,
    slots: int | None = None,
    torque_constant: float | None = None,
    rate: float | None = None,
    name: str | None = None,
    repair: Repairs = (),
    header: bool | Literal["auto"] = "auto",
    separator: str | None = None,
    decimal: str | None = None,
    encoding: str = "utf-8",
    variable: str | None = None,
    drop_rows: int = 0,
    skip_lines: int = 0,
    skip_footer: int = 0,
    units_row: bool = False,
    max_memory: float | None = None,
    facts: Mapping[str, Fact] | None = None,
    joint: str | int | None = None,
    preset: str | None = None,
) -> Log:
    """Read one run of one joint into a `Log`, in SI units.

    Parameters
    ----------
    source : path, ndarray, mapping of arrays, DataFrame or Dataset
        A file of one of the formats in the notes below, delimited text among them, also packed as
        .gz, .bz2, .xz or .zip. A matrix (the longer side is time), a structured
        array, a dictionary, a table of pandas (units in ``attrs["units"]``), polars or xarray
        (units in the attributes of each variable). Where a source samples columns at instants of
        their own, these are laid on one clock, that of the column that is `time`, else of the
        fastest that is chosen, and the history says how: see `flexspline.logs.one_clock`.
    columns : mapping of channel to column, or path of a column map, optional
        A column is a name or a number (from 0), ``(name, unit)``, or a `ColumnSource`
        with unit, sign, scale, bits and clock. Columns that already have a channel's name
        need no entry; all others are ignored, and named in the history. Of a map in a TOML file
        (`guess_map(...).save`, `flexspline init`) all sections count, see `convert`; what is given
        here beside it, other than the default, overrules it.
    gear_ratio, output_spline, pole_pairs, slots, torque_constant
        Facts of the joint; `torque_constant` in Nm/A at the motor. With it
        and a motor_current, motor_torque is derived where the file has none.
    rate : float, optional
        Samples per second [Hz] of a file without time stamps.
    name : str, optional
        Name of the run; by default the file's.
    repair : str, sequence or mapping
        Repairs by name, done in this order, behind those of a map file; see
        `flexspline.logs.repairs`. Columns with a clock of their own are moved after them.
    header, separator, decimal, encoding
        How text is written; found by looking where not given. Separator "whitespace" is any
        run of blanks and tabs.
    variable : str, optional
        The part of a file that is read, such as "run.data": what that is in which format stands in
        the notes below.
    drop_rows : int
        Rows of data at the start that are not read: a transient.
    skip_lines, skip_footer : int
        Lines of a text file above the table and below it, which are not read.
    units_row : bool
        The row below the names holds units: those of columns whose map gives none.
    max_memory : float, optional
        What a file may take once it is unfolded [GB]; by default half of what is free.
    facts : mapping, optional
        More facts. Arguments overrule facts, and facts overrule the file's own.
    joint : str or int, optional
        Which joint of a robot's file: its name takes the place of ``{joint}`` in the sources of
        `columns`, such as ``q_{joint}`` or ``q[:, {joint-1}]``, and is the fact `joint`.
    preset : str, optional
        The map of a recorder that comes with the package, such as "ur-rtde"; what `columns` says is
        laid over it, an entry without a source over the preset's own: ``{"motor_current":
        {"sign": -1}}``. What its sources leave open is not read until it is said, and named in the
        history; see `flexspline.logs.presets`.

    Raises
    ------
    InputError
        One sentence: file, row or column, what is wrong, what to do.

    Notes
    -----
    The format of a file is told by the end of its name, or by how it begins:

    {formats}
    """
    how = {
        "gear_ratio": gear_ratio, "output_spline": output_spline, "pole_pairs": pole_pairs,
        "slots": slots, "torque_constant": torque_constant, "rate": rate, "name": name,
        "header": header, "separator": separator, "decimal": decimal, "encoding": encoding,
        "variable": variable, "drop_rows": drop_rows, "skip_lines": skip_lines,
        "skip_footer": skip_footer, "units_row": units_row, "max_memory": max_memory,
        "facts": facts, "joint": joint, "preset": preset,
    }  # fmt: skip
    if isinstance(columns, (str, os.PathLike)):
        said = map_arguments(columns, joint)
        refuse_split(said, f"{columns}: read_log reads one run, read_runs several")
        usual = inspect.signature(read_log).parameters
        given = {key: value for key, value in how.items() if value != usual[key].default}
        columns, repair, how = _beside_map(said, repair, how | {"facts": {}}, given)
    read = _read(source, columns, how)
    return read.repaired(read.log, repair)


def read_runs(
    source: str | os.PathLike[str] | NDArray[Any] | Mapping[str, Any] | Any,
    columns: Mapping[str, ColumnSpec] | str | os.PathLike[str] | None = None,
    *,
    split_column: str | int | None = None,
    split_gaps: Gaps = None,
    repair: Repairs = (),
    **how: Any,
) -> list[Log]:
    """Read one file that holds several runs of one joint, one behind the other.

    Parameters
    ----------
    source, columns, repair
        As for `read_log`; repairs are made in each run by itself.
    split_column : str or int, optional
        A column of the file, by name or number from 0, of text or numbers: a run begins wherever
        its value changes, and rows without one are in no run.
    split_gaps : bool or float, optional
        A run begins where time goes on by more than so many seconds, or back; True: by more than
        25 median steps.
    **how
        Every other argument of `read_log`.

    Returns
    -------
    list of Log
        Runs of at least 20 rows, in the order of the file, called ``name_1``, ``name_2`` and so
        on. The history of each says how many rows of the file are in no run, and why.

    Raises
    ------
    InputError
        As `read_log`; and where neither is given, the column is not there or empty, or more than
        half of the rows would be in runs that are too short.
    """
    return list(
        cut_runs(
            source, columns, split_column=split_column, split_gaps=split_gaps, repair=repair, **how
        ).runs
    )


@dataclass(frozen=True, eq=False)
class CutRuns:
    """Runs of one file, how many of its rows are in none, and a sentence that says so."""

    runs: tuple[Log, ...]
    rows_left_out: int
    sentence: str


def cut_runs(
    source: Any,
    columns: Mapping[str, ColumnSpec] | str | os.PathLike[str] | None = None,
    *,
    split_column: str | int | None = None,
    split_gaps: Gaps = None,
    repair: Repairs = (),
    **how: Any,
) -> CutRuns:
    """Return what `read_runs` reads, and what is left out."""
    if isinstance(columns, (str, os.PathLike)):
        mapped = map_arguments(columns, how.get("joint"))
        column, gaps = (mapped.pop(key, None) for key in SPLIT)
        split_column = column if split_column is None else split_column
        split_gaps = gaps if split_gaps is None else split_gaps
        columns, repair, how = _beside_map(mapped, repair, {}, how)
    cut = Cut(split_column, split_gaps)
    asked = inspect.signature(read_log).bind(source, columns, **how)
    asked.apply_defaults()
    given = {name: asked.arguments[name] for name in asked.arguments if name not in _NOT_HOW}
    read = _read(source, columns, given)
    parts = parts_of(read.table, read.log["time"], cut)
    said, runs = parts.sentence(read.table.label, cut), []
    for number, (first, last) in enumerate(parts.ranges, 1):
        note = f"rows {first} to {last - 1} of {read.log.name} are its run {number}"
        run = read.log.rows(slice(first, last), note=note)
        named = run.with_facts({"name": f"{read.log.name}_{number}"}, note=said)
        runs.append(read.repaired(named, repair))
    return CutRuns(tuple(runs), parts.left_out, said)


def read_pieces(
    source: str | os.PathLike[str] | NDArray[Any] | Mapping[str, Any] | Any,
    columns: Mapping[str, ColumnSpec] | str | os.PathLike[str] | None = None,
    *,
    rows: int = PIECE,
    **how: Any,
) -> Iterator[Log]:
    """Read a log that is larger than memory, one piece of its rows after the other.

    Parameters
    ----------
    source, columns
        As for `read_log`. Of formats that its notes call read in pieces only what a piece needs is
        in memory. All other files are read as a whole first.
    rows : int
        In a piece; the last may be shorter.
    **how
        Every other argument of `read_log` but `repair`: repairs look at the whole run.

    Yields
    ------
    Log
        With the same numbers as the rows of `read_log`, times included.

    Raises
    ------
    InputError
        As `read_log`; and where repairs are asked for, or a column's clock has an offset or is its
        own.

    Examples
    --------
    >>> pieces = flexspline.read_pieces("year.parquet", "map.toml")       # doctest: +SKIP
    >>> sums = flexspline.accumulate("viscous_friction", pieces, "motor_torque")  # doctest: +SKIP
    >>> sums.solve().coefficients                                         # doctest: +SKIP
    """
    if not (isinstance(rows, int) and rows > 0):
        raise InputError(f"rows is {rows!r}; give how many rows a piece has, such as {PIECE}")
    if isinstance(columns, (str, os.PathLike)):
        said = map_arguments(columns, how.get("joint"))
        refuse_split(said, f"{columns}: read_pieces reads one run")
        columns, repair, how = _beside_map(said, how.pop("repair", ()), {}, how)
    else:
        repair = how.pop("repair", ())
    asked = inspect.signature(read_log).bind(source, columns, **how)
    asked.apply_defaults()
    given = {name: asked.arguments[name] for name in asked.arguments if name not in _NOT_HOW}
    preset = None if given["preset"] is None else preset_of(given["preset"])
    table, origin = _table_of(source, given)
    if repair:
        raise InputError(
            f"{table.label}: repairs look at the whole run, which is read in pieces; leave repair "
            "out, of the column map too, or read the run at once"
        )
    return _pieces(table, rows, lambda part: _log_of(part, origin, columns, preset, given))


def _pieces(table: Table, rows: int, read_of: Callable[[Table], _Read]) -> Iterator[Log]:
    for number, part in enumerate(table.pieces(rows)):
        read = read_of(part)
        if read.late:
            raise InputError(
                f"{table.label}: the clock of {listed(read.late)} has an offset, which moves rows "
                "beyond the end of a piece; read the run at once"
            )
        first = number * rows
        note = f"rows {first} to {first + part.rows - 2} of {table.rows}"
        yield with_motor_torque(read.log).rows(slice(1, None), note=note)


def _beside_map(
    said: Mapping[str, Any], repair: Repairs, usual: Mapping[str, Any], given: Mapping[str, Any]
) -> tuple[Mapping[str, ColumnSpec], Repairs, dict[str, Any]]:
    """Return columns, repairs and the other arguments where a map says some and a call others.

    `said`: by the map; `usual`: where neither says; `given`: by the call.
    """
    how = {**usual, **{key: said[key] for key in said if key not in _NOT_HOW}, **given}
    how["facts"] = {**said["facts"], **(given.get("facts") or {})}
    return said["columns"], repairs_of_both(said.get("repair", ()), repair), how


_NOT_HOW: Final = ("source", "columns", "repair")


def joints_of(
    source: str | os.PathLike[str] | NDArray[Any] | Mapping[str, Any] | Any,
    columns: Mapping[str, ColumnSpec] | str | os.PathLike[str] | None = None,
    **how: Any,
) -> tuple[str, ...]:
    """Return the joints of a robot's file: those of which it has every column of the map.

    Parameters
    ----------
    source : as for `read_log`.
    columns : with places, such as ``{"output_position": "q_{joint}"}``, or path of such a map.
    **how
        Of the arguments of `read_log`, those that say how the file is written, and `preset`.

    Raises
    ------
    InputError
        Where the map has no places or goes by the numbers of columns, no joint has all of them, or
        the file cannot be read.

    Examples
    --------
    >>> for joint in flexspline.joints_of("robot.csv", columns):       # doctest: +SKIP
    ...     log = flexspline.read_log("robot.csv", columns, joint=joint)
    ...     print(joint, flexspline.fit("coulomb_friction", log, "sensor_torque"))
    """
    if isinstance(columns, (str, os.PathLike)):
        said = map_arguments(columns)
        rest = {key: value for key, value in said.items() if key not in SPLIT}
        columns, _, how = _beside_map(rest, (), {}, how)
    asked = inspect.signature(read_log).bind(source, columns, **how)
    asked.apply_defaults()
    preset = asked.arguments["preset"]
    made = None if preset is None else preset_of(preset)
    table, _ = _table_of(source, asked.arguments)
    if made is not None:
        return made.joints_of(columns, table)
    return joints_among(table.names or (), columns, table.label)


@dataclass(frozen=True, eq=False)
class _Read:
    """A log as read, before any repair; its table; and how late each channel's clock is, s."""

    log: Log
    table: Table
    late: Mapping[str, float]

    def repaired(self, log: Log, repair: Repairs) -> Log:
        """Return rows of the log repaired, with columns of a clock of their own moved."""
        whole = with_motor_torque(log)
        parts = repairs_of_source(repair, "motor_torque", "motor_current")
        if whole is log or parts is None:
            made = repaired(whole, repair)
        else:
            made = repaired(with_motor_torque(repaired(log, parts[0])), parts[1])
        for channel, seconds in self.late.items():
            made = move_earlier(made, channel, seconds)
        return made


def _table_of(source: Any, how: Mapping[str, Any]) -> tuple[Table, Source | None]:
    dialect = Dialect(*(how[key] for key in DIALECT))
    return read_table(source, how["variable"], dialect, how["drop_rows"], how["max_memory"])


DIALECT: Final = (
    "header", "separator", "decimal", "encoding", "skip_lines", "skip_footer", "units_row",
)  # fmt: skip
"""Arguments of `read_log` that are fields of a `Dialect`, in their order."""
ARGUMENTS: Final = (
    "gear_ratio", "output_spline", "pole_pairs", "slots", "torque_constant", "name", "joint",
)  # fmt: skip
"""Arguments of `read_log` that are facts."""


def _read(source: Any, columns: Mapping[str, ColumnSpec] | None, how: Mapping[str, Any]) -> _Read:
    """Read a log; `how`: all other arguments of `read_log` but its repairs."""
    preset = None if how["preset"] is None else preset_of(how["preset"])
    table, origin = _table_of(source, how)
    return _log_of(table, origin, columns, preset, how)


def _log_of(
    table: Table,
    origin: Source | None,
    columns: Mapping[str, ColumnSpec] | None,
    preset: Preset | None,
    how: Mapping[str, Any],
) -> _Read:
    """Return the log in a table, or in a piece of one."""
    chosen, by_preset = _chosen_columns(columns, preset, how["joint"], table)
    found = picked(table, chosen)
    table = found.table
    channels, timing = _timed(table, found, how["rate"])
    arguments = {key: how[key] for key in ARGUMENTS}
    given = {k: v for k, v in [*(how["facts"] or {}).items(), *arguments.items()] if v is not None}
    known, overruled = _facts(table, origin.path if origin else None, given)
    rows = f"{table.rows} rows" if table.numbers is None else "in pieces"
    read = f"read {origin.path if origin else table.label}: {rows}"
    read += f" behind the first {how['drop_rows']}" if how["drop_rows"] else ""
    left_open = tuple(preset.open_facts(known)) if preset else ()
    notes = (": ".join([read, "; ".join(table.notes)]), *by_preset, *found.notes, *timing)
    notes += (*overruled, *left_open)
    return _Read(Log(channels, known, notes, origin), table, found.late)


def _chosen_columns(
    columns: Mapping[str, ColumnSpec] | None,
    preset: Preset | None,
    joint: str | int | None,
    table: Table,
) -> tuple[Mapping[str, ColumnSpec] | None, tuple[str, ...]]:
    """Return the map of a table, and what is said of it where it comes from a preset."""
    if preset is None:
        return _of_joint(columns, joint, table.label), ()
    return preset.joined(columns, None if joint is None else str(joint), table)


def _of_joint(
    columns: Mapping[str, ColumnSpec] | None, joint: str | int | None, label: str
) -> Mapping[str, ColumnSpec] | None:
    """Return the map of the joint that is asked for, or the map of a file of one joint."""
    if joint is not None:
        return columns_of_joint(columns, str(joint), label)
    if has_places(columns):
        raise InputError(
            f"{label}: the column map has a place {{joint}}, and no joint is given; give --joint "
            "NAME, or joint= of read_log"
        )
    return columns


def _timed(
    table: Table, found: Picked, rate: float | None
) -> tuple[dict[str, NDArray[np.float64]], tuple[str, ...]]:
    """Return the channels with `time`, made from the rate where the file has none."""
    if rate is None:
        if "time" not in found.channels:
            raise InputError(
                f"{table.label}: no time stamps; map a column to 'time' or give the rate in Hz"
            )
        return found.channels, ()
    if "time" in found.channels:
        raise InputError(f"{table.label}: has time stamps and a rate is given; leave one out")
    if not (isinstance(rate, (int, float)) and rate > 0 and math.isfinite(rate)):
        raise InputError(f"{table.label}: rate is {rate!r}; give a positive number of Hz")
    rows = len(next(iter(found.channels.values())))
    numbers = np.arange(rows) if table.numbers is None else table.numbers
    return {"time": numbers / rate, **found.channels}, (f"time is made of {rate:g} Hz",)


LogLike: TypeAlias = "Log | str | os.PathLike[str] | Mapping[str, Any] | pandas.DataFrame"
"""A log, or what `read_log` reads as one by itself: a file's name, arrays by channel, a table."""


def as_log(source: LogLike) -> Log:
    """Return a log as it is, and read anything else as `read_log` does.

    Raises
    ------
    InputError
        Where it is nothing that can be read, or a file or table that cannot.
    """
    return source if isinstance(source, Log) else read_log(source)


def is_one(source: object) -> bool:
    """Whether that is one log, or what could be read as one, and not several."""
    return isinstance(source, (Log, str, os.PathLike, Mapping, np.ndarray)) or is_frame(source)


def as_logs(sources: LogLike | Iterable[LogLike]) -> list[Log]:
    """Return one log, or several, as a list; see `as_log`."""
    if is_one(sources):
        return [as_log(cast("LogLike", sources))]
    if not isinstance(sources, Iterable):
        raise no_source(sources)
    return [as_log(source) for source in cast("Iterable[LogLike]", sources)]


def _facts(
    table: Table, path: str | None, given: Mapping[str, Any]
) -> tuple[dict[str, Fact], tuple[str, ...]]:
    """Return the file's facts and over them those given, and a sentence for each overruled."""
    run = {"name": run_name(Path(path))} if path else {}
    known = checked_facts({**run, **table.facts, **given}, table.label)
    notes = tuple(
        f"{key} {table.facts[key]} of the file is overruled by {known[key]}"
        for key in given
        if key in table.facts and table.facts[key] != known[key]
    )
    return known, notes


def run_name(path: Path) -> str:
    """Return "run" for run.csv and run.csv.gz."""
    return (path.with_suffix("") if path.suffix.lower() in PACKED else path).stem


def with_motor_torque(log: Log) -> Log:
    """Return the log with motor_torque from its current, where it has a torque constant."""
    constant = log.facts.get("torque_constant")
    if constant is None or "motor_current" not in log or "motor_torque" in log:
        return log
    return log.with_columns(
        {"motor_torque": float(constant) * log["motor_current"]},
        note=f"motor_torque is motor_current times {constant} Nm/A",
    )


if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib


def convert(
    foreign: str | os.PathLike[str],
    columns: str | os.PathLike[str] | None,
    out: str | os.PathLike[str],
    **overruling: Any,
) -> Log:
    """Read `foreign` by the map in the TOML file `columns`, write the run to `out`, return it.

    A map has four sections, each of which may be left out::

        [read]                     # how the file is written, and repairs: arguments of read_log,
        rate = 1000                # and of read_runs for a file of several runs
        separator = "whitespace"
        repair = ["unwrap"]

        [facts]
        gear_ratio = 100
        joint = "7"

        [columns]                  # channel = name, number from 0, or all of a ColumnSource
        output_position = 1
        motor_current = {source = 5, unit = "A", sign = -1}

        [joints.7]                 # facts of one joint of a robot, whose columns have a {joint}
        gear_ratio = 50

    Parameters
    ----------
    foreign, columns, out : path
        The file to read, the map (None where a preset is all of it), the file to write (whole or
        not at all): CSV, or another format as of `write_log`.
    **overruling
        Arguments of `read_log` that overrule the map, such as `gear_ratio`; `preset`.

    Raises
    ------
    InputError
        Where map or file are wrong, or the file is to be cut into runs; `out` is then untouched.
    """
    mapped = {} if columns is None else map_arguments(columns, overruling.get("joint"))
    both = repairs_of_both(mapped.get("repair", ()), overruling.get("repair", ()))
    arguments = {**mapped, **overruling, "repair": both}
    refuse_split(arguments, f"{foreign}: convert writes one run")
    log = read_log(foreign, **arguments)
    write_log(log, out)
    return log


@dataclass(frozen=True)
class Converted:
    """What `convert_in_pieces` wrote: rows, channels, and the history of the first piece."""

    rows: int
    channels: tuple[str, ...]
    history: tuple[str, ...]


def convert_in_pieces(
    foreign: str | os.PathLike[str],
    columns: str | os.PathLike[str] | None,
    out: str | os.PathLike[str],
    *,
    rows: int = PIECE,
    **overruling: Any,
) -> Converted:
    """Write the same file as `convert` of a run that is larger than memory.

    Parameters
    ----------
    foreign, columns, out, **overruling : as for `convert`, but for repairs.
    rows : of a piece, as for `read_pieces`.

    Raises
    ------
    InputError
        As `convert` and `read_pieces`; `out` is then untouched.
    """
    done, first = 0, None

    def counted() -> Iterator[Log]:
        nonlocal done, first
        for piece in read_pieces(foreign, columns, rows=rows, **overruling):
            first = piece if first is None else first
            done += len(piece)
            yield piece

    write_pieces(counted(), out)
    assert first is not None
    return Converted(done, tuple(first.channels), tuple(first.history[:-1]))


def splits(arguments: Mapping[str, Any]) -> list[str]:
    """Return which of these arguments of `read_runs` cut a file into runs."""
    return [key for key in SPLIT if key in arguments]


def refuse_split(arguments: Mapping[str, Any], why: str) -> None:
    """Refuse arguments of `read_runs` that cut a file into runs.

    Raises
    ------
    InputError
        Where they do.
    """
    if given := splits(arguments):
        raise InputError(f"{why}; leave {listed(given)} out, of the column map too")


def map_arguments(path: str | os.PathLike[str], joint: str | int | None = None) -> dict[str, Any]:
    """Return the arguments of `read_runs` that a map file stands for; of a joint, if one is given.

    Raises
    ------
    InputError
        As `read_map`, and where the section of the joint is no section.
    """
    sections = read_map(path)
    own = sections["joints"].get(str(joint), {})
    if not isinstance(own, dict):
        raise InputError(
            f"{path}: joint {joint} is no section; write [joints.{joint}] on a line of its own"
        )
    read = {key: value for key, value in sections["read"].items() if (key, value) not in UNCUT}
    return {**read, "columns": sections["columns"], "facts": {**sections["facts"], **own}}


def read_map(path: str | os.PathLike[str]) -> dict[str, dict[str, Any]]:
    """Return the sections of a map file, `read`, `facts`, `columns`, `joints`; empty if left out.

    Raises
    ------
    InputError
        For a missing file, bad TOML, an unknown section or key.
    """
    refuse_special(path, "the path of a TOML file")
    try:
        content = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(
            f"{path}: the column map cannot be read ({error.strerror}); "
            "give the path of a TOML file"
        ) from error
    except ValueError as error:  # bad TOML or bad UTF-8
        raise InputError(f"{path}: the column map is not TOML ({error}); correct it") from error
    _require_known(path, "section", content, SECTIONS)
    sections = {name: content.get(name, {}) for name in SECTIONS}
    for name, section in sections.items():
        if not isinstance(section, dict):
            raise InputError(f"{path}: '{name}' is no section; write [{name}] on a line of its own")
    _require_known(path, "key of [read]", sections["read"], READ_KEYS)
    return sections


def _require_known(
    path: str | os.PathLike[str], what: str, given: Mapping[str, Any], known: tuple[str, ...]
) -> None:
    for key in given:
        if key not in known:
            raise InputError(
                f"{path}: '{key}' is no {what}{did_you_mean(key, known)}; give {listed(known)}"
            )
