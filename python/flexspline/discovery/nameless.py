"""Functions without a name: what any smooth dependence on a channel, or on two, would explain.

A cause that is not in the catalogue still depends on something measured. Functions of each channel,
and of every two, stand for it: a few powers, which need little evidence, and hats (their products
for two), which follow every smooth function; a channel times every function of another; orders of
the motor's angle, one by one and together; and what a channel was some time ago (`past.py`). What
they explain on left-out folds beyond the named effects is "unexplained", and the channels are those
it depends on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexspline.discovery.past import names_of_past
from flexspline.discovery.settings import SETTINGS, TINY
from flexspline.discovery.values import DIRECTION, RATE, ROUND, values_of
from flexspline.fit.problem import Problem

__all__ = ["Nameless", "channel_told", "columns_of", "nameless_of"]

Array = NDArray[np.float64]
Values = Mapping[str, Array]
Basis = Callable[[Values], Array]

TURN = 2.0 * np.pi
POWERS = tuple((power,) for power in range(1, SETTINGS.tried))
CROSSED = ((1, 1), (2, 1), (1, 2))
NAMELESS = "nameless"  # what a problem keeps of it
TOLD = {ROUND: "motor_position", DIRECTION: "output_velocity"}


@dataclass(frozen=True)
class Nameless:
    """Functions of some channels: `columns` makes them, (N, C), from the values of these."""

    channels: tuple[str, ...]
    columns: Basis
    count: int


def channel_told(name: str, known_load: str | None) -> str:
    """Return the channel of a log behind one that is made of it."""
    return known_load or "" if name == RATE else TOLD.get(name, name)


def nameless_of(problem: Problem, *, pairs: bool = True) -> list[Nameless]:
    """Return functions of every channel that all runs have, and of every two."""
    kept: dict[Any, Any] = problem.kept
    if NAMELESS not in kept:
        kept[NAMELESS] = _nameless(_sample(problem))
    alone, crossed = kept[NAMELESS]
    return [*alone, *crossed] if pairs else [*alone]


def _nameless(sample: Values) -> tuple[list[Nameless], list[Nameless]]:
    """All functions of every channel; and few of every channel and of every two."""
    past = [name for name in sample if names_of_past(name)[0] in sample]
    gone = {late for name in past for late in names_of_past(name)}
    sample = {name: values for name, values in sample.items() if name not in gone}
    alone = [Nameless((name,), *_fine(sample, name)) for name in sample if name != DIRECTION]
    alone += [_memory(name) for name in past]
    straight = [name for name in sample if name not in (ROUND, DIRECTION)]
    made = [_powers(sample, (name,), POWERS) for name in straight]
    scaled = [name for name in sample if name not in (ROUND, "time")]
    made += [_powers(sample, both, CROSSED) for both in combinations(scaled, 2)]
    if ROUND in sample:
        made += [_waves(sample, name) for name in scaled]
        made += [Nameless((ROUND,), _turning(ROUND, [k]), 2) for k in range(1, SETTINGS.lines + 1)]
    for name in (name for name in straight if name not in ("time", RATE)):
        made += [_varying(sample, name, other) for other in scaled if other != name]
    few = SETTINGS.tried + 1
    coarse = {name: _hats_of(sample, name, few) for name in straight if name != "time"}
    return alone, made + [
        Nameless((a, b), _product(coarse[a][0], coarse[b][0]), coarse[a][1] * coarse[b][1])
        for a, b in combinations(coarse, 2)
    ]


def _sample(problem: Problem) -> dict[str, Array]:
    """Every fourth row of all runs, made a window at a time."""
    made = [
        {name: v[:: SETTINGS.tried] for name, v in values_of(problem, number, rows).items()}
        for number, run in enumerate(problem.runs)
        for rows in windows(len(run), SETTINGS.tried * SETTINGS.rows)
    ]
    return {name: np.concatenate([values[name] for values in made]) for name in made[0]}


def windows(size: int, step: int) -> Iterator[slice]:
    """Cut rows [0, size)."""
    return (slice(first, min(first + step, size)) for first in range(0, size, step))


def _fine(sample: Values, name: str) -> tuple[Basis, int]:
    """All functions of one channel: periodic over a turn of an angle that turns, else hats."""
    if name == ROUND:
        return _turning(name, range(1, SETTINGS.functions + 1)), 2 * SETTINGS.functions
    if name == "output_position" and np.ptp(sample[name]) > TURN:
        return _turning(name, range(1, SETTINGS.functions // 2 + 1)), SETTINGS.functions
    return _hats_of(sample, name, SETTINGS.functions)


def _hats_of(sample: Values, name: str, count: int) -> tuple[Basis, int]:
    knots = _knots(sample[name], count, name in ("output_velocity", RATE))
    return (lambda values: _hats(values[name], knots)), len(knots)


def _powers(
    sample: Values, names: tuple[str, ...], exponents: Sequence[tuple[int, ...]]
) -> Nameless:
    """Products of powers of channels, each counted from its middle in its own spread."""
    scales = [_scale(sample[name], name) for name in names]

    def columns(values: Values) -> Array:
        parts = [
            (values[name] - middle) / spread
            for name, (middle, spread) in zip(names, scales, strict=True)
        ]
        made = [
            np.prod([part**power for part, power in zip(parts, powers, strict=True)], axis=0)
            for powers in exponents
        ]
        return np.column_stack(made)

    return Nameless(names, columns, len(exponents))


def _waves(sample: Values, name: str) -> Nameless:
    """Low orders of the motor's angle that grow with a channel."""
    middle, spread = _scale(sample[name], name)
    turning = _turning(ROUND, range(1, SETTINGS.tried + 1))

    def columns(values: Values) -> Array:
        return np.asarray(turning(values) * ((values[name] - middle) / spread)[:, None])

    return Nameless((ROUND, name), columns, 2 * SETTINGS.tried)


