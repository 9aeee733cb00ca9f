"""Figures without pyplot's global state, the colours of all plots, and no more points than show."""

from __future__ import annotations

import contextlib
import io
import math
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import takewhile
from typing import Any, Literal

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import text_to_path
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, MaxNLocator, NullFormatter
from numpy.typing import NDArray

from flexspline.errors import InputError
from flexspline.logs.channels import CHANNELS

__all__ = [
    "GREY",
    "INK",
    "LEAST",
    "MOST_COLOURED_RUNS",
    "MOST_POINTS",
    "PALETTE",
    "STRETCH",
    "TITLE",
    "Bands",
    "Panel",
    "PlainFigure",
    "axes_or_new",
    "banded",
    "can_be_drawn",
    "channel_label",
    "colours_of_runs",
    "finished",
    "legend",
    "log_axis",
    "middle",
    "outline",
    "own_style",
    "panelled",
    "part_of",
    "plain",
    "short_labels",
    "spread_evenly",
    "titled",
]

#: Okabe and Ito's colours that read on white and on black.
PALETTE = ("#0072B2", "#E69F00", "#009E73", "#D55E00", "#CC79A7", "#56B4E9")
INK = "#26282b"
GREY = "#8a8f98"
MOST_COLOURED_RUNS = 10
NARROW = 300.0  # ratio of an axis' ends up to which three numbers a decade have room
WITHIN_A_DECADE = 8.0  # ratio below which 1, 2 and 5 of a decade would be fewer than three numbers

# points; a report scales a figure so that the least text is 9 px high on a screen of 400 px
TITLE, LABELS, TICKS, LEAST = 10.5, 9.5, 8.5, 8.0
TICK_EMS = 4.5  # widths of the letter m that a number on the horizontal axis and its gap may take
HANDLE = 1.6  # of these, a line in a legend
MARGIN = 0.15  # of the width of axes before they are laid out: room for numbers beside them

STRETCH = 10.0  # s of a run that can be looked at in one go

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
    """One view: what draws it on axes, what to look for in it, and its height in inches."""

    draw: Callable[[Axes], object]
    look_for: str
    height: float = 3.4


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


def panelled(panels: Sequence[Panel]) -> PlainFigure:
    """Return a figure of the panels, two in a row, each row as high as its higher panel."""
    heights = [max(p.height for p in panels[k : k + 2]) for k in range(0, len(panels), 2)]
    figure = PlainFigure(11.0, sum(heights))
    cells = figure.subfigures(len(heights), 2, squeeze=False, height_ratios=heights).ravel()
    for cell, panel in zip(cells, panels, strict=False):
        panel.draw(cell.add_subplot())
    return figure


def can_be_drawn(draw: Callable[[Any], object], made: object) -> bool:
    """Whether a drawing has something to show: it is refused where a result lacks that."""
    try:
        draw(made)
    except InputError:
        return False
    return True


def axes_or_new(ax: Axes | None, width: float = 6.0, height: float = 3.8) -> Axes:
    """Return the axes, or those of a new figure, with a light grid and nothing superfluous."""
    if ax is None:
        ax = PlainFigure(width, height).add_subplot()
    ax.grid(True, color=GREY, alpha=0.25, linewidth=0.6)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)
    ax.spines[["left", "bottom"]].set_color(INK)
    ax.tick_params(which="both", colors=INK, labelcolor=INK, labelsize=TICKS)
    for axis in (ax.xaxis, ax.yaxis):
        axis.label.set(color=INK, fontsize=LABELS)
        axis.get_offset_text().set(color=INK, fontsize=LEAST)
    locator = ax.xaxis.get_major_locator()
    if isinstance(locator, MaxNLocator):
        locator.set_params(nbins=max(2, min(9, int(_room(ax) / (TICK_EMS * TICKS)))))
    return ax


def titled(ax: Axes, title: str, above: float = 0.0) -> None:
    """Set a title that does not shout, in as many lines as it needs, points above the axes.

    A legend lifts it. Dollars are dollars, however `plain` had to write them for a legend.
    """
    words = title.replace(r"\$", "$").replace("\n", " ").split(" ")
    shown = "\n".join(_broken(words, _room(ax)))
    ax.set_title(
        shown, loc="left", fontsize=TITLE, color=INK, parse_math=False, pad=5.0 + above
    )  # fmt: skip
    if ax.get_legend() is not None and not above:
        legend(ax)


