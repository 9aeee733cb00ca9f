"""Parts of a model that follow a given motion: nothing is integrated, nothing sticks."""

from __future__ import annotations

import numpy as np

from flexspline.errors import InputError, listed
from flexspline.forward.result import ForwardRun
from flexspline.logs.log import Log
from flexspline.model import Model
from flexspline.part import Part

__all__ = ["reading", "turned"]

_ROUNDS = 8


def reading(model: Model, part: Part, log: Log) -> ForwardRun:
    """Return what a sensor reads along the given motion: the prediction and the known load."""
    torque = model.predict(log, part.target).predicted
    if part.known_load is not None:
        if part.known_load not in log:
            raise InputError(
                f"log '{log.name}': the reading is made of the load, whose channel "
                f"{part.known_load} is not among {listed(log.channels)}; map a column to it"
            )
        torque = torque + log[part.known_load]
    made = Log({"time": log["time"], "sensor_torque": torque}, dict(log.facts), (_note(log),))
    measured = log["sensor_torque"] if "sensor_torque" in log else np.full(len(log), np.nan)
    return ForwardRun(made, "sensor_torque", np.asarray(measured))


def turned(model: Model, part: Part, log: Log) -> ForwardRun:
    """Return where the output stands: q = (θ + Δθ) / Ñ, θ measured.

    Effects that read q see the one that is looked for: they turn it by so little that a few rounds
    of insertion, from q = θ / Ñ, settle it.

    Raises
    ------
    InputError
        Where the log lacks the motor's angle, the gear ratio, or what an effect reads.
    """
    if "motor_position" not in log:
        raise InputError(
            f"log '{log.name}': the output's angle follows from the channel motor_position, which "
            f"is not among {listed(log.channels)}; map a column to it"
        )
    facts = {k: v for k, v in model.facts.items() if k not in log.facts and v is not None}
    log = log.with_facts(facts)
    ratio = log.effective_ratio
    if ratio is None:
        raise InputError(
            f"log '{log.name}': the output's angle needs the gear ratio; give gear_ratio"
        )
    output = log["motor_position"] / ratio
    for _ in range(_ROUNDS):
        there = log.with_columns({"output_position": output}, note="simulated")
        torsion = model.predict(there, part.target).predicted
        before, output = output, (log["motor_position"] + torsion) / ratio
        if not np.nanmax(np.abs(output - before), initial=0.0) > 1e-12:
            break
    made = Log({"time": log["time"], "output_position": output}, dict(log.facts), (_note(log),))
    measured = log["output_position"] if "output_position" in log else np.full(len(log), np.nan)
    return ForwardRun(made, "output_position", np.asarray(measured))


def _note(log: Log) -> str:
    return f"simulated along the motion of '{log.name}'"
