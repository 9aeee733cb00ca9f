"""Orders of what turns, as something that a residual may depend on.

Orders are found in the residual by `flexspline.orders` (noise alone names one in a hundred
logs). What they explain is a cosine and a sine for each order, direction by direction.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexspline.comparison.rows import Rows
from flexspline.comparison.runs import Compared
from flexspline.errors import InputError
from flexspline.orders import FoundOrder, OrderAnalysis, find_orders
from flexspline.orders.parts import output_angle

__all__ = ["Turning", "turning_of"]

Array = NDArray[np.float64]

SEARCHED_ROWS = 150_000
MOST_ORDERS = 12
FALSE_ALARM = 0.01
CELLS = 1e4  # orders that a search looks at: what is left of one has to stand out of as many
_CHUNK = 1 << 16


@dataclass(frozen=True, eq=False)
class Turning:
    """The angle of the output (N,), rad, and the orders found, or why there are none."""

    angle: Array
    direction: NDArray[np.int8]
    analysis: OrderAnalysis | None
    why_not: str

    @property
    def found(self) -> tuple[FoundOrder, ...]:
        """The largest orders."""
        return () if self.analysis is None else self.analysis.found[:MOST_ORDERS]

    def explained(self, rest: Array) -> tuple[Array, Array]:
        """Return what the orders explain of `rest`, (N,), and their amplitudes (orders,)."""
        orders = np.array([order.per_output_turn for order in self.found])
        made, power = np.zeros(len(rest)), np.zeros(len(orders))
        for way in (1, 2):
            rows = np.flatnonzero(self.direction == way)
            if len(rows) < 4 * len(orders) + 8:
                continue
            weights = self._weights(orders, rows, rest)
            for part in np.array_split(rows, -(-len(rows) // _CHUNK)):
                made[part] = self._columns(orders, part) @ weights
            power += len(rows) / len(rest) * (weights.reshape(-1, 2) ** 2).sum(axis=1)
        return made, np.sqrt(power)

    def chance(self, amplitudes: Array) -> float:
        """Return the probability that noise alone leaves any order as large as these."""
        errors = np.array([max(order.error, 1e-300) for order in self.found])
        surprise = float(np.max(0.5 * (amplitudes / errors) ** 2))
        return min(1.0, CELLS * float(np.exp(-surprise)))

    def _weights(self, orders: Array, rows: NDArray[np.intp], rest: Array) -> Array:
        gram, moment = np.zeros((2 * len(orders),) * 2), np.zeros(2 * len(orders))
        for part in np.array_split(rows, -(-len(rows) // _CHUNK)):
            columns = self._columns(orders, part)
            gram += columns.T @ columns
            moment += columns.T @ rest[part]
        return np.asarray(np.linalg.lstsq(gram, moment, rcond=1e-9)[0])

    def _columns(self, orders: Array, rows: NDArray[np.intp]) -> Array:
        phase = self.angle[rows, None] * orders
        return np.stack([np.cos(phase), np.sin(phase)], axis=2).reshape(len(rows), -1)


def turning_of(compared: Compared, rows: Rows, rest: Array) -> Turning:
    """Find the orders in `rest`, (N,), of at most `SEARCHED_ROWS` rows in the middle of runs."""
    logs = [run.log for run in compared.runs]
    sides = ("output_position", "motor_position")
    if not all(any(side in log for side in sides) for log in logs):
        return _none(rows, "the runs hold no angle")
    try:
        angle = rows.column(compared, lambda run, k: output_angle(run.log))
        values = _searched(compared, rows, rest)
        analysis = find_orders(logs, values, false_alarm=FALSE_ALARM, unit=compared.unit)
    except InputError as error:
        return _none(rows, str(error))
    return Turning(angle, rows.direction, analysis, "")


def _none(rows: Rows, why: str) -> Turning:
    return Turning(np.zeros(len(rows)), rows.direction, None, why)


def _searched(compared: Compared, rows: Rows, rest: Array) -> list[Array]:
    """Values of each run; NaN on rows that do not count or are too many."""
    share = min(1.0, SEARCHED_ROWS / len(rows))
    found, first = [], 0
    for run, keep in zip(compared.runs, rows.counts, strict=True):
        at = np.flatnonzero(keep)
        skipped = round(0.5 * (1.0 - share) * len(at))
        values = np.full(len(run.log), np.nan)
        inside = at[skipped : len(at) - skipped]
        values[inside] = rest[first + skipped : first + len(at) - skipped]
        found.append(values)
        first += len(at)
    return found