def _memory(name: str) -> Nameless:
    """What a channel is and was: itself and behind each lag."""
    names = [name, *names_of_past(name)]
    return Nameless((name,), lambda values: np.column_stack([values[n] for n in names]), len(names))


def _varying(sample: Values, name: str, other: str) -> Nameless:
    """A channel times every function of another: a coefficient that varies with it."""
    hats, count = _hats_of(sample, name, SETTINGS.functions)
    middle, spread = _scale(sample[other], other)

    def columns(values: Values) -> Array:
        return np.asarray(hats(values) * ((values[other] - middle) / spread)[:, None])

    return Nameless((name, other), columns, count)


def _scale(values: Array, name: str) -> tuple[float, float]:
    """Middle and spread; what has a sign counts from zero."""
    signed = name in ("output_velocity", "output_acceleration", RATE, DIRECTION)
    low, high = np.quantile(values, (SETTINGS.negligible, 1.0 - SETTINGS.negligible))
    middle = 0.0 if signed else 0.5 * float(low + high)
    return middle, max(float(np.abs(values - middle).max()), TINY)


def _knots(values: Array, count: int, both_ways: bool) -> Array:
    """Between the quantiles of the values; of a velocity, the same on both sides of zero."""
    if both_ways:
        inside = np.linspace(SETTINGS.little, 1.0 - SETTINGS.negligible, count // 2)
        speeds = np.quantile(np.abs(values), inside)
        knots = np.concatenate([-speeds[::-1], [0.0], speeds])
    else:
        inside = np.linspace(SETTINGS.negligible, 1.0 - SETTINGS.negligible, count)
        knots = np.quantile(values, inside)
    least = SETTINGS.little * SETTINGS.negligible * float(knots[-1] - knots[0])
    return np.asarray(knots[np.concatenate([[True], np.diff(knots) > least])])


def _hats(values: Array, knots: Array) -> Array:
    """Piecewise linear functions, one at each knot, constant beyond the ends: (N, knots)."""
    hats = np.zeros((len(values), len(knots)), order="F")
    if len(knots) == 1:
        hats[:] = 1.0
        return hats
    at = np.clip(np.searchsorted(knots, values, side="right") - 1, 0, len(knots) - 2)
    share = np.clip((values - knots[at]) / np.diff(knots)[at], 0.0, 1.0)
    rows = np.arange(len(values))
    hats[rows, at], hats[rows, at + 1] = 1.0 - share, share
    return hats


def _turning(name: str, orders: Sequence[int]) -> Basis:
    """Cosines and sines of an angle, (N, 2 orders)."""
    numbers = np.array(orders)

    def columns(values: Values) -> Array:
        phase = numbers[:, None] * values[name]
        return np.concatenate([np.cos(phase), np.sin(phase)]).T

    return columns


def _product(first: Basis, second: Basis) -> Basis:
    def columns(values: Values) -> Array:
        a, b = first(values), second(values)
        made = np.empty((len(a), a.shape[1] * b.shape[1]), order="F")
        for k, column in enumerate(a.T):
            np.multiply(column[:, None], b, out=made[:, k * b.shape[1] : (k + 1) * b.shape[1]])
        return made

    return columns


def columns_of(groups: Sequence[Nameless], problem: Problem, number: int) -> Array:
    """Columns of all groups of a run, filtered as the target is, (N, C)."""
    run = problem.runs[number]
    values = values_of(problem, number, slice(0, len(run))) if groups else {}
    made = [group.columns(values) for group in groups] or [np.empty((len(run), 0))]
    return problem.smooth(run, np.column_stack(made))
