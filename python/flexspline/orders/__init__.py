"""Order analysis: what turns with the joint, found in its runs and named.

`find_orders` searches a joint's ripple for them, and names them.
The result prints as a table, draws itself and is plain data.
"""

from __future__ import annotations

import html
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from flexspline.errors import InputError, listed
from flexspline.files import save_table
from flexspline.formatting import rows_html, rows_text
from flexspline.lazy import render
from flexspline.logs import Log
from flexspline.logs.read import as_logs
from flexspline.orders.parts import Candidate, Pair, candidates, effective_ratio, owner, pairs
from flexspline.orders.parts import pairs as known_pairs
from flexspline.orders.scan import (
    CLEAR,
    TOGETHER,
    Estimate,
    Faint,
    Line,
    Share,
    estimates,
    find_faint,
    find_lines,
    find_low,
    less_low,
    scattered,
)
from flexspline.orders.spectrum import (
    LONGEST,
    OrderSpectrum,
    Stretch,
    TimeSpectrum,
    Values,
    chosen_values,
    order_spectrum,
    step_turns,
    stretches,
    sweeps,
    time_spectrum,
)
from flexspline.orders.vibrations import (
    Competition,
    Vibration,
    compete,
    one_speed,
    ringing,
)

if TYPE_CHECKING:
    import pandas
    from matplotlib.axes import Axes

__all__ = [
    "FoundOrder",
    "OrderAnalysis",
    "OrderSpectrum",
    "Pair",
    "TimeSpectrum",
    "Vibration",
    "find_orders",
    "order_spectrum",
    "pairs",
    "ringing",
    "time_spectrum",
]


_HEADINGS = (
    "per output turn",
    "resolution",
    "order of pair",
    "what turns",
    "steady part",
    "spread",
    "phase",
    "SNR",
    "false alarm",
    "effect",
    "or, within the resolution",
)
_FREQUENCIES = ("frequency [Hz]", "resolution", "amplitude", "speeds [rad/s]", "pieces",
                "false alarm")  # fmt: skip
_TABLE = [
    "kind",
    "order per output turn",
    "resolution [orders per output turn]",
    "order of pair",
    "pair",
    "what turns",
    "effect",
    "or",
    "steady part [unit]",
    "its error [unit]",
    "spread [unit]",
    "phase [rad]",
    "its error [rad]",
    "amplitude, RMS [unit]",
    "error of the RMS [unit]",
    "SNR",
    "false alarm",
    "speed alone [rad/s]",
    "frequency [Hz]",
    "resolution [Hz]",
    "slowest [rad/s]",
    "fastest [rad/s]",
]
SHOWN = 2.0  # standard errors of the steady part, from which its phase is told
_LEFT = {3, 4, 5, 6, 9, 10}  # columns of words and of sizes with their errors


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
    alone : float
        Where vibrations were looked for: the speed [rad/s] at which it is seen, where that alone
        does not tell it from a vibration of one frequency; NaN where several speeds do.
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
    alone: float = float("nan")

    @property
    def spread(self) -> float:
        """Root mean square by which the waves of the stretches differ from the steady part [unit].

        A stretch is one direction of one run. NaN where there is one, or all are fitted as one.
        """
        return scattered(self.shares)[0]

    @property
    def steady_error(self) -> float:
        """Standard error of `steady` with what the stretches differ by [unit]."""
        return self._errors[0]

    @property
    def steady_phase_error(self) -> float:
        """Standard error of `phase` with what the stretches differ by [rad], π at most."""
        return self._errors[1]

    @property
    def _errors(self) -> tuple[float, float]:
        covariance = scattered(self.shares)[1]
        along = np.array([np.cos(self.phase), np.sin(self.phase)])
        across = np.array([-along[1], along[0]])
        size = float(np.sqrt(along @ covariance @ along))
        turned = float(np.sqrt(across @ covariance @ across)) / max(self.steady, 1e-300)
        return size, min(turned, float(np.pi))


