"""Figures of logs and fits. Every function takes axes to draw on, or makes its own."""

from flexspline.plot.fit import (
    components,
    drift_curve,
    measured_against_predicted,
    plot_fit,
    residual_over,
    simulated_motion,
)
from flexspline.plot.orders import order_spectra

__all__ = [
    "components",
    "drift_curve",
    "measured_against_predicted",
    "order_spectra",
    "plot_fit",
    "residual_over",
    "simulated_motion",
]


def __dir__() -> list[str]:
    return __all__
