"""What functions without a name may depend on, at some rows of a run: a window at a time."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexspline.discovery.past import MOST_ROWS, past_of
from flexspline.discovery.settings import SETTINGS, TINY
from flexspline.fit.problem import Problem, Run
from flexspline.orders.parts import effective_ratio

__all__ = ["DIRECTION", "RATE", "ROUND", "values_of"]

Array = NDArray[np.float64]

HIDDEN = {
    "sensor_torque": ("sensor_torque", "sensor_voltage"),
    "motor_torque": ("motor_torque", "motor_current", "duty", "supply_voltage"),
    "motor_current": ("motor_torque", "motor_current", "duty", "supply_voltage"),
    "torsion": ("motor_velocity",),
}
"""Channels that hold the target itself; a supply sags under the motor's own current."""
NEVER = ("enabled", "thermistor_voltage", "commanded_position", "motor_velocity", "motor_position",
         "simulated_torque")  # fmt: skip
PAST, CHANNELS, FASTEST = "past", "nameless channels", "largest speed"  # what a problem keeps
ROUND, DIRECTION, RATE = "motor_angle", "direction", "load_rate"
LAGGED = ("temperature", "motor_torque")
"""Channels whose past may act, beside the load's; that of the motion is friction with memory."""


def values_of(problem: Problem, number: int, rows: slice) -> dict[str, Array]:
    """Return what functions may depend on at some rows of a run, (n,) each, by name."""
    run, found = problem.runs[number], _channels(problem)
    made = {name: run.log[name][rows] for name in found}
    if "time" in made:
        made["time"] = made["time"] - run.log["time"][0]
    if problem.known_load in found:
        made[RATE] = _rate(run.log[problem.known_load], run.log["time"], rows)
    if "output_velocity" in found:
        width = max(SETTINGS.bends * _fastest(problem), TINY)
        made[DIRECTION] = np.tanh(made["output_velocity"] / width)
    if effective_ratio(run.log.facts) is not None and "output_position" in found:
        made[ROUND] = _motor_angle(run, rows)
    past = _past(problem, number)
    return {**made, **{name: values[rows] for name, values in past.items()}}


def _past(problem: Problem, number: int) -> dict[str, Array]:
    """Return what channels of a run were some time ago, (N,) each."""
    if max(len(r) for r in problem.runs) > MOST_ROWS:
        return {}
    kept: dict[Any, Any] = problem.kept
    if (PAST, number) not in kept:
        log = problem.runs[number].log
        values = {name: log[name] for name in _channels(problem)}
        longest = max(float(np.ptp(r.log["time"])) for r in problem.runs)
        lagged = [*LAGGED, problem.known_load or ""]
        kept[PAST, number] = past_of(log["time"], values, lagged, longest)
    return dict(kept[PAST, number])


def _rate(load: Array, time: Array, rows: slice) -> Array:
    """How fast the load changes, by the differences to the rows beside."""
    first, last = max(rows.start - 1, 0), min(rows.stop + 1, len(load))
    slope = np.gradient(load[first:last], time[first:last])
    return np.asarray(slope[rows.start - first : rows.stop - first])


def _fastest(problem: Problem) -> float:
    """The largest speed of all runs."""
    kept: dict[Any, Any] = problem.kept
    if FASTEST not in kept:
        speeds = (run.log["output_velocity"] for run in problem.runs)
        kept[FASTEST] = max(float(max(v.max(), -v.min())) for v in speeds)
    return float(kept[FASTEST])


def _channels(problem: Problem) -> list[str]:
    kept: dict[Any, Any] = problem.kept
    if CHANNELS not in kept:
        kept[CHANNELS] = _usable(problem)
    return list(kept[CHANNELS])


def _usable(problem: Problem) -> list[str]:
    """Channels that all runs have and that change, but for the target's own."""
    hidden = {*HIDDEN[problem.target], *NEVER}
    logs = [run.log for run in problem.runs]
    load = problem.known_load
    return [
        name
        for name in logs[0].channels
        if name not in hidden
        and (name != "reference_torque" or load == name)
        and all(name in log and np.isfinite(log[name]).all() for log in logs)
        and any(np.ptp(log[name]) > 0.0 for log in logs)
    ]


def _motor_angle(run: Run, rows: slice) -> Array:
    if "motor_position" in run.log:
        return run.log["motor_position"][rows]
    ratio = effective_ratio(run.log.facts) or 1.0
    return np.asarray(ratio * run.log["output_position"][rows])
