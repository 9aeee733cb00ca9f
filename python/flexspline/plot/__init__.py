"""Figures of logs and fits. Every function takes axes to draw on, or makes its own."""

from flexspline.plot.components import components
from flexspline.plot.drift import drift_curve
from flexspline.plot.fit import plot_fit
from flexspline.plot.motion import simulated_motion
from flexspline.plot.orders import order_spectra
from flexspline.plot.residuals import measured_against_predicted, residual_over

__all__ = [
    "components",
    "drift_curve",
    "measured_against_predicted",
    "order_spectra",
    "plot_fit",
    "residual_over",
    "simulated_motion",
]
