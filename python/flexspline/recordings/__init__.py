"""Recordings of foreign recorders: what their columns are, guessed with reasons.

`guess_map` goes from a recording to the column map under which it can be read.

Names say what they can, the file's own units come next, and physics decides or confirms: a velocity
is a position's derivative, the motor turns N times as far as the output, an angle wraps at its
turn, a drive does work against friction. What none of them tells is said to be unsure.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from flexspline.errors import InputError, listed, printable
from flexspline.files import atomic_write
from flexspline.formatting import rows_text, sentences_text, table_html
from flexspline.logs.columns import ColumnSource, to_si
from flexspline.logs.formats import Dialect, read_table, unpacked_text
from flexspline.logs.one_clock import on_one_clock, spanning
from flexspline.logs.table import Table
from flexspline.recordings.columns import (
    SECONDS,
    Array,
    Clock,
    Column,
    Joints,
    Told,
    clock_of,
    columns_of,
    joined,
    one_joint,
    ratio_of,
    ratio_to_integral,
)
from flexspline.recordings.motion import (
    GEARED,
    WHOLE,
    Chosen,
    both_ways,
    friction_share,
    goes_with,
    motion_columns,
    units_of_side,
    usual_units,
    with_resolutions,
)
from flexspline.recordings.text import TextLayout, text_layout
from flexspline.recordings.words import Said, placed, said_in, trusted

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from flexspline.logs.log import Log

__all__ = [
    "Guess",
    "Guessed",
    "guess_map",
]

HEAD = ("channel", "column", "unit", "sign", "why")

SIDES: Final = ("output", "motor")
WORK: Final = 0.02
"""Work against friction as a share of what a drive moves, from which its sign is told: the least of
the thirty recorders' joints has 0.1."""
SUPPLY: Final = 3.0  # V, from which an unnamed voltage of one sign is a supply's
SOLD: Final = (30, 50, 80, 100, 120, 160)  # ratios of strain wave gears in catalogues
LARGEST: Final = 320.0
"""The largest ratio of a strain wave gear in catalogues. What takes degrees for radians is 57 times
too large: of half or twice this, a ratio of 18 or more still is beyond it."""
FULL_DUTY: Final = 1.05  # a duty cycle is within ±1, but for rounding

USUAL_UNIT: Final = {
    "torque": "Nm",
    "current": "A",
    "voltage": "V",
    "temperature": "degC",
    "acceleration": "rad/s^2",
}


@dataclass(frozen=True)
class Guessed:
    """One channel of a guessed map.

    Parameters
    ----------
    number : of the column, from 0.
    name : of the column, "" where it has none.
    unit, sign, scale : as in `flexspline.ColumnSource`.
    reason : why, in words.
    unsure : what speaks for looking again, in words; "" where nothing does.
    """

    number: int
    name: str
    unit: str | None
    sign: int = 1
    scale: float = 1.0
    reason: str = ""
    unsure: str = ""


