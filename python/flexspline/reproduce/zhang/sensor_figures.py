"""Figures 14 to 18 of the first paper."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from flexspline import _core
from flexspline.plot.calibration import calibration_deviation, calibration_line, voltage_drift
from flexspline.plot.canvas import GREY, INK, PALETTE, PlainFigure, axes_or_new, legend, titled
from flexspline.plot.sensor import (
    bridge_orders,
    cancelling_phase,
    heating_curves,
    placement_ripple,
)
from flexspline.reproduce.zhang.study import Study, spectrum
from flexspline.rigs.zhang_sensor import SENSITIVITY, drift_voltage
from flexspline.sensor import (
    Tolerance,
    cancelling_bridge,
    common_bridge,
    heating_drift,
    placement_tolerance,
)

__all__ = [
    "compensated",
    "drift_curve",
    "heating",
    "line",
    "panels",
    "phase",
    "placement",
    "ripple_over_time",
    "ripple_spectrum",
]

BLUE, ORANGE, GREEN, RED = PALETTE[:4]
SHOWN = 2.0  # s


def panels(count: int, width: float = 5.4, height: float = 3.6) -> tuple[PlainFigure, list[Axes]]:
    """Return a figure with so many axes beside each other."""
    figure = PlainFigure(width * count, height)
    return figure, [axes_or_new(figure.add_subplot(1, count, k + 1)) for k in range(count)]


def phase() -> PlainFigure:
    """Figure 7: two gauges and their sum, over the electrical phase."""
    figure = cancelling_phase()
    assert isinstance(figure, PlainFigure)
    return figure


def ripple_over_time(study: Study) -> PlainFigure:
    """Figure 14: voltage of both placements at 35.16 °/s, without its mean."""
    figure, axes = panels(2)
    for ax, log, name, colour in zip(
        axes, study.placements, ("a  common", "b  cancelling"), (ORANGE, BLUE), strict=True
    ):
        time = log["time"] - log["time"][0]
        first = time < SHOWN
        voltage = log["sensor_voltage"] - log["sensor_voltage"].mean()
        ax.plot(time[first], 1e3 * voltage[first], color=colour)
        _with_torque(ax)
        ax.set(xlabel="time [s]", ylabel="voltage less its mean [mV]")
        titled(ax, f"{name} placement, 35.16 °/s")
    axes[1].set_ylim(*axes[0].get_ylim())
    return figure


def ripple_spectrum(study: Study) -> PlainFigure:
    """Figure 15: spectra of both placements."""
    figure, axes = panels(2)
    for ax, log, name, colour in zip(
        axes, study.placements, ("a  common", "b  cancelling"), (ORANGE, BLUE), strict=True
    ):
        hertz, size = spectrum(log)
        ax.semilogy(hertz, np.maximum(1e3 * size, 1e-5), color=colour, linewidth=0.9)
        for at in (9.89, 19.76):
            ax.axvline(at, color=GREY, linestyle="--", linewidth=0.9)
        ax.set(xlabel="frequency [Hz]", ylabel="amplitude [mV]", ylim=(1e-3, 30.0))
        titled(ax, f"{name} placement; dashed: 9.89 and 19.76 Hz")
    return figure


def drift_curve(study: Study) -> PlainFigure:
    """Figure 16: voltage over temperature, our b(T) and (24)."""
    figure, (ax,) = panels(1, 6.4)
    voltage_drift(study.drift, ax)
    grid = np.linspace(20.0, 45.0, 100)
    ax.plot(grid, 1e3 * drift_voltage(grid), "--", color=GREEN, label="(24)")
    lowest = float(grid[np.argmin(drift_voltage(grid))])
    ax.axvline(lowest, color=GREY, linewidth=0.8, linestyle=":", label=f"minimum, {lowest:.1f} °C")
    legend(ax)
    return figure


def compensated(study: Study) -> PlainFigure:
    """Figure 17: a warming that the fit never saw, before and after."""
    figure, axes = panels(2)
    warmth = study.model.estimators["thermistor"]
    temperature = _core.thermistor_temperature(
        study.held_out["thermistor_voltage"], **warmth.to_json()
    )
    minutes = study.held_out["time"] / 60.0
    for ax, x, label in zip(axes, (temperature, minutes), ("temperature [°C]", "time [min]"),
                            strict=True):  # fmt: skip
        for values, colour, name in (
            (study.before, ORANGE, "before"),
            (study.after, BLUE, "after"),
        ):
            ax.plot(x, values, ".", markersize=1.2, color=colour)
            ax.plot([], [], "o", markersize=4, color=colour, label=name)
        ax.axhline(0.0, color=INK, linewidth=0.8)
        for bound in (-0.08, 0.08):
            ax.axhline(bound, color=GREY, linestyle="--", linewidth=0.9)
        ax.axhline(0.38, color=RED, linestyle=":", linewidth=1.0)
        ax.set(xlabel=label, ylabel="reading without load [Nm]")
        legend(ax)
    titled(axes[0], "Over temperature; dashed: published ±0.08 Nm after")
    titled(axes[1], "Over time; dotted: published 0.38 Nm, which (24) turns round")
    return figure


def line(study: Study) -> PlainFigure:
    """Figure 18: the line of §4.3, and what is beside it with the way back."""
    figure, axes = panels(2)
    calibration_line(study.loading, axes[0])
    titled(axes[0], "0 to 70 Nm one way, as printed: τ = 62.738 V + 2.1835")
    calibration_deviation(study.unloading, axes[1])
    titled(axes[1], "Beside the line, with the way back")
    return figure


def placement() -> PlainFigure:
    """Ours: what each placement lets through, and what bonding tolerances leave."""
    figure, axes = panels(2, 6.2, 4.0)
    bridges = {
        "common, 4 gauges": common_bridge(),
        "0° and 90°, 4 gauges": cancelling_bridge(4),
        "all eight": cancelling_bridge(8),
    }
    bridge_orders(bridges, axes[0])
    limits = Tolerance(angle=np.radians(1.0), tilt=np.radians(2.0), factor=0.01)
    placement_ripple(placement_tolerance(cancelling_bridge(8), limits), axes[1])
    return figure


def heating() -> PlainFigure:
    """Ours: drift with the bridge alone, with software alone and with both."""
    figure, axes = panels(2, 5.8)
    drift = heating_drift(cancelling_bridge(8))
    heating_curves(drift, axes[0], uneven=False)
    heating_curves(drift, axes[1], uneven=True)
    return figure


def _with_torque(ax: Axes) -> None:
    """A second axis in Nm by (25)."""
    beside = ax.secondary_yaxis(
        "right",
        functions=(
            lambda y: np.asarray(y) * SENSITIVITY / 1e3,
            lambda y: np.asarray(y) / SENSITIVITY * 1e3,
        ),
    )
    beside.set_ylabel("[Nm]", fontsize=9.5, color=INK)
    beside.tick_params(labelsize=8.5, colors=INK)
