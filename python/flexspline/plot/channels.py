"""The channels of a log over time: faults where they are, gaps, and which effects it excites."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch
from numpy.typing import NDArray

from flexspline.logs.channels import CHANNELS
from flexspline.logs.checks import check
from flexspline.logs.checks.samples import DROP_STEPS
from flexspline.logs.log import emptied
from flexspline.logs.segments import median_step, runs
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
    from flexspline.logs.checks import Excited, Finding, Findings
    from flexspline.logs.log import Log

__all__ = ["channel_over_time", "plot_channels", "plot_log"]

COLOURS = {"error": PALETTE[3], "fault": PALETTE[1], "note": GREY}
Array = NDArray[np.float64]
WHOLE = 0.98  # share of the run from which a finding is of the channel and not of a place in it
EVERYWHERE = ("time", "all")  # channels of findings that concern every channel
SPARSE = 0.5  # of the rows between the first and the last: fewer found rows are single ones
MOST_NAMED = 3
NARROWEST = 0.003  # of the axis' width, that a single row is seen
GAP, GAP_COLOUR = "no samples", PALETTE[4]
DROPPED = "dropped_samples"  # a finding whose places are the gaps
IN_A_ROW = 4  # names of effects that have room beside each other


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
    told = () if findings is None else findings.excited
    excited = [one for one in told if one.excited is not None]
    shown = [name for name in log.channels if name != "time"] or ["time"]
    below = 0.2 * -(-len(excited) // IN_A_ROW) + 0.35 if excited else 0.0
    figure = PlainFigure(10.0, 1.25 * len(shown) + 0.8 + below)
    heights = [1.25] * len(shown) + ([below] if excited else [])
    grid = figure.add_gridspec(len(heights), 1, height_ratios=heights)
    axes: list[Axes] = []
    for k, name in enumerate(shown):
        axes.append(figure.add_subplot(grid[k], sharex=axes[0] if axes else None))
        channel_over_time(log, name, [] if findings is None else findings, axes[k])
        axes[k].set_xlabel("")
        axes[k].tick_params(labelbottom=k == len(shown) - 1)
    of_all = [_said(f) for f in findings or () if f.channel in EVERYWHERE]
    axes[-1].set_xlabel(_clock(log)[1])
    said = "channels" if findings is None else str(findings).partition("\n")[0].split(": ")[-1]
    figure.align_ylabels(axes)
    head = [f"{log.name}: {said}", *([" · ".join(of_all)] if of_all else [])]
    figure.suptitle("\n".join(head), x=0.01, ha="left", fontsize=TITLE, color=INK, parse_math=False)
    if excited:
        effects_excited(excited, figure.add_subplot(grid[-1]))
    gaps = _gaps(log, findings or ())
    others = [f.severity for f in findings or () if f.name != DROPPED or not gaps]
    there: dict[str, str] = {s: colour for s, colour in COLOURS.items() if s in others}
    there |= {GAP: GAP_COLOUR} if gaps else {}
    if there:
        marks = [Patch(color=colour, alpha=0.45, label=said) for said, colour in there.items()]
        figure.legend(
            handles=marks, loc="outside lower right", ncols=4, frameon=False, labelcolor=INK,
            fontsize=LEAST,
        )  # fmt: skip
    return figure


def effects_excited(excited: Sequence[Excited], ax: Axes) -> Axes:
    """Draw the names of effects, with a full mark where they are excited and an open one if not."""
    rows = -(-len(excited) // IN_A_ROW)
    for k, one in enumerate(excited):
        x, y = k // rows / IN_A_ROW, -(k % rows)
        fill = PALETTE[2] if one.excited else "none"
        ax.scatter(x, y, s=30.0, facecolor=fill, edgecolor=PALETTE[2] if one.excited else GREY)
        words = one.effect.replace("_", " ")
        ax.text(x + 0.012, y, words, fontsize=LEAST, va="center", color=INK)
    ax.set_xlim(-0.01, 1.0)
    ax.set_ylim(0.6 - rows, 0.6)
    ax.set_axis_off()
    title = "effects: full mark, excited by this run; open mark, hardly (the check says why)"
    ax.set_title(title, loc="left", fontsize=LEAST, color=INK)
    return ax


def channel_over_time(
    log: Log, channel: str, findings: Sequence[Finding] = (), ax: Axes | None = None
) -> Axes:
    """Draw one channel and what was found of it; what was found of the time stamps is in all.

    Where samples are missing, the line is broken and the gap shaded.
    """
    ax = axes_or_new(ax, 10.0, 2.0)
    log = emptied(log)
    clock, label = _clock(log)
    gaps = _gaps(log, findings)
    _line(ax, clock, log[channel], [row for row, _, _ in gaps])
    for left, right in _wide_enough(clock, gaps):
        ax.axvspan(left, right, color=GAP_COLOUR, alpha=0.3, linewidth=0)
    named = [f for f in findings if channel in f.channel.split(" or ")]
    for finding in [*named, *(f for f in findings if f.channel in EVERYWHERE and f not in named)]:
        if finding.name != DROPPED or not gaps:
            _shade(ax, clock, finding)
    if named:
        more = len(named) - MOST_NAMED
        said = " · ".join(_said(f) for f in named[:MOST_NAMED]) + (f" +{more}" if more > 0 else "")
        colour = COLOURS[named[0].severity] if named[0].severity != "note" else INK
        ax.set_title(said, loc="right", fontsize=LEAST, color=colour, parse_math=False)
    ax.set_ylabel(_short_label(channel), rotation=0, ha="right", va="center", labelpad=10)
    ax.set_xlabel(label)
    return ax


def _line(ax: Axes, clock: Array, values: Array, breaks: Sequence[int]) -> None:
    """Draw values (N,) over the clock, without a line into the rows `breaks`."""
    rows = outline(values)
    at = np.unique(np.searchsorted(rows, breaks))
    x, y = (np.insert(data[rows], at, np.nan) for data in (clock, values))
    ax.plot(x, y, color=PALETTE[0], linewidth=0.8)


def _gaps(log: Log, findings: Sequence[Finding]) -> list[tuple[int, float, float]]:
    """First row behind each gap, and where the gap begins and ends [s]; none over row numbers."""
    time = log["time"]
    if _clock(log)[0] is not time:
        return []
    dropped = any(finding.name == DROPPED for finding in findings)
    behind = runs(time, DROP_STEPS * median_step(time) if dropped else None)[1:, 0]
    return [(int(row), float(time[row - 1]), float(time[row])) for row in behind]


def _wide_enough(
    clock: Array, gaps: Sequence[tuple[int, float, float]]
) -> list[tuple[float, float]]:
    """Gaps as wide as can be seen, those that then touch as one."""
    least, merged = NARROWEST * float(clock[-1] - clock[0]), list[tuple[float, float]]()
    for _, start, end in gaps:
        more = max(0.0, 0.5 * (least - (end - start)))
        left, right = start - more, end + more
        if merged and left <= merged[-1][1]:
            left = merged.pop()[0]
        merged.append((left, right))
    return merged


def _shade(ax: Axes, clock: Array, finding: Finding) -> None:
    first, last = (min(max(row, 0), len(clock)) for row in finding.rows)
    if last <= first or last - first >= WHOLE * len(clock):
        return
    if finding.unit == "rows" and finding.size < SPARSE * (last - first):
        return  # single rows here and there: shaded, all between them would seem wrong
    left, right = clock[first], clock[last - 1]
    least = NARROWEST * float(clock[-1] - clock[0])
    if right - left < least:
        left, right = 0.5 * (left + right - least), 0.5 * (left + right + least)
    ax.axvspan(left, right, color=COLOURS[finding.severity], alpha=0.3, linewidth=0)


def _clock(log: Log) -> tuple[Array, str]:
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
