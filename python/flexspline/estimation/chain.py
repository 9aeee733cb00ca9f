"""`flexspline.estimate`: the production chain over a log."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import InputError, listed
from flexspline.estimation.joint import run_joint
from flexspline.estimation.measurable import measurable
from flexspline.estimation.plan import Plan, plan_of
from flexspline.estimation.preprocessing import with_derivatives
from flexspline.estimation.result import Estimate
from flexspline.estimation.status import Status
from flexspline.logs.log import Log
from flexspline.logs.read import with_motor_torque
from flexspline.logs.segments import median_step, runs
from flexspline.model import Model

__all__ = ["estimate"]

Array = NDArray[np.float64]

STAGES = {  # bit of the core's stage: bit of the status, result, column
    4: (Status.NO_SENSOR, "external_sensor", "external_torque_sensor"),
    8: (Status.NO_OBSERVER, "external_observer", "external_torque_observer"),
    16: (Status.NO_COMPLIANCE, "external_compliance", "external_torque_compliance"),
    32: (Status.NO_MERGED, "external_merged", "external_torque_merged"),
    64: (Status.NO_CONTACT, "contact", "contact"),
    128: (
        Status.NO_COMPLIANT_OBSERVER,
        "external_compliant_observer",
        "external_torque_compliant_observer",
    ),
}
CONTACT, DIFFERENTIATOR = 64, 256
MOST_MISSED = 511  # all stages of the core
FAULTS = 11  # places from the bits of the core's faults to those of the status


def estimate(model: Model, log: Log, *, bandwidth: float | None = None) -> Estimate:
    """Run a model's estimators over a log, sample by sample, by the code that the joint runs.

    The chain is the core's: reading checks, differentiator, thermistor, temperature compensation,
    calibration, the sensor's intrinsic part, observer, compliance, the link's observer, merge,
    collision, each where the model holds it. A value is NaN where its stage had nothing to work
    with, and `status` says so; filters, observer, lags and detector start again behind a gap.
    Nothing that looks ahead is used: a velocity that the log lacks is the causal derivative of its
    position, and a note says so.

    Parameters
    ----------
    model : with estimators, a part for sensor_torque, or both.
    log : time must increase. `sensor_voltage` is read where the model has a calibration, else
        `sensor_torque`; `thermistor_voltage` where it has a thermistor, else `temperature`. A
        voltage or temperature that no instrument measures counts as none.
        A reference torque is never read.
    bandwidth : Hz, of the causal differentiator where the model has none; None for 20 Hz, or a
        quarter of a low rate.

    Returns
    -------
    Columns of (N,): time [s], temperature [°C], sensor_torque [Nm], external torques [Nm at the
    output, positive outward] by sensor, observer, compliance, compliant_observer and merged,
    contact, status. Bits of the status (`flexspline.estimation.Status`): 1 extrapolated, 2
    saturated, 4 no temperature, 8 no sensor, 16 no observer, 32 no compliance, 64 no merged torque,
    128 contact not decided, 256 started again, 512 no observer of the link, 1024 no velocity from
    the angle; what the reading checks took out: 2048 sensor, 4096 motor, 8192 speed, 16384 motion,
    32768 encoders, 131072 temperature; 65536 sensor and observer disagree.

    Raises
    ------
    InputError
        Where the model has nothing to estimate with or lacks what an estimator reads, the log
        lacks every channel that they read, its time does not increase, or the observer's gain is
        not stable at its rate.

    Sources
    -------
    zhang_disturbance_elimination (6)–(11), (16)–(25); full_range_torque_estimation (7), (8),
    (14)–(20).
    """
    plan = plan_of(model)
    _require_increasing(log)
    _require_stable(plan, log)
    said: dict[str, None] = {}  # sentences, each once, in order
    log = with_derivatives(plan, with_motor_torque(log), bandwidth, said)
    log = measurable(log, said, plan.preprocessing.get("reading_checks", {}))
    columns = _columns(plan, log, run_joint(model, plan, log, said))
    _require_something(columns, log, tuple(said))
    return Estimate(log.name, columns, tuple(said))


def _require_increasing(log: Log) -> None:
    bad = np.flatnonzero(~(np.diff(log["time"]) > 0.0))
    if bad.size or not np.isfinite(log["time"][0]):
        row = int(bad[0]) + 1 if bad.size else 0
        raise InputError(
            f"log '{log.name}': time does not increase at row {row}; repair the log before"
        )


def _require_stable(plan: Plan, log: Log) -> None:
    step = median_step(log["time"])
    for key in ("observer", "compliant_observer"):
        entry = plan.estimating.get(key, {})
        if entry.get("discretisation") == "euler" and entry["gain"] * step >= 2.0:
            raise InputError(
                f"log '{log.name}': the {key.replace('_', ' ')}'s gain of {entry['gain']:g} 1/s by "
                f"euler is not stable at {1.0 / step:.4g} Hz; give a gain below "
                f"{2.0 / step:.4g} 1/s or the discretisation exact"
            )


def _columns(plan: Plan, log: Log, found: Mapping[str, Any]) -> dict[str, Array]:
    columns = {"time": np.array(log["time"])}
    columns |= {name: found[name] for name in ("temperature", "sensor_torque")}
    missed = found["missed"]
    bits = np.zeros(MOST_MISSED + 1, dtype=np.int64)  # of the status, by those of `missed`
    some = np.arange(MOST_MISSED + 1)
    bits[(some & DIFFERENTIATOR) != 0] = Status.NO_VELOCITY
    for stage, (bit, result, name) in STAGES.items():
        if result in found:
            columns[name] = found[result]
            bits[(some & stage) != 0] |= bit
    if "contact" in columns:
        columns["contact"] = np.where(missed & CONTACT, np.nan, columns["contact"])
    status = bits[missed]
    status |= found["flags"]
    status |= found["faults"].astype(np.int64) << FAULTS
    if plan.sensing.keys() & {"thermistor", "temperature_compensation"}:
        status[np.isnan(found["temperature"])] |= Status.NO_TEMPERATURE
    status[runs(log["time"])[:, 0]] |= Status.RESTARTED
    return {**columns, "status": status.astype(np.float64)}


def _require_something(columns: Mapping[str, Array], log: Log, said: tuple[str, ...]) -> None:
    estimates = [name for name in columns if name.startswith("external") or name == "contact"]
    if not any(np.isfinite(columns[name]).any() for name in estimates):
        why = f" ({said[-1]})" if said else ""
        raise InputError(
            f"log '{log.name}': no row has all that {listed(estimates)} read{why}; "
            f"it has {listed(log.channels)}; map the columns that are missing"
        )