def legend(ax: Axes) -> None:
    """Add a legend of what has a label, if anything has, between title and axes: never over data.

    It has as many columns as fit above the axes.
    """
    handles, labels = ax.get_legend_handles_labels()
    if not labels:
        return
    columns = _columns([_width(label, LEAST) for label in labels], _room(ax))
    ax.legend(
        handles, labels, fontsize=LEAST, frameon=False, labelcolor=INK, ncols=columns,
        loc="lower right", bbox_to_anchor=(1.0, 1.0), borderpad=0.0, borderaxespad=0.3,
        labelspacing=0.3, handlelength=HANDLE, handletextpad=0.5, columnspacing=1.2,
    )  # fmt: skip
    rows = -(-len(labels) // columns)
    titled(ax, ax.get_title(loc="left"), LEAST * (1.6 * rows + 0.3))


def finished(ax: Axes, title: str) -> Axes:
    """Set the title and the legend of what is drawn, and return the axes."""
    titled(ax, title)
    legend(ax)
    return ax


def short_labels(labels: Sequence[str], longest: int = 12) -> list[str]:
    """Return names short enough to stand side by side, and different where these are.

    Without what all begin or end with alike, words and numbers kept whole; or cut at an end; or
    their numbers in the order of the labels.
    """
    if len(labels) < 2 or max(map(len, labels)) <= longest:
        return list(labels)
    first = _alike(labels, _word)
    last = _alike([label[first:][::-1] for label in labels], _kind)
    bare = [label[first : len(label) - last] for label in labels]
    tries = [
        ["…" * (first > 0) + label for label in bare],
        ["…" + label[1 - longest :] if len(label) > longest else label for label in labels],
        [label[: longest - 1] + "…" if len(label) > longest else label for label in labels],
    ]
    fit = (t for t in tries if len(set(t)) == len(labels) and max(map(len, t)) <= longest)
    return next(fit, [str(number) for number in range(1, len(labels) + 1)])


def _alike(labels: Sequence[str], kind: Callable[[str], int]) -> int:
    """How many characters all labels begin with, up to where a word or a number ends."""
    count = sum(1 for _ in takewhile(lambda c: len(set(c)) == 1, zip(*labels, strict=False)))
    while count and any(
        kind(one[count - 1 : count]) == kind(one[count : count + 1]) != 0 for one in labels
    ):
        count -= 1
    return count


def _word(letter: str) -> int:
    return min(_kind(letter), 1)


def _kind(letter: str) -> int:
    """1 of a letter, 2 of what numbers are made of, 0 of what stands between, or of nothing."""
    return 1 if letter.isalpha() else 2 if letter.isdigit() or letter == "." else 0


def _room(ax: Axes) -> float:
    """Points that the axes are wide, less what names of rows beside them take of that."""
    figure = ax.get_figure(root=True)
    assert figure is not None
    whole = float(ax.get_window_extent().width * 72.0 / figure.dpi)
    named = isinstance(ax.yaxis.get_major_locator(), FixedLocator)
    rows = [_width(row.get_text(), LEAST) for row in ax.get_yticklabels()] if named else []
    return whole - max(0.0, max(rows, default=0.0) - MARGIN * whole)


def _width(text: str, size: float) -> float:
    """Points that a text is wide."""
    font = FontProperties(size=size)
    return float(text_to_path.get_text_width_height_descent(text, font, ismath=False)[0])


def _broken(words: Sequence[str], room: float) -> list[str]:
    """Lines of a title that are no wider than the room where words allow it."""
    lines = [""]
    for word in words:
        longer = f"{lines[-1]} {word}".strip()
        if lines[-1] and _width(longer, TITLE) > room:
            lines.append(word)
        else:
            lines[-1] = longer
    return lines


def _columns(widths: Sequence[float], room: float) -> int:
    """How many columns of a legend fit side by side; Matplotlib fills one after the other."""
    beside = (HANDLE + 0.5 + 1.2) * LEAST
    for columns in range(len(widths), 1, -1):
        parts = np.array_split(np.asarray(widths), columns)
        if sum(part.max() + beside for part in parts) <= room:
            return columns
    return 1


def log_axis(ax: Axes, which: Literal["x", "y"]) -> None:
    """Make an axis of what is drawn logarithmic, marked with plain numbers of one size.

    Where nothing above zero is drawn, as of runs of which few rows count, it stays as it is.
    """
    axis: Axis = getattr(ax, f"{which}axis")
    if not math.isfinite(axis.get_minpos()):
        return
    ax.set(**{f"{which}scale": "log"})
    low, high = sorted(axis.get_view_interval())
    axis.set_major_locator(
        MaxNLocator(5) if high < WITHIN_A_DECADE * low
        else LogLocator(subs=(1.0, 2.0, 5.0) if high < NARROW * low else (1.0,))
    )  # fmt: skip
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}".replace("-", "−")))
    axis.set_minor_formatter(NullFormatter())


def middle(time: Array) -> slice:
    """Return the rows (N,) of the ten seconds in the middle of a run.

    All of a shorter one, and of one that recorded nothing then.
    """
    centre = 0.5 * (time[0] + time[-1])
    first, last = np.searchsorted(time, [centre - STRETCH / 2, centre + STRETCH / 2])
    return slice(first, last) if last - first > 1 else slice(0, len(time))


def part_of(time: Array, some: slice) -> str:
    """Return ": a to b of c s", in one piece, for the title of some rows; "" of all of them."""
    own = time[some]
    if len(own) >= len(time) - 1:
        return ""
    first, last, whole = (f"{t - time[0]:.3g}" for t in (own[0], own[-1], time[-1]))
    told = f"{first} to {last} of {whole} s".replace(" ", "\N{NO-BREAK SPACE}")
    return f": {told}"


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
    """Return a colour for each run: one alone for very many; they read in grey, white, black."""
    if count == 1 or count > MOST_COLOURED_RUNS:
        return [PALETTE[0]] * count
    shades = matplotlib.colormaps["viridis"]
    return [shades(0.34 + 0.44 * k / (count - 1)) for k in range(count)]


@dataclass(frozen=True, eq=False)
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
