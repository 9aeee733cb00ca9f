"""Low whole orders of the output, visible only in all runs together.

A run over part of a turn cannot tell order 2 from a trend. Runs that cover the circle together
can, if the ripple stands still on it: one amplitude and phase for all, an offset for each
segment. An order k is claimed where k times the longest covered arc is at least 1.5 turns, or
the circle is closed; lower ones are fitted beside it as unknowns and never named. Power is
compared with a power law over the orders 1 to 40 around its median (noise at low orders is red).

Where runs cover part of a turn each, the low orders of all runs together are few and correlated,
and a floor that allows for red noise makes few of them significant. Those that exceed the median of
the other low orders are listed apart and never counted as found, with an error from leaving out one
run at a time (jackknife: [Efron1982]), which holds for noise of any colour since runs are
independent.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from flexspline.orders.scan import (
    EFFECTIVE,
    Estimate,
    Line,
    Share,
    chance_in_scan,
    combined,
    surprise,
)
from flexspline.orders.spectrum import Stretch

__all__ = ["SCANNED", "TOGETHER", "Faint", "find_faint", "find_low", "less_low", "pooled", "powers"]

SCANNED = 40
TOGETHER = "all runs"
_CYCLES = 1.5
_BINS = 180
_CLOSED = 0.98  # turns: the circle counts as covered
_EDGE = 0.25  # the end of a fitted power law is known a quarter as well as its middle
_KEPT = 0.05  # of its information that an order must keep beside offsets and other orders

_RUNS = 4  # fewer say nothing on how much one differs from the next


def covered_arc(angles: Sequence[NDArray[np.float64]]) -> float:
    """Return the longest arc of the circle that is covered without a gap, in turns (at most 1)."""
    hit = np.zeros(_BINS, dtype=bool)
    for angle in angles:
        hit[(np.mod(angle / (2 * np.pi), 1.0) * _BINS).astype(int) % _BINS] = True
    if hit.all():
        return 1.0
    gaps = np.flatnonzero(~hit)
    return float(np.diff(np.append(gaps, gaps[0] + _BINS)).max() - 1) / _BINS


def find_low(parts: Sequence[Stretch], false_alarm: float) -> tuple[list[Line], list[Estimate]]:
    """Return low lines and their estimates, sought where single stretches see too little."""
    first, last = scanned_low(parts)
    if first > last:
        return [], []
    longest = max(part.turns for part in parts)
    arc = covered_arc([part.angle for part in parts])
    gram, moment, rows = pooled(parts)
    taken, lines = list(range(1, first)), []
    tried = np.arange(first, SCANNED + 1)
    while True:
        power = powers(gram, moment, rows, taken, tried)
        floor, support = _power_law(tried, power)
        x = surprise(power / floor, np.full(len(power), support))
        best = int(np.argmax(x[: last - first + 1]))
        chance = float(chance_in_scan(x[[best]], np.ones(1), float(last - first + 1))[0])
        if chance >= false_alarm or support < 2:
            break
        taken.append(int(tried[best]))
        lines.append(Line(float(tried[best]), chance, 1 / max(arc, longest)))
    levels = [float(floor[int(line.order) - first]) for line in lines]
    return lines, _estimates(gram, moment, rows, taken, lines, levels)


def _power_law(
    order: NDArray[np.intp], power: NDArray[np.float64]
) -> tuple[NDArray[np.float64], float]:
    """Return the floor at each order, and how many orders it is worth (0: not known)."""
    free = np.flatnonzero(power > 0)
    if len(free) < 10:
        return np.ones(len(power)), 0.0
    slope = min(float(stats.theilslopes(np.log(power[free]), np.log(order[free]))[0]), 0.0)
    shape = order.astype(np.float64) ** slope
    level = np.median(power[free] / shape[free]) / np.log(2)
    return level * shape, _EDGE * EFFECTIVE * len(free)


def scanned_low(parts: Sequence[Stretch]) -> tuple[int, int]:
    """Return the first and last low order that may be claimed, (1, 0) where there is none."""
    arc = covered_arc([part.angle for part in parts])
    first = 1 if arc >= _CLOSED else int(np.ceil(_CYCLES / max(arc, 1 / _BINS)))
    last = min(SCANNED, int(10 / max(part.turns for part in parts)))
    return (first, last) if first <= min(last, SCANNED // 4) else (1, 0)


def flat_floor(power: NDArray[np.float64]) -> tuple[float, float]:
    """Return one floor for all low orders, and how many orders it is worth (0: not known)."""
    free = power[power > 0]
    if len(free) < 10:
        return 1.0, 0.0
    return float(np.median(free)) / float(np.log(2)), _EDGE * EFFECTIVE * len(free)


def less_low(
    part: Stretch, lines: Sequence[Line], found: Sequence[Estimate]
) -> NDArray[np.float64]:
    """Return the stretch's values, shape (rows,), less the low lines."""
    rest = part.values.copy()
    for line, estimate in zip(lines, found, strict=True):
        wave = estimate.steady * np.cos(line.order * part.angle - estimate.phase)
        rest -= wave - part.base @ (part.base.T @ wave)
    return rest


