"""The torque sensor by itself: gauges, bridge, heat, electronics, and what bonding them costs."""

from flexspline.sensor.bridge import Bridge, Gauge, WaveStrain, cancelling_bridge, common_bridge
from flexspline.sensor.electronics import Electronics, NoiseBudget, noise_budget
from flexspline.sensor.heating import Heating, HeatingDrift, heating_drift
from flexspline.sensor.placement import PlacementRipple, Tolerance, placement_tolerance

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
