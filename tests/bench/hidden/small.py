"""Small effects that are there besides the hidden one in half of the recorded cases.

Two or three, each with an RMS of 2 to 6 % of that of the largest hidden term and a t below 3 beside
base, hidden terms and rivals; where fewer can have both, there are fewer. They may be named behind
all that is hidden.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from hidden.combined import ALONE, OF_CURRENT
from hidden.rivals import SAME_THING
from hidden.size import Sizing, Term, sized

if TYPE_CHECKING:
    from hidden.recorded import Rig

__all__ = ["SHARE", "SMALL_T", "small_terms"]

SHARE = (0.02, 0.06)  # of the RMS of the largest hidden term
SMALL_T = 3.0
BELOW = 0.98  # of SMALL_T, where a share is made less to stay below it
TRIES = 8  # effects that are looked at
NEVER = ("sensor_lag", "speed_dependent_ripple")
"""The one cannot be told from the load cell's delay, the other needs a ripple in the base."""


def small_terms(rig: Rig, sizing: Sizing, hidden: Mapping[str, Term]) -> dict[str, Term]:
    """Return the terms of all runs, by name; none where a case has none."""
    case = rig.case
    if not case.nameable or rig.recorder.one_way == 0.0:
        return {}
    generator = np.random.default_rng([20261122, case.seed, 0, 0, 6])
    wanted = int(generator.integers(2, 4))
    rms = max(_rms(rig, term) for term in hidden.values())
    beside = [np.column_stack([column, *(term[k] for term in hidden.values())])
              for k, column in enumerate(sizing.disturbing)]  # fmt: skip
    among = replace(sizing, disturbing=beside)
    made: dict[str, Term] = {}
    for name in generator.permutation(_possible(rig))[:TRIES]:
        raw = [rig.form(str(name))(s) for s in rig.scenes]
        share = float(generator.uniform(*SHARE))
        unit = share * rms / _rms(rig, raw)
        t = 1.0 / sized(among, {str(name): [unit * x for x in raw]}, 1.0)[str(name)].factor
        factor = min(1.0, BELOW * SMALL_T / t)
        if factor * share >= SHARE[0]:
            made[str(name)] = [factor * unit * x for x in raw]
        if len(made) == wanted:
            break
    return made


def _possible(rig: Rig) -> list[str]:
    """Effects that are neither hidden nor in the base, and no other name of what is."""
    case = rig.case
    every = OF_CURRENT.alone if case.target == "motor_current" else ALONE[case.target]
    there = {*case.hidden, *(e.name for e in rig.base)}
    twins = {twin for name in there for twin in SAME_THING.get(name, ())}
    return [name for name in every if name not in {*there, *twins, *NEVER}]


def _rms(rig: Rig, term: Term) -> float:
    """RMS of a term over the runs that are fitted."""
    return float(np.sqrt(np.mean(np.concatenate(term[: rig.runs]) ** 2)))
