"""Figures without pyplot's global state, the colours of all plots, and no more points than show."""

from __future__ import annotations

import contextlib
import io
import math
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, ScalarFormatter
from numpy.typing import NDArray

from flexspline.logs.channels import CHANNELS

__all__ = [
    "GREY",
    "INK",
    "MOST_COLOURED_RUNS",
    "MOST_POINTS",
    "PALETTE",
    "Bands",
    "Panel",
    "PlainFigure",
    "axes_or_new",
    "banded",
    "channel_label",
    "colours_of_runs",
    "legend",
    "orders_axis",
    "outline",
    "own_style",
    "panelled",
    "plain",
    "spread_evenly",
    "titled",
]

#: Okabe and Ito's colours that read on white and on black.
PALETTE = ("#0072B2", "#E69F00", "#009E73", "#D55E00", "#CC79A7", "#56B4E9")
INK = "#26282b"
GREY = "#8a8f98"
MOST_COLOURED_RUNS = 10
NARROW = 300.0  # ratio of an axis' ends up to which three numbers a decade have room

_CHANNEL_WORDS = {
    "output_position": "output angle [rad]",
    "output_velocity": "output velocity [rad/s]",
    "output_acceleration": "output acceleration [rad/s²]",
    "motor_position": "motor angle [rad]",
    "motor_velocity": "motor velocity [rad/s]",
    "motor_torque": "motor torque [Nm]",
    "motor_current": "motor current [A]",
    "sensor_torque": "sensor torque [Nm]",
    "sensor_voltage": "sensor voltage [V]",
    "motor_temperature": "motor temperature [°C]",
    "temperature": "temperature [°C]",
    "reference_torque": "reference torque [Nm]",
    "torsion": "torsion [rad]",
    "time": "time [s]",
}

Array = NDArray[np.float64]

MOST_POINTS = 20_000
LEAST_IN_BIN = 5


_STYLE = threading.RLock()


@contextlib.contextmanager
def own_style() -> Iterator[None]:
    """Draw as Matplotlib does by default, whatever a user's matplotlibrc says (`text.usetex`).

    These settings are Matplotlib's global state: one thread at a time.
    """
    with _STYLE, matplotlib.rc_context():
        matplotlib.rcdefaults()
        yield


@dataclass(frozen=True)
class Panel:
    """One view: what draws it on axes, and what to look for in it."""

    draw: Callable[[Axes], object]
    look_for: str


class PlainFigure(Figure):
    """A figure that pyplot does not know, so nothing has to be closed; notebooks show it."""

    def __init__(self, width: float, height: float) -> None:
        """Make an empty figure of this size in inches."""
        super().__init__(figsize=(width, height), layout="constrained")
        FigureCanvasAgg(self)

    def _repr_png_(self) -> bytes:
        made = io.BytesIO()
        self.savefig(made, format="png", dpi=100)
        return made.getvalue()


def panelled(panels: Sequence[Panel], height: float) -> PlainFigure:
    """Return a figure of the panels, two in a row, each row `height` inches."""
    rows = -(-len(panels) // 2)
    figure = PlainFigure(11.0, height * rows)
    cells = figure.subfigures(rows, 2, squeeze=False).ravel()
    for cell, panel in zip(cells, panels, strict=False):
        panel.draw(cell.add_subplot())
    return figure


def axes_or_new(ax: Axes | None, width: float = 6.0, height: float = 3.8) -> Axes:
    """Return the axes, or those of a new figure, with a light grid and nothing superfluous."""
    if ax is None:
        ax = PlainFigure(width, height).add_subplot()
    ax.grid(True, color=GREY, alpha=0.25, linewidth=0.6)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)
    ax.spines[["left", "bottom"]].set_color(INK)
    ax.tick_params(colors=INK, labelcolor=INK, labelsize=8.5)
    for part in (ax.xaxis.label, ax.yaxis.label):
        part.set_color(INK)
        part.set_fontsize(9.5)
    return ax


def titled(ax: Axes, title: str) -> None:
    """Set a title that does not shout."""
    ax.set_title(title, loc="left", fontsize=10.5, color=INK, parse_math=False)


