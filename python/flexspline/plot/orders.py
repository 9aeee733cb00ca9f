"""Spectra over the angle and over time: what turns with the joint, before and after a fit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from flexspline.errors import InputError
from flexspline.least_squares.ripple import ripple_orders
from flexspline.logs.log import Log
from flexspline.orders.spectrum import OrderSpectrum, TimeSpectrum, fourier_sums, stretches
from flexspline.plot.canvas import GREY, INK, LEAST, PALETTE, axes_or_new, finished, log_axis

if TYPE_CHECKING:
    from flexspline.least_squares.result import Fit
    from flexspline.orders import OrderAnalysis

__all__ = [
    "FIRST",
    "draw_found",
    "draw_frequencies",
    "draw_orders",
    "order_spectra",
    "over_orders",
    "spectrum_over",
]

Array = NDArray[np.float64]

LONGEST = 4.0  # turns in one piece: a picture needs no finer orders, and any log is quick
STEPS = 8  # per whole order, half the resolution of such a piece
HIGHEST = 20_000.0
BINS = 700
FIRST = 0.9  # of an axis, that a mark at order 1 is seen
APART = 0.06  # of the axis: numbers above peaks that are nearer would lie on each other


def order_spectra(fit: Fit, ax: Axes | None = None) -> Axes:
    """Draw the amplitude of target and residual, in its unit, over orders per output turn.

    Runs are cut by direction, their smooth part is taken out, and the amplitudes are averaged
    in the root mean square. Of neighbouring orders the highest is drawn. Fitted orders are marked.

    Raises
    ------
    InputError
        Where the joint does not turn, or the runs hold no angle.
    """
    logs = [run.log for run in fit.runs]
    spectra = [
        spectrum_over(logs, [np.where(run.counts, getattr(run, what), np.nan) for run in fit.runs])
        for what in ("measured", "residual")
    ]
    ax = axes_or_new(ax)
    marks = [o.per_output_turn for o in ripple_orders(fit) if np.isfinite(o.per_output_turn)]
    for number, mark in enumerate(marks):
        ax.axvline(
            mark,
            color=INK,
            linewidth=0.7,
            linestyle=":",
            alpha=0.6,
            label=None if number else "fitted order",
        )
    before, after = spectra
    ax.plot(*before, color=GREY, linewidth=2.0, label="target")
    ax.plot(*after, color=PALETTE[3], linewidth=0.9, label="residual")
    over_orders(ax, before[0], fit.unit)
    return finished(ax, "Order spectrum before and after")


def over_orders(ax: Axes, order: Array, unit: str) -> None:
    """Scale and name the axes of amplitudes [unit] over orders (m,) of the output, from order 1.

    What lies below the first order is slower than a turn: drift and gravity, no ripple.
    """
    highest = float(order[-1])
    ax.set_xlim(FIRST if highest > 1.0 else float(order[0]), highest)
    log_axis(ax, "x")
    log_axis(ax, "y")
    ax.set(xlabel="order [periods per output turn]", ylabel=f"amplitude [{unit}]")


def spectrum_over(logs: Sequence[Log], values: Sequence[Array]) -> tuple[Array, Array]:
    """Return orders and amplitudes, thinned to the highest of each of a few hundred bins.

    Parameters
    ----------
    logs : runs with an angle.
    values : (N,) for each run; NaN where a row does not count.

    Raises
    ------
    InputError
        Where the joint does not turn, or the runs hold no angle.
    """
    parts = stretches(logs, values, LONGEST)
    highest = min(max(part.highest for part in parts), HIGHEST)
    order = np.arange(int(highest * STEPS + 1e-9) + 1) / STEPS
    power, rows = np.zeros((2, len(order)))
    for part in parts:
        seen = (order >= part.lowest) & (order <= part.highest)
        sums = fourier_sums(part.angle, part.values, STEPS, highest)
        power += np.where(seen, 4.0 * np.abs(sums) ** 2 / len(part.values), 0.0)
        rows += np.where(seen, len(part.values), 0.0)
    good = rows > 0
    if np.count_nonzero(good) < 3:
        raise InputError("the joint turns too little for orders to be resolved; turn it further")
    return _peaks(order[good], np.sqrt(power[good] / rows[good]))


def _peaks(order: Array, amplitude: Array) -> tuple[Array, Array]:
    edges = np.geomspace(order[0], order[-1], BINS)[:-1]
    first = np.unique(np.searchsorted(order, edges))
    first = first[first < len(order)]
    highest = np.maximum.reduceat(amplitude, first)
    ends = [*first[1:], len(order)]
    at = [a + int(np.argmax(amplitude[a:b])) for a, b in zip(first, ends, strict=True)]
    return order[at], highest


def draw_orders(made: OrderSpectrum, ax: Axes | None = None) -> Axes:
    """Draw the amplitude over the order."""
    ax = axes_or_new(ax, 9, 4)
    ax.plot(made.order, made.amplitude, color=PALETTE[0], linewidth=0.7)
    side, other = made.pair.rsplit("_", 1) if "_" in made.pair else (made.pair, "")
    ax.set(
        xlabel=f"order [per turn of {side.replace('_', ' ')} against {other}]",
        ylabel=f"amplitude of {made.channel.replace('_', ' ')}"
        + (f" [{made.unit}]" if made.unit else ""),
        ylim=(0, None),
    )
    return ax


def draw_found(made: OrderAnalysis, ax: Axes | None = None) -> Axes:
    """Draw the amplitude over the order, with the orders found where their lines are."""
    ax = draw_orders(made.spectrum, ax)
    label = "order found, as fitted; a line of the spectrum is spread"
    for found in made.found:
        ax.plot(
            found.per_output_turn, found.amplitude, "v", color=PALETTE[3], markersize=5, label=label
        )
        label = ""
    named: list[float] = []
    least = APART * float(made.spectrum.order[-1])
    for found in sorted(made.found, key=lambda one: -one.amplitude):
        if all(abs(found.per_output_turn - other) > least for other in named):
            named.append(found.per_output_turn)
            _named(ax, found.per_output_turn, found.amplitude)
    highest = max((found.amplitude for found in made.found), default=0.0)
    ax.set_ylim(0, 1.1 * max(ax.get_ylim()[1], highest))
    count, s = len(made.found) or "no", "" if len(made.found) == 1 else "s"
    return finished(
        ax, f"{count} order{s} found in {made.runs} run{'' if made.runs == 1 else 's'}".capitalize()
    )


def _named(ax: Axes, at: float, height: float) -> None:
    """Write a number above a peak."""
    ax.annotate(
        f"{at:.4g}", (at, height), (0, 4), textcoords="offset points", ha="center", color=INK,
        fontsize=LEAST,
    )  # fmt: skip


def draw_frequencies(made: TimeSpectrum, ax: Axes | None = None) -> Axes:
    """Draw the amplitude over the frequency, its largest peaks marked."""
    ax = axes_or_new(ax, 9, 4)
    ax.plot(made.frequency, made.amplitude, color=PALETTE[0], linewidth=0.7)
    named: list[float] = []
    for frequency, height in made.peaks[:10]:
        if all(abs(frequency - other) > APART * made.frequency[-1] for other in named):
            named.append(frequency)
            _named(ax, frequency, height)
    ax.set(
        xlabel="frequency [Hz]",
        ylim=(0, None),
        ylabel=f"amplitude of {made.channel.replace('_', ' ')}"
        + (f" [{made.unit}]" if made.unit else ""),
    )
    return ax
