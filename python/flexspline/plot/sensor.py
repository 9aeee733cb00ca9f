"""Figures of the torque sensor by itself: phase of two gauges, placement, heat, noise."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator

from flexspline.plot.canvas import GREY, INK, PALETTE, PlainFigure, axes_or_new, legend, titled
from flexspline.sensor.bridge import Bridge
from flexspline.sensor.electronics import NoiseBudget
from flexspline.sensor.heating import METHODS, HeatingDrift
from flexspline.sensor.placement import PlacementRipple

__all__ = [
    "bridge_orders",
    "cancelling_phase",
    "heating_curves",
    "noise_shares",
    "placement_ripple",
]


def cancelling_phase(bridge: Bridge | None = None, order: int = 2) -> Figure:
    """Draw Fig. 7: the ripple of two gauges and their sum, over the electrical phase.

    A and Ā are sinusoids of one amplitude. With an electrical phase of π between them they
    cancel, as (3) has it; with the π/2 that the text of §2.3 names, √2 of one is left. π/2 is
    the *mechanical* angle between the spokes: at order 2 it is π electrically. The third panel
    has the amplitude of the sum for every phase, 2 |cos(phase/2)|.

    Parameters
    ----------
    bridge : None for amplitudes of one, otherwise its wave's amplitude in Nm.
    order : of the wave, for the angle below and for the bridge.

    References
    ----------
    zhang_disturbance_elimination Fig. 7, (2), (3).
    """
    size, unit = 1.0, "of one gauge"
    if bridge is not None:
        wave = bridge.waves[bridge.orders.index(order)]
        size, unit = wave.bending / bridge.strain_per_torque, "Nm"
    figure = PlainFigure(11.0, 3.6)
    first, second, third = (axes_or_new(ax) for ax in figure.subplots(1, 3))
    _two_signals(first, math.pi, size, unit, "Phase π cancels, as (3)")
    _two_signals(second, math.pi / 2, size, unit, "Phase π/2, as the text says, leaves √2")
    _sum_over_phase(third, size, unit, order)
    figure.supxlabel(
        f"The text's π/2 is the angle between the spokes: at order {order} that is "
        f"{180 * order // 2}° of electrical phase",
        fontsize=8.5,
        color=INK,
    )
    return figure


def _two_signals(ax: Axes, phase: float, size: float, unit: str, title: str) -> None:
    x = np.linspace(0.0, 2.0 * math.pi, 361)
    one, other = size * np.sin(x), size * np.sin(x - phase)
    degrees = np.degrees(x)
    ax.plot(degrees, one, color=PALETTE[0], label="A")
    ax.plot(degrees, other, color=PALETTE[1], label="Ā")
    ax.plot(degrees, one + other, color=PALETTE[3], linewidth=2.0, label="A + Ā")
    ax.set(xlabel="electrical angle [°]", ylabel=f"ripple [{unit}]", ylim=(-1.9 * size, 1.9 * size))
    ax.xaxis.set_major_locator(MultipleLocator(90))
    titled(ax, title)
    legend(ax)


def _sum_over_phase(ax: Axes, size: float, unit: str, order: int) -> None:
    phase = np.linspace(0.0, 2.0 * math.pi, 361)
    ax.plot(np.degrees(phase), 2.0 * size * np.abs(np.cos(phase / 2.0)), color=PALETTE[3])
    for at, colour in ((math.pi / 2, PALETTE[1]), (math.pi, PALETTE[2])):
        left = 2.0 * size * abs(math.cos(at / 2.0))
        label = f"{math.degrees(at):.0f}°: {round(left / size, 3):g} of one"
        ax.plot([math.degrees(at)], [left], "o", color=colour, label=label)
    ax.set(xlabel="electrical phase between A and Ā [°]", ylabel=f"amplitude of A + Ā [{unit}]")
    ax.xaxis.set_major_locator(MultipleLocator(90))
    titled(ax, f"What is left; spokes are {order} times closer")
    legend(ax)


def bridge_orders(bridges: dict[str, Bridge], ax: Axes | None = None, *, highest: int = 8) -> Axes:
    """Draw what share of a bending wave each bridge passes, for orders 1 to `highest`."""
    from flexspline.sensor.bridge import WaveStrain

    ax = axes_or_new(ax)
    orders = np.arange(1, highest + 1)
    width = 0.8 / max(1, len(bridges))
    for k, (name, bridge) in enumerate(bridges.items()):
        unit = bridge.strain_per_torque
        seen = bridge.with_waves(*(WaveStrain(int(o), unit) for o in orders)).ripple()
        at = orders + (k - 0.5 * (len(bridges) - 1)) * width
        shares = 100.0 * np.array(list(seen.values()))
        ax.bar(at, shares, width, color=PALETTE[k % len(PALETTE)], label=name)
    ax.set(
        xlabel="order [periods per turn of the wave generator on the flexspline]",
        ylabel="share of the wave in the reading [%]",
        xticks=orders,
        ylim=(0.0, 105.0),
    )
    titled(ax, "What a placement lets through")
    legend(ax)
    return ax


def placement_ripple(result: PlacementRipple, ax: Axes | None = None) -> Axes:
    """Draw the ripple left over the placement tolerance: median and 95 % of the bridges built.

    Dotted: the rms that the first-order formula gives, for orders that a perfect bridge cancels.
    """
    ax = axes_or_new(ax)
    limits, scale = _tolerance_axis(result)
    x = result.share * scale
    for k, order in enumerate(result.orders):
        colour = PALETTE[k % len(PALETTE)]
        median, high = 1e3 * result.median[:, k], 1e3 * result.high[:, k]
        ax.plot(x, median, color=colour, label=f"order {order}: median")
        ax.fill_between(x, median, high, color=colour, alpha=0.25, linewidth=0, label="to 95 %")
        if result.nominal[k] < 1e-9:
            slope = 1e3 * result.slope[k] * result.share
            ax.plot(x, slope, ":", color=INK, linewidth=1.0, label="first order, rms")
    ax.set(xlabel=limits, ylabel="ripple left, amplitude [mNm]")
    ax.set_ylim(bottom=0.0)
    ax.set_xlim(0.0, scale)
    per_cent = 10.0 * result.full_scale  # mNm
    percent = ax.secondary_yaxis(
        "right",
        functions=(lambda y: np.asarray(y) / per_cent, lambda y: np.asarray(y) * per_cent),
    )
    percent.set_ylabel("[% of full scale]", fontsize=9.5, color=INK)
    percent.tick_params(labelsize=8.5, colors=INK)
    titled(ax, "Ripple left over the placement tolerance")
    legend(ax)
    return ax


def _tolerance_axis(result: PlacementRipple) -> tuple[str, float]:
    """What the axis says and its end; the largest error stands for the others."""
    t = result.tolerance
    others = [f"tilt {math.degrees(t.tilt):.2g}°"] if t.tilt and t.angle else []
    others += [f"gauge factor {100 * t.factor:.2g} %"] if t.factor and (t.angle or t.tilt) else []
    beside = f"; {', '.join(others)} at its end" if others else ""
    if t.angle:
        return f"placement tolerance, ± angle [°]{beside}", math.degrees(t.angle)
    if t.tilt:
        return f"placement tolerance, ± tilt [°]{beside}", math.degrees(t.tilt)
    return "tolerance of the gauge factor, ± [%]", 100.0 * t.factor


def heating_curves(result: HeatingDrift, ax: Axes | None = None, *, uneven: bool = True) -> Axes:
    """Draw the drift over the body's temperature: the median of the bridges and 90 % of them."""
    ax = axes_or_new(ax)
    curves = result.uneven if uneven else result.even
    colours = dict(zip(METHODS[1:], (PALETTE[0], PALETTE[1], PALETTE[2]), strict=True))
    for method, colour in colours.items():
        low, middle, high = np.quantile(curves[method], [0.05, 0.5, 0.95], axis=0)
        worst = result.largest(method, uneven=uneven)
        label = f"{method}: half within {worst:.2g} Nm"
        ax.plot(result.temperature, middle, color=colour, label=label)
        ax.fill_between(result.temperature, low, high, color=colour, alpha=0.2, linewidth=0)
    ax.axhline(0.0, color=GREY, linewidth=0.8)
    ax.set(xlabel="temperature of the body [°C]", ylabel="drift of the reading [Nm]")
    titled(ax, f"Drift, heated {'unevenly' if uneven else 'evenly'} (band: 90 % of bridges)")
    legend(ax)
    return ax


def noise_shares(budget: NoiseBudget, ax: Axes | None = None) -> Axes:
    """Draw the torque noise of each source and of all, rms."""
    ax = axes_or_new(ax, height=2.8)
    names = [source.name for source in budget.sources] + ["total"]
    sizes = [1e3 * source.torque for source in budget.sources] + [1e3 * budget.total]
    colours = [PALETTE[0]] * len(budget.sources) + [PALETTE[3]]
    ax.barh(names, sizes, color=colours, height=0.65)
    ax.invert_yaxis()
    ax.set(xlabel="noise of the reading, rms [mNm]", ylabel="source [–]")
    titled(ax, f"Noise of the reading at {budget.load:g} Nm")
    return ax