def legend(ax: Axes, columns: int = 1, *, beside: bool = False) -> None:
    """Add a legend of what has a label, if anything has; `beside` the axes where they are full."""
    if not ax.get_legend_handles_labels()[1]:
        return
    ax.legend(
        fontsize=7.5,
        loc="upper left" if beside else "best",
        frameon=False,
        labelcolor=INK,
        ncols=columns,
        bbox_to_anchor=(1.0, 1.0) if beside else None,
    )


def orders_axis(ax: Axes) -> None:
    """Make the horizontal axis of what is drawn logarithmic, marked with plain numbers.

    Where no order above zero is drawn, as of runs of which few rows count, it stays as it is.
    """
    if not math.isfinite(ax.xaxis.get_minpos()):
        return
    ax.set_xscale("log")
    low, high = ax.get_xlim()
    few = high < NARROW * low
    ax.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if few else (1.0,)))
    ax.xaxis.set_major_formatter(ScalarFormatter())
    ax.xaxis.set_minor_formatter(NullFormatter())


def plain(name: str) -> str:
    """Return a name as a legend shows it literally: no mathematics, not hidden, not endless."""
    shown = name if len(name) <= 40 else name[:19] + " … " + name[-18:]
    return (" " if shown.startswith("_") else "") + shown.replace("$", r"\$")


def channel_label(channel: str) -> str:
    """Return the label of an axis, with its unit."""
    if channel in _CHANNEL_WORDS:
        return _CHANNEL_WORDS[channel]
    return f"{channel.replace('_', ' ')} [{CHANNELS[channel].unit}]"


def colours_of_runs(count: int) -> list[Any]:
    """Return a colour for each run: a sequence that reads in grey too, one for too many runs."""
    if count == 1 or count > MOST_COLOURED_RUNS:
        return [PALETTE[0]] * count
    shades = matplotlib.colormaps["viridis"]
    return [shades(0.22 + 0.6 * k / (count - 1)) for k in range(count)]


@dataclass(frozen=True)
class Bands:
    """Median and 5 and 95 % points of values in bins, (bins,); NaN in bins with too few."""

    centre: Array
    median: Array
    low: Array
    high: Array


def outline(values: Array, most: int = MOST_POINTS) -> NDArray[np.intp]:
    """Return indices (m,), m ≤ most, that keep the least and largest value of every stretch."""
    count = len(values)
    if count <= most:
        return np.arange(count)
    width = -(-count // (most // 2))
    full = count // width * width
    blocks = np.nan_to_num(values[:full]).reshape(-1, width)
    first = np.arange(0, full, width)
    both = np.stack([first + blocks.argmin(axis=1), first + blocks.argmax(axis=1)], axis=1)
    return np.asarray(np.sort(both, axis=1).ravel())


def spread_evenly(count: int, most: int = MOST_POINTS) -> NDArray[np.intp]:
    """Return at most `most` indices out of `count`, scattered by the golden ratio, not in step.

    They come in no order of time, so that runs do not paint over each other.
    """
    if count <= most:
        return np.argsort(np.modf(np.arange(count) * 0.618033988749895)[0])
    strides = np.modf(np.arange(most) * 0.618033988749895)[0]
    return np.asarray((strides * count).astype(np.intp))


def banded(x: Array, y: Array, bins: int = 60) -> Bands:
    """Return the bands of y in equally wide bins of x; both (N,), rows not finite left out."""
    good = np.isfinite(x) & np.isfinite(y)
    x, y = x[good], y[good]
    empty = np.empty(0)
    if not len(x):
        return Bands(empty, empty, empty, empty)
    edges = np.linspace(x.min(), x.max(), bins + 1)
    place = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, bins - 1)
    order = np.argsort(place, kind="stable")
    groups = np.split(y[order], np.searchsorted(place[order], np.arange(1, bins)))
    nothing = [np.nan] * 3
    points = np.array(
        [np.percentile(g, [5, 50, 95]) if len(g) >= LEAST_IN_BIN else nothing for g in groups]
    )
    return Bands(0.5 * (edges[:-1] + edges[1:]), points[:, 1], points[:, 0], points[:, 2])
