"""Several models in one figure: measured beside all of them, and what each misses where."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from flexspline.plot.canvas import (
    GREY,
    INK,
    PALETTE,
    Panel,
    PlainFigure,
    axes_or_new,
    banded,
    channel_label,
    legend,
    middle,
    outline,
    part_of,
    plain,
    titled,
)

if TYPE_CHECKING:
    from flexspline.comparison.models import ModelComparison, ModelRun

__all__ = ["missed_over", "models_over_time", "panels", "plot_models"]

Array = NDArray[np.float64]

RUN = (
    "At most ten seconds from the middle of the first run. Where a model is judged on held-out "
    "rows, what is drawn is what fits said that never saw them."
)
MISSED = (
    "Measured less modelled over all runs: median and the band that holds 90 % of the rows. A "
    "model that lacks nothing here lies on zero."
)
STYLES = ("-", "--", ":")
LOAD, VELOCITY, MODELLED = "reference_torque", "output_velocity", "modelled"


def plot_models(made: ModelComparison) -> PlainFigure:
    """Return the figure: a run over time, and the residuals over load and velocity below it."""
    first, *below = panels(made)
    figure = PlainFigure(11.0, 7.2)
    grid = figure.add_gridspec(2, len(below))
    first.draw(figure.add_subplot(grid[0, :]))
    for column, panel in enumerate(below):
        panel.draw(figure.add_subplot(grid[1, column]))
    return figure


def panels(made: ModelComparison) -> list[Panel]:
    """Return the views that the runs allow."""
    over = [LOAD if _all_have(made, LOAD) else MODELLED]
    over += [VELOCITY] if _all_have(made, VELOCITY) else []
    return [
        Panel(partial(models_over_time, made, 0), RUN),
        *(Panel(partial(missed_over, made, channel), MISSED) for channel in over),
    ]


def models_over_time(made: ModelComparison, run: int = 0, ax: Axes | None = None) -> Axes:
    """Draw measured and modelled values, at most ten seconds from the middle of a run.

    Where a model is judged on held-out rows, what is drawn is what fits said that never saw them.
    """
    ax = axes_or_new(ax)
    one = made.runs[run]
    time = one.log["time"]
    some = middle(time)
    part, time = part_of(time, some), time - time[0]
    at = outline(one.measured[some]) + some.start
    ax.plot(time[at], one.measured[at], color=GREY, linewidth=1.4, label="measured")
    modelled = one.measured - one.residuals
    rough = np.nan_to_num(np.nanmean(np.abs(np.diff(modelled[:, some], axis=1)), axis=1))
    behind = np.argsort(np.argsort(-rough))  # what is rough would hide the others
    for number, (colour, line) in enumerate(_looks(made)):
        at = outline(modelled[number, some]) + some.start
        label = f"{plain(made.names[number])} ({one.kinds[number]})"
        order = 2.1 + 0.01 * behind[number]
        values = modelled[number, at]
        ax.plot(time[at], values, line, color=colour, linewidth=1.1, label=label, zorder=order)
    what = made.target.replace("_", " ")
    ax.set(xlabel="time since the start of the run [s]", ylabel=f"{what} [{made.unit}]")
    titled(ax, f"Measured and modelled, {plain(one.log.name)}{part}")
    legend(ax)
    return ax


def missed_over(made: ModelComparison, channel: str, ax: Axes | None = None) -> Axes:
    """Draw median and 90 % band of what each model misses over a channel, or over what it says.

    Parameters
    ----------
    channel : of the runs' logs, or "modelled" for the values of each model. Over the measured ones
        the residual of every model would slope, for these hold the noise that it does not explain.
    """
    ax = axes_or_new(ax)
    for number, (colour, line) in enumerate(_looks(made)):
        rows = [(_along(run, channel, number), run.residuals[number]) for run in made.runs]
        x, y = (np.concatenate(part) for part in zip(*rows, strict=True))
        bands = banded(x, y)
        ax.fill_between(bands.centre, bands.low, bands.high, color=colour, alpha=0.15, linewidth=0)
        name = plain(made.names[number])
        ax.plot(bands.centre, bands.median, line, color=colour, linewidth=1.5, label=name)
    what = f"modelled {made.target.replace('_', ' ')}"
    ax.set_xlabel(f"{what} [{made.unit}]" if channel == MODELLED else channel_label(channel))
    ax.set_ylabel(f"residual [{made.unit}]")
    ax.axhline(0.0, color=INK, linewidth=0.8)
    over = what if channel == MODELLED else channel.replace("_", " ")
    titled(ax, f"Residual over {over}: median, band of 90 %")
    legend(ax)
    return ax


def _looks(made: ModelComparison) -> list[tuple[str, str]]:
    """Colour and line of each model; where there are very many they come again."""
    every = [(colour, line) for line in STYLES for colour in PALETTE]
    return [every[k % len(every)] for k in range(len(made.names))]


def _along(run: ModelRun, channel: str, number: int) -> Array:
    if channel == MODELLED:
        return np.asarray(run.measured - run.residuals[number])
    return np.asarray(run.log[channel])


def _all_have(made: ModelComparison, channel: str) -> bool:
    return all(channel in run.log for run in made.runs)
