"""Where an effect acts, in a few words: the part of the runs that holds most of it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexspline.discovery.sheet import Sheet
from flexspline.discovery.stretches import edges_of
from flexspline.discovery.working import Working
from flexspline.effects import Effect
from flexspline.fit.problem import Problem

__all__ = ["contribution", "where"]

Array = NDArray[np.float64]

HOLDS = 0.8  # of its squares that the place holds
NARROW = 0.6  # of the rows that the place has at most
SIDES = 0.15  # of the squares that the smaller direction has at least, to be in both
COVARIATES = (
    ("output_velocity", "rad/s", "speed", True),
    ("known_load", "Nm", "load", True),
    ("temperature", "°C", "temperature", False),
    ("motor_temperature", "°C", "motor temperature", False),
    ("time", "s", "time", False),
)


def contribution(problem: Problem, work: Working, name: str) -> list[Array]:
    """Return what one effect of a model adds to the target, (N,) for each run; NaN elsewhere."""
    ends = np.cumsum([0, *(len(e.terms) for e in work.effects)])
    at = [e.name for e in work.effects].index(name)
    values = np.zeros(len(work.coefficients))
    values[ends[at] : ends[at + 1]] = work.coefficients[ends[at] : ends[at + 1]]
    sheet = Sheet(work.effects, work.coefficients, (), values)
    folds = sum(len(edges_of(problem, number)) - 1 for number in range(len(problem.runs)))
    left = sheet.left_over(problem, [np.empty(0)] * folds)
    return [run.target - rest for run, rest in zip(problem.runs, left, strict=True)]


def where(problem: Problem, effect: Effect, parts: list[Array]) -> str:
    """Return where an effect acts, from what it adds to each run, (N,), NaN where none counts."""
    counted = np.isfinite(np.concatenate(parts))
    values = np.concatenate(parts)[counted]
    squares = (values - (0.0 if effect.name == "offset" else np.median(values))) ** 2
    said = next((s for s in (_place(problem, counted, squares, *c) for c in COVARIATES) if s), "")
    if effect.harmonics:
        turns = ", ".join(str(order) for order, _ in effect.harmonics)
        pair = effect.harmonics[0][1].replace("_", " ")
        ripple = f"order{'s' if len(effect.harmonics) > 1 else ''} {turns} of {pair}"
        said = f"{ripple}, {said}" if said else ripple
    sides = _sides(problem, counted, squares)
    return ", ".join(s for s in (said or "in all parts of the runs", sides) if s)


def _place(
    problem: Problem,
    counted: Array,
    squares: Array,
    channel: str,
    unit: str,
    words: str,
    size: bool,
) -> str:
    """The narrowest end of a channel that holds most of the squares, "" where none is narrow."""
    if not all(channel in run.channels or channel in run.log for run in problem.runs):
        return ""
    values = np.concatenate(
        [run.channels[channel] if channel in run.channels else run.log[channel]
         for run in problem.runs]
    )[counted]  # fmt: skip
    values = np.abs(values) if size else values
    if not np.ptp(values) > 0.0 or not squares.sum() > 0.0:
        return ""
    order = np.argsort(values, kind="stable")
    held = np.cumsum(squares[order]) / squares.sum()
    low = int(np.searchsorted(held, HOLDS))
    high = len(held) - 1 - int(np.searchsorted(held, 1.0 - HOLDS))
    if min(low, high) > NARROW * len(held):
        return ""
    name = "" if channel == "output_velocity" else f"{words} "
    if low <= high:
        return f"{name}below {values[order[min(low, len(order) - 1)]]:.3g} {unit}"
    return f"{name}above {values[order[len(order) - 1 - high]]:.3g} {unit}"


def _sides(problem: Problem, counted: Array, squares: Array) -> str:
    if not all("output_velocity" in run.log for run in problem.runs):
        return ""
    velocity = np.concatenate([run.log["output_velocity"] for run in problem.runs])[counted]
    forward, backward = squares[velocity > 0].sum(), squares[velocity < 0].sum()
    if min(forward, backward) >= SIDES * max(forward + backward, 1e-300):
        return "both directions"
    return "forward" if forward > backward else "backward"
