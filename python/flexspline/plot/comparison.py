"""The map of a comparison: RMS against the noise floor over everything, the worst first.

Several models in one figure: measured beside all of them, and what each misses where.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from flexspline.comparison.result import ranked
from flexspline.comparison.search import Band
from flexspline.formatting import told_apart
from flexspline.orders.parts import pairs
from flexspline.plot.canvas import (
    GREY,
    INK,
    LEAST,
    PALETTE,
    Panel,
    PlainFigure,
    axes_or_new,
    banded,
    channel_label,
    finished,
    legend,
    log_axis,
    middle,
    outline,
    part_of,
    plain,
    short_labels,
    titled,
)
from flexspline.plot.orders import FIRST

if TYPE_CHECKING:
    from flexspline.comparison.models import ModelComparison, ModelRun
    from flexspline.comparison.result import Comparison

__all__ = [
    "bands_over",
    "missed_over",
    "model_panels",
    "models_over_time",
    "panels",
    "plot_comparison",
    "plot_models",
    "plot_orders",
    "residual_orders",
]

Array = NDArray[np.float64]

ORDERS = "position_order"
ACROSS = 3
HEADROOM = 1.12
TALLER = 2.0  # times the largest RMS before, up to which that after is drawn
FEW = 0.02  # of all rows: a band of fewer is hatched
MOST_TICKS = 7
MOST_NAMES = 6
MOST_LETTERS = 36  # of all names below an axis
ORDERS_OF_A_PAIR = (0.5, 13.0)  # from below its first; what is lower stands in that of the output
_BINS = 600


After = Mapping[str, Mapping[str, float]]

RUN = (
    "At most ten seconds from the middle of the first run. Where a model is judged on held-out "
    "rows, what is drawn is predicted by fits without them."
)
MISSED = (
    "Measured less modelled over all runs: median and the band that holds 90 % of the rows. A "
    "model that lacks nothing here lies on zero."
)
STYLES = ("-", "--", ":")
LOAD, VELOCITY, MODELLED = "reference_torque", "output_velocity", "modelled"


def plot_comparison(made: Comparison, after: After | None = None) -> PlainFigure:
    """Return the map: a panel for each covariate, what the gap follows first, on one scale.

    `after`: RMS of a better model, by covariate and label of its bands.
    """
    names = panels(made)
    down = -(-len(names) // ACROSS)
    figure = PlainFigure(3.7 * ACROSS, 2.7 * down)
    grid = figure.subplots(down, ACROSS, squeeze=False).ravel()
    banded = [name for name in names if name != ORDERS]
    highest = _highest(made, banded, after)
    for ax, name in zip(grid, names, strict=False):
        if name == ORDERS:
            residual_orders(made, ax=ax)
            continue
        bands_over(made, name, ax, after)
        ax.set_ylim(0.0, HEADROOM * highest)
        if after is not None:
            _marked_beyond(ax, made, name, after)
    for ax in grid[len(names) :]:
        ax.set_visible(False)
    if banded:
        lines, labels = grid[names.index(banded[0])].get_legend_handles_labels()
        figure.legend(lines, labels, loc="outside upper right", ncols=len(labels), fontsize=LEAST,
                      frameon=False, labelcolor=INK)  # fmt: skip
    return figure


def _highest(made: Comparison, names: list[str], after: After | None) -> float:
    """The largest RMS before and after, of this no more than `TALLER` times that before."""
    bands = [(name, band) for name in names for band in _drawn(made.by[name])]
    before = max((band.rmse for _, band in bands), default=1.0)
    later = [after[name][band.label] for name, band in bands] if after is not None else []
    return max(before, min(max(later, default=0.0), TALLER * before))


def _marked_beyond(ax: Axes, made: Comparison, name: str, after: After) -> None:
    """Write the RMS after into bands where it is above the axes."""
    top = ax.get_ylim()[1]
    for k, band in enumerate(_drawn(made.by[name])):
        later = after[name][band.label]
        if later > top:
            ax.annotate(f"↑ {later:.2g}", (k + 0.5, top), ha="center", va="top", fontsize=LEAST,
                        color=PALETTE[0])  # fmt: skip


def panels(made: Comparison) -> list[str]:
    """Return what the map shows, in its order: names of `made.by`, and position_order."""
    names = [name for name in ranked(made) if len(made.by[name]) > 1]
    if made.spectrum is None:
        return names
    told = [f.name for f in made.follows]
    place = told.index(ORDERS) if ORDERS in told else len(names)
    return [*names[:place], ORDERS, *names[place:]]


def bands_over(
    made: Comparison, name: str, ax: Axes | None = None, after: After | None = None
) -> Axes:
    """Draw RMS and noise floor, in the unit of the comparison, over the bands of one covariate."""
    ax = axes_or_new(ax, 4.5, 3.0)
    bands = _drawn(made[name])
    edges = np.arange(len(bands) + 1, dtype=np.float64)
    rmse, floor, error = (
        np.array([getattr(b, key) for b in bands])
        for key in ("rmse", "noise_floor", "noise_floor_error")
    )
    _steps(ax, edges, floor - 2.0 * error, floor + 2.0 * error, GREY, 0.45, "noise floor")
    over = np.maximum(rmse, floor)
    sure = np.array([b.significant for b in bands])
    _steps(ax, edges, floor, np.where(sure, over, floor), PALETTE[3], 0.3, "excess")
    label = "RMS" if after is None else "RMS before"
    ax.stairs(rmse, edges, color=INK, linewidth=1.3, baseline=None, label=label)
    if after is not None:
        later = np.array([after[name][b.label] for b in bands])
        ax.stairs(later, edges, color=PALETTE[0], linewidth=1.6, baseline=None, label="RMS after")
    middle = edges[:-1] + 0.5
    ax.plot(middle[sure], rmse[sure], "o", color=PALETTE[3], markersize=3.5)
    _marked(ax, made, name, bands)
    _marked_few(ax, made, bands)
    ax.set(ylabel=f"RMS [{made.unit}]", xlim=(0, len(bands)))
    titled(ax, _title(made, name, made.words[name]))
    return ax


def residual_orders(made: Comparison, pair: str = "output_housing", ax: Axes | None = None) -> Axes:
    """Draw the residual's amplitude over the orders of one pair of parts, with the orders found.

    Only for a comparison whose joint turns.
    """
    ax = axes_or_new(ax, 4.5, 3.0)
    assert made.spectrum is not None
    table = {entry.name: entry for entry in pairs({**made.runs[0].log.facts, **_gear(made)})}
    turns = table[pair].turns
    spectrum = made.spectrum.spectrum
    known = np.isfinite(spectrum.amplitude) & (spectrum.order > 0)
    order, amplitude = spectrum.order[known], spectrum.amplitude[known]
    first, last = ORDERS_OF_A_PAIR if pair != "output_housing" else (0.0, np.inf)
    inside = (order >= first * turns) & (order <= last * turns)
    at, highest = _thinned(order[inside] / turns, amplitude[inside])
    ax.plot(at, highest, color=INK, linewidth=0.8, label="residual")
    label = "order found, ± 2 standard errors"
    for peak in made.orders:
        place = peak.per_output_turn / turns
        if len(at) and at[0] <= place <= at[-1]:
            ax.errorbar(
                place,
                peak.amplitude,
                2.0 * peak.error,
                fmt="v",
                color=PALETTE[3],
                markersize=4,
                linewidth=1.0,
                label=label,
            )
            label = ""
    words = table[pair].words
    ax.set(xlabel=f"order per turn of {words}", ylabel=f"amplitude [{made.unit}]", ylim=(0, None))
    if pair == "output_housing" and len(at):  # a run of few rows has no spectrum
        ax.set_xlim(FIRST if at[-1] > 1.0 else at[0], at[-1])
        log_axis(ax, "x")
    title = "orders of what turns" if pair == "output_housing" else words
    titled(ax, _title(made, ORDERS, title) if pair == "output_housing" else title)
    return ax


def plot_orders(made: Comparison) -> PlainFigure:
    """Return the order spectra of the residual, one panel for each pair of parts."""
    known = [p for p in pairs({**made.runs[0].log.facts, **_gear(made)}) if p.turns > 0]
    assert made.spectrum is not None
    shown = [p for p in known if p.turns < made.spectrum.scanned[1]]
    figure = PlainFigure(11.0, 2.6 * len(shown))
    for ax, pair in zip(figure.subplots(len(shown), 1, squeeze=False).ravel(), shown, strict=True):
        residual_orders(made, pair.name, ax)
    legend(figure.axes[0])
    return figure


def _gear(made: Comparison) -> dict[str, object]:
    return {k: made.facts[k] for k in ("gear_ratio", "output_spline") if k in made.facts}


def _drawn(bands: tuple[Band, ...]) -> list[Band]:
    """All bands, of many kinds the worst only."""
    if bands[0].lower is not None or bands[-1].upper is not None or len(bands) <= 2 * MOST_NAMES:
        return list(bands)
    worst = sorted(bands, key=lambda band: -band.rmse)[: 2 * MOST_NAMES]
    return [band for band in bands if band in worst]


def _steps(
    ax: Axes, edges: Array, low: Array, high: Array, colour: str, alpha: float, label: str
) -> None:
    ax.fill_between(edges, np.append(low, low[-1]), np.append(high, high[-1]), step="post",
                    color=colour, alpha=alpha, linewidth=0, label=label)  # fmt: skip


def _marked(ax: Axes, made: Comparison, name: str, bands: list[Band]) -> None:
    """Ticks: edges of bands, or names of kinds."""
    kinds = all(band.lower is None and band.upper is None for band in bands)
    if kinds:
        shown = short_labels([b.label for b in bands])
        room = min(MOST_NAMES, MOST_LETTERS // max(map(len, shown)))
        every = -(-len(bands) // room)
        at = np.arange(0, len(bands), every)
        ax.set_xticks(at + 0.5, [shown[k].replace("$", r"\$") for k in at])
        ax.set_xlabel(made.words[name])
        return
    every = max(1, -(-(len(bands) + 1) // MOST_TICKS))
    ends = [band.lower for band in bands] + [bands[-1].upper]
    marks = {k: end for k in range(0, len(ends), every) if (end := ends[k]) is not None}
    ax.set_xticks(list(marks), [t.replace("-", "−") for t in told_apart(list(marks.values()))])
    ax.set_xlabel(f"{made.words[name]} [{made.units[name]}]")


def _marked_few(ax: Axes, made: Comparison, bands: list[Band]) -> None:
    """Hatch the bands that have next to none of the rows."""
    for k, band in enumerate(bands):
        if band.rows < FEW * made.overall.rows:
            ax.axvspan(k, k + 1, facecolor="none", edgecolor=GREY, hatch="////", linewidth=0.0,
                       alpha=0.4, zorder=0.5)  # fmt: skip


def _title(made: Comparison, name: str, words: str) -> str:
    words = words[0].upper() + words[1:]
    for f in made.follows:
        if f.name == name:
            return f"{words}: {100.0 * min(f.share, 1.0):.0f} % of the excess"
    return words


def _thinned(order: Array, amplitude: Array) -> tuple[Array, Array]:
    """The highest amplitude of each of a few hundred bins."""
    if len(order) <= _BINS:
        return order, amplitude
    first = np.unique(np.searchsorted(order, np.geomspace(order[0], order[-1], _BINS)[:-1]))
    ends = [*first[1:].tolist(), len(order)]
    at = np.array([a + int(np.argmax(amplitude[a:b])) for a, b in zip(first, ends, strict=True)])
    return order[at], amplitude[at]


def plot_models(made: ModelComparison) -> PlainFigure:
    """Return the figure: a run over time, and the residuals over load and velocity below it."""
    first, *below = model_panels(made)
    figure = PlainFigure(11.0, 7.2)
    grid = figure.add_gridspec(2, len(below))
    first.draw(figure.add_subplot(grid[0, :]))
    for column, panel in enumerate(below):
        panel.draw(figure.add_subplot(grid[1, column]))
    return figure


def model_panels(made: ModelComparison) -> list[Panel]:
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
    return finished(ax, f"Measured and modelled, {plain(one.log.name)}{part}")


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
    return finished(ax, f"Residual over {over}: median, band of 90 %")


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
