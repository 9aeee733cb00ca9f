"""External torques over time, as each estimator sees them."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexspline.estimation.result import Estimate
from flexspline.estimation.status import Status
from flexspline.plot.canvas import (
    GREY,
    PALETTE,
    PlainFigure,
    axes_or_new,
    channel_label,
    legend,
    titled,
)
from flexspline.plot.thin import outline

__all__ = ["external_torques", "plot_estimate", "status_bits"]

PREFIX = "external_torque_"


def plot_estimate(made: Estimate) -> Figure:
    """Return a figure: external torques with contacts shaded, and below it what is flagged."""
    figure = PlainFigure(9.0, 5.2)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=[3, 1])
    external_torques(made, above)
    above.set_xlabel("")
    status_bits(made, below)
    return figure


def external_torques(made: Estimate, ax: Axes | None = None) -> Axes:
    """Draw each external torque over time; contacts are shaded."""
    ax = axes_or_new(ax)
    time = made["time"]
    names = [name for name in made.columns if name.startswith(PREFIX)]
    for colour, name in zip(PALETTE, names, strict=False):
        if np.isfinite(made[name]).any():
            rows = outline(made[name])
            label = name.removeprefix(PREFIX)
            ax.plot(time[rows], made[name][rows], color=colour, linewidth=0.9, label=label)
    for start, end in made.contacts:
        ax.axvspan(start, end, color=GREY, alpha=0.25, linewidth=0)
    ax.set_xlabel(channel_label("time"))
    ax.set_ylabel("external torque [Nm]")
    titled(ax, f"{made.name}: external torque at the output")
    legend(ax)
    return ax


def status_bits(made: Estimate, ax: Axes | None = None) -> Axes:
    """Draw a mark at each row that has a bit of the status, a line for each bit that occurs."""
    ax = axes_or_new(ax, height=1.6)
    time = made["time"]
    found = [bit for bit in Status if made.flagged(bit).any()]
    for line, bit in enumerate(found):
        rows = np.flatnonzero(made.flagged(bit))
        rows = rows[outline(rows.astype(np.float64))]
        ax.plot(time[rows], np.full(rows.size, line), "|", color=PALETTE[3], markersize=7)
    ax.set_yticks(range(len(found)), [str(bit.name).lower().replace("_", " ") for bit in found])
    ax.set_ylim(-0.6, max(len(found), 1) - 0.4)
    ax.set_xlabel(channel_label("time"))
    return ax
