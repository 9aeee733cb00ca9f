"""A fleet in figures: the values of its joints beside their mean and spread."""

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
    finished,
    panelled,
    plain,
)

if TYPE_CHECKING:
    from flexspline.fleet.result import FleetFit, UnitFit

__all__ = ["joint_among_others", "parameter_of_joints", "plot_fleet", "population_panels"]

Array = NDArray[np.float64]

MOST_NAMED = 40  # joints that have a row of their own; of more a histogram is drawn
ROW = 0.21  # inches of a joint's row
SURE = 1.96  # standard errors of a bar
BINS = 40  # at most

NAMED = (
    "Each joint's own estimate (line: 95 % interval) and its value given the fleet (dot); shaded: "
    "the fleet's mean ± once and twice the spread between joints. A diamond stands out."
)
COUNTED = (
    "Values of the joints given the fleet, and the fleet's mean ± once and twice the spread "
    "between joints (shaded). A diamond is the own value of a joint that stands out."
)


def plot_fleet(made: FleetFit) -> PlainFigure:
    """Return the figure: a panel for each parameter."""
    return panelled(population_panels(made))


def population_panels(made: FleetFit) -> list[Panel]:
    """Return a view of each parameter."""
    named = len(made.units) <= MOST_NAMED
    height = max(2.6, 1.4 + ROW * len(made.units)) if named else 3.0
    return [
        Panel(partial(parameter_of_joints, made, k), NAMED if named else COUNTED, height)
        for k in range(len(made.parameters))
    ]


def parameter_of_joints(made: FleetFit, number: int, ax: Axes | None = None) -> Axes:
    """Draw one parameter of all joints."""
    ax = axes_or_new(ax)
    name, unit = made.parameters[number], made.plan.units[number]
    margin = made.population.margins[number]
    if np.isfinite(margin.mean):
        for times in (2.0, 1.0):
            ends = margin.mean - times * margin.spread, margin.mean + times * margin.spread
            ax.axvspan(*ends, color=PALETTE[5], alpha=0.18, linewidth=0)
        ax.axvline(margin.mean, color=INK, linewidth=1.0, label="mean of the fleet")
    (_named if len(made.units) <= MOST_NAMED else _counted)(made, number, ax)
    words = name.replace("_", " ").replace(".", ": ")
    ax.set_xlabel(f"{words} [{unit}]" if unit not in ("", "1") else words)
    return finished(ax, words[0].upper() + words[1:])


def _named(made: FleetFit, number: int, ax: Axes) -> None:
    """A row for each joint, the largest on top."""
    order = sorted(made.units, key=lambda unit: float(unit.shrunken.values[number]))
    own = np.array([unit.own.values[number] for unit in order])
    errors = np.array([unit.own.errors[number] for unit in order])
    drawn = np.array([unit.shrunken.values[number] for unit in order])
    out = np.array([bool(unit.outlying[number]) for unit in order])
    rows, told = np.arange(len(order)), np.isfinite(errors)
    ax.hlines(
        rows[told], (own - SURE * errors)[told], (own + SURE * errors)[told],
        color=GREY, linewidth=2.0, label="own estimate, 95 %",
    )  # fmt: skip
    ax.plot(drawn[~out], rows[~out], "o", color=PALETTE[0], markersize=4.5, label="given the fleet")
    if out.any():
        ax.plot(own[out], rows[out], "D", color=PALETTE[3], markersize=6.0, label="stands out")
    ax.set_yticks(rows, [plain(unit.name) for unit in order])
    ax.set_ylim(-0.8, len(order) - 0.2)
    ax.grid(False, axis="y")
    short = told & (errors <= 4.0 * np.median(errors[told]) if told.any() else told)
    bars = [own[short] - SURE * errors[short], own[short] + SURE * errors[short]]
    low, high = _ends(np.concatenate([own[told], drawn[np.isfinite(drawn)], *bars]))
    margin = made.population.margins[number]
    if np.isfinite(margin.mean):
        low = min(low, margin.mean - 2.2 * margin.spread)
        high = max(high, margin.mean + 2.2 * margin.spread)
    ax.set_xlim(low, high)


def _counted(made: FleetFit, number: int, ax: Axes) -> None:
    """A histogram."""
    drawn = np.array([unit.shrunken.values[number] for unit in made.units])
    out = np.array([bool(unit.outlying[number]) for unit in made.units])
    shown = drawn[~out & np.isfinite(drawn)]
    bins = int(np.clip(1.5 * np.sqrt(len(shown)), 8, BINS))
    ax.hist(shown, bins, color=PALETTE[0], alpha=0.75, label="joints, given the fleet")
    if out.any():
        own = np.array([unit.own.values[number] for unit in made.units])[out]
        ax.plot(own, np.zeros(len(own)), "D", color=PALETTE[3], markersize=6.0, clip_on=False,
                label="stands out", zorder=3)  # fmt: skip
    ax.set_ylabel("joints")


def _ends(values: Array) -> tuple[float, float]:
    low, high = float(values.min()), float(values.max())
    room = 0.08 * (high - low) or 1.0
    return low - room, high + room


def joint_among_others(made: FleetFit, unit: UnitFit, ax: Axes | None = None) -> Axes:
    """Draw how far each parameter of a joint is from the others, over what is to be expected."""
    ax = axes_or_new(ax)
    off = (unit.own.values - unit.expected) / unit.expected_error
    told = np.isfinite(off)
    rows = np.arange(len(off))[::-1]
    for times in (2.0, 1.0):
        ax.axvspan(-times, times, color=PALETTE[5], alpha=0.18, linewidth=0)
    ax.axvline(0.0, color=INK, linewidth=1.0)
    usual = told & ~unit.outlying
    ax.plot(off[usual], rows[usual], "o", color=PALETTE[0], markersize=6.0, label="as the others")
    if unit.outlying.any():
        out = unit.outlying
        ax.plot(off[out], rows[out], "D", color=PALETTE[3], markersize=7.0, label="stands out")
    ax.set_yticks(rows, [name.replace("_", " ").replace(".", ": ") for name in made.parameters])
    ax.set_ylim(-0.7, len(off) - 0.3)
    ax.grid(False, axis="y")
    far = max(3.0, 1.1 * float(np.nanmax(np.abs(off), initial=0.0)))
    ax.set_xlim(-far, far)
    ax.set_xlabel("off the others, in predictive errors")
    return finished(ax, f"{plain(unit.name)} among {len(made.units)} joints")
