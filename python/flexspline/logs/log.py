"""A log: channels and facts of one run of one joint, in SI units, and how they came to be.

A fact does not change during a run, such as the gear ratio or the run's name.

It holds numbers that an instrument reads, on a clock that a recorder has. Beyond these limits
squares and products leave the range of a double, sorting by time asks for memory without end, and
no physics is left. An instrument that has nothing to say often writes a number all the same:
9.91e37 for an overload (SCPI).
"""

from __future__ import annotations

import html
import math
import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from numbers import Real
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexspline.errors import InputError, did_you_mean, listed, printable, shortened
from flexspline.formatting import rows_html, rows_text, sentences_text
from flexspline.lazy import render
from flexspline.logs.channels import CHANNELS

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

__all__ = [
    "COLDEST",
    "HOTTEST",
    "IMAGINABLE",
    "LATEST",
    "LEAST",
    "MOST",
    "SHORTEST",
    "Beyond",
    "Fact",
    "Log",
    "Source",
    "beyond",
    "checked_facts",
    "emptied",
    "given_number",
    "is_read",
    "limits_of",
    "measurable",
    "parsed_fact",
    "require_clock",
    "unmasked",
    "unmasking_notes",
    "who_reads",
]


_CHUNK = 1 << 20  # rows looked at in one go, so that a memory-mapped log stays on disk

Fact = str | float | int

TEXTS: Final = ("name", "joint")
POSITIVE: Final = {"gear_ratio": 2.0**30, "torque_constant": 1e9}
"""Facts above zero, and what none of them exceeds: the ratio that the core's angles can hold; Nm/A,
for which no motor is known."""
COUNTS: Final = {"pole_pairs": 1e6, "slots": 1e6}
"""Whole numbers above zero, and what no motor exceeds."""
SPLINES: Final = ("circular", "flex")

IMAGINABLE: Final = 1e9
"""No channel of a log but time is beyond this, in SI units: a motor at 60 000 rpm needs two days
for 1e9 rad, and what twists, pulls or heats a joint is further from it still. Half and double of it
change nothing that an instrument has written."""

COLDEST: Final = -273.0
"""°C: nothing is colder than absolute zero, which an empty reading in kelvin becomes, −273.15."""

HOTTEST: Final = 660.0
"""°C: no joint is hotter, whose housing is of aluminium: it melts. What a converter writes in place
of a temperature is above it: 850 of a platinum thermometer without a lead, 999, 3276.7, 65535."""

TEMPERATURES: Final = ("temperature", "motor_temperature")

LATEST: Final = 1e11
"""s: time stamps are within this: 3000 years, so that they may count from the year 0. A double
tells steps of 15 µs there."""

SHORTEST: Final = 1e-9
"""s: no recorder of a joint steps faster; who writes seconds as milliseconds is far above it."""

LEAST: Final = 1e-20
"""No target is as small as this throughout, in SI units: its square, and the square of that, are
numbers of full precision. The finest torsion balances resolve 1e-18 Nm."""


MOST: Final = 1e15
"""No parameter or setting that somebody gives is beyond this, in SI units, nor a standard error
below its inverse: beside it a double has no digit left for a torque of 1 Nm."""


@dataclass(frozen=True)
class Source:
    """The file that a log was read from: path, SHA-256 of its bytes, rows of data in it."""

    path: str
    sha256: str
    rows: int


