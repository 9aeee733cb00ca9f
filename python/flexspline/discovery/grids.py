"""Where a shape may lie in these runs: a few values to screen, spread over what the data show.

A Stribeck speed lies among the speeds of the runs, the width of a loop among its turns, a time
constant between two samples and half a run, a resonance among the orders times the speeds. Where
nothing tells, the bounds of the catalogue do.
"""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexspline.discovery.settings import SETTINGS
from flexspline.effects import Effect, ShapeInfo
from flexspline.fit.problem import Problem

__all__ = ["shaped"]

Array = NDArray[np.float64]

SHARED = ("direction_width", "mesh_shape")
"""One for the whole model: what the model has is taken."""

SEEN = (0.5, 2.0)  # of an order's largest frequency: a resonance beyond bends nothing that is seen
UNIT_CHANNELS = {
    "rad/s": ("output_velocity",),
    "Nm": ("known_load",),
    "rad": ("output_position", "motor_position"),
}


def shaped(effect: Effect, model: tuple[Effect, ...], problem: Problem) -> list[Effect]:
    """Return the effect with each combination of shapes that is worth screening."""
    known = {name: e.shapes[name] for e in model for name in SHARED if name in e.shapes}
    own = {name: value for name, value in known.items() if name in effect.shapes}
    effect = effect.with_shapes(**own)
    free = [s for s in effect.fitted_shapes if s.name not in own]
    count = max(SETTINGS.points - 2 * max(len(free) - 1, 0), 2)
    grids = [_grid(effect, shape, problem, count) for shape in free]
    names = [shape.name for shape in free]
    return [
        effect.with_shapes(**dict(zip(names, values, strict=True))) for values in product(*grids)
    ]


def _grid(effect: Effect, shape: ShapeInfo, problem: Problem, count: int) -> list[float]:
    kept: dict[Any, Any] = problem.kept  # a long log is read once for a range
    key = ("range", effect.name, effect.reads, effect.harmonics, shape.name)
    if key not in kept:
        kept[key] = _range(effect, shape, problem)
    low, high = kept[key]
    low, high = max(low, shape.lower), min(high, shape.upper)
    if not low < high:
        return [float(np.clip(shape.default, shape.lower, shape.upper))]
    inside = np.clip(np.geomspace(low, high, count), shape.lower, shape.upper)
    return [float(value) for value in inside]


def _range(effect: Effect, shape: ShapeInfo, problem: Problem) -> tuple[float, float]:
    if shape.unit == "s":
        step = min(1.0 / run.log.rate for run in problem.runs)
        return 2.0 * step, 0.5 * max(run.log.duration for run in problem.runs)
    wanted = UNIT_CHANNELS.get(shape.unit, ())
    reads = ("known_load" if name == "load" else name for name in effect.reads)
    for name in (name for name in reads if name in wanted):
        found = [run.channels[name] for run in problem.runs if name in run.channels]
        sizes = [_size(values, shape.unit) for values in found]
        if sizes and max(sizes) > 0.0:
            if effect.ripple:
                return _resonance(effect, max(sizes))
            return 0.5 * SETTINGS.negligible * max(sizes), max(sizes)
    return shape.lower, shape.upper


def _resonance(effect: Effect, speed: float) -> tuple[float, float]:
    """Where a resonance bends one of the orders at one of the speeds, in order × rad/s."""
    orders = [order for order, _ in effect.harmonics] or [1]
    return SEEN[0] * min(orders) * speed, SEEN[1] * max(orders) * speed


def _size(values: Array, unit: str) -> float:
    """The largest without the outermost per cent; of angles half the way from end to end."""
    if unit != "rad":
        return float(np.quantile(np.abs(values), 1.0 - 0.5 * SETTINGS.negligible))
    low, high = np.quantile(values, (0.5 * SETTINGS.negligible, 1.0 - 0.5 * SETTINGS.negligible))
    return float(max(high - low, 0.0)) / 2.0
