"""Measured against predicted, and the residual over any channel."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from flexspline.errors import InputError, listed
from flexspline.plot.canvas import (
    GREY,
    INK,
    MOST_COLOURED_RUNS,
    axes_or_new,
    channel_label,
    colours_of_runs,
    legend,
    plain,
    titled,
)
from flexspline.plot.thin import banded, outline, spread_evenly

if TYPE_CHECKING:
    from flexspline.least_squares.result import Fit, FittedRun

__all__ = ["has_channel", "measured_against_predicted", "residual_over"]

Array = NDArray[np.float64]

_WORDS = {"output_position": "output angle", "motor_position": "motor angle"}


def measured_against_predicted(fit: Fit, ax: Axes | None = None) -> Axes:
    """Draw measured over predicted y, in the target's unit, with the diagonal.

    Runs are told apart by colour where there are ten or fewer.
    """
    ax = axes_or_new(ax)
    x, y, colour = _points(fit, [run.predicted for run in fit.runs], "measured")
    ax.scatter(x, y, c=colour, s=2.5, alpha=0.35, linewidths=0, rasterized=True)
    ends = [min(x.min(), y.min()), max(x.max(), y.max())]
    ax.plot(ends, ends, color=INK, linewidth=1.0, label="measured = predicted")
    what = fit.target.replace("_", " ")
    ax.set(xlabel=f"predicted {what} [{fit.unit}]", ylabel=f"measured {what} [{fit.unit}]")
    titled(ax, "Measured against predicted")
    _name_runs(fit, ax)
    legend(ax)
    return ax


def residual_over(fit: Fit, channel: str = "time", ax: Axes | None = None) -> Axes:
    """Draw measured − predicted over a channel, in the unit of the target.

    Over time the runs stand one after the other. Over other channels dots, coloured by run where
    there are ten or fewer, lie behind the median and the band that holds 90 %. An angle over
    more than a turn is wrapped.

    Raises
    ------
    InputError
        Where no run has the channel.
    """
    alone, ax = ax is None, axes_or_new(ax)
    if not has_channel(fit, channel):
        known = dict.fromkeys(name for run in fit.runs for name in run.log.channels)
        raise InputError(f"no run of the fit has values of '{channel}'; they have {listed(known)}")
    if channel == "time":
        _over_time(fit, ax)
    else:
        _over_channel(fit, channel, ax)
    ax.axhline(0.0, color=INK, linewidth=0.8)
    ax.set_ylabel(f"residual [{fit.unit}]")
    titled(ax, f"Residual over {_WORDS.get(channel, channel.replace('_', ' '))}")
    if alone:
        _name_runs(fit, ax)
    legend(ax, 2)
    return ax


def has_channel(fit: Fit, channel: str) -> bool:
    """Whether a run has finite values of a channel on rows that count."""
    return any(
        channel in run.log and bool(np.isfinite(run.log[channel][run.counts]).any())
        for run in fit.runs
    )


def _over_time(fit: Fit, ax: Axes) -> None:
    end = 0.0
    most = max(200, 20_000 // len(fit.runs))
    for run, colour in zip(fit.runs, colours_of_runs(len(fit.runs)), strict=True):
        time = run.log["time"] - run.log["time"][0] + end
        residual = np.where(run.counts, run.residual, np.nan)
        at = outline(residual, most)
        ax.plot(time[at], residual[at], color=colour, linewidth=0.6, rasterized=len(at) > 5000)
        end = float(time[-1])
    many = len(fit.runs) > 1
    ax.set_xlabel("time, runs one after the other [s]" if many else "time since the start [s]")


def _over_channel(fit: Fit, channel: str, ax: Axes) -> None:
    wrapped = channel.endswith("position") and _range(fit, channel) > 2.02 * np.pi
    columns = [_column(run, channel, wrapped) for run in fit.runs]
    x, y, colour = _points(fit, columns, "residual")
    ax.scatter(x, y, c=colour, s=2, alpha=0.2, linewidths=0, rasterized=True)
    inside = [run.counts for run in fit.runs]
    whole = np.concatenate([c[i] for c, i in zip(columns, inside, strict=True)])
    residual = np.concatenate([run.residual[run.counts] for run in fit.runs])
    bands = banded(whole, residual)
    ax.fill_between(
        bands.centre, bands.low, bands.high, color=GREY, alpha=0.25, linewidth=0, label="90 %"
    )
    ax.plot(
        bands.centre, bands.median, ".-", color=INK, linewidth=1.6, markersize=2, label="median"
    )
    words = channel_label(channel)
    ax.set_xlabel(words.replace(" [", " within a turn [") if wrapped else words)
    low, high = np.nanpercentile(y, [0.1, 99.9])
    ax.set_ylim(low - 0.25 * (high - low), high + 0.25 * (high - low))


def _column(run: FittedRun, channel: str, wrapped: bool) -> Array:
    if channel not in run.log:
        return np.full(len(run.log), np.nan)
    values = run.log[channel]
    return np.asarray(np.mod(values, 2.0 * np.pi) if wrapped else values)


def _range(fit: Fit, channel: str) -> float:
    """From the least to the largest value in all runs."""
    columns = [run.log[channel] for run in fit.runs if channel in run.log]
    return float(max(map(np.nanmax, columns)) - min(map(np.nanmin, columns)))


def _points(fit: Fit, columns: list[Array], what: str) -> tuple[Array, Array, NDArray[np.float64]]:
    """At most 20 000 points of all runs, shuffled, with colours (m, 4)."""
    from matplotlib.colors import to_rgba_array

    shades = to_rgba_array(colours_of_runs(len(fit.runs)))
    x = np.concatenate([c[run.counts] for c, run in zip(columns, fit.runs, strict=True)])
    y = np.concatenate([getattr(run, what)[run.counts] for run in fit.runs])
    number = np.repeat(np.arange(len(fit.runs)), [int(run.counts.sum()) for run in fit.runs])
    good = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
    at = good[spread_evenly(len(good))]
    return x[at], y[at], shades[number[at]]


def _name_runs(fit: Fit, ax: Axes) -> None:
    if 1 < len(fit.runs) <= MOST_COLOURED_RUNS:
        for run, colour in zip(fit.runs, colours_of_runs(len(fit.runs)), strict=True):
            ax.plot([], [], "o", color=colour, markersize=4, label=plain(run.log.name))
