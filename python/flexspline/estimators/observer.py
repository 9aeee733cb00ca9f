"""The external torque from momentum."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from flexspline.errors import InputError
from flexspline.estimators.checks import above_zero, choice, from_fields, to_fields

__all__ = ["Observer"]

COMPLIANCE = "compliance"
INPUTS = ("sensor_torque", "motor_torque", COMPLIANCE)
DISCRETISATIONS = ("exact", "euler")


@dataclass(frozen=True)
class Observer:
    """Momentum observer: the external torque, late by one over the gain.

        ṗ = τ̄ − τ_ext,    p = J q̇,    d τ̂_ext / dt = K (τ_ext − τ̂_ext)

    τ̄ is the torque of the input minus what the model's part knows of it but inertia, which
    is J: part "sensor" for the input sensor_torque (zhang), "drive" for motor_torque
    (full_range). A sensor part without inertia makes J zero, and the observer a low pass.

    With the input compliance the link alone is observed, behind the gear: τ̄ is the torque that
    the estimator `Compliance` finds in the mesh, less the gravity of the part "drive" (or
    "sensor"); friction of motor and gear lies before it. J is that of the drive's part less
    Ñ² · rotor_inertia, or of the sensor's part where there is no drive's. A model may hold this
    observer beside one of the others: `model.json` has it under `compliant_observer`.

    Sources: zhang_disturbance_elimination (16)–(21), full_range_torque_estimation (7), (8); the
    compliant gear is the next step that its conclusion names.

    Parameters
    ----------
    gain : K, 1/s; −3 dB at K/2π Hz.
    input : "sensor_torque", "motor_torque" or "compliance".
    discretisation : "exact", stable at any rate, or "euler" as the papers print it, which is
        refused where gain · period is 2 or more.
    rotor_inertia : of the input compliance: kg·m² at the motor's shaft; zero, as where nothing is
        given, leaves all inertia of the drive's part to the link.

    Raises
    ------
    InputError
        Where the gain is not above zero, a word is unknown, or a rotor's inertia is below zero or
        given for another input.
    """

    gain: float
    input: str = "sensor_torque"
    discretisation: str = "exact"
    rotor_inertia: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "gain", above_zero(self.gain, "observer: gain", "1/s"))
        choice(self.input, "observer: input", INPUTS)
        choice(self.discretisation, "observer: discretisation", DISCRETISATIONS)
        if self.input == COMPLIANCE:
            rotor = above_zero(
                self.rotor_inertia or 0.0, "observer: rotor_inertia", "kg·m²", or_zero=True
            )
            object.__setattr__(self, "rotor_inertia", rotor)
        elif self.rotor_inertia is not None:
            raise InputError(
                "observer: rotor_inertia belongs to the input compliance; leave it out or give "
                "that input"
            )

    @property
    def key(self) -> str:
        """The name of its entry in `model.json`."""
        return "compliant_observer" if self.input == COMPLIANCE else "observer"

    def to_json(self) -> dict[str, Any]:
        """Return the entry of `model.json`."""
        return to_fields(self)

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> Observer:
        """Return the estimator of an entry of `model.json`."""
        return from_fields(cls, content, "observer")
