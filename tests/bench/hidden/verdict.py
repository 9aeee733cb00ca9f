"""Whether what is said of a recorded case is right: names, their order, and faults of the data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexspline.discovery.faults import DataFault
from hidden.cases import Case
from hidden.recorder import Recorder
from hidden.rig import LOAD

__all__ = ["MOST_ALIASES", "Verdict", "judged_recorded", "real_fault", "short_lists"]

MOST_ALIASES = 3  # names of a declared list that counts
TWICE = 2.0  # a delay that is stated may be off by this factor


@dataclass(frozen=True)
class Verdict:
    """`means`: the effect that each name stands for, "" for a wrong one; `wrong`: whether any
    name or fault is; `right`: whether all is as it should be.
    """

    means: tuple[str, ...]
    wrong: bool
    right: bool


def short_lists(aliases: Sequence[tuple[str, ...]]) -> list[tuple[str, ...]]:
    """Aliases that count: of a list that is longer than MOST_ALIASES none."""
    return [own if len(own) <= MOST_ALIASES else () for own in aliases]


def judged_recorded(
    case: Case,
    recorder: Recorder,
    small: Sequence[str],
    names: Sequence[str],
    aliases: Sequence[tuple[str, ...]],
    means: Sequence[str],
    unexplained: bool,
    faults: Sequence[DataFault],
) -> Verdict:
    """Judge a case of the classes lab and robot.

    Parameters
    ----------
    small : effects that are there besides: right behind all hidden ones, themselves or as a
        declared alias, and never missed.
    means : the hidden effect that each name stands for, "" for none (`trial.stands_for`).

    A sensor lag is right where the load cell is late and the name declares a delay as its alias.
    Nothing hidden: nothing else is named. Hidden effects: each named once, and no other. A cause
    without a name: nothing named, and said to be unexplained. A fault that is not there is a wrong
    name.
    """
    told = list(means)
    last = max((k for k, meant in enumerate(means) if meant), default=-1)
    complete = bool(case.nameable) and set(means) - {""} == set(case.nameable)
    for k, name in enumerate(names):
        late = recorder.load_delay > 0.0 and any("delay" in alias for alias in aliases[k])
        behind = complete and k > last and not {name, *aliases[k]}.isdisjoint(small)
        if not means[k] and (behind or (name == "sensor_lag" and late)):
            told[k] = name
    wrong = "" in told or not all(real_fault(case, recorder, fault) for fault in faults)
    nothing = not (case.hidden or case.unknown)
    right = complete if case.nameable else unexplained or nothing
    return Verdict(tuple(told), wrong, right and not wrong)


def real_fault(case: Case, recorder: Recorder, fault: DataFault) -> bool:
    """Whether a fault that is reported is one that the recorder made."""
    if "noise" in fault.name or "quant" in fault.name:
        return True  # every channel of these recorders has some
    if fault.name == "dropped_samples":
        return recorder.kind == "robot"
    if "delay" not in fault.name and "lag" not in fault.name:
        return False
    if fault.channel == "temperature":
        return recorder.temperature_lag > 0.0
    if fault.channel == "output_velocity":
        return _near(fault.size, _velocity_delay(recorder), 1.0 / recorder.rate)
    late = fault.size if fault.channel == LOAD else -fault.size
    slack = 0.5 / recorder.rate
    if fault.channel in (LOAD, "sensor_torque", "motor_torque"):
        return "sensor_lag" in case.hidden or _near(late, recorder.load_delay, slack)
    return False


def _velocity_delay(recorder: Recorder) -> float:
    """Delay of the velocity channel with that of its filter at low frequencies, s."""
    if recorder.kind == "robot":
        return 0.5 / recorder.rate  # a difference stands for the middle of its two samples
    corner = 1.0 / (2.0 * np.pi * recorder.velocity_cutoff)
    return recorder.velocity_delay + recorder.velocity_order**0.5 * corner


def _near(stated: float, true: float, slack: float) -> bool:
    """Whether a delay that is there is stated within a factor of TWICE, or nearly so."""
    return true > 0.0 and true / TWICE - slack <= stated <= TWICE * true + slack
