"""What an estimator is checked for: its fields, how they go to JSON and back, and what it needs.

An estimator that reads another, or a part of the model, has a method `require`, which refuses a
model without.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import MISSING, dataclass, fields
from typing import Any, TypeVar

from flexspline.effects.causes import INERTIA, MESH
from flexspline.errors import InputError, did_you_mean, in_unit, listed, numbers
from flexspline.part import Part

__all__ = [
    "ABSOLUTE_ZERO",
    "Entry",
    "Estimators",
    "Parts",
    "choice",
    "has_effect",
    "json_record",
    "link_part",
    "require_complete",
    "require_estimators",
    "require_mesh",
    "span",
]

ABSOLUTE_ZERO = -273.15  # °C

Made = TypeVar("Made", bound="Entry")

Estimators = Mapping[str, Any]
Parts = Mapping[str, Part]

MAKES = {"compliant_observer": 'Observer(..., input="compliance")'}


def span(values: Iterable[object] | None, name: str, unit: str) -> tuple[float, float] | None:
    """Return (low, high) with low < high, or None where nothing is known."""
    if values is None:
        return None
    found = numbers(values, name, unit)
    if len(found) != 2 or not found[0] < found[1]:
        raise InputError(f"{name} = {list(found)} is no range; give low and high{in_unit(unit)}")
    return found[0], found[1]


def choice(value: object, name: str, known: Iterable[str]) -> str:
    """Return a word that is one of the known."""
    words = tuple(known)
    if value not in words:
        near = did_you_mean(str(value), words)
        raise InputError(f"{name} = {value!r} is unknown{near}; give one of {listed(words)}")
    return str(value)


def json_record(record: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Return a copy as JSON would give it back, so that a round trip changes nothing."""
    try:
        copy: dict[str, Any] = json.loads(json.dumps(dict(record), allow_nan=False))
    except (TypeError, ValueError) as error:
        raise InputError(
            f"{name}: the record holds what JSON does not know ({error}); "
            "give text, numbers, lists and mappings"
        ) from error
    return copy


@dataclass(frozen=True)
class Entry:
    """What `model.json` holds of one estimator: its fields, under its key."""

    def to_json(self) -> dict[str, Any]:
        """Return the entry of `model.json`, without fields that say nothing."""
        content = {known.name: getattr(self, known.name) for known in fields(self)}
        return {
            name: list(value) if isinstance(value, tuple) else value
            for name, value in content.items()
            if value is not None and value != {}
        }

    @classmethod
    def from_json(cls: type[Made], content: Mapping[str, Any]) -> Made:
        """Return the estimator of an entry of `model.json`."""
        label = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", cls.__name__).lower()  # its key there
        known = {field.name: field for field in fields(cls)}
        for name in content:
            if name not in known:
                near = did_you_mean(name, known)
                raise InputError(f"{label} has no '{name}'{near}; it has {listed(known)}")
        for name, field in known.items():
            needed = field.default is MISSING and field.default_factory is MISSING
            if needed and name not in content:
                raise InputError(f"{label} lacks '{name}'; it needs a value")
        return cls(**content)


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
