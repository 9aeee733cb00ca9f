"""The external torque from momentum."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from flexspline.estimators.checks import above_zero, choice, from_fields, to_fields

__all__ = ["Observer"]

INPUTS = ("sensor_torque", "motor_torque")
DISCRETISATIONS = ("exact", "euler")


@dataclass(frozen=True)
class Observer:
    """Momentum observer: the external torque, late by one over the gain.

        ṗ = τ̄ − τ_ext,    p = J q̇,    d τ̂_ext / dt = K (τ_ext − τ̂_ext)

    τ̄ is the torque of the input minus what the model's part knows of it but inertia, which
    is J: part "sensor" for the input sensor_torque (zhang), "drive" for motor_torque
    (full_range). A sensor part without inertia makes J zero, and the observer a low pass.
    Sources: zhang_disturbance_elimination (16)–(21), full_range_torque_estimation (7), (8).

    Parameters
    ----------
    gain : K, 1/s; −3 dB at K/2π Hz.
    input : "sensor_torque" or "motor_torque".
    discretisation : "exact", stable at any rate, or "euler" as the papers print it, which is
        refused where gain · period is 2 or more.

    Raises
    ------
    InputError
        Where the gain is not above zero, or a word is unknown.
    """

    key: ClassVar[str] = "observer"

    gain: float
    input: str = "sensor_torque"
    discretisation: str = "exact"

    def __post_init__(self) -> None:
        object.__setattr__(self, "gain", above_zero(self.gain, "observer: gain", "1/s"))
        choice(self.input, "observer: input", INPUTS)
        choice(self.discretisation, "observer: discretisation", DISCRETISATIONS)

    def to_json(self) -> dict[str, Any]:
        """Return the entry of `model.json`."""
        return to_fields(self)

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> Observer:
        """Return the estimator of an entry of `model.json`."""
        return from_fields(cls, content, cls.key)
