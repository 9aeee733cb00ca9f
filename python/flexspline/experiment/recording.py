"""A planned run as a log: what is commanded, and what follows from it in a recording."""

from __future__ import annotations

from collections.abc import Sequence
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
from flexspline.fit.memory import kept_rows
from flexspline.fit.problem import Problem, Run
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
    seconds = count / rate
    drawn = made.kind.draw(made.numbers, bounds.lasting(seconds))
    local = np.arange(count) / rate
    path = drawn.path(local)
    pieces, time, now = list[Array](), list[Array](), 0.0
    parts, last = made.setting.parts, drawn.path(np.array([0.0]))
    for number, part in enumerate(parts):
        rest = _change(parts[number - 1], part, bounds, rate) if number else None
        if rest is not None and len(rest):
            pieces.append(_beside(np.repeat(last, len(rest), axis=0), rest, part, 0.0))
            time.append(now + np.arange(len(rest)) / rate)
            now = float(time[-1][-1]) + 1.0 / rate
        if number and part.temperature != parts[number - 1].temperature:
            now += WAIT
        share = local / seconds
        pieces.append(_beside(path, part.loads(share) if part.load else None, part, share))
        time.append(now + local)
        now = float(time[-1][-1]) + 1.0 / rate
    end = np.array([1.0])
    pieces.append(_beside(last, parts[-1].loads(end) if parts[-1].load else None, parts[-1], end))
    time.append(np.array([now]))
    names = ["output_position", "output_velocity", "output_acceleration"]
    names += ["load"] if parts[0].load else []
    names += ["temperature"] if parts[0].temperature else []
    columns = dict(zip(names, np.concatenate(pieces).T, strict=True))
    return {"time": np.concatenate(time), **columns}


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


def _change(before: Part, after: Part, bounds: Bounds, rate: float) -> Array | None:
    count = int(_rest(before, after, bounds) * rate)
    if not count:
        return None
    first, last = before.loads(np.ones(1))[0], after.loads(np.zeros(1))[0]
    return np.asarray(first + (last - first) * smoothstep(np.arange(count) / count)[:, 0])


def _beside(path: Array, load: Array | None, part: Part, share: Array | float) -> Array:
    """Columns of motion, load and temperature."""
    columns = [path]
    if load is not None:
        columns.append(load[:, None])
    if part.temperature is not None:
        heat = part.temperatures(np.broadcast_to(np.asarray(share, dtype=float), len(path)))
        columns.append(heat[:, None])
    return np.column_stack(columns)
