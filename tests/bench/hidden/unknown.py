"""Causes that no effect of the catalogue has: products, bumps and waves of what is measured.

In rich runs no single effect explains more than half of the variance of any of them.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hidden.forms import Form
from hidden.rig import Array, Scene

__all__ = ["UNKNOWN"]


def _bump(values: Array, middle: float, width: float) -> Array:
    return np.asarray(np.exp(-(((values - middle) / width) ** 2)))


def _beyond(values: Array, limit: float) -> Array:
    return np.maximum(values - limit, 0.0)


OF_LOAD: Mapping[str, Form] = {
    "load times angle": lambda s: s.load * np.cos(s.q),
    "waves in load": lambda s: np.sin(2.0 * s.load),
    "a bump at an angle": lambda s: _bump(s.q, 0.4, 0.1),
    "load beyond an angle": lambda s: s.load * np.tanh((s.q - 0.8) / 0.05),
    "waves in temperature": lambda s: np.sin(1.3 * s.temperature),
    "waves in temperature times angle": lambda s: np.sin(0.8 * s.temperature) * np.sin(s.q),
    "temperature times speed": lambda s: (s.temperature - 29.0) * _bump(np.abs(s.v), 0.35, 0.15),
    "even in speed": lambda s: _bump(np.abs(s.v), 0.35, 0.12),
    "power": lambda s: s.load * s.v,
    "squared acceleration": lambda s: s.a**2,
}

OF_MOTION: Mapping[str, Form] = {
    **OF_LOAD,
    "acceleration times angle": lambda s: s.a * np.sin(s.q),
    "viscosity by angle": lambda s: s.v * np.cos(5.0 * s.q - 1.0),
    "one way only": lambda s: _beyond(s.v, 0.3) ** 2,
    "load times acceleration": lambda s: s.load * s.a,
}


def _unlike(s: Scene) -> Array:
    return np.asarray(np.sin(1.2 * s.load) * s.motor_torque)


UNKNOWN: Mapping[str, Mapping[str, Form]] = {
    "sensor_torque": {**OF_MOTION, "load against motor": _unlike},
    "motor_torque": OF_MOTION,
    "torsion": {**OF_LOAD, "load against motor": _unlike},
}
"""By target and what it is called."""
