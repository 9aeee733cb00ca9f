"""The run to record next: what to command over time, and what it is expected to tell."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from flexspline.experiment.plan import ENOUGH
from flexspline.plot.canvas import (
    GREY,
    INK,
    PALETTE,
    PlainFigure,
    axes_or_new,
    channel_label,
    legend,
    titled,
)

if TYPE_CHECKING:
    from flexspline.experiment.plan import Plan

__all__ = ["commanded_channel", "expected_separation", "plot_plan"]

Array = NDArray[np.float64]

CHANNELS = ("output_position", "output_velocity", "reference_torque", "temperature")


def plot_plan(made: Plan) -> PlainFigure:
    """Return a figure: commanded channels over time, and the separation that is expected."""
    shown = [name for name in CHANNELS if name in made.log]
    figure = PlainFigure(10.0, 1.7 * len(shown) + 1.2)
    left, right = figure.subfigures(1, 2, width_ratios=(2.2, 1.0), squeeze=False)[0]
    axes = left.subplots(len(shown), 1, sharex=True, squeeze=False).ravel()
    for ax, name in zip(axes, shown, strict=True):
        commanded_channel(made, name, ax)
        ax.set_xlabel("time [s]" if name == shown[-1] else "")
    titled(axes[0], "To be commanded")
    expected_separation(made, right.add_subplot())
    return figure


def commanded_channel(made: Plan, channel: str, ax: Axes | None = None) -> Axes:
    """Draw one channel of the trajectory; a wait for another temperature is a dotted line."""
    ax = axes_or_new(ax, 6.0, 2.0)
    time, values = _without_waits(made.log["time"], made.log[channel])
    ax.plot(time, values, color=PALETTE[0], linewidth=1.0)
    for wait in time[np.isnan(values)]:
        ax.axvline(wait, color=GREY, linewidth=1.0, linestyle=":")
    ax.set(ylabel=channel_label(channel).replace("output ", ""), xlabel="time [s]")
    return ax


def expected_separation(made: Plan, ax: Axes | None = None) -> Axes:
    """Draw what the first question stands at: now, with the best run of each kind, as planned."""
    ax = axes_or_new(ax, 4.0, 3.0)
    first = made.outlooks[0]
    if first.parameter:
        names, values = ["now", "planned"], [first.now, first.expected]
        ax.set_xlabel(f"standard error [{first.unit}]")
    else:
        others = sorted(made.kinds.items(), key=lambda item: item[1])
        names = ["now", *(name for name, _ in others), "planned"]
        values = [first.now, *(t for _, t in others), first.expected]
        ax.axvline(
            ENOUGH, color=GREY, linestyle="--", linewidth=1.0, label=f"distinguished: {ENOUGH:g}"
        )
        ax.set_xlabel("expected separation t [–]")
    shown = [v if np.isfinite(v) else 0.0 for v in values]
    colours = [GREY, *([PALETTE[5]] * (len(shown) - 2)), PALETTE[0]]
    ax.barh(names, shown, color=colours, height=0.6)
    for place, value in enumerate(values):
        said = f"{value:.3g}" if np.isfinite(value) else "not known"
        ax.annotate(f" {said}", (shown[place], place), va="center", fontsize=8, color=INK)
    titled(ax, " or\n".join(first.names).replace("_", " "))
    legend(ax)
    return ax


def _without_waits(time: Array, values: Array) -> tuple[Array, Array]:
    """Time (N,) with waits taken out, and values that are NaN there."""
    step = np.diff(time, prepend=time[0])
    usual = float(np.median(step[1:]))
    waits = np.flatnonzero(step > 60.0)
    kept = np.cumsum(np.where(step > 60.0, usual, step))
    return np.insert(kept, waits, kept[waits]), np.insert(values, waits, np.nan)
