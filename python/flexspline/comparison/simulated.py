"""Comparing motion: the model driven forward from the inputs of each run.

An angle's noise floor is known before: it is what its encoder reads at rest. What is left once all
that the residual follows is taken out would be no floor, for a simulation that drifts is off by
something that no channel shows.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexspline.comparison.runs import Compared, ComparedRun, load_of, load_source_of
from flexspline.comparison.velocity import velocity_noise, with_motion
from flexspline.errors import InputError
from flexspline.forward.servo import PositionServo
from flexspline.forward.simulating import simulate
from flexspline.logs.grain import quantum, white_noise
from flexspline.logs.log import Log
from flexspline.model import Model

__all__ = ["simulated"]


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
    floor = _resolution(runs) if channel == "output_position" else None
    return Compared(tuple(runs), channel, unit, True, None, source, part.unit, floor)


def _resolution(runs: Sequence[ComparedRun]) -> float:
    """RMS of the noise of the measured angle, rad: white noise or its counts."""
    found = [
        max(white_noise(run.measured), quantum(run.measured) / np.sqrt(12.0))
        for run in runs
        if np.isfinite(run.measured).all()
    ]
    return float(np.sqrt(np.mean(np.square(found)))) if found else 0.0
