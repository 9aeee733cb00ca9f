"""A planned run as a log: what is commanded, and what follows from it in a recording."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from flexspline.effects import Effect
from flexspline.experiment.family import Kind
from flexspline.experiment.limits import Bounds
from flexspline.experiment.motion import smoothstep
from flexspline.experiment.motor import Motor
from flexspline.experiment.setting import Part, Setting
from flexspline.least_squares.problem import Problem, Run, kept_rows
from flexspline.logs.derive import lowpass
from flexspline.logs.log import Log
from flexspline.logs.segments import runs
from flexspline.signals import core_channels

__all__ = ["Excitation", "as_problem", "commanded"]

Array = NDArray[np.float64]

REST = 1.0  # s at least, in which a load changes
STEEPEST = 1.875  # of a smooth step of one second and one unit
RESTS = 0.25  # of the run that changes of the load may take
WAIT = 1800.0  # s in the file between runs at different temperatures


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
