"""`find_orders`: the orders of a joint's ripple, searched for and named, and its result.

The result prints as a table, draws itself and is plain data.
"""

from __future__ import annotations

import html
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from flexspline.errors import InputError
from flexspline.formatting import rows_html, rows_text
from flexspline.logs import Log
from flexspline.logs.read import as_logs
from flexspline.orders.low import Faint, find_faint, find_low, less_low
from flexspline.orders.parts import Candidate, Pair, candidates, effective_ratio, owner
from flexspline.orders.parts import pairs as known_pairs
from flexspline.orders.scan import Estimate, Line, Share, estimates, find_lines
from flexspline.orders.spectrum import LONGEST, OrderSpectrum, order_spectrum, step_turns
from flexspline.orders.stretches import Values, chosen_values, stretches

if TYPE_CHECKING:
    import pandas
    from matplotlib.axes import Axes

__all__ = [
    "FoundOrder",
    "OrderAnalysis",
    "find_orders",
]

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

_CLEAR = 2.0  # standard errors that an order must keep once all are fitted together


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
        Order per output turn; two orders nearer than `resolution` are indistinguishable.
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
    (never part of `found`; see `orders/low.py`), `unit` and `channel` what was looked at,
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
        right = {0, 1, 5}
        left = {*range(len(_HEADINGS))} - right
        table = rows_text([_HEADINGS, *self._cells()], left)
        return "\n".join([self._title(), table, *self._doubtful()])

    def _repr_html_(self) -> str:
        rows = rows_html([_HEADINGS, *self._cells()]) if self.found else ""
        notes = "".join(f"<p>{html.escape(sentence)}</p>" for sentence in self._doubtful())
        return f"<div><b>{html.escape(self._title())}</b><table>{rows}</table>{notes}</div>"

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


def find_orders(
    logs: Log | Sequence[Log],
    values: Values,
    *,
    pairs: Sequence[Pair] | None = None,
    max_order: float | None = None,
    false_alarm: float = 0.01,
    unit: str | None = None,
) -> OrderAnalysis:
    """Find the orders at which something turns with the joint, and name them.

    Parameters
    ----------
    logs : Log or sequence of Log
        Runs of one joint with `output_position` or `motor_position`; samples need not be even.
    values : str, callable or sequence of arrays
        A channel, a function of a log, or one array of shape (rows,) for each log; NaN rows
        are left out.
    pairs : sequence of Pair, optional
        Pairs of parts that may own an order; default `flexspline.orders.pairs` of the log.
    max_order : float, optional
        Highest order per output turn; default 50 Ñ, at most 10 000 and what the rate shows.
    false_alarm : float
        Probability that logs of noise alone, of any colour, yield any order.
    unit : str, optional
        Unit of `values`; a channel knows its own.

    Returns
    -------
    OrderAnalysis

    Raises
    ------
    InputError
        Where no log is given, values do not fit, no run moves, or an option is out of range.

    Notes
    -----
    Runs are cut by direction; amplitude and phase may differ between the stretches, and both
    what keeps its phase and what does not is found. Sources: `orders/scan.py`, `orders/low.py`.
    """
    logs = as_logs(logs)
    if not 0 < false_alarm < 1:
        raise InputError(
            f"find_orders: false_alarm = {false_alarm} is no probability; "
            "give a number between 0 and 1"
        )
    if max_order is not None and not max_order > 0:
        raise InputError(f"find_orders: max_order = {max_order} must be above 0")
    arrays, channel, unit = chosen_values(logs, values, unit)
    parts = stretches(logs, arrays, LONGEST)
    ratio = effective_ratio(logs[0]) or 100.0
    highest = min(max_order or min(50 * ratio, 1e4), max(part.highest for part in parts))
    table = tuple(known_pairs(logs[0]) if pairs is None else pairs)

    def snap(order: float, resolution: float) -> float:
        near = candidates(order, resolution, table)
        return near[0].per_output_turn if near else order

    low, low_estimates = find_low(parts, false_alarm / 2)
    rest = [replace(part, values=less_low(part, low, low_estimates)) for part in parts]
    lines, last = find_lines(rest, step_turns(parts), highest, false_alarm / 2, snap, low)
    fitted = estimates(rest, last.floors, [line.order for line in lines])
    named = _named([*low, *lines], [*low_estimates, *fitted], table, logs[0].facts)
    lowest = min([line.order for line in low] + [part.lowest for part in parts])
    faint = find_faint(parts, [order.per_output_turn for order in named], false_alarm / 2)
    spectrum = order_spectrum(logs, arrays, max_order=highest, unit=unit)
    return OrderAnalysis(
        tuple(named),
        faint,
        channel,
        unit,
        false_alarm,
        (lowest, highest),
        len(logs),
        replace(spectrum, channel=channel),
    )


def _named(
    lines: Sequence[Line],
    fitted: Sequence[Estimate | None],
    table: tuple[Pair, ...],
    facts: Mapping[str, object],
) -> list[FoundOrder]:
    """Return the lines that the joint fit separates, named, the largest first."""
    kept = [
        (line, fit)
        for line, fit in zip(lines, fitted, strict=True)
        if fit is not None and max(fit.amplitude, fit.steady) > _CLEAR * fit.error
    ]
    choices = [candidates(line.order, line.resolution, table) for line, _ in kept]
    alone = sum(bool(choice) and choice[0].pair.motor == 0 for choice in choices) == 1
    found = [
        _one(line, fit, choice, table, facts, alone)
        for (line, fit), choice in zip(kept, choices, strict=True)
    ]
    return sorted(found, key=lambda order: -order.amplitude)


def _one(
    line: Line,
    fit: Estimate,
    choice: Sequence[Candidate],
    table: tuple[Pair, ...],
    facts: Mapping[str, object],
    alone: bool,
) -> FoundOrder:
    wide = candidates(line.order, line.resolution, table, wide=True)
    if choice:
        order: int | float = choice[0].order
        pair = choice[0].pair.name
        effect, label = owner(choice[0], facts, alone=alone)
        wide = [other for other in wide if (other.pair, other.order) != (choice[0].pair, order)]
    else:
        order, pair, effect, label = line.order, "", "", "no known pair turns at a whole order"
    return FoundOrder(
        order,
        pair,
        line.order,
        line.resolution,
        fit.amplitude,
        fit.error,
        fit.steady,
        fit.phase,
        fit.phase_error,
        fit.amplitude / max(fit.error, 1e-300),
        line.chance,
        label,
        effect,
        tuple(other.label for other in wide),
        fit.shares,
    )
