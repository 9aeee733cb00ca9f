"""The model's joint over a log: built from its plan, run by the core, and what it says of the log.

The core's `Joint` is the one of the device (`flexspline/joint.hpp`), with effects and stages chosen
at run time.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexspline import _core
from flexspline.errors import InputError
from flexspline.estimation.plan import Plan
from flexspline.estimation.preprocessing import READINGS, made_by
from flexspline.logs.local_fit import require_bandwidth
from flexspline.logs.log import Log
from flexspline.logs.segments import runs
from flexspline.model import Model
from flexspline.part import Part
from flexspline.signals import channels_for, gear_of

__all__ = ["run_joint"]

Array = NDArray[np.float64]
Said = dict[str, None]  # sentences, each once, in order

LOAD = "reference_torque"  # the channel through which the effects of a part get their load


def run_joint(
    model: Model, plan: Plan, log: Log, said: Said, *, inputs: bool = False
) -> dict[str, Any]:
    """Return what the joint makes of each row of a log, by the core's names, (N,) each.

    Parameters
    ----------
    plan : of the model.
    log : with increasing time and the derivatives that the joint reads and does not make.
    said : takes sentences on what is missing.
    inputs : also return what the stages read: momenta, torsion, what the models predict.

    Raises
    ------
    InputError
        Where the log is of another gear, or the differentiator's bandwidth does not suit its rate.
    """
    made = plan.preprocessing.get("differentiator")
    if made is not None:
        label = f"{log.name}, derivative of output_position"
        require_bandwidth(made["bandwidth"], log.rate, label)
    sensing = _sensing(plan, log, said)
    joint = _core.Joint(
        {"sensor": plan.has_sensor, **plan.preprocessing, **sensing, **plan.estimating},
        {name: _model(model, part) for name, part in plan.models.items() if part is not None},
        effective_ratio=plan.effective_ratio,
        inertia=plan.inertia,
        link_inertia=plan.link_inertia,
        **_limits(plan),
    )
    _say_of_models(model, plan, log, said)
    columns = {name: log[name] for name in ("time", *READINGS) if name in log}
    return joint.run(columns, runs(log["time"])[:, 0].tolist(), inputs=inputs)


def _model(model: Model, part: Part) -> tuple[_core.Design, Array]:
    by_motor_encoder = "motor_position" in part.record.get("channels", ())
    effects = [effect.for_core() for effect in part.effects]
    return _core.Design(effects, **gear_of(model.facts, by_motor_encoder)), part.coefficients


def _limits(plan: Plan) -> dict[str, float]:
    if plan.temperature_range is None:
        return {}
    return dict(zip(("low", "high"), plan.temperature_range, strict=True))


def _sensing(plan: Plan, log: Log, said: Said) -> Mapping[str, Mapping[str, Any]]:
    """The sensing stages without those whose result is a channel of the log already."""
    stages = dict(plan.sensing)
    if "thermistor" in stages and "thermistor_voltage" not in log:
        stages.pop("thermistor")
        if "temperature" in log:
            said["temperature is the log's own: it has no thermistor_voltage"] = None
    if "calibration" in stages and "sensor_voltage" not in log and "sensor_torque" in log:
        stages.pop("calibration")
        stages.pop("temperature_compensation", None)
        said["sensor_torque is the log's own, not compensated: it has no sensor_voltage"] = None
    return stages


def _say_of_models(model: Model, plan: Plan, log: Log, said: Said) -> None:
    """Say what the models lack of the log, stage by stage."""
    made = plan.preprocessing.get("differentiator")
    named = {"temperature", LOAD, *(() if made is None else made_by(made))} - {*log.channels}
    log = log.with_columns(dict.fromkeys(named, log["time"]), note="of the joint")
    if plan.has_sensor:
        if plan.sensor is None:
            said[
                "the model has no part for sensor_torque: what the joint adds to it is not taken "
                "off"
            ] = None
        _say_of_part(model, plan.sensor, log, said)
    if "compliance" in plan.estimating:
        _say_of_torsion(model, plan, log, said)
    if "compliant_observer" in plan.estimating:
        _say_of_momentum(plan.link_inertia, log, "compliant observer", said)
    if not plan.has_sensor and plan.observed is not None and _reads_load(plan.observed):
        how = "the compliance's of the row before: no sensor"
        if "compliance" not in plan.estimating:
            how = "it as zero: no sensor, and no estimator compliance"
        said[f"the effects of the observer's part that read the load take {how}"] = None
    if "observer" in plan.estimating:
        _say_of_momentum(plan.inertia, log, "observer", said)
        _say_of_part(model, plan.observed, log, said)
        if plan.estimating["observer"]["input"] == "motor_torque" and "motor_torque" not in log:
            said[f"the observer reads motor_torque, which log '{log.name}' lacks"] = None


def _say_of_torsion(model: Model, plan: Plan, log: Log, said: Said) -> None:
    for name in ("output_position", "motor_position"):
        if name not in log:
            said[f"the compliance reads {name}, which log '{log.name}' lacks"] = None
    _say_of_part(model, plan.torsion, log, said)
    _say_of_part(model, plan.carried, log, said)


def _say_of_momentum(inertia: float, log: Log, whose: str, said: Said) -> None:
    if inertia == 0.0:
        said[f"the {whose} is a low pass of its torque: its part knows no inertia"] = None
    elif "output_velocity" not in log:
        said[f"the {whose} reads output_velocity, which log '{log.name}' lacks"] = None


def _say_of_part(model: Model, part: Part | None, log: Log, said: Said) -> None:
    """Say what a part lacks of the log, and what it reads as it is: nothing here looks ahead."""
    if part is None:
        return
    for one in part.preparations:
        said[
            f"the part for {part.target} was found with {one.channel} {one.how}, zero phase; here "
            "it reads the channel as it is, as the joint does"
        ] = None
    try:
        channels_for(log, part.effects, None)
    except InputError as error:
        said[str(error)] = None
    else:
        model.require_scales(log, part)


def _reads_load(part: Part) -> bool:
    return any("load" in effect.reads for effect in part.effects)
