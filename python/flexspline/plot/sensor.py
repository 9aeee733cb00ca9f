"""Figures of the torque sensor: by itself, and calibrated.

By itself it has the phase of two gauges, placement, heat and noise. Of a calibration there are
drift, before and after, the line, and what is beside the line: zhang_disturbance_elimination
Fig. 16, 17 and 18, the last with the way that the load went.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator
from numpy.typing import NDArray

from flexspline.errors import InputError
from flexspline.plot.canvas import (
    GREY,
    INK,
    PALETTE,
    Panel,
    PlainFigure,
    axes_or_new,
    channel_label,
    finished,
    panelled,
    spread_evenly,
    titled,
)
from flexspline.sensor.bridge import Bridge, PlacementRipple
from flexspline.sensor.electronics import NoiseBudget
from flexspline.sensor.heating import METHODS, HeatingDrift

if TYPE_CHECKING:
    from flexspline.calibration.accuracy import Points
    from flexspline.calibration.result import CalibrationResult

__all__ = [
    "bridge_orders",
    "calibration_deviation",
    "calibration_line",
    "cancelling_phase",
    "compensation",
    "heating_curves",
    "noise_shares",
    "panels",
    "placement_ripple",
    "plot_calibration",
    "voltage_drift",
]


Array = NDArray[np.float64]

NORMAL_95 = 1.959964
MILLI = 1000.0
HOT, COLD, BEFORE, AFTER = PALETTE[3], PALETTE[0], PALETTE[1], PALETTE[2]

LOOK_FOR = {
    "drift": "The voltage without the share of the load should follow the curve; the band holds "
    "the true curve with 95 %. Heating and cooling apart from each other are a thermal lag.",
    "compensation": "After the compensation the mean should lie on zero at every temperature. "
    "Lines are means over a tenth of the range, full where the temperature rises.",
    "line": "Means on plateaus or in bins should lie along the line. Rising and falling legs lie "
    "apart where there is hysteresis: the next figure shows by how much.",
    "deviation": "What is left beside the line. A bow is non-linearity, a gap between rising and "
    "falling is hysteresis, curves of one colour apart are a lack of repeatability.",
}


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
    finished(ax, title)


def _sum_over_phase(ax: Axes, size: float, unit: str, order: int) -> None:
    phase = np.linspace(0.0, 2.0 * math.pi, 361)
    ax.plot(np.degrees(phase), 2.0 * size * np.abs(np.cos(phase / 2.0)), color=PALETTE[3])
    for at, colour in ((math.pi / 2, PALETTE[1]), (math.pi, PALETTE[2])):
        left = 2.0 * size * abs(math.cos(at / 2.0))
        label = f"{math.degrees(at):.0f}°: {round(left / size, 3):g} of one"
        ax.plot([math.degrees(at)], [left], "o", color=colour, label=label)
    ax.set(xlabel="electrical phase between A and Ā [°]", ylabel=f"amplitude of A + Ā [{unit}]")
    ax.xaxis.set_major_locator(MultipleLocator(90))
    finished(ax, f"What is left; spokes are {order} times closer")


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
    return finished(ax, "What a placement lets through")


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
    return finished(ax, "Ripple left over the placement tolerance")


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
    return finished(
        ax, f"Drift, heated {'unevenly' if uneven else 'evenly'} (band: 90 % of bridges)"
    )


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


def plot_calibration(result: CalibrationResult) -> Figure:
    """Return a figure with a panel for each view that the runs allow."""
    return panelled(panels(result))


def panels(result: CalibrationResult) -> list[Panel]:
    """Return the views that the runs allow."""
    views: dict[str, Callable[..., Axes]] = {}
    if result.points is not None:
        views |= {"line": calibration_line, "deviation": calibration_deviation}
    if result.thermal is not None:
        views |= {"drift": voltage_drift, "compensation": compensation}
    return [Panel(partial(view, result), LOOK_FOR[name]) for name, view in views.items()]


def voltage_drift(result: CalibrationResult, ax: Axes | None = None) -> Axes:
    """Draw the voltage less the share of the load over temperature, and b(T) (Fig. 16).

    Raises
    ------
    InputError
        Where temperature was left out.
    """
    ax = axes_or_new(ax)
    temperature, values, warming = _without_load(result)
    for mask, colour, label in (
        (warming > 0, HOT, "heating"),
        (warming < 0, COLD, "cooling"),
        (warming == 0, GREY, "neither"),
    ):
        at = np.flatnonzero(mask)[spread_evenly(int(mask.sum()), 6000)]
        if len(at):
            _dots(ax, temperature[at], MILLI * values[at], colour, label)
    grid = np.linspace(temperature.min(), temperature.max(), 200)
    curve, error = result.drift_voltage(grid)
    ax.plot(grid, MILLI * curve, color=INK, linewidth=1.8, label="b(T)")
    low, high = MILLI * (curve - NORMAL_95 * error), MILLI * (curve + NORMAL_95 * error)
    shown = MILLI * np.concatenate([values, curve])  # a band that knows nothing hides no data
    around = 0.5 * float(np.ptp(shown)) or 1.0
    ax.fill_between(grid, low, high, color=INK, alpha=0.2, linewidth=0, label="95 %")
    ax.set(xlabel=channel_label("temperature"), ylabel="voltage without load [mV]")
    if max(high.max() - shown.max(), shown.min() - low.min()) > around:
        ax.set_ylim(shown.min() - around, shown.max() + around)
    return finished(ax, "Drift over temperature")


def compensation(result: CalibrationResult, ax: Axes | None = None) -> Axes:
    """Draw the error of the reading over temperature, before and after (Fig. 17).

    Raises
    ------
    InputError
        Where temperature was left out.
    """
    ax = axes_or_new(ax)
    if result.thermal is None:
        raise InputError("the calibration leaves temperature out; give a degree of 1 or more")
    temperature = np.concatenate([_required(run.temperature) for run in result.runs])
    free = _unloaded(result)
    centre = result.thermal.centre
    torque = result.unit == "Nm"
    scale = 1.0 if torque else MILLI
    for column, name, colour in ((0, "uncompensated", BEFORE), (1, "error", AFTER)):
        values = scale * np.concatenate([getattr(run, name) for run in result.runs])
        at = np.flatnonzero(free)[spread_evenly(int(free.sum()), 4000)]
        _dots(ax, temperature[at], values[at], colour, None, 0.15)
        label = "before" if column == 0 else "after"
        for means, style, way in (
            (result.thermal.heating, "-", ", heating"),
            (result.thermal.cooling, "--", ", cooling"),
        ):
            good = np.isfinite(means[:, column])
            if good.any():
                ax.plot(
                    centre[good], scale * means[good, column], style, color=colour, linewidth=2.0,
                    marker="o", markersize=3.5, label=label + way,
                )  # fmt: skip
    ax.axhline(0.0, color=INK, linewidth=0.8)
    what = "reading − reference [Nm]" if torque else "voltage, zero taken off [mV]"
    ax.set(xlabel=channel_label("temperature"), ylabel=what)
    return finished(ax, "Before and after the compensation")


def calibration_line(result: CalibrationResult, ax: Axes | None = None) -> Axes:
    """Draw the reference over the compensated voltage, with the line (Fig. 18).

    Raises
    ------
    InputError
        Where the runs hold no legs of the reference, or no sensitivity.
    """
    ax = axes_or_new(ax)
    points, calibration = _points(result), result.calibration
    if calibration is None:
        raise InputError("the sensitivity is not determined; add a run with load")
    volts = points.y[:, 1]
    rising = _rising(result, points)
    _marks(ax, volts[rising], points.x[rising], True)
    _marks(ax, volts[~rising], points.x[~rising], False)
    ends = np.array([volts.min(), volts.max()])
    sign = "−" if calibration.zero < 0.0 else "+"
    label = f"τ = {calibration.sensitivity:.5g} V {sign} {abs(calibration.zero):.4g}"
    ax.plot(
        ends, calibration.sensitivity * ends + calibration.zero, color=INK, linewidth=1.2,
        label=label, zorder=1,
    )  # fmt: skip
    ax.set(xlabel="sensor voltage, drift taken off [V]", ylabel=channel_label("reference_torque"))
    return finished(ax, "Calibration")


def calibration_deviation(result: CalibrationResult, ax: Axes | None = None) -> Axes:
    """Draw reading − reference over the reference, a curve for each leg, in %FS.

    Raises
    ------
    InputError
        Where the runs hold no legs of the reference.
    """
    ax = axes_or_new(ax)
    points, scale = _points(result), 100.0 / (result.full_scale or 100.0)
    told: set[bool] = set()
    for number, leg in enumerate(result.legs):
        own = points.leg == number
        order = np.argsort(points.x[own])
        label = None if leg.rising in told else "rising" if leg.rising else "falling"
        told.add(leg.rising)
        ax.plot(
            points.x[own][order], scale * points.y[own, 0][order], "o-" if leg.rising else "s--",
            color=HOT if leg.rising else COLD, linewidth=1.2, markersize=3.5, label=label,
        )  # fmt: skip
    ax.axhline(0.0, color=INK, linewidth=0.8)
    ax.set(xlabel=channel_label("reference_torque"), ylabel="reading − reference [%FS]")
    return finished(ax, "Beside the line")


def _dots(
    ax: Axes, x: Array, y: Array, colour: str, label: str | None, alpha: float = 0.25
) -> None:
    ax.scatter(x, y, s=3, alpha=alpha, linewidths=0, color=colour, rasterized=True)
    if label is not None:
        ax.plot([], [], "o", color=colour, markersize=4, label=label)


def _marks(ax: Axes, x: Array, y: Array, rising: bool) -> None:
    if len(x):
        ax.plot(
            x, y, "^" if rising else "v", color=HOT if rising else COLD, markersize=5,
            markerfacecolor="none", label="rising" if rising else "falling",
        )  # fmt: skip


def _points(result: CalibrationResult) -> Points:
    if result.points is None:
        raise InputError("the runs hold no leg of the reference; add a run with load")
    return result.points


def _rising(result: CalibrationResult, points: Points) -> NDArray[np.bool_]:
    return np.array([leg.rising for leg in result.legs])[points.leg]


def _required(temperature: Array | None) -> Array:
    if temperature is None:
        raise InputError("the calibration leaves temperature out; give a degree of 1 or more")
    return temperature


def _unloaded(result: CalibrationResult) -> NDArray[np.bool_]:
    """Rows that the means over temperature are taken of, all runs together."""
    from flexspline.calibration.thermal import unloaded

    scale = result.full_scale if result.calibration is not None else None
    return np.concatenate(unloaded([run.reference for run in result.runs], scale))


def _without_load(result: CalibrationResult) -> tuple[Array, Array, NDArray[np.int8]]:
    """Temperature, voltage less s τ, and 1 heating, −1 cooling, 0 neither, all runs together."""
    from flexspline.calibration.thermal import thermal_legs

    temperatures = [_required(run.temperature) for run in result.runs]
    slope = 0.0 if result.calibration is None else 1.0 / result.calibration.sensitivity
    volts = [run.voltage - run.own_zero - slope * run.reference for run in result.runs]
    ways = [np.zeros(len(t), dtype=np.int8) for t in temperatures]
    for leg in thermal_legs(temperatures):
        ways[leg.run][leg.start : leg.stop] = 1 if leg.rising else -1
    free = _unloaded(result)
    return (
        np.concatenate(temperatures)[free],
        np.concatenate(volts)[free],
        np.concatenate(ways)[free],
    )