@dataclass(frozen=True, repr=False)
class Guess:
    """A column map as `guess_map` guesses it.

    Parameters
    ----------
    recording : path of the file.
    read, facts : sections of the map.
    channels : what each channel is made of.
    ignored : number of a column → its name, and why it is no channel.
    reasons : sentences on how the file is read.
    fact_reasons : a sentence for each fact.
    unsure : sentences on what is not of one channel alone.
    numbered : whether columns go by number: a reader does not see their names.
    max_memory : what the recording may unfold to when it is read again [GB].
    joint : that the map of all joints is guessed from, None for a map of one.
    places : sources with ``{joint}`` in a map of all joints, by channel.
    """

    recording: str
    read: Mapping[str, Any]
    facts: Mapping[str, Any]
    channels: Mapping[str, Guessed]
    ignored: Mapping[int, tuple[str, str]] = field(default_factory=dict)
    reasons: tuple[str, ...] = ()
    fact_reasons: Mapping[str, str] = field(default_factory=dict)
    unsure: tuple[str, ...] = ()
    numbered: bool = False
    max_memory: float | None = None
    joint: str | None = None
    places: Mapping[str, str] = field(default_factory=dict)

    @property
    def columns(self) -> dict[str, ColumnSource]:
        """The map for ``read_log(recording, columns=…)``."""
        names = ["", "", *(each.name for each in self.channels.values()),
                 *(name for name, _ in self.ignored.values())]  # fmt: skip
        return {
            channel: ColumnSource(
                self.places[channel] if channel in self.places
                else each.name if names.count(each.name) == 1 and not self.numbered
                else each.number,
                each.unit, each.sign, each.scale,
            )
            for channel, each in self.channels.items()
        }  # fmt: skip

    @property
    def doubts(self) -> dict[str, str]:
        """What is unsure, by channel."""
        return {name: each.unsure for name, each in self.channels.items() if each.unsure}

    def log(self) -> Log:
        """Read the recording with this map; of a map of all joints, the one it is guessed from.

        Raises
        ------
        InputError
            Where it has neither time stamps nor a rate, or cells that are no numbers.
        """
        from flexspline.logs.read import read_log

        return read_log(
            self.recording,
            self.columns,
            facts=self.facts,
            max_memory=self.max_memory,
            joint=self.joint,
            **self.read,
        )

    def to_json(self) -> dict[str, Any]:
        """Return the map with its reasons and doubts, as `flexspline init --json` prints it."""
        return {
            "read": dict(self.read),
            "facts": dict(self.facts),
            "channels": {name: asdict(each) for name, each in self.channels.items()},
            "unsure": [*(f"{name}: {said}" for name, said in self.doubts.items()), *self.unsure],
        }

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the map as TOML, each entry with its reason as a comment; whole or not at all."""
        atomic_write(path, self.toml())

    def toml(self) -> str:
        """Return the map as TOML."""
        lines = [_comment(f"column map of {self.recording}, guessed; look at what is unsure"), ""]
        lines += [_comment(said) for said in self.reasons]
        lines += ["[read]", *(f"{key} = {_toml(value)}" for key, value in self.read.items()), ""]
        lines += ["[facts]"]
        for name, value in self.facts.items():
            lines += [_comment(self.fact_reasons[name]), f"{name} = {_toml(value)}"]
        lines += ["", "[columns]"]
        for channel, source in self.columns.items():
            each = self.channels[channel]
            lines += [_comment(f"UNSURE: {each.unsure}")] if each.unsure else []
            lines += [_comment(each.reason)] if each.reason else []
            lines += [f"{channel} = {_source(source)}"]
        lines += ["", *(_comment(f"unsure: {said}") for said in self.unsure)]
        lines += [
            _comment(f"no channel: column {number}{f' {name!r}' if name else ''}: {why}")
            for number, (name, why) in self.ignored.items()
        ]
        content = "\n".join(lines).rstrip("\n") + "\n"
        return content.encode(errors="replace").decode()  # halves of letters are none

    def plot(self) -> Figure:
        """Return a figure of the channels over time, as the map makes them."""
        return self.log().plot()

    def __str__(self) -> str:
        said = sentences_text(self._said(), 100)
        return "\n".join([rows_text(self._table(), left=(0, 1, 2, 4)), *said])

    def __repr__(self) -> str:
        return f"Guess({self.recording!r}, {listed(self.channels)}; unsure: {listed(self.doubts)})"

    def _repr_html_(self) -> str:
        return table_html(f"column map of {self.recording}", self._table(), self._said())

    def _table(self) -> list[tuple[str, ...]]:
        rows = [
            (
                channel + (" ?" if each.unsure else ""),
                printable(self.places.get(channel, each.name)) or f"column {each.number}",
                _unit(each),
                "" if each.sign == 1 else "−1",
                each.reason,
            )
            for channel, each in self.channels.items()
        ]
        return [HEAD, *rows]

    def _said(self) -> list[str]:
        facts = [f"{name} {value}: {self.fact_reasons[name]}" for name, value in self.facts.items()]
        doubts = [*(f"{name}: {said}" for name, said in self.doubts.items()), *self.unsure]
        none = [printable(name) or f"column {number}" for number, (name, _) in self.ignored.items()]
        said = [*self.reasons, *facts, *(f"Unsure (?): {doubt}" for doubt in doubts)]
        return [*said, f"No channel: {listed(none)}"] if none else said


def _unit(each: Guessed) -> str:
    if each.scale == 1.0 or not each.unit:
        return each.unit or ""
    parts = 1.0 / each.scale
    return (
        f"{each.unit} / {parts:.0f}" if parts == round(parts) else f"{each.unit} × {each.scale:g}"
    )


def _source(source: ColumnSource) -> str:
    parts = [f"source = {_toml(source.source)}"]
    parts += [f"unit = {_toml(source.unit)}"] if source.unit else []
    parts += [f"sign = {source.sign}"] if source.sign != 1 else []
    parts += [f"scale = {source.scale!r}"] if source.scale != 1.0 else []
    return "{" + ", ".join(parts) + "}"


def _toml(value: object) -> str:
    """Return a value as TOML, whose strings, numbers and lists are JSON's but for one sign."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def _comment(said: str) -> str:
    return f"# {printable(said)}"


