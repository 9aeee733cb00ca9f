"""The channels of a log over time, with the faults that the checks found where they are."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch
from numpy.typing import NDArray

from flexspline.logs.channels import CHANNELS
from flexspline.logs.checks import check
from flexspline.logs.plausible import emptied
from flexspline.plot.canvas import (
    GREY,
    INK,
    LEAST,
    PALETTE,
    TITLE,
    PlainFigure,
    axes_or_new,
    channel_label,
    outline,
)

if TYPE_CHECKING:
    from flexspline.logs.checks import Finding, Findings
    from flexspline.logs.log import Log

__all__ = ["channel_over_time", "plot_channels", "plot_log"]

COLOURS = {"error": PALETTE[3], "fault": PALETTE[1], "note": GREY}
WHOLE = 0.98  # share of the run from which a finding is of the channel and not of a place in it
EVERYWHERE = ("time", "all")  # channels of findings that concern every channel
MOST_NAMED = 3
NARROWEST = 0.003  # of the axis' width, that a single row is seen


def plot_log(log: Log, effects: Sequence[str] = (), target: str | None = None) -> PlainFigure:
    """Return the figure of a log with all that `check` finds for these effects and this target."""
    return plot_channels(log, check(log, effects=effects, target=target))


def plot_channels(log: Log, findings: Findings | None = None) -> PlainFigure:
    """Return a figure: each channel over time, one below the other, and the findings beside them.

    A finding with a place shades its rows; what is so all along, such as a delay, stands as a name
    above the channel. Where the time does not increase, rows are counted instead. What no
    instrument reads is left out: beside an overload nothing else would be seen.
    """
    log = emptied(log)
    shown = [name for name in log.channels if name != "time"] or ["time"]
    figure = PlainFigure(10.0, 1.25 * len(shown) + 0.8)
    axes = figure.subplots(len(shown), 1, sharex=True, squeeze=False).ravel()
    for ax, name in zip(axes, shown, strict=True):
        channel_over_time(log, name, [] if findings is None else findings, ax)
        ax.set_xlabel("")
    of_all = [_said(f) for f in findings or () if f.channel in EVERYWHERE]
    axes[-1].set_xlabel(": ".join([_clock(log)[1], *([" · ".join(of_all)] if of_all else [])]))
    said = "channels" if findings is None else str(findings).partition("\n")[0].split(": ")[-1]
    figure.align_ylabels(axes)
    figure.suptitle(
        f"{log.name}: {said}", x=0.01, ha="left", fontsize=TITLE, color=INK, parse_math=False
    )
    there = [s for s in COLOURS if findings and any(f.severity == s for f in findings)]
    if there:
        marks = [Patch(color=COLOURS[s], alpha=0.45, label=s) for s in there]
        figure.legend(
            handles=marks, loc="outside lower right", ncols=3, frameon=False, labelcolor=INK,
            fontsize=LEAST,
        )  # fmt: skip
    return figure


def channel_over_time(
    log: Log, channel: str, findings: Sequence[Finding] = (), ax: Axes | None = None
) -> Axes:
    """Draw one channel and what was found of it; what was found of the time stamps is in all."""
    ax = axes_or_new(ax, 10.0, 2.0)
    log = emptied(log)
    clock, label = _clock(log)
    rows = outline(log[channel])
    ax.plot(clock[rows], log[channel][rows], color=PALETTE[0], linewidth=0.8)
    named = [f for f in findings if channel in f.channel.split(" or ")]
    for finding in [*named, *(f for f in findings if f.channel in EVERYWHERE and f not in named)]:
        _shade(ax, clock, finding)
    if named:
        more = len(named) - MOST_NAMED
        said = " · ".join(_said(f) for f in named[:MOST_NAMED]) + (f" +{more}" if more > 0 else "")
        colour = COLOURS[named[0].severity] if named[0].severity != "note" else INK
        ax.set_title(said, loc="right", fontsize=LEAST, color=colour, parse_math=False)
    ax.set_ylabel(_short_label(channel), rotation=0, ha="right", va="center", labelpad=10)
    ax.set_xlabel(label)
    return ax


def _shade(ax: Axes, clock: NDArray[np.float64], finding: Finding) -> None:
    first, last = (min(max(row, 0), len(clock)) for row in finding.rows)
    if last <= first or last - first >= WHOLE * len(clock):
        return
    left, right = clock[first], clock[last - 1]
    least = NARROWEST * float(clock[-1] - clock[0])
    if right - left < least:
        left, right = 0.5 * (left + right - least), 0.5 * (left + right + least)
    ax.axvspan(left, right, color=COLOURS[finding.severity], alpha=0.3, linewidth=0)


def _clock(log: Log) -> tuple[NDArray[np.float64], str]:
    """The time stamps where they can be an axis, else the numbers of the rows; and the label."""
    time = log["time"]
    if len(time) > 1 and np.isfinite(time).all() and (np.diff(time) > 0.0).all():
        return time, channel_label("time")
    return np.arange(len(time), dtype=np.float64), "row"


def _said(finding: Finding) -> str:
    size = f" {finding.amount}".replace("-", "−") if finding.unit else ""
    return finding.name.replace("_", " ") + size


def _short_label(channel: str) -> str:
    """The name over its unit: there is little room beside a flat panel."""
    return f"{channel.replace('_', ' ')}\n[{CHANNELS[channel].unit or '–'}]"
