"""The figures of a calibration: drift, before and after, the line, and what is beside the line.

zhang_disturbance_elimination Fig. 16, 17 and 18, the last with the way that the load went.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from flexspline.errors import InputError
from flexspline.plot.canvas import (
    GREY,
    INK,
    PALETTE,
    Panel,
    axes_or_new,
    channel_label,
    legend,
    panelled,
    spread_evenly,
    titled,
)

if TYPE_CHECKING:
    from flexspline.calibration.accuracy import Points
    from flexspline.calibration.result import CalibrationResult

__all__ = [
    "calibration_deviation",
    "calibration_line",
    "compensation",
    "panels",
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
    ax.fill_between(grid, low, high, color=INK, alpha=0.2, linewidth=0, label="95 %")
    ax.set(xlabel=channel_label("temperature"), ylabel="voltage without load [mV]")
    titled(ax, "Drift over temperature")
    legend(ax)
    return ax


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
    titled(ax, "Before and after the compensation")
    legend(ax)
    return ax


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
    titled(ax, "Calibration")
    legend(ax)
    return ax


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
    titled(ax, "Beside the line")
    legend(ax)
    return ax


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
