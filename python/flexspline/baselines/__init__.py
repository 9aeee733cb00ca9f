"""What the papers compare with or cite, for the same logs: drift models and ripple removal."""

from flexspline.baselines.drift import (
    KernelDrift,
    LinearDrift,
    compare_drift_methods,
    kernel_drift,
    linear_drift,
)
from flexspline.baselines.ripple import (
    MethodScore,
    RippleComparison,
    RippleKalman,
    compare_ripple_methods,
    kalman_oscillator,
    order_tracking,
    sum_of_two_bridges,
    wave_generator_angle,
)

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


def __dir__() -> list[str]:
    return __all__
