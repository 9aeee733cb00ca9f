"""Scan of the orders of all stretches, lines taken out as they are found.

Each round looks at what is left of the values: the power over the local floor is summed over
the stretches as it is (a ripple whose phase changes with speed) and with phases (one that does
not). Of the surprising peaks those with the most power become lines, all lines are fitted
together with the smooth part, and the rest is scanned again until nothing stands out: a strong
order's leakage over part of a turn, gone with it, is not named. Surprise says whether something
is there; it cannot say where, because it compares with what lies beside, which a side lobe too
has far above it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexspline.orders.floor import (
    NEIGHBOURS,
    Floor,
    block_floor,
    chance_in_scan,
    neighbours,
    surprise,
)
from flexspline.orders.stretches import Stretch
from flexspline.orders.transform import fourier_sums

__all__ = ["Line", "Round", "find_lines", "normal_equations", "scan", "visible"]

_CHUNK = 1 << 15
_MOST = 200  # lines; more are not ripple


@dataclass(frozen=True)
class Line:
    """An order per output turn, its false-alarm probability, and the resolution there."""

    order: float
    chance: float
    resolution: float


@dataclass(frozen=True)
class Round:
    """What one scan saw, over `order`: the two statistics, their shapes and the sharpest span.

    `power`, `steady`: over the block floors alone, summed as it is and with phases.
    """

    order: NDArray[np.float64]
    summed: NDArray[np.float64]
    seen: NDArray[np.float64]
    coherent: NDArray[np.float64]
    turns: NDArray[np.float64]
    power: NDArray[np.float64]
    steady: NDArray[np.float64]
    floors: list[Floor | None]


def scan(
    parts: Sequence[Stretch],
    rest: Sequence[NDArray[np.float64]],
    turns: int,
    highest: float,
    lines: Sequence[float],
) -> Round:
    """Return the statistics of one round over orders k = 0, 1/turns, … `highest`."""
    order = np.arange(int(np.floor(highest * turns + 1e-9)) + 1) / turns
    summed, seen, span, total = np.zeros((4, len(order)))
    phasor, spread, support = np.zeros(len(order), complex), *np.zeros((2, len(order)))
    over_floor, weight = np.zeros(len(order), complex), np.zeros(len(order))
    floors: list[Floor | None] = []
    for part, values in zip(parts, rest, strict=True):
        where = slice(*np.searchsorted(order, [part.lowest, min(part.highest, highest)]))
        k = order[where]
        floor = None
        if len(k) > 2:
            sums = fourier_sums(part.angle, values, turns, highest)[where]
            power = np.abs(sums) ** 2 / len(values)
            floor = block_floor(k, power, part.turns, lines)
        floors.append(floor)
        if floor is None:
            continue
        level, known = floor.level(k), floor.support(k)
        total[where] += power / level
        over_floor[where] += sums / level
        weight[where] += len(values) / level
        beside = neighbours(power, turns / part.turns)
        known = np.where(beside > level, np.minimum(known, NEIGHBOURS), known)
        level = np.maximum(level, beside)
        summed[where] += surprise(power / level, known)
        seen[where] += 1
        phasor[where] += sums / level
        spread[where] += len(values) / level
        support[where] += known
        span[where] = np.maximum(span[where], part.turns)
    coherent = surprise(np.abs(phasor) ** 2 / np.maximum(spread, 1e-300), np.maximum(support, 1.0))
    steady = np.abs(over_floor) ** 2 / np.maximum(weight, 1e-300)
    return Round(order, summed, seen, coherent, span, total, steady, floors)


def find_lines(
    parts: Sequence[Stretch],
    turns: int,
    highest: float,
    false_alarm: float,
    snap: Callable[[float, float], float],
    known: Sequence[Line] = (),
) -> tuple[list[Line], Round]:
    """Search until nothing stands out; return the lines and the last round.

    Parameters
    ----------
    turns, highest : int, float
        Step (1/turns) and end of the orders scanned.
    false_alarm : float
        Probability that noise alone yields any line.
    snap : callable
        (order, resolution) -> the whole order that it stands for, or the order itself.
    known : sequence of Line
        Lines that the values are free of already, near which nothing is named.
    """
    lines: list[Line] = []
    rest: Sequence[NDArray[np.float64]] = [part.values for part in parts]
    apart = 3 / min(part.turns for part in parts)
    while True:
        seen = scan(parts, rest, turns, highest, [line.order for line in (*known, *lines)])
        new: list[Line] = []
        strongest = 0.0
        for strength, peak in _peaks(seen, false_alarm):
            line = Line(snap(peak.order, peak.resolution), peak.chance, peak.resolution)
            if strength < 0.2 * strongest:
                break
            if _is_new(line, [*known, *lines], 2.0) and _is_new(line, new, apart / line.resolution):
                strongest = strongest or strength
                new.append(line)
        if not new or len(lines) > _MOST:
            return lines, seen
        lines += new
        rest = [without(part, [line.order for line in lines]) for part in parts]


def without(part: Stretch, orders: Sequence[float]) -> NDArray[np.float64]:
    """Return the stretch's values, shape (rows,), less what base and `orders` explain."""
    here = visible(part, orders)
    if not here:
        return part.values
    gram, moment, shared = normal_equations(part, here)
    level = np.trace(gram) / len(gram)
    weight = np.linalg.solve(gram + 1e-6 * level * np.eye(len(gram)), moment)
    rest = part.values + part.base @ (shared @ weight)
    for rows, columns in _harmonics(part, here):
        rest[rows] -= columns @ weight
    return rest


