"""Models with every effect of a target, runs that show them, and an FMU driven row by row."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from fmpy.fmi3 import FMU3Slave
from numpy.typing import NDArray

from flexspline.effects import CATALOGUE, TARGETS, Effect, effect
from flexspline.logs.log import Log
from flexspline.model import PART_OF, Model, Part

Array = NDArray[np.float64]

LOAD = "reference_torque"
FACTS = {"gear_ratio": 50.0, "output_spline": "circular", "joint": "elbow"}


def run_of(seed: int = 1, rows: int = 1500) -> Log:
    """A run at an uneven rate with every channel that an effect reads."""
    random = np.random.default_rng(seed)
    time = 0.7 + np.cumsum(random.uniform(0.002, 0.006, rows))
    angle = 1.3 * np.sin(1.1 * time) + 0.2 * np.sin(5.3 * time)
    speed = 1.43 * np.cos(1.1 * time) + 1.06 * np.cos(5.3 * time)
    turn = -1.573 * np.sin(1.1 * time) - 5.618 * np.sin(5.3 * time)
    load = 4.0 * np.sin(0.9 * time + 1.0) + random.normal(0.0, 0.1, rows)
    channels = {
        "time": time,
        "output_position": angle,
        "output_velocity": speed,
        "output_acceleration": turn,
        "motor_position": 51.0 * angle + 0.01 * load,
        "temperature": 25.0 + 3.0 * np.sin(0.2 * time),
        "motor_torque": 0.02 * load + 0.01 * speed,
        LOAD: load,
    }
    return Log.from_arrays(**channels).with_facts({**FACTS, "name": "run"})


def every_effect(target: str) -> list[Effect]:
    """Every effect of a target; ripples with one order, or two."""
    known = [info for info in CATALOGUE.values() if TARGETS[target] in info.targets]
    return [effect(e.name, orders=[2, 5]) if e.pairs else effect(e.name) for e in known]


def model_of(
    target: str, effects: Sequence[Effect], *, encoder: bool = True, **record: Any
) -> Model:
    """A model with coefficients that are all different; of a joint with a motor encoder."""
    terms = sum(len(one.terms) for one in effects)
    numbers = np.linspace(0.4, 0.02, terms)
    channels = [*run_of().channels] if encoder else ["time", "output_position"]
    made = {"channels": channels, **record}
    return Model({PART_OF[target]: Part(target, tuple(effects), numbers, LOAD, made)}, FACTS)


@contextmanager
def unpacked(path: Path, folder: Path) -> Iterator[tuple[Any, Any]]:
    """The description of an FMU, and what makes an instance of it."""
    fmpy.extract(path, folder)
    description = fmpy.read_model_description(folder)
    made: list[FMU3Slave] = []

    def instance(name: str = "one", **options: Any) -> FMU3Slave:
        slave = FMU3Slave(
            guid=description.guid,
            modelIdentifier=description.coSimulation.modelIdentifier,
            unzipDirectory=str(folder),
            instanceName=name,
        )
        slave.instantiate(**options)
        made.append(slave)
        return slave

    yield description, instance
    for slave in made:
        slave.freeInstance()


def started(slave: FMU3Slave, at: float) -> FMU3Slave:
    slave.enterInitializationMode(startTime=at)
    slave.exitInitializationMode()
    return slave


def references(description: Any) -> dict[str, int]:
    return {one.name: one.valueReference for one in description.modelVariables}


def inputs_of(description: Any) -> dict[str, int]:
    return {v.name: v.valueReference for v in description.modelVariables if v.causality == "input"}


def driven(
    description: Any, slave: FMU3Slave, log: Log, rows: slice = slice(None)
) -> tuple[list[str], Array]:
    """Names of the outputs that are numbers and their values, (N, outputs), row by row."""
    inputs, known = inputs_of(description), references(description)
    outputs = [
        v.name
        for v in description.modelVariables
        if v.causality == "output" and v.type == "Float64"
    ]
    columns = np.array([log[LOAD if name == "known_load" else name] for name in inputs]).T
    time, made = log["time"], []
    ends = np.append(time[1:], time[-1] + 0.004)
    for row in range(len(time))[rows]:
        slave.setFloat64([*inputs.values()], columns[row].tolist())
        made.append(slave.getFloat64([known[name] for name in outputs]))
        slave.doStep(time[row], ends[row] - time[row])
    return outputs, np.array(made)