def guess_map(
    recording: str | os.PathLike[str],
    *,
    joint: str | None = None,
    rate: float | None = None,
    encoding: str | None = None,
    skip_lines: int = 0,
    units_row: bool | None = None,
    max_memory: float | None = None,
) -> Guess:
    """Guess the column map of a recording, with a reason for each entry.

    Parameters
    ----------
    recording : path
        Delimited text in any encoding, with or without a preamble, names and a row of units;
        or any other format of `read_log`; packed or not.
    joint : str, optional
        Which of several joints, as the columns call it; by default the one that moves. "all": a map
        of all, with ``{joint}`` in its sources, which is guessed from that one.
    rate : float, optional
        Rows per second [Hz], where the recording has no time stamps.
    encoding, units_row : optional
        Of a text file, as `read_log` takes them, where they are known; else they are found.
    skip_lines : int
        Lines at the start of a text file that are not looked at.
    max_memory : float, optional
        What a file may unfold to [GB]; by default half of what is free.

    Returns
    -------
    Guess
        The map, what is sure in it and what is not; `Guess.log` reads the recording with it.

    Raises
    ------
    InputError
        Where the file cannot be read, no table is seen in it, or no column can be told.

    Examples
    --------
    >>> guess = flexspline.guess_map("recording.txt")        # doctest: +SKIP
    >>> guess.save("map.toml")                               # doctest: +SKIP
    >>> log = guess.log()                                    # doctest: +SKIP
    """
    path = Path(recording)
    text = unpacked_text(path, max_memory)
    Dialect(encoding=encoding or "utf-8", skip_lines=skip_lines)  # says what cannot be
    if text is None and (encoding or skip_lines or units_row is not None):
        raise InputError(f"{path}: is no text; leave encoding, skip_lines and units_row out")
    layout = TextLayout() if text is None else text_layout(
        text, str(path), encoding=encoding, skip_lines=skip_lines, units_row=units_row
    )  # fmt: skip
    dialect = {key: value for key, value in layout.read.items() if key != "drop_rows"}
    table, _ = read_table(
        path, None, Dialect(**dialect), layout.read.get("drop_rows", 0), max_memory
    )
    table = on_one_clock(table, spanning(table))
    table = replace(table, names=table.names or layout.names, units=table.units or layout.units)
    said = said_in([*layout.preamble, *(f"{name}: {v}" for name, v in table.facts.items())])
    joints = one_joint(columns_of(table), joint, path.stem, str(path))
    clock = clock_of(joints.columns, layout.preamble)
    if rate is not None:
        clock = _given(clock, rate)
    found = _Found(clock, joints, said)
    found.assign()
    if not found.channels:
        raise InputError(
            f"{path}: no column can be told by its name or its numbers; "
            "write the column map by hand"
        )
    return replace(found.guess(path, layout, table), max_memory=max_memory)


def _given(clock: Clock, rate: float) -> Clock:
    """Return the clock of a given rate, unsure where the recording has one of its own.

    Raises
    ------
    InputError
        For a rate that is not above zero.
    """
    if not (isinstance(rate, (int, float)) and math.isfinite(rate) and rate > 0):
        raise InputError(f"rate is {rate!r}; give rows per second, above zero")
    doubt = "" if clock.column is None else f"column '{clock.column.says.name}' seems to be a clock"
    return Clock(rate=float(rate), reason="as given", unsure=doubt)