def visible(part: Stretch, orders: Sequence[float]) -> list[float]:
    """Return those of `orders` that the stretch can show."""
    return [k for k in orders if part.lowest <= k <= part.highest]


def normal_equations(
    part: Stretch, orders: Sequence[float]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return XᵀX, Xᵀy and BᵀX: X cosine and sine of each order less its smooth part B.

    Shapes (2 orders, 2 orders), (2 orders,) and (base columns, 2 orders).
    """
    size = 2 * len(orders)
    gram, moment = np.zeros((size, size)), np.zeros(size)
    shared = np.zeros((part.base.shape[1], size))
    for rows, columns in _harmonics(part, orders):
        gram += columns.T @ columns
        moment += columns.T @ part.values[rows]
        shared += part.base[rows].T @ columns
    return gram - shared.T @ shared, moment, shared


def _harmonics(
    part: Stretch, orders: Sequence[float]
) -> Iterator[tuple[slice, NDArray[np.float64]]]:
    """Yield chunks of rows with columns cos k_1 q, sin k_1 q, cos k_2 q, …"""
    for first in range(0, len(part.angle), _CHUNK):
        rows = slice(first, first + _CHUNK)
        phase = part.angle[rows, None] * np.asarray(orders)
        columns = np.empty((len(phase), 2 * len(orders)))
        columns[:, 0::2], columns[:, 1::2] = np.cos(phase), np.sin(phase)
        yield rows, columns


def _peaks(seen: Round, false_alarm: float) -> list[tuple[float, Line]]:
    """Return significant peaks with their power over the floor, the strongest first."""
    step = seen.order[1] - seen.order[0]
    cells = 2 * step * float(np.sum(seen.turns))  # two statistics
    found: list[tuple[float, Line]] = []
    for x, shape, power in (
        (seen.summed, seen.seen, seen.power),
        (seen.coherent, np.minimum(seen.seen, 1.0), seen.steady),
    ):
        middle = x[1:-1]
        top = (middle >= x[:-2]) & (middle > x[2:]) & (middle > shape[1:-1] + 4)
        at = 1 + np.flatnonzero(top)
        chance = chance_in_scan(x[at], shape[at], cells)
        for i, p in zip(at[chance < false_alarm], chance[chance < false_alarm], strict=True):
            k = _summit(power, int(i), round(0.5 / (seen.turns[i] * step)))
            order = float(seen.order[k] + step * _beside(power, k))
            found.append((float(power[k]), Line(order, float(p), float(1 / seen.turns[i]))))
    return sorted(found, key=lambda peak: -peak[0])


def _summit(power: NDArray[np.float64], at: int, reach: int) -> int:
    """Return where the power is highest within `reach` entries of `at`."""
    first = max(at - reach, 0)
    return first + int(np.argmax(power[first : at + reach + 1]))


def _beside(power: NDArray[np.float64], at: int) -> float:
    """Return by how many entries a parabola's top lies beside `at`."""
    if not 0 < at < len(power) - 1:
        return 0.0
    before, here, after = power[at - 1 : at + 2]
    bend = before - 2 * here + after
    return float(0.5 * (before - after) / bend) if bend < 0 else 0.0


def _is_new(line: Line, known: Sequence[Line], distance: float) -> bool:
    """Whether `line` lies `distance` resolutions or more from every line of `known`."""
    return all(abs(line.order - other.order) >= distance * line.resolution for other in known)
