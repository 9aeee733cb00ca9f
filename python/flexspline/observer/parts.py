"""What a fitted part, or an array, says of the torque that is no rigid body's: friction."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import InputError
from flexspline.logs.log import Log
from flexspline.model import Model
from flexspline.part import PART_OF, Part

__all__ = ["coefficient", "friction_torque", "parts_of"]

Array = NDArray[np.float64]


def parts_of(friction: Any, count: int) -> list[Part | None]:
    """The parts given for friction, one for each joint; all None where an array was given."""
    if isinstance(friction, Part):
        friction = [friction]
    listed = isinstance(friction, (list, tuple))
    if not listed or not all(part is None or isinstance(part, Part) for part in friction):
        return [None] * count
    if len(friction) != count:
        raise InputError(f"observer: {len(friction)} parts for {count} joints; give one each")
    return list(friction)


def coefficient(part: Part | None, name: str) -> float | None:
    first = 0
    for effect in part.effects if part is not None else ():
        if effect.name == name and part is not None:
            return float(part.coefficients[first])
        first += len(effect.terms)
    return None


def friction_torque(
    friction: Any,
    parts: list[Part | None],
    time: Array,
    state: tuple[Array, ...],
) -> Array:
    """Friction and the like, (N, n) Nm: an array as given, or what the parts say.

    `state`: q, q̇ and, where inertia belongs to it, q̈, each (N, n).
    """
    angle = state[0]
    if friction is None or any(part is not None for part in parts):
        made = [_said(part, time, *(x[:, k] for x in state)) for k, part in enumerate(parts)]
        return np.stack(made, axis=1)
    try:
        values = np.asarray(friction, dtype=float)
    except (TypeError, ValueError):
        raise InputError("observer: friction must be parts of a model or an array") from None
    values = values[:, None] if values.ndim == 1 and angle.shape[1] == 1 else values
    if values.shape != angle.shape:
        raise InputError(f"observer: friction of shape {values.shape}; give {angle.shape}")
    return values


def _said(
    part: Part | None, time: Array, angle: Array, speed: Array, rate: Array | None = None
) -> Array:
    """What a part says of the state, without its inertia where q̈ is None, Nm, (N,)."""
    if part is None:
        return np.zeros(len(time))
    if part.target not in ("sensor_torque", "motor_torque"):
        raise InputError(
            f"observer: friction is a part for {part.target}; give one for sensor_torque or "
            "motor_torque, in Nm"
        )
    reads = {name for effect in part.effects for name in effect.reads}
    if "load" in reads:
        raise InputError(
            "observer: the part reads the load, which is what is looked for; use "
            "flexspline.estimate, which takes the sensor's"
        )
    if "motor_position" in reads:
        raise InputError(
            "observer: the part has ripple of the wave generator, whose angle takes the gear; "
            "predict it with its Model and give the torque as an array"
        )
    alone = _alone(part, inertia=rate is not None)
    if not alone.effects:
        return np.zeros(len(time))
    channels = {"time": time, "output_position": angle, "output_velocity": speed}
    if rate is not None:
        channels["output_acceleration"] = rate
    log = Log(channels)
    return Model({PART_OF[part.target]: alone}).predict(log).predicted


def _alone(part: Part, *, inertia: bool) -> Part:
    kept, first = [], 0
    values: list[float] = []
    for effect in part.effects:
        last = first + len(effect.terms)
        if inertia or effect.name != "inertia":
            kept.append(effect)
            values += part.coefficients[first:last].tolist()
        first = last
    return replace(
        part,
        effects=tuple(kept),
        coefficients=np.array(values),
        known_load=None,
        record={**part.record, "channels": []},
    )
