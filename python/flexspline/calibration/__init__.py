"""Calibration of the torque sensor and compensation of its drift with temperature."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from flexspline.calibration.calibrating import calibrate

if TYPE_CHECKING:
    from flexspline.calibration.accuracy import Figure
    from flexspline.calibration.result import CalibratedRun, CalibrationResult

__all__ = ["CalibratedRun", "CalibrationResult", "Figure", "calibrate"]

_HOME = {"CalibratedRun": "result", "CalibrationResult": "result", "Figure": "accuracy"}


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used (PEP 562)."""
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_HOME[name]}"), name)
