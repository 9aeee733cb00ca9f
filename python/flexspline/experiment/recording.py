"""A planned run as a log: the commanded trajectory, and the channels that a recording would have.

The motor torque is what the drive of the recorded runs would need for the motion.

Load and temperature stand at levels, at which the motion is repeated, or change slowly under it: a
part of a run has a load that is constant or a cosine, and a temperature that is constant or rises
exponentially. Between parts the joint rests while the load changes. Parts at different temperatures
are runs of their own, with a gap between them in the file's time.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, product

import numpy as np
from numpy.typing import NDArray

from flexspline.effects import Effect, effect
from flexspline.effects.causes import BASIC, GRAVITY, SCALING_WITH_LOAD
from flexspline.errors import InputError
from flexspline.experiment.plan import Bounds, Range, joined, short
from flexspline.experiment.trajectories import Kind, smoothstep
from flexspline.least_squares.problem import Problem, Run, kept_rows, problem_of
from flexspline.logs.derive import lowpass
from flexspline.logs.log import Log
from flexspline.logs.segments import runs
from flexspline.regression.candidate_model import Working, started, working
from flexspline.regression.gram import Whitening
from flexspline.signals import channels_for, core_channels, gear_of

__all__ = ["Excitation", "Motor", "Part", "as_problem", "commanded", "motor_of", "settings"]

Array = NDArray[np.float64]

REST = 1.0  # s at least, in which a load changes
STEEPEST = 1.875  # of a smooth step of one second and one unit
RESTS = 0.25  # of the run that changes of the load may take
WAIT = 1800.0  # s in the file between runs at different temperatures

LEAST_KELVIN = 1.0  # below, temperature is a constant
MOST_PARTS = 6
MOST_ROWS = 10_000_000  # of a run that is planned: each kind is drawn some hundred times
WARM = 3.0  # time constants of a warm-up in a part


@dataclass(frozen=True, eq=False)
class Excitation:
    """One run of the family: kind, its numbers (D,) in [0, 1], and load and temperature."""

    kind: Kind
    numbers: Array
    setting: Setting

    @property
    def name(self) -> str:
        return self.kind.name

    def words(self, bounds: Bounds) -> str:
        """What to record, in words."""
        drawn = self.kind.draw(self.numbers, bounds.lasting(_seconds(self.setting, bounds)))
        return ", ".join(s for s in (drawn.words, self.setting.words) if s)


def commanded(made: Excitation, bounds: Bounds, rate: float) -> dict[str, Array]:
    """Return time, motion, and load and temperature where they are set, arrays (N,)."""
    count = max(int(_seconds(made.setting, bounds) * rate), 2)
    if count > MOST_ROWS:
        raise InputError(
            f"a run of {count / rate:.4g} s at {rate:.4g} Hz has {count} rows where {MOST_ROWS} "
            "are planned at most; give a shorter duration"
        )
    drawn = made.kind.draw(made.numbers, bounds.lasting(count / rate))
    path = drawn.path(np.arange(count + 1) / rate)
    pieces = list(_pieces(made.setting.parts, path, bounds, rate))
    rows = np.concatenate([piece for piece, _ in pieces])
    waits = np.repeat(np.cumsum([wait for _, wait in pieces]), [len(p) for p, _ in pieces])
    names = ["output_position", "output_velocity", "output_acceleration"]
    names += ["load"] if made.setting.parts[0].load else []
    names += ["temperature"] if made.setting.parts[0].temperature else []
    time = np.arange(len(rows)) / rate + waits
    return {"time": time, **dict(zip(names, rows.T, strict=True))}


def _pieces(
    parts: Sequence[Part], path: Array, bounds: Bounds, rate: float
) -> Iterator[tuple[Array, float]]:
    """Rows of each part and of rests before it, with the wait [s] before them.

    `path`: (n + 1, 3), from rest to rest; its last row is the first of what follows.
    """
    share = np.linspace(0.0, 1.0, len(path))
    for number, part in enumerate(parts):
        before = parts[number - 1] if number else part
        rest = _change(before, part, bounds, rate)
        if len(rest):
            still = np.repeat(path[:1], len(rest), axis=0)
            yield _beside(still, rest, part, np.zeros(len(rest))), 0.0
        last = len(path) if number == len(parts) - 1 else len(path) - 1
        load = part.loads(share[:last]) if part.load else None
        wait = WAIT if part.temperature != before.temperature else 0.0
        yield _beside(path[:last], load, part, share[:last]), wait


def as_problem(
    columns: dict[str, Array], problem: Problem, effects: Sequence[Effect], motor: Motor | None
) -> Problem:
    """Return a planned run as the core would read its recording; the target is not known: zero.

    What waits for a temperature lies in runs of their own.
    """
    columns = dict(columns)
    load = columns.pop("load", None)
    if load is not None and problem.known_load is not None:
        columns[problem.known_load] = load
    if problem.gear["motor_encoder"]:
        ratio = float(problem.gear["effective_ratio"])
        columns["motor_position"] = ratio * columns["output_position"]
    cuts = np.flatnonzero(np.diff(columns["time"]) > 0.5 * WAIT) + 1
    pieces = zip(*(np.split(values, cuts) for values in columns.values()), strict=True)
    parts = [dict(zip(columns, piece, strict=True)) for piece in pieces]
    made = tuple(_run(part, problem, effects, motor) for part in parts)
    return replace(problem, runs=made, kept={})


def _run(
    columns: dict[str, Array], problem: Problem, effects: Sequence[Effect], motor: Motor | None
) -> Run:
    log = Log(columns, dict(problem.runs[0].log.facts))
    if motor is not None:
        log = log.with_columns({"motor_torque": motor.torque(log)}, note="as the drive needs")
    channels = core_channels(log, effects, problem.known_load)
    stretches = [(int(a), int(b)) for a, b in runs(log["time"])]
    target = np.zeros(len(log))
    if problem.lowpass is not None:
        stretches = kept_rows(stretches, lowpass(target, log["time"], problem.lowpass).valid)
    return Run(log, channels, target, tuple(stretches), tuple(stretches))


def _seconds(setting: Setting, bounds: Bounds) -> float:
    """Of one part."""
    parts = setting.parts
    rests = sum(_rest(a, b, bounds) for a, b in pairwise(parts))
    return (bounds.duration - rests) / len(parts)


def _rest(before: Part, after: Part, bounds: Bounds) -> float:
    """Seconds at rest while the load changes between two parts."""
    if before.load is None or after.load is None or before.load == after.load:
        return 0.0
    change = abs(float(after.loads(np.zeros(1))[0] - before.loads(np.ones(1))[0]))
    longest = RESTS * bounds.duration / 5.0
    return float(min(max(STEEPEST * change / max(bounds.load_rate, 1e-12), REST), longest))


def _change(before: Part, after: Part, bounds: Bounds, rate: float) -> Array:
    """Load (N,) at rest between two parts; none where it stays."""
    count = int(_rest(before, after, bounds) * rate)
    if not count:
        return np.empty(0)
    first, last = before.loads(np.ones(1))[0], after.loads(np.zeros(1))[0]
    return np.asarray(first + (last - first) * smoothstep(np.arange(count) / count)[:, 0])


def _beside(path: Array, load: Array | None, part: Part, share: Array) -> Array:
    """Columns of motion, load and temperature."""
    columns = [path]
    if load is not None:
        columns.append(load[:, None])
    if part.temperature is not None:
        columns.append(part.temperatures(share)[:, None])
    return np.column_stack(columns)


@dataclass(frozen=True)
class Part:
    """`load`: from, to [Nm] and how often to and fro, 0 for standing at the first; or None.

    `temperature`: at the start and, after a warm-up, at the end [°C]; or None.
    """

    load: tuple[float, float, int] | None
    temperature: Range | None

    def loads(self, share: Array) -> Array:
        """Load (N,) over the share of the part that has gone."""
        assert self.load is not None
        low, high, times = self.load
        return np.asarray(low + 0.5 * (high - low) * (1.0 - np.cos(2 * np.pi * times * share)))

    def temperatures(self, share: Array) -> Array:
        """Temperature (N,) over the share of the part that has gone."""
        assert self.temperature is not None
        cold, warm = self.temperature
        return np.asarray(cold + (warm - cold) * np.expm1(-WARM * share) / np.expm1(-WARM))


@dataclass(frozen=True)
class Setting:
    """Parts of a run, each with the same motion."""

    parts: tuple[Part, ...]

    @property
    def words(self) -> str:
        loads = list(dict.fromkeys(p.load for p in self.parts if p.load))
        temperatures = list(dict.fromkeys(p.temperature for p in self.parts if p.temperature))
        said = [_load_words(loads), _temperature_words(temperatures)]
        return ", ".join(s for s in said if s)


def settings(bounds: Bounds) -> list[Setting]:
    """All settings worth trying, the one that visits most first."""
    made = [
        Setting(tuple(Part(a, b) for b, a in product(temperatures, loads)))
        for loads, temperatures in product(_loads(bounds), _temperatures(bounds))
        if len(loads) * len(temperatures) <= MOST_PARTS
    ]
    return list(dict.fromkeys(made))


def _loads(bounds: Bounds) -> list[list[tuple[float, float, int] | None]]:
    if bounds.load is None:
        return [[None]]
    low, high = bounds.load
    least = float(np.clip(0.0, low, high))
    levels = [sorted({low, high}), sorted({low, least, high}), [high], [least], [low],
              sorted({least, max(low, high, key=abs)})]  # fmt: skip
    made: list[list[tuple[float, float, int] | None]] = [[(v, v, 0) for v in row] for row in levels]
    period = np.pi * (high - low) / max(bounds.load_rate, 1e-12)
    often = int(min(bounds.duration / max(period, 1e-3), 1000.0))
    return made + [[(low, high, n)] for n in sorted({often, often // 4, 2}) if 0 < n <= often]


def _temperatures(bounds: Bounds) -> list[list[Range | None]]:
    if bounds.temperature is None:
        return [[None]]
    cold, warm = bounds.temperature
    if warm - cold < LEAST_KELVIN:
        middle = 0.5 * (cold + warm)
        return [[(middle, middle)]]
    made: list[list[Range | None]] = [[(cold, cold), (warm, warm)], [(warm, warm)], [(cold, cold)]]
    rise = min(bounds.warming * bounds.duration, warm - cold)
    return [*made, [(cold, cold + rise)]] if rise >= LEAST_KELVIN else made


def _load_words(loads: Sequence[tuple[float, float, int]]) -> str:
    if not loads:
        return ""
    low, high, times = loads[0]
    if times:
        return f"while the load goes {times} times from {short(low)} to {short(high)} Nm and back"
    if len(loads) == 1:
        return f"at a load of {short(low)} Nm"
    return joined(f"once at {short(load[0])} Nm" for load in loads)


def _temperature_words(temperatures: Sequence[Range]) -> str:
    if not temperatures:
        return ""
    cold, warm = temperatures[0]
    if warm > cold:
        return f"while the joint warms up from {short(cold)} to {short(warm)} °C"
    if len(temperatures) == 1:
        return f"at {short(cold)} °C"
    each = joined(f"once at {short(t[0])} °C" for t in temperatures)
    return f"{each}, each a run of its own"


@dataclass(frozen=True, eq=False)
class Motor:
    """The drive's equation, fitted to the motor torque of the recorded runs."""

    work: Working
    known_load: str | None

    def torque(self, log: Log) -> Array:
        """Motor torque (N,) [Nm] of a log that has motion and load."""
        from flexspline import _core

        log = _geared(log)
        design = _core.Design(
            [e.for_core() for e in self.work.effects], **gear_of(log.facts, "motor_position" in log)
        )
        channels = core_channels(log, self.work.effects, self.known_load)
        y = np.asarray(design.predict(channels, len(log), self.work.coefficients))
        load = log[self.known_load] if self.known_load is not None else 0.0
        return np.asarray((y + load) / float(log.effective_ratio or 1.0))


def motor_of(logs: Sequence[Log], known_load: str | None) -> Motor:
    """Fit the drive of logs with motor torque."""
    names: Sequence[str] = BASIC
    if known_load is not None:  # which holds gravity
        names = [*(name for name in BASIC if name != GRAVITY), *SCALING_WITH_LOAD]
    effects = [effect(name) for name in names]
    problem = problem_of(
        [channels_for(_geared(log), effects, known_load) for log in logs],
        effects,
        "motor_torque",
        known_load=known_load,
        lowpass_hz=None,
        threads=1,
    )
    plain = Whitening(np.ones(1), 1.0, 1)
    return Motor(started(problem, working(effects, len(effects), {}), plain)[0], known_load)


def _geared(log: Log) -> Log:
    """The log with a gear ratio: 1 where none is known, which the load's scale makes up for."""
    if "gear_ratio" in log.facts:
        return log
    return log.with_facts({"gear_ratio": 1.0})
