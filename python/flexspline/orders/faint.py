"""Low orders of the output that stand out, but not beyond doubt.

Where runs cover part of a turn each, the low orders of all runs together are few and not
alike, and a floor that allows for red noise leaves little certain. What stands out of the
median of the other low orders is still worth seeing. It is listed apart, never counted as
found, with an error from leaving out one run at a time (jackknife: [Efron1982]), which holds
for noise of any colour since runs are independent.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from flexspline.orders.floor import chance_in_scan, surprise
from flexspline.orders.low import (
    SCANNED,
    flat_floor,
    harmonic_columns,
    pooled,
    powers,
    scanned_low,
)
from flexspline.orders.stretches import Stretch

__all__ = ["Faint", "find_faint"]

_RUNS = 4  # fewer say nothing on how much one differs from the next


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
