"""The base of a comparison or a discovery where that is what a simulation says: a part without
effects, whose prediction is the simulation's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from flexspline.errors import InputError
from flexspline.logs.log import Log
from flexspline.model import PART_OF, Model, Part
from flexspline.simulator.taken import Remark, take

__all__ = ["Base", "based"]

FACTS = ("joint", "gear_ratio", "output_spline", "pole_pairs", "slots", "torque_constant")


@dataclass(frozen=True)
class Base:
    """A model to start from, the runs with what it reads, and what there is to say of these."""

    model: Model
    logs: list[Log]
    remarks: tuple[Remark, ...]


def based(
    model: Model | None,
    logs: Sequence[Log],
    target: str | None,
    known_load: str | None,
    simulation: Log | Sequence[Log] | None,
    column: str | None,
) -> Base:
    """Return the base that a simulation makes, alone or beneath the model that corrects it.

    Parameters
    ----------
    model : None, or one whose part for the target corrects this simulation.
    simulation, column : as for `take`; not None both.

    Raises
    ------
    InputError
        As `take`; for a model that is a base by itself, and where no target is given.
    """
    if model is None:
        if target is None:
            raise InputError("no target is given; give target='sensor_torque' or another one")
        taken = take(logs, target, known_load, simulation, column)
        part = Part(target, (), np.zeros(0), known_load, simulated=taken.simulated)
        facts = {key: logs[0].facts[key] for key in FACTS if key in logs[0].facts}
        return Base(Model({PART_OF[target]: part}, facts), list(taken.logs), taken.remarks)
    part = model.part(target)
    if part.simulated is None:
        raise InputError(
            "a model and a simulation are given, and each is a base by itself; give exactly one of "
            "effects, a model, and a simulation"
        )
    known_load = known_load or part.known_load
    taken = take(logs, part.target, known_load, simulation, column)
    simulated = replace(taken.simulated, holds_load=part.simulated.holds_load)
    part = replace(part, known_load=known_load, simulated=simulated)
    parts = {**model.parts, PART_OF[part.target]: part}
    return Base(replace(model, parts=parts), list(taken.logs), taken.remarks)
