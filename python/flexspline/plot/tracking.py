"""Figures of a track: each parameter over calendar time, with its band and what changed."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import matplotlib.dates
import numpy as np

from flexspline.plot.canvas import (
    GREY,
    INK,
    LEAST,
    PALETTE,
    Panel,
    PlainFigure,
    axes_or_new,
    finished,
    own_style,
    panelled,
    plain,
)
from flexspline.tracking.result import spoken

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from flexspline.tracking.fleet import FleetTrack
    from flexspline.tracking.result import Change, Forecast, Track, TrackedParameter

__all__ = ["LOOK", "fleet_panels", "panels", "plot_track"]

DATES: Any = matplotlib.dates  # which has no types
LOOK = (
    "Dots are sessions at the reference temperature, with two standard errors of what was "
    "measured; hollow ones are left out. Line and band are the level with 95 %, on to the date of "
    "a limit where one is told. Dashed: the onset of a change, shaded where it may have been "
    "(95 %). Dotted: a limit."
)
MOST_COLOURED = 4  # joints that changed in a parameter, the surest first
FLEET_LOOK = (
    "Level of each joint at its reference temperature: grey where no change is told, coloured with "
    "its 95 % band where this parameter changed."
)
FAR = 3.0  # spans of what is drawn: a limit beyond would flatten all else


@own_style()
def plot_track(made: Track) -> PlainFigure:
    """Return a figure of all parameters, those that changed first."""
    return panelled(panels(made))


def panels(made: Track) -> list[Panel]:
    """Return a panel for each parameter, those that changed first."""
    order = sorted(
        range(len(made.parameters)),
        key=lambda p: made.parameters[p].state in ("no change told", "not known yet"),
    )
    return [_panel(made, p) for p in order]


def fleet_panels(made: FleetTrack) -> list[Panel]:
    """Return a panel for each parameter of a fleet that changed in some joint."""
    changed = {name: {change.parameter for change in of} for name, of in made.changed.items()}
    names = dict.fromkeys(p.name for one in made.tracks.values() for p in one.parameters)
    shown = [name for name in names if any(name in of for of in changed.values())]
    return [
        Panel(partial(_draw_joints, made, name, [j for j in changed if name in changed[j]]),
              FLEET_LOOK)
        for name in shown
    ]  # fmt: skip


def _draw_joints(made: FleetTrack, name: str, moved: Sequence[str], ax: Axes) -> None:
    axes_or_new(ax)
    unit, quiet = "", "no change told"
    for joint, one in made.tracks.items():
        parameter = next((p for p in one.parameters if p.name == name), None)
        if parameter is None or joint in moved or not np.isfinite(parameter.band.middle).any():
            continue
        band, unit = parameter.band, parameter.unit
        ax.plot(band.dates, band.middle, color=GREY, linewidth=0.7, alpha=0.6, label=quiet)
        quiet = "_"
    for k, joint in enumerate(moved):
        parameter = made.tracks[joint][name]
        band, unit, colour = parameter.band, parameter.unit, PALETTE[k % MOST_COLOURED]
        label = plain(joint) if k < MOST_COLOURED else "_"
        ax.plot(band.dates, band.middle, color=colour, linewidth=1.6, label=label)
        ax.fill_between(band.dates, band.low, band.high, color=colour, alpha=0.2, linewidth=0.0)
    _dated(ax)
    ax.set_ylabel(f"[{unit}]" if unit != "1" else "")
    finished(ax, spoken(name))


def _panel(made: Track, p: int) -> Panel:
    parameter = made.parameters[p]
    changes = [c for c in made.changes if c.parameter == parameter.name or c.scaled]
    limits = [f for f in made.forecasts if f.parameter == parameter.name]
    return Panel(partial(_draw, made, p, parameter, changes, limits), parameter.sentence)


def _draw(
    made: Track,
    p: int,
    parameter: TrackedParameter,
    changes: Sequence[Change],
    limits: Sequence[Forecast],
    ax: Axes,
) -> None:
    axes_or_new(ax)
    dates, errors = made.history.dates, made.history.errors[:, p]
    told = np.isfinite(parameter.corrected)
    ax.errorbar(
        dates[told], parameter.corrected[told], 2.0 * errors[told], fmt="o", color=GREY,
        markersize=3.0, elinewidth=0.7, label="sessions",
    )  # fmt: skip
    rest = ~told & np.isfinite(parameter.values)
    if rest.any():
        ax.plot(
            dates[rest], parameter.values[rest], "o", mfc="none", color=GREY, markersize=3.5,
            label="left out",
        )  # fmt: skip
    band = parameter.band
    if np.isfinite(band.middle).any():
        ax.plot(band.dates, band.middle, color=PALETTE[0], linewidth=1.4, label="level")
        ax.fill_between(band.dates, band.low, band.high, color=PALETTE[0], alpha=0.2, linewidth=0.0)
    for k, change in enumerate(changes):
        first, last = (float(DATES.date2num(each)) for each in change.between)
        ax.axvspan(first, last, color=PALETTE[3], alpha=0.12, linewidth=0.0)
        label = "change" if not k else None
        onset = float(DATES.date2num(change.date))
        ax.axvline(onset, color=PALETTE[3], linewidth=1.2, linestyle="--", label=label)
    low, high = ax.get_ylim()
    for limit in limits:
        if not low - FAR * (high - low) < limit.limit < high + FAR * (high - low):
            continue
        ax.axhline(limit.limit, color=INK, linewidth=1.0, linestyle=":", label="limit")
    _dated(ax)
    ax.set_ylabel(f"[{parameter.unit}]" if parameter.unit != "1" else "")
    finished(ax, spoken(parameter.name))


def _dated(ax: Axes) -> None:
    locator = DATES.AutoDateLocator(minticks=3, maxticks=6)
    ax.xaxis.set_major_locator(locator)
    ax.xaxis.set_major_formatter(DATES.ConciseDateFormatter(locator))
    ax.xaxis.get_offset_text().set(color=INK, fontsize=LEAST)
