"""The torque sensor by itself: gauges, bridge, heat, electronics, and what bonding them costs."""

from flexspline.sensor.bridge import (
    Bridge,
    Gauge,
    PlacementRipple,
    Tolerance,
    WaveStrain,
    cancelling_bridge,
    common_bridge,
    placement_tolerance,
)
from flexspline.sensor.electronics import Electronics, NoiseBudget, noise_budget
from flexspline.sensor.heating import Heating, HeatingDrift, heating_drift

__all__ = [
    "Bridge",
    "Electronics",
    "Gauge",
    "Heating",
    "HeatingDrift",
    "NoiseBudget",
    "PlacementRipple",
    "Tolerance",
    "WaveStrain",
    "cancelling_bridge",
    "common_bridge",
    "heating_drift",
    "noise_budget",
    "placement_tolerance",
]


def __dir__() -> list[str]:
    return __all__
