"""What each effect contributes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes

from flexspline.errors import InputError, listed
from flexspline.least_squares.result import contributions
from flexspline.plot.canvas import (
    GREY,
    INK,
    PALETTE,
    axes_or_new,
    channel_label,
    legend,
    plain,
    titled,
)
from flexspline.plot.thin import banded, outline

if TYPE_CHECKING:
    from flexspline.least_squares.result import Fit, FittedRun

__all__ = ["components"]

STRETCH = 10.0  # s of a run that can be looked at in one go
LOOSE = 0.5  # a band wider than this part of the median's range hides the median
STYLES = ("-", "--", ":")


def components(
    fit: Fit, over: str = "time", ax: Axes | None = None, *, run: int | None = None
) -> Axes:
    """Draw the contribution of each effect, in the target's unit.

    Effects that the runs cannot tell apart are drawn as their sum.

    Parameters
    ----------
    over : "time" draws the measured and each part of the predicted y over at most ten seconds
        from the middle of a run; another channel the median of each effect over it within
        the band that holds 90 %, or the band alone where the effect hangs on something else.
    run : number of the run; None: the first over time, all over another channel.

    Raises
    ------
    InputError
        Where a run lacks the channel, or there is no such run.
    """
    ax = axes_or_new(ax)
    if run is not None and not 0 <= run < len(fit.runs):
        raise InputError(f"there is no run {run}; the fit has runs 0 to {len(fit.runs) - 1}")
    if over == "time":
        _over_time(fit, fit.runs[run or 0], ax)
    else:
        _over_channel(fit, list(fit.runs) if run is None else [fit.runs[run]], over, ax)
    ax.axhline(0.0, color=INK, linewidth=0.6)
    ax.set_ylabel(f"{fit.target.replace('_', ' ')} [{fit.unit}]")
    legend(ax, beside=True)
    return ax


def _over_time(fit: Fit, run: FittedRun, ax: Axes) -> None:
    time = run.log["time"]
    middle = 0.5 * (time[0] + time[-1])
    some = slice(*np.searchsorted(time, [middle - STRETCH / 2, middle + STRETCH / 2]))
    time = time - time[0]
    at = outline(run.measured[some]) + some.start
    ax.plot(time[at], run.measured[at], color=GREY, linewidth=1.0, label="measured")
    parts = contributions(fit, run)
    rough = {name: float(np.nanmean(np.abs(np.diff(y[some])))) for name, y in parts.items()}
    behind = sorted(parts, key=lambda name: -rough[name])
    for (name, values), (colour, line) in zip(parts.items(), _looks(), strict=False):
        at = outline(values[some]) + some.start
        ax.plot(
            time[at],
            values[at],
            line,
            color=colour,
            linewidth=1.3,
            label=name,
            zorder=2.1 + 0.01 * behind.index(name),
        )
    ax.set_xlabel("time since the start of the run [s]")
    titled(ax, f"Contribution of each effect, {plain(run.log.name)}")


def _over_channel(fit: Fit, runs: list[FittedRun], channel: str, ax: Axes) -> None:
    for each in runs:
        if channel not in each.log:
            raise InputError(
                f"log '{each.log.name}': no channel '{channel}'; it has {listed(each.log.channels)}"
            )
    x = np.concatenate([each.log[channel][each.counts] for each in runs])
    parts = [{k: v[each.counts] for k, v in contributions(fit, each).items()} for each in runs]
    for name, (colour, line) in zip(parts[0] if parts else {}, _looks(), strict=False):
        bands = banded(x, np.concatenate([part[name] for part in parts]))
        middle = bands.median[np.isfinite(bands.median)]
        rounding = 1e-6 * float(np.abs(middle).max(initial=0.0))
        tells = np.nanmedian(bands.high - bands.low) <= LOOSE * np.ptp(middle) + rounding
        ax.fill_between(
            bands.centre,
            bands.low,
            bands.high,
            color=colour,
            alpha=0.2,
            linewidth=0,
            label=None if tells else f"{name} (90 %)",
        )
        if tells:
            ax.plot(
                bands.centre,
                bands.median,
                line,
                color=colour,
                linewidth=1.5,
                marker=".",
                markersize=2.5,
                label=name,
            )
    ax.set_xlabel(channel_label(channel))
    titled(ax, f"Contribution of each effect over {channel.replace('_', ' ')}")


def _looks() -> list[tuple[str, str]]:
    return [(colour, line) for line in STYLES for colour in PALETTE]
