"""What the papers compare with or cite, for the same logs: drift models and ripple removal."""

from flexspline.baselines.compare import compare_ripple_methods
from flexspline.baselines.drift import KernelDrift, LinearDrift, kernel_drift, linear_drift
from flexspline.baselines.drift_table import compare_drift_methods
from flexspline.baselines.ripple import (
    RippleKalman,
    kalman_oscillator,
    order_tracking,
    sum_of_two_bridges,
    wave_generator_angle,
)
from flexspline.baselines.table import MethodScore, RippleComparison

__all__ = [
    "KernelDrift",
    "LinearDrift",
    "MethodScore",
    "RippleComparison",
    "RippleKalman",
    "compare_drift_methods",
    "compare_ripple_methods",
    "kalman_oscillator",
    "kernel_drift",
    "linear_drift",
    "order_tracking",
    "sum_of_two_bridges",
    "wave_generator_angle",
]
