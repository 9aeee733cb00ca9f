"""Motor torque of a planned run: what the drive of the recorded runs would need for it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexspline.effects import effect
from flexspline.least_squares.problem import problem_of
from flexspline.logs.log import Log
from flexspline.regression.gram import Whitening
from flexspline.regression.working import Working, started, working
from flexspline.signals import channels_for, core_channels, gear_of

__all__ = ["Motor", "motor_of"]

Array = NDArray[np.float64]

EFFECTS = ("offset", "coulomb_friction", "viscous_friction", "inertia", "gravity")
LOADED = ("load_dependent_friction", "torque_constant_error")
"""With a known load: what it adds to friction, and its scale."""


@dataclass(frozen=True, eq=False)
class Motor:
    """The drive's equation, fitted to the motor torque of the recorded runs."""

    work: Working
    known_load: str | None

    def torque(self, log: Log) -> Array:
        """Motor torque (N,) [Nm] of a log that has motion and load."""
        from flexspline import _core

        log = _geared(log)
        design = _core.Design(
            [e.for_core() for e in self.work.effects], **gear_of(log.facts, "motor_position" in log)
        )
        channels = core_channels(log, self.work.effects, self.known_load)
        y = np.asarray(design.predict(channels, len(log), self.work.coefficients))
        load = log[self.known_load] if self.known_load is not None else 0.0
        return np.asarray((y + load) / float(log.effective_ratio or 1.0))


def motor_of(logs: Sequence[Log], known_load: str | None) -> Motor:
    """Fit the drive of logs with motor torque."""
    names = EFFECTS if known_load is None else (*EFFECTS[:-1], *LOADED)
    effects = [effect(name) for name in names]
    problem = problem_of(
        [channels_for(_geared(log), effects, known_load) for log in logs],
        effects,
        "motor_torque",
        known_load=known_load,
        lowpass_hz=None,
        threads=1,
    )
    plain = Whitening(np.ones(1), 1.0, 1)
    return Motor(started(problem, working(effects, len(effects), {}), plain)[0], known_load)


def _geared(log: Log) -> Log:
    """The log with a gear ratio: 1 where none is known, which the load's scale makes up for."""
    if "gear_ratio" in log.facts:
        return log
    return log.with_facts({"gear_ratio": 1.0})
