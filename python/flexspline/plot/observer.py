"""What a gain of the momentum observer costs."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from flexspline.observer.observing import observer_delay, observer_noise
from flexspline.plot.canvas import GREY, PALETTE, axes_or_new, legend, titled

__all__ = ["observer_gain"]


def observer_gain(
    period: float,
    *,
    torque_noise: float,
    velocity_noise: float = 0.0,
    inertia: float = 0.0,
    gains: ArrayLike | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw delay and noise of the estimate over the gain, exact and by forward Euler.

    Parameters
    ----------
    period : s, between samples.
    torque_noise, velocity_noise, inertia : as for `observer_noise`; Nm, rad/s, kg m².
    gains : 1/s; default: gain · period of 0.01 to 1.9.
    ax : axes to draw on; default: those of a new figure.

    Raises
    ------
    InputError
        Where a gain or the period is not above zero, or Euler cannot be stable.
    """
    at = np.geomspace(0.01, 1.9, 80) / period if gains is None else np.asarray(gains, dtype=float)
    noise: dict[str, Any] = {
        "torque_noise": torque_noise,
        "velocity_noise": velocity_noise,
        "inertia": inertia,
    }
    axes = axes_or_new(ax)
    beside = axes.twinx()
    for name, style in (("exact", "-"), ("euler", "--")):
        late = 1e3 * observer_delay(at, period, name)
        spread = observer_noise(at, period, name, **noise)
        axes.loglog(at, late, style, color=PALETTE[0], label=f"delay, {name}")
        axes.plot([], [], style, color=PALETTE[3], label=f"noise, {name}")
        beside.loglog(at, spread, style, color=PALETTE[3])
    axes.axvline(1.0 / period, color=GREY, linewidth=0.8, linestyle=":")
    axes.set_xlabel("gain K [1/s]")
    axes.set_ylabel("delay [ms]")
    beside.set_ylabel("noise of the external torque [Nm RMS]", fontsize=9.5)
    beside.spines["top"].set_visible(False)
    titled(axes, "Momentum observer: delay against noise; dotted: gain · period = 1")
    legend(axes)
    return axes
