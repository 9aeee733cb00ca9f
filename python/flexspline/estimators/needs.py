"""What an estimator needs of the model that it is part of."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from flexspline.effects.causes import INERTIA, MESH
from flexspline.errors import InputError
from flexspline.estimators.external_torque import Collision, Merge, Observer
from flexspline.estimators.sensing import DERIVED, Differentiator, ReadingChecks
from flexspline.part import Part

__all__ = ["link_part", "require_complete"]

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


def link_part(parts: Parts) -> Part | None:
    """The part whose inertia is that of the link, or of link and rotor: the drive's first."""
    for name, target in (("drive", "motor_torque"), ("sensor", "sensor_torque")):
        part = parts.get(name)
        if part is not None and part.target == target and _has(part, INERTIA):
            return part
    return None


def _reading_checks(estimators: Estimators, parts: Parts) -> None:
    checks: ReadingChecks = estimators["reading_checks"]
    made: Differentiator | None = estimators.get("differentiator")
    if made is None or DERIVED[0] not in made.channels:
        return
    for name in ("way", "most_acceleration"):
        if getattr(checks, name) is not None:
            raise InputError(
                f"reading_checks: {name} is of a velocity that is read, but the differentiator "
                "makes it from the angle itself; leave it out and give most_speed or twist"
            )


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
    if not _has(part, INERTIA):
        raise InputError(
            "the estimator observer with the input motor_torque needs the effect inertia in the "
            "part for motor_torque; fit it again with: flexspline fit RUN.csv --target "
            "motor_torque --effects inertia,... --into MODEL.json"
        )


def _compliance(estimators: Estimators, parts: Parts) -> None:
    _require_mesh("compliance", parts)


def _compliant_observer(estimators: Estimators, parts: Parts) -> None:
    named = "observer with the input compliance"
    _require_mesh(named, parts)
    if link_part(parts) is None:
        raise InputError(
            f"the estimator {named} needs the effect inertia in a part for motor_torque or "
            "sensor_torque, which the model lacks; make one with: flexspline fit RUN.csv --target "
            "motor_torque --effects inertia,coulomb_friction_per_direction,viscous_friction "
            "--into MODEL.json"
        )
    _require_estimators(f"the estimator {named} needs", ("compliance",), estimators)


def _require_mesh(named: str, parts: Parts) -> None:
    if "torsion" not in parts or not _has(parts["torsion"], MESH):
        raise InputError(
            f"the estimator {named} needs the effect mesh_compliance in a part for torsion, "
            "which the model lacks; make one with: flexspline fit RUN.csv --target torsion "
            "--known-load CHANNEL --effects mesh_compliance,... --into MODEL.json"
        )


def _merge(estimators: Estimators, parts: Parts) -> None:
    merge: Merge = estimators["merge"]
    _require_estimators("the estimator merge needs", ("observer", merge.at_rest), estimators)


def _collision(estimators: Estimators, parts: Parts) -> None:
    collision: Collision = estimators["collision"]
    needed = {"sensor": (), "merged": ("merge",)}.get(collision.input, (collision.input,))
    watches = f"the estimator collision watches the {collision.input} estimate and needs"
    _require_estimators(watches, needed, estimators)


def _require_estimators(needs: str, keys: tuple[str, ...], estimators: Estimators) -> None:
    for key in keys:
        if key not in estimators:
            made = _MAKES.get(key, f"{key.capitalize()}(...)")
            raise InputError(
                f"{needs} the estimator {key}, which the model lacks; add it with: "
                f"model.with_estimator(flexspline.{made})"
            )


def _has(part: Part, effect: str) -> bool:
    return any(known.name == effect for known in part.effects)


_MAKES = {"compliant_observer": 'Observer(..., input="compliance")'}

_CHECKS: dict[str, Callable[[Estimators, Parts], None]] = {
    "reading_checks": _reading_checks,
    "observer": _observer,
    "compliance": _compliance,
    "compliant_observer": _compliant_observer,
    "merge": _merge,
    "collision": _collision,
}
