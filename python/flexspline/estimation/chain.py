"""`flexspline.estimate`: the production chain over a log."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import InputError, listed
from flexspline.estimation.measurable import measurable
from flexspline.estimation.models import channel, model_inputs
from flexspline.estimation.plan import Plan, plan_of
from flexspline.estimation.preprocessing import Prepared, prepared, with_derivatives
from flexspline.estimation.result import Estimate
from flexspline.estimation.running import last_good, run_chain
from flexspline.estimation.status import Status
from flexspline.logs.log import Log
from flexspline.logs.read import with_motor_torque
from flexspline.logs.segments import median_step, runs
from flexspline.model import Model

__all__ = ["estimate"]

Array = NDArray[np.float64]
Bits = NDArray[np.integer[Any]]
Runs = NDArray[np.intp]

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
THERMISTOR, COMPENSATION, SENSOR = 1, 2, 4
FAULTS = 11  # places from the bits of the core's faults to those of the status


def estimate(model: Model, log: Log, *, bandwidth: float | None = None) -> Estimate:
    """Run a model's estimators over a log, sample by sample, as the joint would.

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
    ranges = _increasing(log)
    _require_stable(plan, log)
    said: dict[str, None] = {}  # sentences, each once, in order
    log = with_derivatives(plan, with_motor_torque(log), bandwidth, said)
    read = prepared(plan.preprocessing, log, ranges)
    log = read.log
    sensed = _sensed(plan, log, ranges, said)
    log = log.with_columns(
        {"temperature": last_good(sensed["temperature"], ranges)}, note="as the chain knows it"
    )
    inputs = model_inputs(
        model, plan, log, sensed["sensor_torque"], lambda sentence: said.update({sentence: None})
    )
    checks = {k: entry for k, entry in plan.preprocessing.items() if k == "reading_checks"}
    config = {"sensor": plan.has_sensor, **checks, **plan.estimating}
    found = run_chain(config, log, inputs, ranges)
    columns = _columns(plan, read, sensed, found, ranges)
    _require_something(columns, log, tuple(said))
    return Estimate(log.name, columns, tuple(said))


def _increasing(log: Log) -> Runs:
    """Row ranges without a gap."""
    bad = np.flatnonzero(~(np.diff(log["time"]) > 0.0))
    if bad.size or not np.isfinite(log["time"][0]):
        row = int(bad[0]) + 1 if bad.size else 0
        raise InputError(
            f"log '{log.name}': time does not increase at row {row}; repair the log before"
        )
    return runs(log["time"])


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


def _sensed(plan: Plan, log: Log, ranges: Runs, said: dict[str, None]) -> dict[str, Array]:
    """Temperature and sensor torque, NaN where there is none, with their flags and `missed`."""
    config, inputs = dict(plan.sensing), {}
    log = measurable(log, said)
    if "thermistor" in config and "thermistor_voltage" in log:
        inputs["thermistor_voltage"] = channel(log, "thermistor_voltage")
    elif config.pop("thermistor", None) is not None and "temperature" in log:
        said["temperature is the log's own: it has no thermistor_voltage"] = None
    inputs["temperature"] = channel(log, "temperature")
    inputs["voltage"] = channel(log, "sensor_voltage")
    if "calibration" in config and "sensor_voltage" not in log and "sensor_torque" in log:
        config.pop("calibration")
        config.pop("temperature_compensation", None)
        said["sensor_torque is the log's own, not compensated: it has no sensor_voltage"] = None
    inputs["sensor_torque"] = channel(log, "sensor_torque")
    found = run_chain({"sensor": plan.has_sensor, **config}, log, inputs, ranges)
    missed = found["missed"]
    temperature = found.get("temperature", inputs["temperature"])
    torque = found.get("sensor_torque", inputs["sensor_torque"])
    return {
        "temperature": _unless(missed & (THERMISTOR | COMPENSATION), temperature),
        "sensor_torque": _unless(missed & SENSOR, torque),
        "flags": found["flags"],
    }


def _columns(
    plan: Plan, read: Prepared, sensed: Mapping[str, Array], found: Mapping[str, Any], ranges: Runs
) -> dict[str, Array]:
    log = read.log
    columns = {"time": np.array(log["time"])}
    columns |= {name: np.array(sensed[name]) for name in ("temperature", "sensor_torque")}
    status = np.zeros(len(log), dtype=np.int64)
    for stage, (bit, result, name) in STAGES.items():
        if result in found:
            columns[name] = _unless(found["missed"] & stage, found[result])
            status |= np.where(found["missed"] & stage, int(bit), 0)
    if plan.sensing.keys() & {"thermistor", "temperature_compensation"}:
        status |= np.where(np.isnan(sensed["temperature"]), int(Status.NO_TEMPERATURE), 0)
    status |= _flagged(plan, log, sensed["flags"] | found["flags"])
    status |= np.where(read.missed, int(Status.NO_VELOCITY), 0)
    status |= (read.faults | found.get("faults", 0)).astype(np.int64) << FAULTS
    status[ranges[:, 0]] |= int(Status.RESTARTED)
    return {**columns, "status": status.astype(np.float64)}


def _flagged(plan: Plan, log: Log, flags: Bits) -> NDArray[np.int64]:
    """Bits of extrapolation and saturation: those of the core are the same."""
    made = flags.astype(np.int64)
    if plan.temperature_range is not None:
        low, high = plan.temperature_range
        outside = (log["temperature"] < low) | (log["temperature"] > high)
        made |= np.where(outside, int(Status.EXTRAPOLATED), 0)
    return np.asarray(made)


def _unless(missed: Bits, values: Array) -> Array:
    return np.where(missed, np.nan, values)


def _require_something(columns: Mapping[str, Array], log: Log, said: tuple[str, ...]) -> None:
    estimates = [name for name in columns if name.startswith("external") or name == "contact"]
    if not any(np.isfinite(columns[name]).any() for name in estimates):
        why = f" ({said[-1]})" if said else ""
        raise InputError(
            f"log '{log.name}': no row has all that {listed(estimates)} read{why}; "
            f"it has {listed(log.channels)}; map the columns that are missing"
        )