@dataclass
class _Found:
    """What is found, step by step: channels by name, facts, and why columns are none."""

    clock: Clock
    joints: Joints
    said: Said
    channels: dict[str, Guessed] = field(default_factory=dict)
    facts: dict[str, Any] = field(default_factory=dict)
    fact_reasons: dict[str, str] = field(default_factory=dict)
    unsure: list[str] = field(default_factory=list)
    ignored: dict[int, str] = field(default_factory=dict)
    wrapped: list[str] = field(default_factory=list)
    columns: list[Column] = field(default_factory=list)

    def assign(self) -> None:
        """Find time, motion, the gear, then what drives and is measured."""
        self._time()
        self.columns = with_resolutions(self.joints.columns, self.said, self.time)
        motion = motion_columns(self.columns, self.taken, self.time, timed=self.timed)
        usual = usual_units(motion, self.time, self.timed)
        for side in SIDES:
            self._side(side, motion[side], usual[side])
        self._gear()
        self._torques()
        self._currents()
        self._switches()
        self._temperatures()
        self._voltages()
        self._commanded()
        self._signs()
        self._leave_out()

    @property
    def taken(self) -> set[int]:
        """Numbers of columns that are channels already."""
        return {guessed.number for guessed in self.channels.values()}

    @property
    def time(self) -> Array:
        """Seconds of each row, or their numbers where nothing tells the rate."""
        column = self.clock.column
        if column is not None and column.values is not None:
            seconds = 1.0 if column.stamps else SECONDS[self.clock.unit or "s"]
            return column.whole * seconds
        rows = max((len(c.whole) for c in self.joints.columns), default=0)
        return np.arange(rows) / (self.clock.rate or 1.0)

    @property
    def timed(self) -> bool:
        """Whether `time` is in seconds."""
        return math.isfinite(self.clock.step)

    def si(self, channel: str) -> Array:
        """Return a channel as the map makes it, without the jumps of a wrap."""
        guessed = self.channels[channel]
        column = next(c for c in self.columns if c.number == guessed.number)
        factor, zero = to_si(channel, guessed.unit) if guessed.unit else (1.0, 0.0)
        return column.whole * factor * guessed.sign * guessed.scale + zero

    def _time(self) -> None:
        if self.clock.column is not None:
            told = Told(self.clock.unit, reason=self.clock.reason, unsure=self.clock.unsure)
            self._add("time", self.clock.column, told)

    def _add(
        self, channel: str, column: Column, told: Told, reason: str = "", unsure: str = ""
    ) -> None:
        """Take a column for a channel, unless that is found or the column cannot be told."""
        if told.unit is None and told.unsure:
            self.ignored[column.number] = told.unsure
        elif channel in self.channels:
            taken = self.channels[channel]
            self.ignored[column.number] = f"{channel} is {taken.name or f'column {taken.number}'}"
        else:
            why, doubt = joined(reason, told.reason), joined(unsure, told.unsure)
            self.channels[channel] = Guessed(
                column.number, column.says.name, told.unit, told.sign, told.scale, why, doubt
            )

    def _side(self, side: str, found: Mapping[str, Chosen], usual: str) -> None:
        """Add position, velocity and acceleration of one side, each with its unit."""
        position, velocity = (
            found[name].column if name in found else None for name in ("position", "velocity")
        )
        told = units_of_side(position, velocity, self.time, self.timed, usual)
        if told.rate is not None:
            why = "under which the velocity is the position's derivative"
            self.clock = Clock(rate=told.rate, reason=why, unsure="the rate is not stated")
        units = {"position": told.position, "velocity": told.velocity}
        for quantity, chosen in found.items():
            unit = units[quantity] if quantity in units else _stated(chosen.column)
            self._add(f"{side}_{quantity}", chosen.column, unit, chosen.reason, chosen.unsure)
        if position is not None and position.turn is not None and told.position.unit is not None:
            self.wrapped.append(f"{side}_position")

    def _gear(self) -> None:
        """Tell the gear ratio and the motor's sign from how far both sides turn."""
        factor = self._turns()
        stated = self.said.gear_ratio
        if factor is None:
            if stated is not None:
                self._fact("gear_ratio", stated, "as the file says")
            return
        if factor < 0:
            self._reverse_motor()
        turns, whole = abs(factor), round(abs(factor))
        if stated is not None and min(abs(turns / n - 1) for n in (stated, stated + 1)) > WHOLE:
            said = f"the file says {stated:g}, the motor turns {turns:.5g} times"
            self.unsure.append(f"gear_ratio: {said}; is a unit wrong?")
        near = abs(turns - whole) < WHOLE * whole and whole >= GEARED
        if stated is not None and near and round(stated) == whole - 1:
            self._fact("gear_ratio", stated, "as the file says")
            why = f"the motor turns {whole} times for {stated:g}:1, one more"
            self._fact("output_spline", "circular", why)
        elif stated is not None and abs(turns / stated - 1) < WHOLE:
            self._fact("gear_ratio", stated, f"as the file says; the motor turns {turns:.5g} times")
        elif near:
            said = f"the motor turns {turns:.5g} times as far as the output"
            self._fact("gear_ratio", float(whole), said)
            self.unsure += _beyond_gears(turns)
            if whole - 1 in SOLD:
                self.unsure.append(
                    f"gear_ratio: {whole} turns are also those of a gear of {whole - 1}:1 whose "
                    f"circular spline is the output: then give gear_ratio = {whole - 1} and "
                    'output_spline = "circular"'
                )
        else:
            self._fact("gear_ratio", float(f"{turns:.5g}"), "how far the motor turns")
            doubt = f"gear_ratio: {turns:.5g} is no whole number; are both units right?"
            self.unsure += _beyond_gears(turns) or [doubt]

    def _turns(self) -> float | None:
        """Return how far the motor turns for the output, with its sign; by integrals if need be."""
        for pair in (("output_position", "motor_position"), ("output_velocity", "motor_velocity")):
            if all(name in self.channels for name in pair):
                told = ratio_of(self.si(pair[0]), self.si(pair[1]))
                if told.told:
                    return told.factor
        for motor, output in (("motor_velocity", "output_position"),):
            if motor in self.channels and output in self.channels:
                told = ratio_to_integral(self.time, self.si(motor), self.si(output))
                if told.told:
                    return 1.0 / told.factor
        return None

    def _reverse_motor(self) -> None:
        for name in ("motor_position", "motor_velocity"):
            if name in self.channels:
                old = self.channels[name]
                why = joined(old.reason, "the motor counts against the output in the file")
                self.channels[name] = replace(old, sign=-old.sign, reason=why)

    def _fact(self, name: str, value: Any, reason: str) -> None:
        self.facts[name], self.fact_reasons[name] = value, reason

    def _free(self, quantity: str) -> Iterator[Column]:
        """Columns of a quantity that are neither taken, nor a command, nor a state."""
        for column in self.columns:
            if column.number in self.taken or column.says.quantity != quantity:
                continue
            if column.values is not None and column.says.role not in ("other", "commanded"):
                yield column

    def _torques(self) -> None:
        for column in sorted(self._free("torque"), key=lambda c: _torque_channel(c) == ""):
            channel = _torque_channel(column)
            doubt = _torque_doubt(column, channel)
            self._add(channel or "sensor_torque", column, _stated(column), _by_name(column), doubt)
        if self.said.torque_constant is not None and "motor_torque" not in self.channels:
            self._fact("torque_constant", self.said.torque_constant, "as the file says")

    def _currents(self) -> None:
        """Take the current that makes the torque, the q-axis' where it is there."""

        def likely(column: Column) -> tuple[bool, bool]:
            name = column.says.name.lower()
            return not ("q_" in name or "iq" in name or "_q" in name), column.says.side != "motor"

        free = sorted(self._free("current"), key=likely)
        several = len(free) > 1 and likely(free[0]) == likely(free[1])
        for column in free:
            doubt = "several columns may be it" if several else ""
            self._add("motor_current", column, _stated(column), _by_name(column), doubt)

    def _switches(self) -> None:
        for column in self._free("enabled"):
            self._add("enabled", column, Told(None), _by_name(column))
        for column in self._free("duty"):
            most = float(np.max(np.abs(column.whole), initial=0.0))
            told = Told({"%": "%", "permille": "permille"}.get(str(column.says.unit)))
            if told.unit is None and most > FULL_DUTY:
                told = Told(None, unsure="a duty cycle beyond 1, whose full scale is not stated")
            self._add("duty", column, told, _by_name(column))

    def _temperatures(self) -> None:
        free = list(self._free("temperature"))
        for column in free:
            motor = column.says.side == "motor"
            channel = "motor_temperature" if motor else "temperature"
            same = sum((c.says.side == "motor") == motor for c in free)
            electronics = "drive" in column.says.name.lower()
            doubt = "" if motor or placed(column.says.name) else "where it is measured is not named"
            doubt = "several columns may be it" if same > 1 else doubt
            doubt = "of the motor, or of its electronics" if electronics else doubt
            self._add(channel, column, _stated(column), _by_name(column), doubt)

    def _voltages(self) -> None:
        for column in self._free("voltage"):
            channel, doubt = _voltage_channel(column)
            if channel:
                self._add(channel, column, _stated(column), _by_name(column), doubt)

    def _commanded(self) -> None:
        """Add the angle that the servo was told; where no unit is said, in the measured one's."""
        measured = self.channels.get("output_position")
        for column in self.columns:
            says = column.says
            if (says.quantity, says.role) != ("position", "commanded") or says.side == "motor":
                continue
            if column.values is None or column.number in self.taken:
                continue
            if says.unit is not None and says.unit != "counts":
                self._add("commanded_position", column, _stated(column), _by_name(column))
            elif measured is not None:
                doubt = "its unit is taken for that of the measured angle"
                told = Told(measured.unit, measured.sign, measured.scale, unsure=doubt)
                self._add("commanded_position", column, told, _by_name(column))

    def _signs(self) -> None:
        """Tell signs of torques and of the current by the work that friction takes."""
        motion = self._motion()
        if motion is None:
            return
        drive = None
        for channel in ("motor_torque", "motor_current"):
            if channel not in self.channels:
                continue
            share = friction_share(self.si(channel), *motion)
            if not both_ways(motion[1]):
                self._doubt(channel, "the motion goes one way, which does not tell its sign")
                continue
            if abs(share) < WORK:
                self._doubt(channel, "friction takes too little of it to tell its sign")
                continue
            if share < 0:
                self._turn(channel, "so that the drive does work against friction")
            drive = self.si(channel)
        for channel in ("sensor_torque", "reference_torque"):
            if drive is None or channel not in self.channels:
                continue
            way = goes_with(drive, self.si(channel), *motion)
            if way < 0:
                self._turn(channel, "so that it pushes the way the drive does")

    def _motion(self) -> tuple[Array, Array] | None:
        """Return position and velocity of one side, scaled to the output's turns."""
        ratio = float(self.facts.get("gear_ratio", 1.0))
        for side, turns in (("output", 1.0), ("motor", ratio)):
            names = f"{side}_position", f"{side}_velocity"
            if names[0] in self.channels:
                position = self.si(names[0]) / turns
                velocity = self.si(names[1]) / turns if names[1] in self.channels else None
                if velocity is None and "motor_velocity" in self.channels:
                    velocity = self.si("motor_velocity") / ratio
                return position, np.gradient(position) if velocity is None else velocity
        return None

    def _turn(self, channel: str, why: str) -> None:
        old = self.channels[channel]
        doubt = joined(old.unsure, "its sign is turned: look at it")
        self.channels[channel] = replace(
            old, sign=-old.sign, reason=joined(old.reason, why), unsure=doubt
        )

    def _doubt(self, channel: str, doubt: str) -> None:
        old = self.channels[channel]
        self.channels[channel] = replace(old, unsure=joined(old.unsure, doubt))

    def _leave_out(self) -> None:
        for column in self.columns:
            if column.number not in self.taken and column.number not in self.ignored:
                self.ignored[column.number] = _why_not(column)
        for number in () if self.joints.places else self.joints.others:
            self.ignored[number] = "another joint"

    def guess(self, path: Path, layout: TextLayout, table: Table) -> Guess:
        """Return all of it."""
        read, reasons, unsure = dict(layout.read), list(layout.reasons), list(self.unsure)
        if self.clock.rate is not None:
            read["rate"] = self.clock.rate
            reasons.append(joined(f"{self.clock.rate:g} Hz", self.clock.reason))
            unsure += [f"rate: {self.clock.unsure}"] if self.clock.unsure else []
        elif "time" not in self.channels:
            unsure.append("time: no time stamps, and nothing tells the rate; give it by --rate")
        if not self.channels.keys() - {"time"}:
            unsure.append("no column but the time can be told; write the others by hand")
        if self.wrapped:
            read["repair"] = [f"unwrap={name}" for name in self.wrapped]
            reasons += [f"{name} wraps at a turn" for name in self.wrapped]
        if self.joints.reason:
            reasons.append(self.joints.reason)
            unsure += [self.joints.reason] if self.joints.unsure else []
        names = table.names or tuple("" for _ in table.data)
        ignored = {n: (names[n], why) for n, why in sorted(self.ignored.items())}
        return Guess(
            str(path),
            read,
            self.facts,
            self.channels,
            ignored,
            tuple(reasons),
            self.fact_reasons,
            tuple(unsure),
            layout.numbered,
            joint=self.joints.joint if self.joints.places else None,
            places=self._places(layout, path),
        )

    def _places(self, layout: TextLayout, path: Path) -> dict[str, str]:
        """Return the sources of channels that each joint has, by channel."""
        places = self.joints.places
        if places and layout.numbered:
            raise InputError(
                f"{path}: its columns go by number in a map, and numbers tell no joints; give one "
                "joint, and write {joint+COUNT} by hand"
            )
        return {
            channel: places[each.number]
            for channel, each in self.channels.items()
            if each.number in places
        }


