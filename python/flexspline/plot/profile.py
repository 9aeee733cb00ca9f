"""A profile over its parameter, beside Wald's parabola, and the region of two parameters."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexspline.formatting import percent, short_names
from flexspline.plot.canvas import GREY, INK, PALETTE, axes_or_new, legend, log_axis, titled

if TYPE_CHECKING:
    from flexspline.least_squares.profile import Contour, Profile

__all__ = ["draw_contour", "draw_profile", "plot_contour", "plot_profile"]

HIGHEST = 4.0  # times the limit: what lies above tells nothing


def plot_profile(made: Profile) -> Figure:
    """Return a figure of a profile."""
    figure = draw_profile(made).figure
    assert isinstance(figure, Figure)
    return figure


def plot_contour(made: Contour) -> Figure:
    """Return a figure of a region."""
    figure = draw_contour(made).figure
    assert isinstance(figure, Figure)
    return figure


def draw_profile(made: Profile, ax: Axes | None = None) -> Axes:
    """Draw the statistic over the value, its limit, and what Wald's interval takes it for."""
    ax = axes_or_new(ax)
    shown = made.statistic <= HIGHEST * made.limit
    low, high = made.values[shown].min(), made.values[shown].max()
    half = 0.5 * (made.wald[1] - made.wald[0])
    line = np.linspace(low, high, 400)
    parabola = made.limit * ((line - made.value) / half) ** 2
    ax.plot(line, parabola, "--", color=GREY, linewidth=1.0, label="Wald")
    ax.plot(made.values, made.statistic, ".-", color=PALETTE[0], markersize=3, label="profile")
    label = f"limit at {percent(made.level)}"
    ax.axhline(made.limit, color=INK, linewidth=0.8, linestyle=":", label=label)
    for number, (start, end) in enumerate(made.parts):
        inside = (low if start is None else start, high if end is None else end)
        label = "" if number else "interval"
        ax.axvspan(*inside, color=PALETTE[0], alpha=0.12, linewidth=0, label=label)
    ax.set(ylim=(0.0, HIGHEST * made.limit), xlim=(low, high), ylabel="statistic D [1]")
    if low > 0.0 and high > 10.0 * low:
        log_axis(ax, "x")
    ax.set_xlabel(f"{short_names(made.name)} [{made.unit}]")
    titled(ax, f"Profile of {short_names(made.name)}")
    legend(ax)
    return ax


def draw_contour(made: Contour, ax: Axes | None = None) -> Axes:
    """Draw the region of two parameters; it is open where it does not end within bounds."""
    ax = axes_or_new(ax)
    around = np.vstack([made.points, made.points[:1]])
    label = f"{percent(made.level)}, both together"
    ax.plot(*around.T, ".-", color=PALETTE[0], markersize=3, label=label)
    ax.plot(*made.values, "+", color=INK, markersize=8, label="as fitted")
    one, other = (f"{short_names(n)} [{u}]" for n, u in zip(made.names, made.units, strict=True))
    ax.set(xlabel=one, ylabel=other)
    titled(ax, "Region of two parameters")
    legend(ax)
    return ax