def pooled(parts: Sequence[Stretch]) -> tuple[NDArray[np.float64], NDArray[np.float64], int]:
    """Return XᵀX, Xᵀy for orders 1 to 40 less each stretch's mean, and the number of rows."""
    size = 2 * SCANNED
    gram, moment = np.zeros((size, size)), np.zeros(size)
    for part in parts:
        y = part.raw
        total, centred = np.zeros(size), y - y.mean()
        for first in range(0, len(y), 1 << 15):
            turn = part.angle[first : first + (1 << 15), None] * np.arange(1, SCANNED + 1)
            columns = np.concatenate([np.cos(turn), np.sin(turn)], axis=1)
            gram += columns.T @ columns
            moment += columns.T @ centred[first : first + (1 << 15)]
            total += columns.sum(axis=0)
        gram -= np.outer(total, total) / len(y)
    return gram, moment, sum(len(part.raw) for part in parts)


def harmonic_columns(orders: Sequence[int]) -> NDArray[np.intp]:
    """Return where the cosines and the sines of `orders` stand among the pooled columns."""
    cosines = np.asarray(orders, dtype=np.intp) - 1
    return np.concatenate([cosines, cosines + SCANNED])


def powers(
    gram: NDArray[np.float64],
    moment: NDArray[np.float64],
    rows: int,
    taken: Sequence[int],
    tried: NDArray[np.intp],
) -> NDArray[np.float64]:
    """Return half the drop of the squared rest by each tried order beside those taken."""
    base = harmonic_columns(taken)
    known = np.linalg.pinv(gram[np.ix_(base, base)], rcond=1e-6, hermitian=True)
    power = np.zeros(len(tried))
    for i, k in enumerate(tried):
        if int(k) in taken:
            continue
        pair = harmonic_columns([int(k)])
        shared = gram[np.ix_(pair, base)] @ known
        inner = gram[np.ix_(pair, pair)] - shared @ gram[np.ix_(base, pair)]
        rest = moment[pair] - shared @ moment[base]
        if np.linalg.eigvalsh(inner)[0] > _KEPT * rows / 2:
            power[i] = 0.5 * rest @ np.linalg.solve(inner, rest)
    return power


def _estimates(
    gram: NDArray[np.float64],
    moment: NDArray[np.float64],
    rows: int,
    taken: Sequence[int],
    lines: Sequence[Line],
    levels: Sequence[float],
) -> list[Estimate]:
    """Return the joint estimates of `lines`, with their floors."""
    base = harmonic_columns(taken)
    inverse = np.linalg.pinv(gram[np.ix_(base, base)], rcond=1e-6, hermitian=True)
    weight = inverse @ moment[base]
    found = []
    for line, level in zip(lines, levels, strict=True):
        i = list(taken).index(int(line.order))
        pair = np.array([i, i + len(taken)])
        found.append(
            combined(
                [
                    Share(
                        TOGETHER,
                        float("nan"),
                        rows,
                        weight[pair],
                        level * inverse[np.ix_(pair, pair)],
                    )
                ]
            )
        )
    return found


@dataclass(frozen=True)
class Faint:
    """A whole order per output turn with amplitude and its standard error [unit]."""

    order: int
    amplitude: float
    error: float


def find_faint(
    parts: Sequence[Stretch], found: Sequence[float], false_alarm: float
) -> tuple[Faint, ...]:
    """Return low orders that stand out of a flat floor beside those `found` already."""
    first, last = scanned_low(parts)
    runs = [list(group) for _, group in groupby(parts, lambda part: part.run)]
    if first > last or len(runs) < _RUNS:
        return ()
    each = [pooled(run) for run in runs]
    gram = np.sum([e[0] for e in each], axis=0)
    moment = np.sum([e[1] for e in each], axis=0)
    rows = sum(e[2] for e in each)
    taken = [*range(1, first), *(int(k) for k in found if k <= SCANNED and k == int(k))]
    tried = np.arange(first, SCANNED + 1)
    new: list[int] = []
    while True:
        power = powers(gram, moment, rows, taken, tried)
        level, support = flat_floor(power)
        x = surprise(power / level, np.full(len(power), support))
        best = int(np.argmax(x[: last - first + 1]))
        chance = float(chance_in_scan(x[[best]], np.ones(1), float(last - first + 1))[0])
        if chance >= false_alarm or support < 2:
            break
        new.append(int(tried[best]))
        taken.append(new[-1])
    return tuple(_jackknifed(each, taken, order) for order in sorted(new))


def _jackknifed(
    each: Sequence[tuple[NDArray[np.float64], NDArray[np.float64], int]],
    taken: Sequence[int],
    order: int,
) -> Faint:
    """Return `order` fitted beside `taken`, its error from leaving out one run at a time."""
    base = harmonic_columns(taken)
    at = [list(taken).index(order), list(taken).index(order) + len(taken)]
    grams, moments = np.array([e[0] for e in each]), np.array([e[1] for e in each])

    def fitted(kept: NDArray[np.bool_]) -> NDArray[np.float64]:
        gram = grams[kept].sum(axis=0)[np.ix_(base, base)]
        inverse = np.linalg.pinv(gram, rcond=1e-6, hermitian=True)
        return np.asarray((inverse @ moments[kept].sum(axis=0)[base])[at])

    runs = len(each)
    whole = fitted(np.ones(runs, dtype=bool))
    less_one = np.array([fitted(np.arange(runs) != run) for run in range(runs)])
    spread = less_one - less_one.mean(axis=0)
    amplitude = float(np.hypot(*whole))
    along = spread @ whole / max(amplitude, 1e-300)
    return Faint(order, amplitude, float(np.sqrt((runs - 1) / runs * np.sum(along**2))))