@dataclass(frozen=True, eq=False, repr=False)
class Log:
    """One run of one joint.

    Parameters
    ----------
    columns : mapping of str to array, shape (rows,)
        Names and SI units of `CHANNELS`; "time" [s] is always there. Arrays that can be
        written to are copied (memory maps are not); what the log holds is read-only. Masked
        samples are NaN.
    facts : mapping of str to str, float or int
        What does not change: `name`, `joint`, `gear_ratio`, `output_spline`, `pole_pairs`,
        `slots`, `torque_constant` [Nm/A], and anything else.
    history : sequence of str
        Sentences: what was read, converted, repaired.
    source : Source, optional
        The file that the log comes from.

    Raises
    ------
    InputError
        For an unknown channel, columns of unequal length, values that are no numbers,
        a missing `time`, no rows at all, or a fact with an impossible value.
    """

    columns: Mapping[str, NDArray[np.float64]]
    facts: Mapping[str, Fact] = field(default_factory=dict)
    history: Sequence[str] = ()
    source: Source | None = None

    def __post_init__(self) -> None:
        label = f"log '{self.facts.get('name', 'log')}'"
        said = unmasking_notes(self.columns.items())
        columns = {
            name: _readonly(name, unmasked(data), label) for name, data in self.columns.items()
        }
        _require_one_table(columns, label)
        ordered = {name: columns[name] for name in CHANNELS if name in columns}
        object.__setattr__(self, "columns", MappingProxyType(ordered))
        facts = checked_facts(self.facts, label)
        object.__setattr__(self, "facts", MappingProxyType(facts))
        object.__setattr__(self, "history", (*self.history, *said))

    @classmethod
    def from_arrays(cls, *, facts: Mapping[str, Fact] | None = None, **columns: ArrayLike) -> Log:
        """Return a log of arrays in SI units, as in ``from_arrays(time=t, output_position=q)``."""
        arrays: dict[str, Any] = dict(columns)
        return cls(arrays, facts or {}, ("made of arrays",))

    def __reduce__(self) -> tuple[Any, ...]:
        return (Log, (dict(self.columns), dict(self.facts), self.history, self.source))

    def __len__(self) -> int:
        return len(self.columns["time"])

    def __contains__(self, channel: object) -> bool:
        return channel in self.columns

    def __getitem__(self, channel: str) -> NDArray[np.float64]:
        """Return one channel, shape (rows,), read-only, in the unit of `CHANNELS`."""
        if channel in self.columns:
            return self.columns[channel]
        near = "" if channel in CHANNELS else did_you_mean(channel, CHANNELS)
        raise InputError(
            f"log '{self.name}': no channel '{channel}'{near}; it has {listed(self.channels)}"
        )

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the channels, in the order of `CHANNELS`."""
        return tuple(self.columns)

    @property
    def name(self) -> str:
        """Name of the run, "log" where none is known."""
        return str(self.facts.get("name", "log"))

    @property
    def duration(self) -> float:
        """Time from the first row to the last [s]."""
        time = self.columns["time"]
        return float(time[-1] - time[0])

    @cached_property
    def rate(self) -> float:
        """Sampling rate [Hz]: one over the median step of time, NaN for a single row.

        Of a long log 100 stretches of 1000 rows, evenly spread, are looked at.
        """
        time = self.columns["time"]
        if len(time) < 2:
            return float("nan")
        starts = [0] if len(time) <= 100_000 else np.linspace(0, len(time) - 1000, 100, dtype=int)
        length = len(time) if len(time) <= 100_000 else 1000
        step = float(np.median(np.concatenate([np.diff(time[i : i + length]) for i in starts])))
        return 1.0 / step if step else float("inf")

    @property
    def effective_ratio(self) -> float | None:
        """Ñ, turns of the motor side per turn of the output; None without `gear_ratio`.

        N + 1 where the circular spline is the output, else N.
        """
        if "gear_ratio" not in self.facts:
            return None
        return float(self.facts["gear_ratio"]) + (self.facts.get("output_spline") == "circular")

    def with_columns(self, columns: Mapping[str, ArrayLike], *, note: str) -> Log:
        """Return a log with these channels added or replaced; `note` goes into the history."""
        merged: dict[str, Any] = {**self.columns, **columns}
        return Log(merged, self.facts, (*self.history, note), self.source)

    def without(self, channels: Collection[str], notes: Sequence[str]) -> Log:
        """Return a log without these channels; `notes` go into the history."""
        if not channels:
            return self
        kept = {name: data for name, data in self.columns.items() if name not in channels}
        return Log(kept, self.facts, (*self.history, *notes), self.source)

    def with_facts(self, facts: Mapping[str, Fact], *, note: str | None = None) -> Log:
        """Return a log with these facts added or replaced."""
        said = note or "facts given: " + listed(f"{key} = {facts[key]}" for key in facts)
        return Log(self.columns, {**self.facts, **facts}, (*self.history, said), self.source)

    def rows(self, which: slice | NDArray[Any], *, note: str | None = None) -> Log:
        """Return a log of some rows: a slice, a mask or row numbers.

        A slice shares memory with this log, and keeps a memory-mapped one on disk. The history
        says `note`, by default how many rows were kept; nothing for the empty text.
        """
        columns = {name: data[which] for name, data in self.columns.items()}
        for data in columns.values():
            data.flags.writeable = False
        said = f"kept {len(columns['time'])} of {len(self)} rows" if note is None else note
        history = (*self.history, said) if said else self.history
        return Log(columns, self.facts, history, self.source)

    def plot(self, *, effects: Sequence[str] = (), target: str | None = None) -> Figure:
        """Return a figure of the channels over time, with what `check` finds in them.

        Parameters
        ----------
        effects, target : what is to be fitted, as for `check`.

        Raises
        ------
        InputError
            For an effect or target that does not exist.
        """
        return render("log", "figure", self, tuple(effects), target)

    def to_frame(self) -> pandas.DataFrame:
        """Return a copy as a pandas table with one column for each channel."""
        import pandas

        return pandas.DataFrame({name: np.array(data) for name, data in self.columns.items()})

    def __repr__(self) -> str:
        return f"<Log '{self.name}': {len(self)} rows, {listed(self.channels)}>"

    def __str__(self) -> str:
        rows = [("channel", "unit", "min", "max", "what"), *self._table()]
        facts = "; ".join(f"{key}: {value}" for key, value in self.facts.items() if key != "name")
        notes = sentences_text(self.history, 96)
        return "\n".join(
            [self._title(), *([facts] if facts else []), rows_text(rows, left=(0, 1, 4)), *notes]
        )

    def _repr_html_(self) -> str:
        table = rows_html([("channel", "unit", "min", "max", "what"), *self._table()])
        facts = "".join(
            f"<tr><td>{html.escape(key)}</td><td>{html.escape(str(value))}</td></tr>"
            for key, value in self.facts.items()
        )
        notes = "".join(f"<li>{html.escape(sentence)}</li>" for sentence in self.history)
        return (
            f"<div><b>{html.escape(self._title())}</b><table>{table}</table>"
            f"<table>{facts}</table><ul>{notes}</ul></div>"
        )

    def _title(self) -> str:
        return f"{self.name}: {len(self)} rows, {self.duration:.6g} s at {self.rate:.6g} Hz"

    def _table(self) -> list[tuple[str, str, str, str, str]]:
        return [(name, *_described(name, data)) for name, data in self.columns.items()]


def _readonly(name: str, data: ArrayLike, label: str) -> NDArray[np.float64]:
    if name not in CHANNELS:
        raise InputError(
            f"{label}: '{name}' is no channel of a log{did_you_mean(name, CHANNELS)}; "
            f"the channels are {listed(CHANNELS)}"
        )
    if np.iscomplexobj(data):  # astype would leave out the imaginary part
        raise InputError(
            f"{label}: channel '{name}' holds complex numbers; give real ones, as measured"
        )
    try:
        array = np.asarray(data)
        values = array.astype(np.float64, copy=False)
    except (TypeError, ValueError) as error:
        raise InputError(
            f"{label}: channel '{name}' holds something that is no number; "
            "convert it to numbers first"
        ) from error
    if values.ndim != 1:
        raise InputError(f"{label}: channel '{name}' has shape {values.shape}; give one dimension")
    borrowed = values is array and values.flags.writeable and not isinstance(data, np.memmap)
    values = values.copy() if borrowed else np.asarray(values).view()
    values.flags.writeable = False
    return values


def unmasked(data: Any) -> Any:
    """Return a masked array of NumPy with NaN for what is masked, and all else as it is."""
    if not isinstance(data, np.ma.MaskedArray):
        return data
    values: NDArray[Any] = np.ma.getdata(data)
    if not np.ma.is_masked(data):
        return values
    kind = values.dtype.kind
    wide = np.float64 if kind in "biuf" else values.dtype if kind in "cmM" else object
    values = np.array(values, dtype=wide)
    values[np.ma.getmaskarray(data)] = "NaT" if kind in "mM" else np.nan
    return values


def unmasking_notes(columns: Iterable[tuple[str, Any]]) -> tuple[str, ...]:
    """Return a sentence on how many samples `unmasked` empties in these columns, if any."""
    counts = [
        f"{np.count_nonzero(np.ma.getmaskarray(data))} of {name}"
        for name, data in columns
        if np.ma.is_masked(data)
    ]
    return (f"masked samples are empty: {listed(counts)}",) if counts else ()


def _require_one_table(columns: Mapping[str, NDArray[np.float64]], label: str) -> None:
    if "time" not in columns:
        raise InputError(f"{label}: no channel 'time' [s]; give time stamps or a rate")
    rows = len(columns["time"])
    if rows == 0:
        raise InputError(f"{label}: no rows; a log needs at least one")
    for name, data in columns.items():
        if len(data) != rows:
            raise InputError(
                f"{label}: channel '{name}' has {len(data)} rows where 'time' has "
                f"{rows}; give columns of equal length"
            )


def _described(name: str, data: NDArray[np.float64]) -> tuple[str, str, str, str]:
    """Return unit, smallest and largest value and meaning as text, reading in chunks."""
    parts = [data[i : i + _CHUNK] for i in range(0, len(data), _CHUNK)]
    low = np.fmin.reduce([np.fmin.reduce(part) for part in parts])
    high = np.fmax.reduce([np.fmax.reduce(part) for part in parts])
    bad = sum(len(part) - int(np.count_nonzero(np.isfinite(part))) for part in parts)
    unit, meaning = CHANNELS[name]
    return unit, f"{low:.6g}", f"{high:.6g}", f"{meaning}; {bad} not finite" if bad else meaning


def checked_facts(facts: Mapping[str, Any], label: str) -> dict[str, Fact]:
    """Return `facts` with the known ones in their own type.

    Parameters
    ----------
    facts : mapping of str to str, float or int
        `gear_ratio` [–] and `torque_constant` [Nm/A] are positive numbers, `pole_pairs` and
        `slots` positive whole numbers, `output_spline` is "circular" or "flex", `name`
        and `joint` are text. Everything else is free; all text is kept to one line that a terminal
        can show. None means "not known" and is left out.
    label : str
        What an error calls the log, such as its file name.

    Raises
    ------
    InputError
        Where a known fact has a value that it cannot have.
    """
    return {
        printable(str(key)): _checked(str(key), value, label)
        for key, value in facts.items()
        if value is not None
    }


def parsed_fact(text: str) -> Fact:
    """Return a number where `text` is how Python writes that number, else the text.

    A serial number such as "00123" therefore stays text.
    """
    try:
        number: float | int = int(text) if re.fullmatch(r"[+-]?\d+", text) else float(text)
        return number if repr(number) == text and math.isfinite(number) else text
    except (ValueError, OverflowError):  # whole numbers beyond a double stay text
        return text


def _checked(key: str, value: Any, label: str) -> Fact:
    if key in TEXTS:
        return printable(str(value))
    if key in POSITIVE:
        return _positive(key, value, label, POSITIVE[key])
    if key in COUNTS:
        number = _positive(key, value, label, COUNTS[key])
        if number != int(number):
            raise InputError(f"{label}: {key} is {value!r}; give a positive whole number")
        return int(number)
    if key == "output_spline" and value not in SPLINES:
        raise InputError(f"{label}: output_spline is {value!r}; give 'circular' or 'flex'")
    if hasattr(value, "item"):
        value = value.item()
    return value if isinstance(value, (int, float)) else printable(str(value))


def _positive(key: str, value: Any, label: str, most: float) -> float:
    truth = isinstance(value, bool | np.bool_)  # which float would take for 1 or 0
    try:
        number = math.nan if truth else float(value)
    except (TypeError, ValueError):
        number = math.nan
    except OverflowError:
        number = math.inf
    if not (number > 0 and math.isfinite(number)):
        raise InputError(f"{label}: {key} is {shortened(repr(value))}; give a positive number")
    if not 1.0 / most <= number <= most:
        unit = " Nm/A" if key == "torque_constant" else ""
        raise InputError(
            f"{label}: {key} is {number:g}{unit}, which no joint has; give one from "
            f"{1.0 / most:.3g} to {most:.3g}{unit}"
        )
    return number


class Beyond(NamedTuple):
    """A channel with numbers that no instrument reads, and their rows."""

    channel: str
    rows: NDArray[np.intp]
    sentence: str


def limits_of(channel: str) -> tuple[float, float]:
    """Return the least and the largest number that a channel can hold, in its SI unit."""
    if channel in TEMPERATURES:
        return COLDEST, HOTTEST
    most = LATEST if channel == "time" else IMAGINABLE
    return -most, most


def who_reads(channel: str) -> str:
    """Return who never says what is beyond the limits of a channel: "instrument reads"."""
    if channel in TEMPERATURES:
        return "joint has"
    return "recorder stamps" if channel == "time" else "instrument reads"


def beyond(log: Log) -> Iterator[Beyond]:
    """Give each channel with finite numbers beyond the limits."""
    for name, values in log.columns.items():
        low, high = limits_of(name)
        if low <= np.fmin.reduce(values) and np.fmax.reduce(values) <= high:
            continue
        rows = np.flatnonzero(np.isfinite(values) & ((values < low) | (values > high)))
        if len(rows):
            unit = CHANNELS[name].unit
            what = who_reads(name)
            count = "in one row" if len(rows) == 1 else f"in {len(rows)} rows"
            yield Beyond(
                name,
                rows,
                f"{name} is beyond what any {what} {count}: {values[rows[0]]:.4g} {unit} in row "
                f"{rows[0]}",
            )


def is_read(channel: str, values: NDArray[np.float64]) -> bool:
    """Whether all values of a channel are such as an instrument reads; not so with NaN."""
    low, high = limits_of(channel)
    return bool(np.all((values >= low) & (values <= high)))


def given_number(value: object, what: str) -> float:
    """Return a number that somebody gives, or refuse what is none or beyond `MOST`.

    Raises
    ------
    InputError
        That begins with `what`.
    """
    number = value if isinstance(value, int) else float(value) if isinstance(value, Real) else None
    if number is None or not -math.inf < number < math.inf:
        raise InputError(f"{what} is {shortened(repr(value))}; give a finite number")
    if not -MOST <= number <= MOST:
        raise InputError(
            f"{what} is {shortened(value, 40)}, beyond {MOST:g}, which no joint has; correct it"
        )
    return float(number)


def emptied(log: Log) -> Log:
    """Return the log with NaN for what no instrument reads, and for a time that is infinite."""
    made = {}
    for one in beyond(log):
        made[one.channel] = np.array(log[one.channel])
        made[one.channel][one.rows] = np.nan
    if np.isinf(log["time"]).any():
        made["time"] = np.where(np.isinf(log["time"]), np.nan, made.get("time", log["time"]))
    return log.with_columns(made, note="overloads are empty") if made else log


def measurable(log: Log) -> tuple[Log, tuple[str, ...]]:
    """Return the log with NaN for what no instrument reads, and a sentence for each such channel.

    Raises
    ------
    InputError
        Where the log has no clock, see `require_clock`.
    """
    require_clock(log)
    said = tuple(
        f"{log.name}: {one.sentence}; it counts as empty: look for an overload, or for another "
        "unit of the column"
        for one in beyond(log)
    )
    return (emptied(log) if said else log), said


def require_clock(log: Log) -> None:
    """Refuse time stamps that are no numbers, or that no recorder makes; not their order.

    Raises
    ------
    InputError
        Where time is not finite or beyond `LATEST`, or its steps are below `SHORTEST`.
    """
    time = log["time"]
    lost = np.flatnonzero(~np.isfinite(time) | (np.abs(time) > LATEST))
    if len(lost):
        raise InputError(
            f"log '{log.name}': time is {time[lost[0]]:.4g} s in row {lost[0]} (rows of this kind: "
            f"{len(lost)}); ask for the repair drop_invalid, or correct the unit of the column"
        )
    if 0.0 < 1.0 / log.rate < SHORTEST:
        raise InputError(
            f"log '{log.name}': time goes by steps of {1.0 / log.rate:.3g} s, which no recorder "
            "has; correct the unit of its column"
        )