def _beyond_gears(turns: float) -> list[str]:
    """Return what speaks against a ratio that is beyond those of gears."""
    if GEARED <= turns <= LARGEST:
        return []
    degree = math.pi / 180
    other = turns * degree if turns > LARGEST else turns / degree
    if GEARED <= other <= LARGEST and abs(other - round(other)) < WHOLE * other:
        times = "57.3 times" if turns > LARGEST else "1/57.3 of"
        return [
            f"gear_ratio: {turns:.5g} is {times} {round(other)}; is the one angle in degrees and "
            "the other in radians?"
        ]
    if turns <= LARGEST:
        return []
    return [f"gear_ratio: {turns:.5g} is more than a gear's {LARGEST:g}; are both units right?"]


def _stated(column: Column) -> Told:
    """Return the unit that a column states, or the usual one of its quantity, and that it is."""
    unit = column.says.unit
    if unit == "ddegC":
        return Told("degC", scale=0.1, reason="tenths")
    if unit in ("%", "permille"):
        return Told(None, unsure="a share of a rated value that is not stated")
    if unit is not None and unit != "counts":
        return Told(unit, reason="its unit is stated")
    usual = USUAL_UNIT.get(str(column.says.quantity))
    return Told(usual, unsure=f"no unit is stated; taken for {usual}")


