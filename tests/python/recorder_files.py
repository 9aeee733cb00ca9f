"""What recorders of known truth are made of: a run of a joint, columns of text, a file, a recorder.

The recorders themselves are in `recorders`, `more_recorders`, `unseen_recorders` and
`fresh_recorders`. Not part of the package.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

DEG = math.pi / 180.0  # rad
REV = 2.0 * math.pi  # rad
RPM = REV / 60.0  # rad/s
LBF_IN = 0.3048 / 12.0 * 0.45359237 * 9.80665  # Nm
KGF_CM = 0.0980665  # Nm
KELVIN = -273.15  # °C at 0 K
OWN_OR_BESIDE = "a torque at the output, of the joint's sensor or of another"
WHERE = "a temperature: of the motor, the joint or the room is not said"
NO_UNIT = "its unit is stated nowhere"
RMS_OR_AMPLITUDE = "A rms or amplitude: which one a torque constant goes with is open"
ONE_UNIT = "that both angles have one unit is likely, but not stated"
RATED = "per mille of a rated torque that only the preamble gives"
NO_RESOLUTION = "counts without a resolution"
TO_A_FACTOR = "counts of both sides are known to a factor alone"
MOTOR_OR_SENSOR = "may be that of the motor or that of the joint's sensor"


# the joint


def joint_run(
    seed: int,
    rate: float,
    seconds: float,
    *,
    ratio: float = 100.0,
    motion: str = "sines",
    amplitude: float = 1.0,
    pace: float = 1.0,
    torque_constant: float = 0.1,
    from_zero: bool = False,
) -> dict[str, Array]:
    """One run of a joint under gravity, in SI units and with the signs of the package.

    Parameters
    ----------
    seed : int
        Of everything that is drawn.
    rate : float
        Rows per second.
    seconds : float
        Length of the run.
    ratio : float
        Turns of the motor for one turn of the output.
    motion : {"sines", "trapezoids"}
        Sum of three sines, or moves between two angles with rests.
    amplitude : float
        Of the output [rad].
    pace : float
        A motion `pace` times as fast.
    torque_constant : float
        Nm/A.
    from_zero : bool
        The motor's encoder counts from where it was switched on, not from the output's zero.

    Returns
    -------
    dict of str to ndarray, shape (N,)
        By the names of the channels; noise in every one but `time` and `commanded_position`.
    """
    rng = np.random.default_rng([seed, 2026])
    time = np.arange(round(rate * seconds)) / rate
    course = {"sines": _sines, "trapezoids": _trapezoids}[motion]
    q, dq, ddq = course(rng, time * pace, amplitude)
    dq, ddq = dq * pace, ddq * pace**2
    load = 1.2 * ddq + 18.0 * np.sin(q)  # Nm: a link of 1.2 kg m² and 18 Nm
    friction = (3.0 + 1.5 * np.exp(-((dq / 0.15) ** 2))) * np.tanh(dq / 0.01) + 4.0 * dq
    torque = (load + 0.9 * ddq + friction) / ratio  # Nm at the motor shaft, its rotor 0.9 kg m²
    theta = ratio * (q + load / 12e3 + 1.5e-4 * np.sin(2.0 * ratio * q))

    def noisy(values: Array, level: float) -> Array:
        return values + rng.normal(scale=level, size=time.size)

    heat = np.cumsum(torque**2) / max(float(np.sum(torque**2)), 1e-9)
    return {
        "time": time,
        "output_position": noisy(q, 1.5e-5),
        "output_velocity": noisy(dq, 3e-3),
        "motor_position": noisy(theta - (theta[0] if from_zero else 0.0), 1e-3),
        "motor_velocity": noisy(ratio * dq, 0.15),
        "motor_torque": noisy(torque, 3e-3),
        "motor_current": noisy(torque / torque_constant, 0.03),
        "sensor_torque": noisy(load + 0.35 + 0.12 * np.sin(2.0 * q + 0.4), 0.05),
        "reference_torque": noisy(load, 0.03),
        "temperature": noisy(27.0 + 2.0 * heat, 0.04),
        "motor_temperature": noisy(31.0 + 9.0 * heat, 0.08),
        "commanded_position": q + 4e-3 * dq,
        "supply_voltage": noisy(48.0 - 0.1 * np.abs(torque / torque_constant), 0.03),
        "duty": noisy((0.4 * torque / torque_constant + torque_constant * ratio * dq) / 48.0, 2e-3),
    }


def _sines(rng: np.random.Generator, time: Array, amplitude: float) -> tuple[Array, ...]:
    q, dq, ddq = np.zeros((3, time.size))
    for frequency, share in ((0.11, 0.7), (0.23, 0.25), (0.47, 0.08)):
        omega = REV * frequency * rng.uniform(0.9, 1.1)
        phase = omega * time + rng.uniform(0.0, REV)
        q += amplitude * share * np.sin(phase)
        dq += amplitude * share * omega * np.cos(phase)
        ddq -= amplitude * share * omega**2 * np.sin(phase)
    return q, dq, ddq


def _trapezoids(rng: np.random.Generator, time: Array, amplitude: float) -> tuple[Array, ...]:
    """Moves from -a to a and back, 0.5 s of acceleration, rests of 0.4 s."""
    ramp, rest = 0.5, 0.4
    cruise = rng.uniform(1.2, 1.8)
    speed = 2.0 * amplitude / (cruise + ramp)
    move = 2.0 * ramp + cruise
    number, into = np.divmod(time, move + rest)
    into = np.minimum(into, move)
    way = np.where(number % 2 == 0, 1.0, -1.0)
    ddq = np.where(into < ramp, 1.0, np.where(into > move - ramp, -1.0, 0.0)) * speed / ramp
    ddq = np.where(into >= move, 0.0, ddq)
    dq = speed * np.clip(np.minimum(into, move - into) / ramp, 0.0, 1.0)
    up = speed * np.where(into < ramp, into**2 / 2.0 / ramp, into - ramp / 2.0)
    late = np.maximum(into - (move - ramp), 0.0)
    return way * (up - speed * late**2 / 2.0 / ramp - amplitude), way * dq, way * ddq


# a file and its recorder


@dataclass(frozen=True)
class File:
    """What a recorder wrote.

    Attributes
    ----------
    name : str
        Of the file.
    content : bytes
        All of it.
    truth : mapping of str to ndarray, shape (rows,)
        Channels that are in the file, in SI units with the signs of the package; NaN where a cell
        is empty; `time` in seconds from the first row.
    steps : mapping of str to float
        The step in which the file holds a channel, in the channel's SI unit; 0 where it holds the
        number itself.
    facts : mapping of str to object
        What the file tells besides the channels. `gear_ratio` is the turns of the motor for one
        turn of the output.
    ambiguous : mapping of str to str
        Channel (or fact) to why the file alone does not tell it, so that a guess must say so.
    wraps : mapping of str to float
        Channels that the file holds modulo so many rad (or s): the truth goes on.
    """

    name: str
    content: bytes
    truth: Mapping[str, Array]
    steps: Mapping[str, float]
    facts: Mapping[str, object] = field(default_factory=dict)
    ambiguous: Mapping[str, str] = field(default_factory=dict)
    wraps: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Recorder:
    """A recorder, by a file that it wrote.

    Attributes
    ----------
    name : str
        Short, for the id of a test.
    source : str
        Where the form of its files is documented; empty where made up.
    hard : str
        What is hard in its file.
    file : callable
        Returns the file, the same one each time.
    """

    name: str
    source: str
    hard: str
    file: Callable[[], File]

    def write(self, folder: Path) -> Path:
        """Write the file into `folder` and return where it is."""
        path = folder / self.file().name
        path.write_bytes(self.file().content)
        return path

    def gap(self, channel: str, values: Array) -> float:
        """How far `values` are from the truth at most, in SI units, modulo what the file wraps."""
        made = self.file()
        truth = made.truth[channel]
        if np.shape(values) != truth.shape or np.any(np.isnan(values) != np.isnan(truth)):
            return math.inf
        apart = np.asarray(values, dtype=float) - truth
        if channel in made.wraps:
            apart -= made.wraps[channel] * np.rint(apart / made.wraps[channel])
        return float(np.nanmax(np.abs(apart)))


class Recorders(list[Recorder]):
    """Recorders in the order in which they are defined: called, it decorates the next one.

    What is decorated makes a file. Its docstring says what is hard in it and, behind "Source:",
    where such files are documented.
    """

    def __call__(self, make: Callable[[], File]) -> Callable[[], File]:
        """Take in what makes a file."""
        hard, _, source = (make.__doc__ or "").partition("Source:")
        words = (" ".join(text.split()) for text in (source, hard))
        self.append(Recorder(make.__name__, *words, cache(make)))
        return make


# columns of text


@dataclass(frozen=True)
class Column:
    """One column of a table of text: its header, its cells, and which channel that is, if any."""

    header: str
    cells: Sequence[str]
    channel: str = ""
    truth: Array | None = None
    step: float = 0.0


def channel(
    run: Mapping[str, Array],
    channel: str,
    header: str,
    shape: str,
    unit: float = 1.0,
    *,
    zero: float = 0.0,
    wrap: float = 0.0,
    start: float = 0.0,
) -> Column:
    """A channel in a unit: the cells are (SI - zero) / unit + start, modulo `wrap`."""
    values = (run[channel] - zero) / unit + start
    if wrap:
        values = np.mod(values, wrap)
    if shape.endswith("d"):
        values = np.rint(values)
    step = abs(unit) * _step(shape, float(np.max(np.abs(values))))
    cells = [shape % value for value in values.tolist()]
    return Column(header, cells, channel, run[channel], step)


def _step(shape: str, largest: float) -> float:
    """In which step a %-format holds numbers up to `largest`."""
    if shape == "%r":
        return 0.0
    match = re.fullmatch(r"%[+ ]?\d*(?:\.(\d+))?([dfeEg])", shape)
    assert match
    digits = int(match[1] or 6)
    if match[2] == "d":
        return 1.0
    if match[2] == "f":
        return 10.0**-digits
    significant = digits if match[2] == "g" else digits + 1
    return 10.0 ** (math.floor(math.log10(largest)) + 1 - significant)


def other(header: str, values: Iterable[object], shape: str = "%s") -> Column:
    """A column that is no channel."""
    return Column(header, [shape % value for value in values])


def same(header: str, value: str, rows: int) -> Column:
    """A column that is no channel and holds one word."""
    return Column(header, [value] * rows)


def commas(columns: Iterable[Column]) -> list[Column]:
    """The columns with a decimal comma."""
    return [
        Column(c.header, [cell.replace(".", ",") for cell in c.cells], c.channel, c.truth, c.step)
        for c in columns
    ]


def lines(columns: Sequence[Column], between: str, end: str = "") -> list[str]:
    """A line of each row's cells."""
    return [between.join(row) + end for row in zip(*(c.cells for c in columns), strict=True)]


