"""One table of what each way to remove ripple leaves, delays and costs."""

from __future__ import annotations

import html
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from flexspline.formatting.numbers import short
from flexspline.formatting.rows import rows_html, rows_text

if TYPE_CHECKING:
    import pandas

__all__ = ["MethodScore", "RippleComparison"]


@dataclass(frozen=True)
class MethodScore:
    """What one method leaves of the ripple.

    Parameters
    ----------
    name : of the method.
    moving_error, rest_error : RMS of its torque less the true one, in motion and at standstill,
        Nm, less the mean error in motion (a zero).
    orders : amplitude left in motion by order, Nm.
    moving_delay, rest_delay : mean delay of a step of torque, s; infinite where half of the step
        did not come out within the window.
    cost : s per sample, measured on this machine; `operations`: additions and multiplications,
        estimated.
    needs : what it takes beside one bridge and its reading.
    """

    name: str
    moving_error: float
    rest_error: float
    orders: Mapping[int, float]
    moving_delay: float
    rest_delay: float
    cost: float
    operations: float
    needs: str


@dataclass(frozen=True)
class RippleComparison:
    """Scores of all methods on one log; `window`: s behind a step in which delay is measured."""

    scores: tuple[MethodScore, ...]
    window: float

    def __getitem__(self, name: str) -> MethodScore:
        return next(score for score in self.scores if score.name == name)

    def to_frame(self) -> pandas.DataFrame:
        """Return the scores in SI units, by the names of the methods."""
        import pandas

        data = [
            {
                **{k: v for k, v in vars(s).items() if k not in ("orders", "name")},
                **{f"order_{order}": size for order, size in s.orders.items()},
            }
            for s in self.scores
        ]
        return pandas.DataFrame(data, index=[s.name for s in self.scores])

    def __str__(self) -> str:
        rows = self._rows()
        return f"{rows_text(rows, left=(0, len(rows[0]) - 1))}\n{self._note()}"

    def to_html(self) -> str:
        """Return the table as HTML."""
        rows = rows_html(self._rows())
        note = html.escape(self._note())
        return f'<table class="scores">{rows}</table><p>{note}</p>'

    def _repr_html_(self) -> str:
        return self.to_html()

    def _note(self) -> str:
        return (
            "left: RMS of torque less the true one; delay: mean of a step's, ∞ where not half of "
            f"it came out within {self.window:g} s"
        )

    def _rows(self) -> list[tuple[str, ...]]:
        orders = list(self.scores[0].orders)
        head = (
            "method",
            "in motion: left [mNm]",
            *(f"order {order} [mNm]" for order in orders),
            "delay [ms]",
            "at standstill: left [mNm]",
            "delay [ms]",
            "cost [ns]",
            "operations",
            "needs",
        )
        return [head, *(self._cells(score) for score in self.scores)]

    def _cells(self, s: MethodScore) -> tuple[str, ...]:
        return (
            s.name,
            short(1e3 * s.moving_error),
            *(short(1e3 * size) for size in s.orders.values()),
            _milliseconds(s.moving_delay),
            short(1e3 * s.rest_error),
            _milliseconds(s.rest_delay),
            f"{1e9 * s.cost:.0f}",
            f"{s.operations:.0f}",
            s.needs,
        )


def _milliseconds(delay: float) -> str:
    if math.isinf(delay):
        return "∞"
    if math.isnan(delay):
        return "–"
    return f"{1e3 * delay + 0.0:.2f}" if abs(delay) >= 5e-6 else "0"