@dataclass(frozen=True, repr=False)
class OrderAnalysis:
    """Orders found in runs of one joint, the largest first.

    `found` are the orders, `faint` low orders of the output that stand out but are not certain
    (never part of `found`; see `orders/scan.py`), `unit` and `channel` what was looked at,
    `false_alarm` the probability that noise alone yields any, `scanned` the lowest and highest
    order per output turn, `runs` how many, `spectrum` what the plot shows. Where vibrations were
    looked for, `vibrations` are those that stay at one frequency, `frequencies` the lowest and the
    highest [Hz] that was scanned, None where they were not, and `speed` the one speed [rad/s] of
    all runs, NaN where there are several.
    """

    found: tuple[FoundOrder, ...]
    faint: tuple[Faint, ...]
    channel: str
    unit: str
    false_alarm: float
    scanned: tuple[float, float]
    runs: int
    spectrum: OrderSpectrum
    vibrations: tuple[Vibration, ...] = ()
    frequencies: tuple[float, float] | None = None
    speed: float = float("nan")

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

    def to_table(self) -> pandas.DataFrame:
        """Return a pandas table of orders and vibrations, a row for each, units in the names."""
        import pandas

        rows = [*map(self._order_row, self.found), *map(self._vibration_row, self.vibrations)]
        unit = self.unit or "1"
        names = [name.replace("unit", unit) for name in _TABLE]
        return pandas.DataFrame(rows, columns=_TABLE).set_axis(names, axis="columns")

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the table of orders and vibrations as CSV, whole or not at all.

        Raises
        ------
        InputError
            Where the file cannot be written.
        """
        save_table(self.to_table(), path)

    def _order_row(self, found: FoundOrder) -> dict[str, object]:
        return {
            "kind": "order",
            "order per output turn": found.per_output_turn,
            "resolution [orders per output turn]": found.resolution,
            "order of pair": found.order,
            "pair": found.pair,
            "what turns": found.label,
            "effect": found.effect,
            "or": "; ".join(_joined(found.aliases)),
            "steady part [unit]": found.steady,
            "its error [unit]": found.steady_error,
            "spread [unit]": found.spread,
            "phase [rad]": found.phase,
            "its error [rad]": found.steady_phase_error,
            "amplitude, RMS [unit]": found.amplitude,
            "error of the RMS [unit]": found.error,
            "SNR": found.snr,
            "false alarm": found.chance,
            "speed alone [rad/s]": found.alone,
        }

    def _vibration_row(self, found: Vibration) -> dict[str, object]:
        return {
            "kind": "vibration",
            "amplitude, RMS [unit]": found.amplitude,
            "error of the RMS [unit]": found.error,
            "SNR": found.amplitude / found.error,
            "false alarm": found.chance,
            "frequency [Hz]": found.frequency,
            "resolution [Hz]": found.resolution,
            "slowest [rad/s]": found.speeds[0],
            "fastest [rad/s]": found.speeds[1],
        }

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the amplitude over orders per output turn, the orders found marked."""
        drawn: Axes = render("order analysis", "axes", self, ax)
        return drawn

    def __repr__(self) -> str:
        return f"<OrderAnalysis of {self.channel}: {len(self.found)} orders>"

    def __str__(self) -> str:
        blocks = [self._title()]
        if self.found:
            blocks.append(rows_text([_HEADINGS, *self._cells()], _LEFT))
        if self.vibrations:
            blocks.append("\n" + rows_text([_FREQUENCIES, *self._waves()], {2}))
        return "\n".join([*blocks, *self.sentences])

    def _repr_html_(self) -> str:
        tables = [[_HEADINGS, *self._cells()]] if self.found else []
        tables += [[_FREQUENCIES, *self._waves()]] if self.vibrations else []
        shown = "".join(f"<table>{rows_html(rows)}</table>" for rows in tables)
        notes = "".join(f"<p>{html.escape(sentence)}</p>" for sentence in self.sentences)
        return f"<div><b>{html.escape(self._title())}</b>{shown}{notes}</div>"

    def _title(self) -> str:
        low, high = self.scanned
        count = f"{len(self.found) or 'no'} order{'' if len(self.found) == 1 else 's'}"
        return (
            f"{_measured(self.channel, self.unit)}: {count} found between {low:.3g} and "
            f"{high:.6g} per output turn in {self.runs} run{'' if self.runs == 1 else 's'} "
            f"(noise alone names one in {self.false_alarm:.2g} of cases at most)"
        )

    @property
    def sentences(self) -> list[str]:
        """What is to be said of the orders: which are not certain, and which may be vibrations."""
        return [*self._doubtful(), *self._of_vibrations()]

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

    def _of_vibrations(self) -> list[str]:
        """What is told of vibrations, and what these runs cannot tell."""
        if self.frequencies is None:
            return []
        alone = [found for found in self.found if np.isfinite(found.alone)]
        if np.isfinite(self.speed) and len(alone) == len(self.found) and not self.vibrations:
            return [
                f"all runs turn at one speed, {self.speed:.3g} rad/s: an order cannot be told from "
                f"a vibration that stays at one frequency{_hertz(alone)}; record a run at another "
                "speed"
            ]
        said = []
        if not self.vibrations:
            low, high = self.frequencies
            said.append(
                f"no vibration that stays at one frequency was found between {low:.3g} and "
                f"{high:.4g} Hz"
            )
        if alone:
            said.append(
                "orders that may as well be a vibration that stays at one frequency, by the speeds "
                f"that show them{_hertz(alone)}; runs at other speeds would tell"
            )
        return said

    def _cells(self) -> list[tuple[str, ...]]:
        return [
            (
                f"{f.per_output_turn:.6g}",
                f"{f.resolution:.2g}",
                f"{f.order:.6g}",
                f.label,
                _rounded(f.steady, f.steady_error, self.unit),
                _size(f.spread, f.steady_error, self.unit) if f.spread != 0.0 else "none seen",
                _phase(f),
                f"{f.snr:.1f}",
                _chance(f.chance),
                f.effect or "–",
                "; ".join(_joined(f.aliases)) or "–",
            )
            for f in self.found
        ]

    def _waves(self) -> list[tuple[str, ...]]:
        return [
            (
                f"{wave.frequency:.{_decimals(0.1 * wave.resolution)}f}",
                f"{wave.resolution:.2g}",
                _rounded(wave.amplitude, wave.error, self.unit),
                " to ".join(dict.fromkeys(f"{speed:.3g}" for speed in wave.speeds)),
                f"{wave.seen} of {wave.of}",
                _chance(wave.chance),
            )
            for wave in self.vibrations
        ]


