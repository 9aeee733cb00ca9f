"""Estimators with their values: what `model.json` holds under `estimators`.

Each is a frozen dataclass, checked when it is made. The formulas are in the core; `estimate` runs
them over a log, an exported header on the joint.
"""

from __future__ import annotations

from types import MappingProxyType
from typing import TypeAlias

from flexspline.estimators.external_torque import Adaptation, Collision, Compliance, Merge, Observer
from flexspline.estimators.sensing import (
    Calibration,
    Differentiator,
    ReadingChecks,
    TemperatureCompensation,
    Thermistor,
)

__all__ = [
    "ESTIMATORS",
    "PREPROCESSING",
    "SENSING",
    "Adaptation",
    "Calibration",
    "Collision",
    "Compliance",
    "Differentiator",
    "Estimator",
    "Merge",
    "Observer",
    "ReadingChecks",
    "TemperatureCompensation",
    "Thermistor",
]

Estimator: TypeAlias = (
    ReadingChecks
    | Differentiator
    | Thermistor
    | TemperatureCompensation
    | Calibration
    | Observer
    | Compliance
    | Merge
    | Collision
    | Adaptation
)

ESTIMATORS: MappingProxyType[str, type[Estimator]] = MappingProxyType(
    {
        "reading_checks": ReadingChecks,
        "differentiator": Differentiator,
        "thermistor": Thermistor,
        "temperature_compensation": TemperatureCompensation,
        "calibration": Calibration,
        "observer": Observer,
        "compliance": Compliance,
        "compliant_observer": Observer,
        "merge": Merge,
        "collision": Collision,
        "adaptation": Adaptation,
    }
)  # by their `key`, in the order in which they run
PREPROCESSING = ("reading_checks", "differentiator")
SENSING = ("thermistor", "temperature_compensation", "calibration")
"""Those before the sensor's torque; all others estimate by it."""
