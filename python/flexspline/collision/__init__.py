"""When a residual is a contact: thresholds for a stated rate of false alarms, delays, sizes."""

from flexspline.collision.calibrating import calibrate_detector, left_out_margin
from flexspline.collision.result import (
    DetectorCalibration,
    Residual,
    Threshold,
    detection_delay,
    smallest_detectable_torque,
    standstill_residual,
)

__all__ = [
    "DetectorCalibration",
    "Residual",
    "Threshold",
    "calibrate_detector",
    "detection_delay",
    "left_out_margin",
    "smallest_detectable_torque",
    "standstill_residual",
]


def __dir__() -> list[str]:
    return __all__
