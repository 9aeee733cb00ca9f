"""The orders of a joint's ripple, found and named.

What `find_orders` returns: prints as a table, draws itself and is plain data.
"""

from __future__ import annotations

import html
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flexspline.orders.faint import Faint
from flexspline.orders.joint import Share
from flexspline.orders.spectrum import OrderSpectrum

if TYPE_CHECKING:
    import pandas
    from matplotlib.axes import Axes

__all__ = ["FoundOrder", "OrderAnalysis"]

_HEADINGS = (
    "per output turn",
    "order of pair",
    "amplitude",
    "steady part",
    "phase",
    "SNR",
    "false alarm",
    "label",
    "effect",
    "or",
)


@dataclass(frozen=True)
class FoundOrder:
    """One order of ripple.

    Attributes
    ----------
    order : int or float
        Order of `pair`, whole where it could be; else per output turn.
    pair : str
        The parts that turn against each other; "" where no known pair turns at a whole order.
    per_output_turn, resolution : float
        Order per output turn; two orders nearer than `resolution` cannot be told apart.
    amplitude, error : float
        Root mean square over the runs of the amplitude, and its standard error [unit].
    steady, phase, phase_error : float
        Amplitude [unit] of the part that keeps its phase, steady · cos(order · q - phase), with
        q the angle of the output [rad]; phase [rad].
    snr : float
        Amplitude over its standard error.
    chance : float
        Probability that noise alone gives such a peak anywhere in the scan.
    label, effect : str
        What turns, in words; the effect that owns the order, "" for none.
    aliases : tuple of str
        What else turns within the resolution.
    shares : tuple of Share
        Amplitude in each stretch of each run, with its speed.
    """

    order: int | float
    pair: str
    per_output_turn: float
    resolution: float
    amplitude: float
    error: float
    steady: float
    phase: float
    phase_error: float
    snr: float
    chance: float
    label: str
    effect: str
    aliases: tuple[str, ...]
    shares: tuple[Share, ...]


@dataclass(frozen=True, repr=False)
class OrderAnalysis:
    """Orders found in runs of one joint, the largest first.

    `found` are the orders, `faint` low orders of the output that stand out but are not certain
    (never part of `found`; see `orders/faint.py`), `unit` and `channel` what was looked at,
    `false_alarm` the probability that noise alone yields any, `scanned` the lowest and highest
    order per output turn, `runs` how many, `spectrum` what the plot shows.
    """

    found: tuple[FoundOrder, ...]
    faint: tuple[Faint, ...]
    channel: str
    unit: str
    false_alarm: float
    scanned: tuple[float, float]
    runs: int
    spectrum: OrderSpectrum

    def __iter__(self) -> Iterator[FoundOrder]:
        return iter(self.found)

    def __len__(self) -> int:
        return len(self.found)

    def orders_for(self, effect: str, pair: str | None = None) -> list[int]:
        """Return the whole orders, ascending, that `effect` owns, counted per turn of their pair.

        With `pair` only those of that pair of parts.
        """
        return sorted(
            {
                found.order
                for found in self.found
                if found.effect == effect
                and isinstance(found.order, int)
                and (pair is None or found.pair == pair)
            }
        )

    def to_frame(self) -> pandas.DataFrame:
        """Return a pandas table with a row for each order; units as in `FoundOrder`."""
        import pandas

        names = [name for name in FoundOrder.__dataclass_fields__ if name != "shares"]
        rows = [[getattr(found, name) for name in names] for found in self.found]
        return pandas.DataFrame(rows, columns=names)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the amplitude over orders per output turn, the orders found marked."""
        ax = self.spectrum.plot(ax)
        for number, found in enumerate(self.found):
            ax.plot(found.per_output_turn, found.amplitude, "v", color="C3", markersize=4)
            if number < 15:
                ax.annotate(
                    f"{found.per_output_turn:.6g}",
                    (found.per_output_turn, found.amplitude),
                    (0, 5),
                    textcoords="offset points",
                    fontsize=8,
                    rotation=60,
                )
        highest = max((found.amplitude for found in self.found), default=0.0)
        ax.set_ylim(0, 1.2 * max(ax.get_ylim()[1], highest))
        ax.set_title(
            f"{len(self.found)} orders found in {self.runs} run{'' if self.runs == 1 else 's'}"
        )
        return ax

    def __repr__(self) -> str:
        return f"<OrderAnalysis of {self.channel}: {len(self.found)} orders>"

    def __str__(self) -> str:
        if not self.found:
            return "\n".join([self._title(), *self._doubtful()])
        table = [_HEADINGS, *self._cells()]
        width = [max(len(row[i]) for row in table) for i in range(len(_HEADINGS))]
        right = {0, 1, 5}
        lines = [
            "  ".join(
                cell.rjust(width[i]) if i in right else cell.ljust(width[i])
                for i, cell in enumerate(row)
            ).rstrip()
            for row in table
        ]
        return "\n".join([self._title(), *lines, *self._doubtful()])

    def _repr_html_(self) -> str:
        def row(cells: Sequence[str], tag: str) -> str:
            return "<tr>" + "".join(f"<{tag}>{html.escape(c)}</{tag}>" for c in cells) + "</tr>"

        body = "".join(row(cells, "td") for cells in self._cells())
        notes = "".join(f"<p>{html.escape(sentence)}</p>" for sentence in self._doubtful())
        head = row(_HEADINGS, "th") if self.found else ""
        return f"<div><b>{html.escape(self._title())}</b><table>{head}{body}</table>{notes}</div>"

    def _title(self) -> str:
        low, high = self.scanned
        count = f"{len(self.found) or 'no'} order{'' if len(self.found) == 1 else 's'}"
        return (
            f"{self.channel} [{self.unit or '1'}]: {count} found between {low:.3g} and "
            f"{high:.6g} per output turn in {self.runs} run{'' if self.runs == 1 else 's'} "
            f"(noise alone names one in {self.false_alarm:.2g} of cases at most)"
        )

    def _doubtful(self) -> list[str]:
        if not self.faint:
            return []
        each = "; ".join(
            f"{f.order} ({_rounded(f.amplitude, f.error, self.unit)})" for f in self.faint
        )
        return [
            f"not certain, but out of the other low orders per output turn: {each}; "
            "runs over full turns would tell"
        ]

    def _cells(self) -> list[tuple[str, ...]]:
        return [
            (
                f"{f.per_output_turn:.6g}",
                f"{f.order:.6g}",
                _rounded(f.amplitude, f.error, self.unit),
                _rounded(f.steady, f.error, self.unit),
                f"{f.phase:+.2f} ± {f.phase_error:.2f} rad",
                f"{f.snr:.1f}",
                f"{max(f.chance, 1e-99):.0e}",
                f.label,
                f.effect or "–",
                "; ".join(f.aliases[:2]),
            )
            for f in self.found
        ]


def _rounded(value: float, error: float, unit: str) -> str:
    digits = max(0, 1 - int(np.floor(np.log10(error)))) if error > 0 else 3
    return f"{value:.{digits}f} ± {error:.{digits}f} {unit}".rstrip()
