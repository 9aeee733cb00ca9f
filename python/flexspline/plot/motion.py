"""The motion that a fit by simulation was made to match, run by run."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes

from flexspline.errors import InputError
from flexspline.forward import simulate
from flexspline.plot.canvas import GREY, PALETTE, axes_or_new, legend, plain, titled
from flexspline.plot.thin import outline

if TYPE_CHECKING:
    from flexspline.least_squares.result import Fit

__all__ = ["simulated_motion"]


def simulated_motion(fit: Fit, run: str = "worst", ax: Axes | None = None) -> Axes:
    """Draw the measured and the simulated angle [rad] of one run over time [s].

    Parameters
    ----------
    fit : made by simulation.
    run : a run's name; or "worst" or "median", by the gap on rows that a fit did not count.

    Raises
    ------
    InputError
        Where the fit was not made by simulation, or has no such run.
    """
    if fit.simulation is None:
        raise InputError("the fit is a regression; fit with by='simulation' to draw its motion")
    number = _chosen(fit, run)
    log = fit.runs[number].log
    made = simulate(fit.model, log, target=fit.target, controller=fit.simulation.controller)
    ax = axes_or_new(ax)
    time = log["time"] - log["time"][0]
    for label, values, colour in (
        ("measured", made.measured, GREY),
        ("simulated", made.simulated, PALETTE[0]),
    ):
        at = outline(values)
        ax.plot(time[at], values[at], color=colour, linewidth=1.2, label=label)
    ax.set(xlabel="time since the start [s]", ylabel="output angle [rad]")
    gap = fit.simulation.runs[number]
    titled(ax, f"{plain(gap.name)}: {1e3 * gap.held_out:.3g} mrad RMS held out")
    legend(ax)
    return ax


def _chosen(fit: Fit, run: str) -> int:
    """The number of a run in the fit."""
    assert fit.simulation is not None
    gaps = fit.simulation.runs
    order = np.argsort([gap.held_out for gap in gaps])
    if run in ("worst", "median"):
        return int(order[-1] if run == "worst" else order[(len(order) - 1) // 2])
    names = [gap.name for gap in gaps]
    if run not in names:
        raise InputError(f"no run '{run}' in this fit; it has {', '.join(names)}")
    return names.index(run)
