"""The external torque from the torsion of the gear."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from flexspline.errors import InputError
from flexspline.estimators.checks import above_zero, from_fields, to_fields

__all__ = ["Compliance"]


@dataclass(frozen=True)
class Compliance:
    """Torque through the gear's mesh from its torsion; stiffness and shape are those of the
    effect mesh_compliance in the model's part "torsion".

        τ = −tan(c_m K_m0 Δθ_m) / c_m

    Δθ_m is what is left of the measured torsion q Ñ − θ, seen from the output, when the other
    effects of the part are taken off: negative where the joint pushes outward. Hysteresis on the
    path of the load needs the torque that is looked for: each sample finds it with the loop of the
    sample before, corrects it once by the loop at that torque, and moves the loop on. The loop
    follows this torque alone, also where there is a sensor, and stays while the torque is held.

    Where the model has no sensor torque, the drive's effects that read the load take it from here:
    the external torque of the sample before, zero until there is one.

    Source: full_range_torque_estimation (14), (15), (18); hysteresis is the step beyond it.

    Parameters
    ----------
    margin : share of the way to the pole, π / (2 c_m K_m0), that is kept free: beyond it the
        estimate is held and flagged as saturated. Above 0, below 1.

    Raises
    ------
    InputError
        Where the margin is not between 0 and 1.
    """

    key: ClassVar[str] = "compliance"

    margin: float = 0.05

    def __post_init__(self) -> None:
        margin = above_zero(self.margin, "compliance: margin")
        if not margin < 1.0:
            raise InputError(
                f"compliance: margin = {margin:g} leaves no torque; give a share below 1"
            )
        object.__setattr__(self, "margin", margin)

    def to_json(self) -> dict[str, Any]:
        """Return the entry of `model.json`."""
        return to_fields(self)

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> Compliance:
        """Return the estimator of an entry of `model.json`."""
        return from_fields(cls, content, cls.key)
