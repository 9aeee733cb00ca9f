"""Amplitudes over order, and over frequency."""

from __future__ import annotations

from matplotlib.axes import Axes

from flexspline.orders.spectrum import OrderSpectrum, TimeSpectrum
from flexspline.plot.canvas import axes_or_new

__all__ = ["draw_frequencies", "draw_orders"]


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