def headers(columns: Sequence[Column], between: str, end: str = "") -> str:
    """The line of the headers."""
    return between.join(c.header for c in columns) + end


def text(lines: Iterable[str], newline: str = "\n", encoding: str = "utf-8") -> bytes:
    """What a file of these lines holds."""
    return "".join(line + newline for line in lines).encode(encoding)


def file(
    name: str, content: bytes, columns: Iterable[Column], **more: Mapping[str, object]
) -> File:
    """A file whose content holds these columns."""
    channels = [c for c in columns if c.channel]
    truth = {c.channel: c.truth for c in channels}
    assert len(truth) == len(channels), "one column for each channel"
    steps = {c.channel: c.step for c in channels}
    return File(name, content, truth, steps, **more)


def table(
    name: str,
    columns: Sequence[Column],
    between: str,
    newline: str = "\n",
    encoding: str = "utf-8",
    *,
    head: Iterable[str] = (),
    units: Sequence[str] = (),
    **more: Mapping[str, object],
) -> File:
    """A file of text: lines of a preamble, the headers, a line of units if any, the cells."""
    named = [headers(columns, between), *([between.join(units)] if units else [])]
    written = [*head, *named, *lines(columns, between)]
    return file(name, text(written, newline, encoding), columns, **more)


def of_run(
    name: str,
    content: bytes,
    run: Mapping[str, Array],
    steps: Mapping[str, float],
    **more: Mapping[str, object],
) -> File:
    """A file whose content holds channels of a run, each in its step."""
    return File(name, content, {channel: run[channel] for channel in steps}, dict(steps), **more)


