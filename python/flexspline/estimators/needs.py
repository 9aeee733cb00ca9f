"""What an estimator needs of the model that it is part of."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from flexspline.errors import InputError
from flexspline.estimators.collision import Collision
from flexspline.estimators.observer import Observer
from flexspline.part import Part

__all__ = ["require_complete"]

Estimators = Mapping[str, Any]
Parts = Mapping[str, Part]


def require_complete(estimators: Estimators, parts: Parts) -> None:
    """Refuse estimators that lack the part or the estimator that they read.

    Raises
    ------
    InputError
        Names what is missing and the command that makes it.
    """
    for key, check in _CHECKS.items():
        if key in estimators:
            check(estimators, parts)


def _observer(estimators: Estimators, parts: Parts) -> None:
    observer: Observer = estimators["observer"]
    if observer.input != "motor_torque":
        return
    part = parts.get("drive")
    if part is None or part.target != "motor_torque":
        raise InputError(
            "the estimator observer with the input motor_torque needs a part for motor_torque, "
            "which the model lacks; make one with: flexspline fit RUN.csv --target motor_torque "
            "--effects inertia,coulomb_friction_per_direction,viscous_friction --into MODEL.json"
        )
    if not _has(part, "inertia"):
        raise InputError(
            "the estimator observer with the input motor_torque needs the effect inertia in the "
            "part for motor_torque; fit it again with: flexspline fit RUN.csv --target "
            "motor_torque --effects inertia,... --into MODEL.json"
        )


def _compliance(estimators: Estimators, parts: Parts) -> None:
    if "torsion" not in parts or not _has(parts["torsion"], "mesh_compliance"):
        raise InputError(
            "the estimator compliance needs the effect mesh_compliance in a part for torsion, "
            "which the model lacks; make one with: flexspline fit RUN.csv --target torsion "
            "--known-load CHANNEL --effects mesh_compliance,... --into MODEL.json"
        )


def _merge(estimators: Estimators, parts: Parts) -> None:
    for key in ("observer", "compliance"):
        if key not in estimators:
            raise InputError(
                f"the estimator merge needs the estimator {key}, which the model lacks; add it "
                f"with: model.with_estimator(flexspline.{key.capitalize()}(...))"
            )


def _collision(estimators: Estimators, parts: Parts) -> None:
    collision: Collision = estimators["collision"]
    needed = {"observer": "observer", "merged": "merge"}.get(collision.input)
    if needed is not None and needed not in estimators:
        raise InputError(
            f"the estimator collision watches the {collision.input} estimate and needs the "
            f"estimator {needed}, which the model lacks; add it with: "
            f"model.with_estimator(flexspline.{needed.capitalize()}(...))"
        )


def _has(part: Part, effect: str) -> bool:
    return any(known.name == effect for known in part.effects)


_CHECKS: dict[str, Callable[[Estimators, Parts], None]] = {
    "observer": _observer,
    "compliance": _compliance,
    "merge": _merge,
    "collision": _collision,
}
