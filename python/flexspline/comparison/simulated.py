"""Comparing motion: the model driven forward from the inputs of each run.

An angle's noise floor is known before: it is what its encoder reads at rest. What is left once all
that the residual follows is taken out would be no floor, for a simulation that drifts is off by
something that no channel shows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flexspline.comparison.runs import LOADS, Compared, ComparedRun, load_of, load_source_of
from flexspline.errors import InputError
from flexspline.forward.servo import PositionServo
from flexspline.forward.simulating import simulate
from flexspline.logs.derive import velocity_noise, with_motion
from flexspline.logs.log import Log
from flexspline.logs.quantisation import quantum, white_noise
from flexspline.model import Model
from flexspline.simulator.taken import covered, onto_clock, paired

__all__ = ["resolution", "simulated", "simulated_elsewhere"]


def simulated(
    model: Model, logs: Sequence[Log], target: str | None, controller: PositionServo | None
) -> Compared:
    """Return measured and simulated motion of every run; of a sensor, its reading.

    Raises
    ------
    InputError
        Where a run cannot be simulated, or lacks the channel to compare with.
    """
    part = model.part(target)
    source = load_source_of(part, logs)
    runs, channel, unit = [], "", ""
    for log in logs:
        made = simulate(model, log, target=target, controller=controller)
        channel, unit = made.channel, made.unit
        if not np.isfinite(made.residual).any():
            raise InputError(
                f"log '{log.name}': has no {channel} to compare the simulation with; map a column "
                "to it"
            )
        log = with_motion(log)
        nothing = np.zeros(len(log))
        load = load_of(model, part, log, source)
        runs.append(
            ComparedRun(log, made.measured, made.simulated, nothing, load, velocity_noise(log))
        )
    floor = resolution([run.measured for run in runs]) if channel == "output_position" else None
    return Compared(tuple(runs), channel, unit, True, None, source, part.unit, floor)


def simulated_elsewhere(logs: Sequence[Log], simulation: Log | Sequence[Log]) -> Compared:
    """Return measured angles of the output, and those that a foreign simulation gives.

    Raises
    ------
    InputError
        Where a run or its simulation has no output_position, or the simulation is of another span.
    """
    runs, notes = [], []
    for log, other in zip(logs, paired(logs, simulation), strict=True):
        for one in (log, other):
            if "output_position" not in one:
                raise InputError(
                    f"log '{one.name}': has no output_position to compare the motion by; map a "
                    "column to it"
                )
        angle = onto_clock(log, other, other["output_position"])
        log, left = covered(log, angle)
        angle = angle[np.isfinite(angle)]
        notes += [f"{log.name}: {found.sentence}" for found in left]
        log = with_motion(log)
        load = np.asarray(log[LOADS[0]]) if LOADS[0] in log else None
        measured = np.asarray(log["output_position"])
        nothing = np.zeros(len(log))
        runs.append(ComparedRun(log, measured, angle, nothing, load, velocity_noise(log)))
    source = LOADS[0] if all(run.load is not None for run in runs) else ""
    made = tuple(run if source else replace(run, load=None) for run in runs)
    floor = resolution([run.measured for run in made])
    return Compared(
        made, "output_position", "rad", True, None, source, "Nm", floor,
        "files of its own", tuple(notes),
    )  # fmt: skip


def resolution(angles: Sequence[NDArray[np.float64]]) -> float:
    """Return the RMS of the noise of measured angles, rad: white noise or their counts."""
    found = [
        max(white_noise(angle), quantum(angle) / np.sqrt(12.0))
        for angle in angles
        if np.isfinite(angle).all()
    ]
    return float(np.sqrt(np.mean(np.square(found)))) if found else 0.0