def _by_name(column: Column) -> str:
    return "its name" if column.says.name else ""


def _torque_channel(column: Column) -> str:
    says = column.says
    if says.role == "trusted" and says.side != "motor":
        return "reference_torque"
    if says.side == "motor":
        return "motor_torque"
    return "sensor_torque" if says.role == "sensor" or says.side == "output" else ""


def _torque_doubt(column: Column, channel: str) -> str:
    if not channel:
        return "its side is not named; of the motor's shaft it is motor_torque"
    if channel == "sensor_torque" and column.says.role != "sensor":
        return "at the output, of the joint's own sensor or of another (reference_torque)"
    if channel == "reference_torque" and not trusted(column.says.name):
        return "taken for a trusted torque, beside that of the joint's own sensor"
    return ""


def _voltage_channel(column: Column) -> tuple[str, str]:
    name, says = column.says.name.lower(), column.says
    if says.role == "supply":
        return "supply_voltage", ""
    if "therm" in name or "ntc" in name:
        return "thermistor_voltage", ""
    if says.role == "sensor" or any(word in name for word in ("bridge", "brück")):
        return "sensor_voltage", ""
    one_signed = column.moves and bool(np.min(column.whole) > SUPPLY)
    return ("supply_voltage", "which voltage it is is not named") if one_signed else ("", "")


def _why_not(column: Column) -> str:
    says = column.says
    if column.values is None:
        return (
            "it ends long before the others: it has a clock of its own" if column.short else "text"
        )
    if says.unit == "foreign":
        return "its unit is not known, or that of no channel"
    if says.role == "commanded":
        return "a command"
    if says.role == "other":
        return "an error, a state, or what the recorder made of other columns"
    return (
        f"no channel for this {says.quantity}"
        if says.quantity
        else ("its name says nothing known" if says.name else "it has no name")
    )
