"""One part of a model: the effects that explain one target, with their coefficients."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexspline.effects import UNITS, Effect, require_effects, slices_of
from flexspline.errors import InputError
from flexspline.logs.log import Log
from flexspline.own import OwnEffect, declaration, of_file
from flexspline.prepared import Preparation, preparations_of
from flexspline.signals import Carried
from flexspline.simulator import Simulated

__all__ = ["PART_OF", "SIDES", "Part", "part_from_json", "part_to_json"]

Array = NDArray[np.float64]

PART_OF = {
    "sensor_torque": "sensor",
    "motor_torque": "drive",
    "motor_current": "drive",
    "torsion": "torsion",
}
SIDES = tuple(dict.fromkeys(PART_OF.values()))


@dataclass(frozen=True, eq=False)
class Part:
    """The effects that explain one target.

    Parameters
    ----------
    target : sensor_torque, motor_torque, motor_current or torsion.
    effects : with shapes and orders.
    coefficients : (P,), in the order of the effects' terms, units of the target.
    known_load : channel that holds τ_load, or None.
    record : what the fit knew beside the values: parameters with errors, confounded groups,
        validity, the target's range, scores, logs. Kept as it is through a round trip.
    simulated : the foreign simulation that the effects correct, or None: they explain y alone.
    """

    target: str
    effects: tuple[Effect, ...]
    coefficients: Array
    known_load: str | None = None
    record: Mapping[str, Any] = field(default_factory=dict)
    simulated: Simulated | None = None

    def __repr__(self) -> str:
        beside = f", {self.simulated.words} corrected" if self.simulated is not None else ""
        return f"<Part for {self.target}: {', '.join(e.name for e in self.effects)}{beside}>"

    def __post_init__(self) -> None:
        require_effects(self.effects, self.target)
        values = np.array(self.coefficients, dtype=np.float64)
        values.flags.writeable = False
        object.__setattr__(self, "coefficients", values)
        terms = sum(len(effect.terms) for effect in self.effects)
        if values.shape != (terms,):
            raise InputError(
                f"the effects have {terms} coefficients, but {values.size} are given; give one each"
            )
        if not np.isfinite(values).all():
            raise InputError("a coefficient is not finite; give numbers")
        _require_ranges(self.record)

    @property
    def unit(self) -> str:
        return UNITS[self.target]

    def by_effect(self) -> Iterator[tuple[Effect, Array]]:
        """Yield each effect with its coefficients, (terms,)."""
        for effect, at in zip(self.effects, slices_of(self.effects), strict=True):
            yield effect, self.coefficients[at]

    def coefficients_of(self, name: str) -> Array:
        """Return the coefficients of an effect by its name, (terms,); none without it."""
        return next((values for each, values in self.by_effect() if each.name == name), np.empty(0))

    def keeping(self, wanted: Callable[[Effect], bool]) -> Part:
        """Return the part with those of its effects alone that are wanted."""
        kept = [(effect, values) for effect, values in self.by_effect() if wanted(effect)]
        return replace(
            self,
            effects=tuple(effect for effect, _ in kept),
            coefficients=np.concatenate([np.empty(0), *(values for _, values in kept)]),
        )

    @property
    def preparations(self) -> tuple[Preparation, ...]:
        """How channels are to be made before the effects read them."""
        return preparations_of(self.record)

    @property
    def carried(self) -> Carried | None:
        """The weight that the effects read as part of the load, or None."""
        return Carried.of(self.record)

    def load(self, log: Log) -> Array:
        """Return what the effects read as the known load, (N,), Nm, of a log that holds it."""
        assert self.known_load is not None
        load = np.asarray(log[self.known_load])
        return load if self.carried is None else load + self.carried.torque(log)

    def preparing(self, ways: Iterable[Preparation]) -> Part:
        """Return the part whose effects read channels made in these ways."""
        return replace(self, record={**self.record, "prepared": [way.to_json() for way in ways]})


def _require_ranges(record: Mapping[str, Any]) -> None:
    """Refuse ends of a range that are reversed or not finite: every row would be outside of it."""
    ranges = [(f"validity of {name}", ends) for name, ends in record.get("validity", {}).items()]
    ranges += [("target_range", record["target_range"])] if "target_range" in record else []
    for what, (low, high) in ranges:
        if not -math.inf < low <= high < math.inf:
            raise InputError(
                f"{what} = [{low:g}, {high:g}] is no range; give the lowest and then the highest "
                "value, or fit the model again"
            )


def part_to_json(part: Part) -> dict[str, Any]:
    """Return a part as `model.json` holds it."""
    effects = [
        {
            "name": effect.name,
            "shapes": dict(effect.shapes),
            "harmonics": [list(harmonic) for harmonic in effect.harmonics],
            "coefficients": values.tolist(),
            **({"own": declaration(effect)} if isinstance(effect, OwnEffect) else {}),
        }
        for effect, values in part.by_effect()
    ]
    return {
        "target": part.target,
        "unit": part.unit,
        "known_load": part.known_load,
        "effects": effects,
        **({} if part.simulated is None else {"simulated": part.simulated.to_json()}),
        **part.record,
    }


def part_from_json(
    name: str, content: dict[str, Any], label: str, own: Iterable[Effect] = ()
) -> Part:
    """Return the part `name` of a `model.json` that fits the schema.

    `label` begins its errors; `own`: the effects that a file may call its maker's own.
    """
    if PART_OF[content["target"]] != name:
        raise InputError(
            f"{label}: the target {content['target']} belongs to the part "
            f"'{PART_OF[content['target']]}'; correct it or fit the model again"
        )
    kept = ("target", "unit", "known_load", "effects", "simulated")
    corrects = content.get("simulated")
    try:
        effects, values = [], []
        for entry in content["effects"]:
            effects.append(_effect(entry, own))
            if len(entry["coefficients"]) != len(effects[-1].terms):
                raise InputError(
                    f"effect '{entry['name']}' has {len(effects[-1].terms)} coefficients, but "
                    f"{len(entry['coefficients'])} are given; give one each"
                )
            values += entry["coefficients"]
        if content["unit"] != UNITS[content["target"]]:
            raise InputError(
                f"the unit is {content['unit']}, but the target {content['target']} is in "
                f"{UNITS[content['target']]}; correct it or fit the model again"
            )
        record = {key: value for key, value in content.items() if key not in kept}
        return Part(
            content["target"],
            tuple(effects),
            np.array(values),
            content["known_load"],
            record,
            None if corrects is None else Simulated.from_json(corrects),
        )
    except InputError as error:
        raise InputError(f"{label}: {error}") from error


def _effect(entry: Mapping[str, Any], own: Iterable[Effect]) -> Effect:
    if "own" in entry:
        return of_file(entry["name"], entry["own"], own).with_shapes(**entry["shapes"])
    harmonics = tuple((order, pair) for order, pair in entry["harmonics"])
    return Effect(entry["name"], entry["shapes"], harmonics)