def single(run: Mapping[str, Array], channels: Iterable[str]) -> dict[str, float]:
    """Steps of channels that a file holds in single precision."""
    return {name: float(np.max(np.abs(run[name]))) * 2.0**-23 for name in channels}


def still(seed: int, angle: float, rows: int) -> Array:
    """A joint that holds its angle."""
    return angle + np.random.default_rng([seed, 7]).normal(scale=1e-5, size=rows)


def white(seed: int, level: float, rows: int) -> Array:
    """White noise of a standard deviation."""
    return np.random.default_rng([seed, 8]).normal(scale=level, size=rows)


def stamps(time: Array, start: str, timespec: str) -> tuple[list[str], Array]:
    """Words of a calendar clock for `time`, to ms or ns, and the time that they say."""
    unit = {"ms": 1e-3, "ns": 1e-9}[timespec]
    ticks = np.rint(time / unit).astype(np.int64)
    moments = np.datetime64(start, timespec) + ticks.astype(f"timedelta64[{timespec}]")
    return np.datetime_as_string(moments).tolist(), (ticks - ticks[0]) * unit


def filtered(values: Array, rate: float, constant: float) -> Array:
    """A first-order low pass, as a drive smooths its velocity."""
    share = 1.0 / (1.0 + rate * constant)
    smooth = np.empty_like(values)
    last = values[0]
    for row, value in enumerate(values.tolist()):
        last += share * (value - last)
        smooth[row] = last
    return smooth