def _hertz(found: Sequence[FoundOrder]) -> str:
    """Orders with the frequency that each has at its one speed."""
    each = listed(
        (f"{f.per_output_turn:.6g} ({f.per_output_turn * f.alone / (2 * np.pi):.3g} Hz)"
         for f in found), 10,
    )  # fmt: skip
    return f": {each}" if found else ""


def _phase(found: FoundOrder) -> str:
    """The phase of the steady part, "–" where its error does not tell that from zero."""
    if not found.steady > SHOWN * found.steady_error:
        return "–"
    return f"{found.phase:+.2f} ± {found.steady_phase_error:.2f} rad"


def _measured(what: str, unit: str) -> str:
    return f"{what} [{unit}]" if unit else what


def _joined(labels: Sequence[str]) -> list[str]:
    """Labels such as "output, 7 per turn", the orders of one pair joined: "output, 7, 9 per turn".

    Each is what a `Candidate` is called.
    """
    orders: dict[str, list[int]] = {}
    for label in labels:
        words, _, order = label.removesuffix(" per turn").rpartition(", ")
        orders.setdefault(words, []).append(int(order))
    return [f"{words}, {listed(sorted(each), 6)} per turn" for words, each in orders.items()]


def _decimals(step: float) -> int:
    """Decimals that show a step of this size."""
    return max(0, int(np.ceil(-np.log10(step))))


def _chance(chance: float) -> str:
    return f"{chance:.0e}" if chance >= 1e-99 else "below 1e-99"


def _size(value: float, error: float, unit: str) -> str:
    """A value with the decimals of an error, "–" where there is none."""
    return _rounded(value, error, unit).split(" ± ")[0] + f" {unit}" if value == value else "–"


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
    channel: str | None = None,
    vibrations: bool = False,
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
    channel : str, optional
        What the values are called; a channel has its own name.
    vibrations : bool
        Also look for vibrations that stay at one frequency, and tell orders from them: an order
        that is one is not among those found. A second scan, over time.

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
    what keeps its phase and what does not is found. Sources: `orders/scan.py`, `orders/scan.py`.
    """
    logs = as_logs(logs)
    if not 0 < false_alarm < 1:
        raise InputError(
            f"find_orders: false_alarm = {false_alarm} is no probability; "
            "give a number between 0 and 1"
        )
    if max_order is not None and not max_order > 0:
        raise InputError(f"find_orders: max_order = {max_order} must be above 0")
    arrays, named, unit = chosen_values(logs, values, unit)
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
    orders = _named([*low, *lines], [*low_estimates, *fitted], table, logs[0].facts)
    lowest = min([line.order for line in low] + [part.lowest for part in parts])
    faint = find_faint(parts, [order.per_output_turn for order in orders], false_alarm / 2)
    spectrum = order_spectrum(logs, arrays, max_order=highest, unit=unit)
    found = OrderAnalysis(
        tuple(orders),
        faint,
        channel or named,
        unit,
        false_alarm,
        (lowest, highest),
        len(logs),
        replace(spectrum, channel=channel or named),
    )
    if not vibrations:
        return found
    rate = min(log.rate for log in logs)
    swept = sweeps(rest)
    return _told(found, swept, compete(swept, highest, rate, false_alarm, snap, low))


def _told(found: OrderAnalysis, parts: Sequence[Stretch], made: Competition) -> OrderAnalysis:
    """Return the analysis with the vibrations, and without the orders that these explain."""
    left = [
        order
        for order in found
        if not made.vibrations
        or order.shares[0].stretch == TOGETHER
        or any(abs(order.per_output_turn - line.order) < order.resolution for line in made.orders)
    ]
    told = [
        replace(order, alone=made.speed_alone(parts, order.per_output_turn, order.resolution))
        for order in left
    ]
    speed = float(np.median([abs(part.speed) for part in parts])) if one_speed(parts) else np.nan
    return replace(
        found,
        found=tuple(told),
        vibrations=made.vibrations,
        frequencies=made.scanned,
        speed=speed,
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
        if fit is not None and max(fit.amplitude, fit.steady) > CLEAR * fit.error
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
