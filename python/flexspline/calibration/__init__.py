"""Calibration of the torque sensor and compensation of its drift with temperature."""

from flexspline.calibration.accuracy import Figure
from flexspline.calibration.calibrating import calibrate
from flexspline.calibration.result import CalibratedRun, CalibrationResult

__all__ = ["CalibratedRun", "CalibrationResult", "Figure", "calibrate"]
