"""Functions without a name: what any smooth dependence on a channel, or on two, would explain.

A cause that is not in the catalogue still depends on something measured. Hat functions of each
channel (and their products for two) stand for every smooth function of it: what they explain on
left-out folds beyond the named effects is "unexplained", and the channels are those it depends on.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from flexspline.fit.problem import Problem, Run
from flexspline.orders.parts import effective_ratio

__all__ = ["Nameless", "nameless_of"]

Array = NDArray[np.float64]
Basis = Callable[[Run], Array]

TURN = 2.0 * np.pi
FINE, COARSE = 15, 5
HIDDEN = {
    "sensor_torque": ("sensor_torque", "sensor_voltage"),
    "motor_torque": ("motor_torque", "motor_current", "duty"),
    "motor_current": ("motor_torque", "motor_current", "duty"),
    "torsion": ("motor_velocity",),
}
"""Channels that hold the target itself."""
NEVER = ("enabled", "thermistor_voltage", "commanded_position", "motor_velocity", "motor_position")
ROUND = "motor_angle"


@dataclass(frozen=True)
class Nameless:
    """Functions of some channels: `columns` makes them, (N, C), of a run."""

    channels: tuple[str, ...]
    columns: Basis
    count: int


def nameless_of(problem: Problem, *, pairs: bool = True) -> list[Nameless]:
    """Return functions of every channel that all runs have, and of every two."""
    channels = _channels(problem)
    fine = {name: _basis(problem, name, FINE) for name in channels}
    coarse = {name: _basis(problem, name, COARSE) for name in channels if name != ROUND}
    single = [Nameless((name,), made[0], made[1]) for name, made in fine.items()]
    if not pairs:
        return single
    return single + [
        Nameless((a, b), _product(coarse[a][0], coarse[b][0]), coarse[a][1] * coarse[b][1])
        for a, b in combinations(coarse, 2)
        if "time" not in (a, b)
    ]


def _channels(problem: Problem) -> list[str]:
    hidden = {*HIDDEN[problem.target], *NEVER}
    logs = [run.log for run in problem.runs]
    load = problem.known_load
    found = [
        name
        for name in logs[0].channels
        if name not in hidden
        and (name != "reference_torque" or load == name)
        and all(name in log and np.isfinite(log[name]).all() for log in logs)
        and any(np.ptp(log[name]) > 0.0 for log in logs)
    ]
    turns = effective_ratio(logs[0].facts) is not None and "output_position" in found
    return [*found, ROUND] if turns else found


def _basis(problem: Problem, name: str, count: int) -> tuple[Basis, int]:
    """Hats of one channel: periodic over a turn of an angle that turns, else between quantiles."""
    if name == ROUND:
        return _turning(_motor_angle, count + 1), count + 1
    every = np.concatenate([_values(run, name)[::7] for run in problem.runs])
    if name == "output_position" and np.ptp(every) > TURN:
        return _turning(lambda run: run.log[name], count + 1), count + 1
    knots = _knots(every, count, name.endswith("velocity"))
    return (lambda run: _hats(_values(run, name), knots)), len(knots)


def _values(run: Run, name: str) -> Array:
    values = run.log[name]
    return np.asarray(values - values[0] if name == "time" else values)


def _motor_angle(run: Run) -> Array:
    if "motor_position" in run.log:
        return run.log["motor_position"]
    ratio = effective_ratio(run.log.facts) or 1.0
    return np.asarray(ratio * run.log["output_position"])


def _knots(values: Array, count: int, both_ways: bool) -> Array:
    """Between the quantiles of the values; of a velocity, the same on both sides of zero."""
    if both_ways:
        speeds = np.quantile(np.abs(values), np.linspace(0.15, 0.995, count // 2 + 1))
        knots = np.concatenate([-speeds[::-1], [0.0], speeds])
    else:
        knots = np.quantile(values, np.linspace(0.005, 0.995, count))
    span = float(knots[-1] - knots[0])
    return np.asarray(knots[np.concatenate([[True], np.diff(knots) > 1e-3 * span])])


def _hats(values: Array, knots: Array) -> Array:
    """Piecewise linear functions, one at each knot, constant beyond the ends: (N, knots)."""
    return np.column_stack([np.interp(values, knots, row) for row in np.eye(len(knots))])


def _turning(angle: Callable[[Run], Array], count: int) -> Basis:
    """Cosines and sines of an angle, (N, count)."""
    orders = np.arange(1, count // 2 + 1)

    def columns(run: Run) -> Array:
        phase = angle(run)[:, None] * orders
        return np.column_stack([np.cos(phase), np.sin(phase)])

    return columns


def _product(first: Basis, second: Basis) -> Basis:
    def columns(run: Run) -> Array:
        a, b = first(run), second(run)
        return np.asarray((a[:, :, None] * b[:, None, :]).reshape(len(a), -1))

    return columns


def columns_of(groups: Sequence[Nameless], problem: Problem, number: int) -> Array:
    """Columns of all groups of a run, filtered as the target is, (N, C)."""
    run = problem.runs[number]
    made = [group.columns(run) for group in groups] or [np.empty((len(run), 0))]
    return problem.smooth(run, np.column_stack(made))
