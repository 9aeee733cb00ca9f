"""Drives of known effects, and runs that drive them forward."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from flexspline.effects import Effect, effect
from flexspline.forward import drive_inputs
from flexspline.logs.log import Log
from flexspline.model import Model, Part

Array = NDArray[np.float64]

RATIO = 100.0
FACTS: dict[str, str | float | int] = {"gear_ratio": RATIO, "name": "run"}

Given = Sequence[tuple[str | Effect, Sequence[float]]]


def drive(given: Given, known_load: str | None = None) -> Model:
    """A model of a drive: effects, each with its coefficients."""
    effects = tuple(e if isinstance(e, Effect) else effect(e) for e, _ in given)
    values = np.concatenate([np.asarray(c, dtype=float) for _, c in given])
    return Model({"drive": Part("motor_torque", effects, values, known_load)}, FACTS)


def run_of(time: Array, torque: Array, **more: Array) -> Log:
    """A run of a drive: `torque` is counted at the output, Nm."""
    columns = {"output_position": np.zeros(len(time)), **more}
    return Log.from_arrays(time=time, motor_torque=torque / RATIO, facts=FACTS, **columns)


def driven(
    model: Model,
    log: Log,
    start: tuple[float, float] = (0.0, 0.0),
    steps: int = 1,
) -> Mapping[str, Array]:
    """All channels of the model driven through the run from an angle and a velocity."""
    given = drive_inputs(model, log)
    channels = ("position", "velocity", "acceleration", "motor", "stuck")
    return given.run(model.part(), steps, channels, start=np.array([start]))
