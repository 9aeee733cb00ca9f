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
from flexspline.orders.spectrum import OrderSpectrum, TimeSpectrum, fourier_sums
from flexspline.orders.stretches import stretches
from flexspline.plot.canvas import GREY, INK, PALETTE, axes_or_new, legend, orders_axis, titled

if TYPE_CHECKING:
    from flexspline.least_squares.result import Fit

__all__ = ["draw_frequencies", "draw_orders", "order_spectra", "spectrum_over"]

Array = NDArray[np.float64]

LONGEST = 4.0  # turns in one piece: a picture needs no finer orders, and any log is quick
STEPS = 8  # per whole order, half the resolution of such a piece
HIGHEST = 20_000.0
BINS = 700


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
    ax.plot(*before, color=GREY, linewidth=1.1, label="target")
    ax.plot(*after, color=PALETTE[3], linewidth=1.1, label="residual")
    orders_axis(ax)
    ax.set(
        yscale="log",
        xlabel="order [periods per output turn]",
        ylabel=f"amplitude [{fit.unit}]",
    )
    ax.set_xlim(before[0][0], before[0][-1])
    titled(ax, "Order spectrum before and after")
    legend(ax)
    return ax


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
    ax.plot(made.order, made.amplitude, linewidth=0.7)
    side, other = made.pair.rsplit("_", 1) if "_" in made.pair else (made.pair, "")
    ax.set(
        xlabel=f"order [per turn of {side.replace('_', ' ')} against {other}]",
        ylabel=f"amplitude of {made.channel} [{made.unit or '1'}]",
        ylim=(0, None),
    )
    return ax


def draw_frequencies(made: TimeSpectrum, ax: Axes | None = None) -> Axes:
    """Draw the amplitude over the frequency, its largest peaks marked."""
    ax = axes_or_new(ax, 9, 4)
    ax.plot(made.frequency, made.amplitude, linewidth=0.7)
    for frequency, height in made.peaks[:10]:
        ax.annotate(
            f"{frequency:.4g}",
            (frequency, height),
            (0, 4),
            textcoords="offset points",
            fontsize=8,
            ha="center",
        )
    ax.set(
        xlabel="frequency [Hz]",
        ylim=(0, None),
        ylabel=f"amplitude of {made.channel} [{made.unit or '1'}]",
    )
    return ax
