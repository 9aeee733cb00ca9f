"""What the model's parts say of a log: the chain's inputs between sensing and estimating.

The device makes the same numbers from one sample: `flexspline/joint.hpp`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flexspline import _core
from flexspline.errors import InputError
from flexspline.estimation.plan import Plan
from flexspline.estimation.running import last_good, run_chain
from flexspline.logs.log import Log
from flexspline.logs.segments import runs
from flexspline.model import Model
from flexspline.part import PART_OF, Part
from flexspline.signals import channels_for

__all__ = ["channel", "model_inputs"]

Array = NDArray[np.float64]
Say = Callable[[str], None]

LOAD = "reference_torque"  # the channel through which a load reaches `Model.predict`
SATURATED = 2


def channel(log: Log, name: str) -> Array:
    """Return a channel, NaN where the log lacks it; (N,)."""
    return np.ascontiguousarray(log[name]) if name in log else np.full(len(log), np.nan)


def model_inputs(
    model: Model, plan: Plan, log: Log, sensor_torque: Array, say: Say
) -> dict[str, Array]:
    """Return the columns that the estimating chain reads, by its names, each (N,).

    Parameters
    ----------
    log : with all channels that there are; the temperature is the last good one.
    sensor_torque : Nm, compensated; NaN where there is none.
    say : takes a sentence on what is missing.
    """
    velocity = channel(log, "output_velocity")
    known_load = np.zeros(len(log))
    columns = {"velocity": velocity}
    if plan.has_sensor:
        intrinsic = _sensor_intrinsic(model, plan, log, sensor_torque, say)
        known_load = sensor_torque - intrinsic
        columns |= {"sensor_torque": sensor_torque, "sensor_intrinsic": intrinsic}
    if "compliance" in plan.estimating:
        columns |= _twisted(model, plan, log, say)
    if "compliant_observer" in plan.estimating:
        columns["link_momentum"] = _momentum(plan.link_inertia, log, "compliant observer", say)
    if not plan.has_sensor and plan.observed is not None and _reads_load(plan.observed):
        known_load = _gear_load(plan, log, columns, say)
    if "observer" in plan.estimating:
        columns |= _observed(model, plan, log, known_load, say)
    return columns


def _gear_load(plan: Plan, log: Log, columns: dict[str, Array], say: Say) -> Array:
    """The load [Nm] of a joint without sensor, (N,): the compliance's of the row before.

    Of the last row that had one, not held at the pole; 0 before the first.
    """
    which = "the effects of the observer's part that read the load take"
    if "compliance" not in plan.estimating:
        say(f"{which} it as zero: no sensor, and no estimator compliance")
        return np.zeros(len(log))
    say(f"{which} the compliance's of the row before: no sensor")
    ranges = runs(log["time"])
    inputs = {name: columns[name] for name in ("torsion", "gear_known")}
    found = run_chain({"compliance": plan.estimating["compliance"]}, log, inputs, ranges)
    good = (found["missed"] == 0) & ((found["flags"] & SATURATED) == 0)
    held = last_good(np.where(good, found["external_compliance"], np.nan), ranges)
    before = np.concatenate([[0.0], held[:-1]])
    before[ranges[:, 0]] = 0.0
    return np.where(np.isfinite(before), before, 0.0)


def _sensor_intrinsic(model: Model, plan: Plan, log: Log, torque: Array, say: Say) -> Array:
    """What the sensor reads beside the load, Nm; asked twice where that depends on the load."""
    nothing = np.zeros(len(log))
    if plan.sensor is None:
        say("the model has no part for sensor_torque: what the joint adds to it is not taken off")
        return nothing
    if not _reads_load(plan.sensor):
        return _predicted(model, plan.sensor, log, nothing, say)
    first = _predicted(model, plan.sensor, log, nothing, say)
    return _predicted(model, plan.sensor, log, torque - first, say)


def _observed(model: Model, plan: Plan, log: Log, load: Array, say: Say) -> dict[str, Array]:
    columns = {
        "momentum": _momentum(plan.inertia, log, "observer", say),
        "observer_intrinsic": _predicted(model, plan.observed, log, load, say),
    }
    if plan.estimating["observer"]["input"] == "motor_torque":
        columns["motor_torque"] = plan.effective_ratio * channel(log, "motor_torque")
        if "motor_torque" not in log:
            say(f"the observer reads motor_torque, which log '{log.name}' lacks")
    return columns


def _momentum(inertia: float, log: Log, whose: str, say: Say) -> Array:
    if inertia == 0.0:
        say(f"the {whose} is a low pass of its torque: its part knows no inertia")
        return np.zeros(len(log))
    if "output_velocity" not in log:
        say(f"the {whose} reads output_velocity, which log '{log.name}' lacks")
    return inertia * channel(log, "output_velocity")


def _twisted(model: Model, plan: Plan, log: Log, say: Say) -> dict[str, Array]:
    """Torsion and what is known of its torque; neither part reads the load: the chain has it."""
    load = np.zeros(len(log))
    for name in ("output_position", "motor_position"):
        if name not in log:
            say(f"the compliance reads {name}, which log '{log.name}' lacks")
    torsion = _core.mesh_torsion_left(
        channel(log, "output_position"),
        channel(log, "motor_position"),
        _predicted(model, plan.torsion, log, load, say),
        effective_ratio=plan.effective_ratio,
    )
    return {
        "torsion": torsion,
        "gear_known": _predicted(model, plan.carried, log, load, say),
    }


def _predicted(model: Model, part: Part | None, log: Log, load: Array, say: Say) -> Array:
    """What a part says of the log under a load [Nm], (N,); NaN where it cannot say."""
    if part is None:
        return np.zeros(len(log))
    if _reads_load(part):
        part = replace(part, known_load=LOAD)
        log = log.with_columns({LOAD: load}, note="the load as the chain knows it")
    else:
        part = replace(part, known_load=None)
    part = _as_recorded(part, say)
    log = _whole_rows(part, log)
    try:
        channels_for(log, part.effects, part.known_load)
    except InputError as error:
        say(str(error))
        return np.full(len(log), np.nan)
    alone = replace(model, parts={PART_OF[part.target]: part}, estimators={})
    return alone.predict(log).predicted


def _as_recorded(part: Part, say: Say) -> Part:
    """The part reading its channels as they are: a smoother that looks ahead runs on no joint."""
    for one in part.preparations:
        say(
            f"the part for {part.target} was found with {one.channel} {one.how}, zero phase; here "
            "it reads the channel as it is, as the joint does"
        )
    return replace(part, record={k: v for k, v in part.record.items() if k != "prepared"})


def _whole_rows(part: Part, log: Log) -> Log:
    """The log without the motor's angle where a channel of the part is missing.

    What remembers stays in such a row, as on the device, which looks at the whole sample first.
    """
    if "motor_position" not in log or not any(e.info.remembers for e in part.effects):
        return log
    reads = {name for effect in part.effects for name in effect.reads} - {"load"}
    good = np.isfinite([log[name] for name in {*reads, "output_position"} if name in log])
    angle = np.where(good.all(axis=0), log["motor_position"], np.nan)
    return log.with_columns({"motor_position": angle}, note="in whole rows")


def _reads_load(part: Part) -> bool:
    return any("load" in effect.reads for effect in part.effects)
