"""Quantities that follow from an effect's own parameters: stiffnesses, loops, a resonance.

A torsion is linear in compliances, in rad/Nm; engineers and full_range_torque_estimation
(Table III) speak of stiffnesses.

Source: full_range_torque_estimation (15).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from flexspline.effects.roles import (
    LAG,
    LOAD_LOOP,
    MESH,
    MODULATED_RIPPLE,
    PRESLIDING,
    TORSION_LOOP,
    WAVE_GENERATOR,
)

__all__ = ["DERIVED", "SPRINGS", "Formula"]

SPRINGS = np.array([1.0, 2.0, 4.0, 8.0])  # of a loop: they slip at w, w/2, w/4, w/8


@dataclass(frozen=True)
class Formula:
    """A quantity of one effect: `value` of its terms and shapes by name, and Ñ as "ratio"."""

    name: str
    unit: str
    value: Callable[[Mapping[str, float]], float]


DERIVED: Mapping[str, tuple[Formula, ...]] = {
    MESH: (
        Formula("mesh stiffness K_m0", "Nm/rad", lambda p: p["ratio"] / p["compliance"]),
        Formula(
            "largest mesh torsion, at the output",
            "rad",
            lambda p: np.pi * p["compliance"] / (2 * p["mesh_shape"] * p["ratio"]),
        ),
    ),
    WAVE_GENERATOR: (
        Formula("wave generator stiffness K_w0", "Nm/rad", lambda p: 1.0 / p["compliance"]),
        Formula(
            "lost motion each way, at the motor",
            "rad",
            lambda p: p["compliance"] / p["wave_generator_shape"],
        ),
    ),
    TORSION_LOOP: (
        Formula(
            "half the loop of the hysteresis, at the motor",
            "rad",
            lambda p: p["wide"] + p["half"] + p["quarter"] + p["eighth"],
        ),
        Formula(
            "half the loop of the hysteresis, at the output",
            "rad",
            lambda p: (p["wide"] + p["half"] + p["quarter"] + p["eighth"]) / p["ratio"],
        ),
    ),
    "backlash": (
        Formula("dead zone of the backlash, at the motor", "rad", lambda p: 2.0 * p["half_gap"]),
        Formula(
            "dead zone of the backlash, at the output",
            "rad",
            lambda p: 2.0 * p["half_gap"] / p["ratio"],
        ),
    ),
    PRESLIDING: (
        Formula(
            "level of the presliding friction once it slips",
            "Nm",
            lambda p: p["wide"] + p["half"] + p["quarter"] + p["eighth"],
        ),
    ),
    LOAD_LOOP: (
        Formula(
            "half the loop of the sensor's hysteresis",
            "Nm",
            lambda p: p["wide"] + p["half"] + p["quarter"] + p["eighth"],
        ),
    ),
    MODULATED_RIPPLE: (
        Formula(
            "resonance frequency",
            "Hz",
            lambda p: p["ratio"] * p["resonance_velocity"] / (2 * np.pi),
        ),
    ),
    LAG: (
        Formula(
            "smoothing over lateness (a lag has 1, a delay 0.5)",
            "1",
            lambda p: p["smoothing_time"] / p["lateness"],
        ),
    ),
}
