"""What an estimator needs of the model that it is part of.

An estimator that reads another, or a part, has a method `require`, which refuses a model without.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from flexspline.effects.causes import INERTIA, MESH
from flexspline.errors import InputError
from flexspline.part import Part

__all__ = [
    "Estimators",
    "Parts",
    "has_effect",
    "link_part",
    "require_complete",
    "require_estimators",
    "require_mesh",
]

Estimators = Mapping[str, Any]
Parts = Mapping[str, Part]

MAKES = {"compliant_observer": 'Observer(..., input="compliance")'}


def require_complete(estimators: Estimators, parts: Parts) -> None:
    """Refuse estimators that lack the part or the estimator that they read.

    Raises
    ------
    InputError
        Names what is missing and the command that makes it.
    """
    for estimator in estimators.values():
        if hasattr(estimator, "require"):
            estimator.require(estimators, parts)


def link_part(parts: Parts) -> Part | None:
    """The part whose inertia is that of the link, or of link and rotor: the drive's first."""
    for name, target in (("drive", "motor_torque"), ("sensor", "sensor_torque")):
        part = parts.get(name)
        if part is not None and part.target == target and has_effect(part, INERTIA):
            return part
    return None


def require_mesh(named: str, parts: Parts) -> None:
    """Refuse parts without a torsion that has a mesh; `named`: the estimator that reads it."""
    if "torsion" not in parts or not has_effect(parts["torsion"], MESH):
        raise InputError(
            f"the estimator {named} needs the effect mesh_compliance in a part for torsion, "
            "which the model lacks; make one with: flexspline fit RUN.csv --target torsion "
            "--known-load CHANNEL --effects mesh_compliance,... --into MODEL.json"
        )


def require_estimators(needs: str, keys: tuple[str, ...], estimators: Estimators) -> None:
    """Refuse estimators without these keys; `needs` begins the sentence."""
    for key in keys:
        if key not in estimators:
            made = MAKES.get(key, f"{key.capitalize()}(...)")
            raise InputError(
                f"{needs} the estimator {key}, which the model lacks; add it with: "
                f"model.with_estimator(flexspline.{made})"
            )


def has_effect(part: Part, effect: str) -> bool:
    """Whether a part has an effect."""
    return any(known.name == effect for known in part.effects)
