"""Where an effect acts, in a few words: the part of the runs that holds most of it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from flexspline.discovery.settings import SETTINGS, TINY
from flexspline.discovery.sheet import Sheet
from flexspline.discovery.stretches import edges_of
from flexspline.discovery.working import Working
from flexspline.effects import Effect
from flexspline.fit.problem import Problem
from flexspline.fit.ripple import CORE_PAIRS
from flexspline.orders.parts import Candidate, Pair, owner, pairs

__all__ = ["contribution", "where"]

Array = NDArray[np.float64]

REVERSALS = {
    "coulomb_friction": "a jump at each reversal",
    "presliding_friction": "built up anew after each reversal",
    "torsional_hysteresis": "a loop between reversals",
    "torque_hysteresis": "a loop between reversals of the load",
}
COVARIATES = (
    ("output_velocity", "rad/s", "speed", True),
    ("known_load", "Nm", "load", True),
    ("temperature", "°C", "temperature", False),
    ("motor_temperature", "°C", "motor temperature", False),
    ("time", "s", "time", False),
)
ALWAYS = ("output_velocity", "known_load")  # else of an effect that reads it: all heats up in time


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
    middle = 0.0 if effect.name == "offset" else _middle(problem, counted, values)
    squares = (values - middle) ** 2
    own = [c for c in COVARIATES if c[0] in ALWAYS or c[0] in effect.reads]
    places = (_place(problem, counted, squares, *c) for c in own)
    said = next((place for place in places if place), "")
    ripple = _orders(effect, problem.runs[0].log.facts)
    said = ", ".join(s for s in (ripple, said) if s) or "in all parts of the runs"
    sides, reversals = _sides(problem, counted, squares), REVERSALS.get(effect.name, "")
    return ", ".join(s for s in (said, sides, reversals) if s)


def _middle(problem: Problem, counted: Array, values: Array) -> float:
    """Half way between the directions: friction lies to either side of it, not about its median."""
    medians = [np.median(values[side]) for side in _directions(problem, counted) if side.any()]
    return float(np.mean(medians or [np.median(values)]))


def _orders(effect: Effect, facts: Mapping[str, object]) -> str:
    """Orders of a ripple effect by pair of parts, and what turns where a fact tells it."""
    said = []
    for pair in dict.fromkeys(pair for _, pair in effect.harmonics):
        own = [order for order, of in effect.harmonics if of == pair]
        known = [p for p in pairs(facts) if CORE_PAIRS[p.name] == pair][:1]
        words = [_told(order, p, facts) for order in own for p in known]
        told = "; ".join(word for word in words if word)
        said.append(
            f"order{'s' if len(own) > 1 else ''} {', '.join(map(str, own))} of "
            + pair.replace("_", " ")
            + (f" ({told})" if told else "")
        )
    return ", ".join(said)


def _told(order: int, pair: Pair, facts: Mapping[str, object]) -> str:
    """What has this order by the pole pairs or slots of the motor, "" where nothing known does."""
    _, words = owner(Candidate(order, pair, order * pair.turns), facts, alone=False)
    known = any(fact in words for fact in ("pole pairs", "slots"))
    return f"{order} is {words}" if known else ""


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
    low = int(np.searchsorted(held, SETTINGS.most))
    high = len(held) - 1 - int(np.searchsorted(held, 1.0 - SETTINGS.most))
    if min(low, high) > 0.5 * len(held):
        return ""
    name = "" if channel == "output_velocity" else f"{words} "
    if low <= high:
        return f"{name}below {values[order[min(low, len(order) - 1)]]:.3g} {unit}"
    return f"{name}above {values[order[len(order) - 1 - high]]:.3g} {unit}"


def _sides(problem: Problem, counted: Array, squares: Array) -> str:
    sides = _directions(problem, counted)
    if not sides:
        return ""
    forward, backward = (float(squares[side].sum()) for side in sides)
    if min(forward, backward) >= SETTINGS.little * max(forward + backward, TINY):
        return "both directions"
    return "forward" if forward > backward else "backward"


def _directions(problem: Problem, counted: Array) -> list[NDArray[np.bool_]]:
    """Which of the rows that count move forward and which backward; none without a velocity."""
    if not all("output_velocity" in run.log for run in problem.runs):
        return []
    velocity = np.concatenate([run.log["output_velocity"] for run in problem.runs])[counted]
    return [velocity > 0.0, velocity < 0.0]
