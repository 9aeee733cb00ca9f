"""Do 95 % intervals of `fit` cover the truth where every channel is recorded? Class lab.

Runs of the benchmark's joints (`hidden/rig.py`) behind its recorder of class lab
(`hidden/recorder.py`): quantised encoders, a drive's filtered velocity that is late, a noisy
acceleration or none, a load cell with noise and delay. The target is a model of the catalogue with
known coefficients, of exact channels, and noise of the benchmark's kinds. So only the recorder
stands between a fit and the truth.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, os.path.dirname(__file__))

import flexspline
from flexspline.effects import effect
from flexspline.errors import InputError
from flexspline.logs.log import Log
from hidden.cases import RICH, Case, _Maker
from hidden.made import noise_of
from hidden.recorded import Rig
from hidden.recorder import Recorder
from hidden.rig import LOAD

__all__ = ["Drawn", "WATCHED", "drawn"]

Array = NDArray[np.float64]

FACTOR = 0.03  # of the load, that friction grows by
WATCHED = ("inertia", "viscous_friction", "load_dependent_friction")
MODEL = ("offset", "coulomb_friction", "viscous_friction", "inertia", "load_dependent_friction")


@dataclass(frozen=True)
class _Rig(Rig):
    """A rig whose friction is the same both ways: what a fit to the catalogue may assume."""

    @cached_property
    def recorder(self) -> Recorder:
        return replace(super().recorder, one_way=0.0)


@dataclass(frozen=True)
class Drawn:
    case: Case
    recorder: Recorder
    logs: list[Log]
    truth: dict[str, float]


def drawn(number: int, deal: int, poor: bool = False) -> Drawn:
    """Return the runs of one set."""
    maker = _Maker(deal, "lab")
    maker.numbers = iter([number])
    target = ("sensor_torque", "motor_torque")[number % 2]
    case = maker("nothing", target, (), 0.0, poor_every=1 if poor else 0)
    rig = _Rig(case)
    joint = rig.joint
    logs = []
    for k in range(rig.runs):
        seen = rig.taken(k)
        s = seen.truth
        y = s.friction + FACTOR * np.abs(s.transmitted) * s.direction
        y = y + noise_of(case, rig.level, k, len(y))
        logs.append(rig.recorded(seen, y, k))
    truth = {
        "offset": joint.offset, "coulomb_friction": joint.coulomb, "direction_width": joint.width,
        "viscous_friction": joint.viscous, "inertia": joint.inertia,
        "load_dependent_friction": FACTOR,
    }
    return Drawn(case, rig.recorder, logs, truth)
