"""The production chain over a log: what the joint computes, sample by sample.

`estimate` runs the joint of a model over a log, by the code that a device runs.

The core's `Joint` (`flexspline/joint.hpp`) is built from the model's plan, with effects and stages
chosen at run time; on a device both are fixed at compile time.

A log may hold voltages and temperatures that no instrument measures. They mark an overload: SCPI
instruments write 9.9e37 for it and 9.91e37 for "not a number" (SCPI-99, 7.2.1.4 and 7.2.1.5).
`measurable` empties them; the joint's own converter cannot give such a number.

The result is of one run its columns, the bits of their status, and text and HTML; of several runs
also how far their external torques are from a reference. The error is the estimate less
`reference_torque`, which has the same sign: positive where the joint pushes the outside world in
+q. No estimator ever reads the reference.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from enum import IntFlag
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import NDArray

from flexspline import _core
from flexspline.errors import InputError, did_you_mean, listed, number
from flexspline.estimation.plan import (
    FORGOTTEN,
    OBSERVERS,
    READINGS,
    Plan,
    adapted_units,
    doubts_of,
    joint_limits,
    made_by,
    plan_of,
    readings_of,
    reads_load,
    reads_of,
    with_stage,
)
from flexspline.files import save_columns
from flexspline.formatting import rows_text, sentences_text, short, table_html
from flexspline.lazy import render
from flexspline.logs.local_fit import require_bandwidth
from flexspline.logs.log import Log, require_clock
from flexspline.logs.read import LogLike, as_logs, is_one, with_motor_torque
from flexspline.logs.segments import median_step, output_speed, runs, true_ranges
from flexspline.model import Model
from flexspline.part import Part
from flexspline.prediction import SIZES, OfRuns, error_sizes
from flexspline.signals import channels_for, gear_of

if TYPE_CHECKING:
    import pandas

__all__ = [
    "Estimate",
    "Estimates",
    "Status",
    "estimate",
]

Array = NDArray[np.float64]

COLUMNS = {
    "time": "s",
    "temperature": "°C",
    "sensor_torque": "Nm",
    "external_torque_sensor": "Nm",
    "external_torque_observer": "Nm",
    "external_torque_compliance": "Nm",
    "external_torque_compliant_observer": "Nm",
    "external_torque_merged": "Nm",
    "contact": "0/1",
    "status": "bits",
}

WHOLE = ("contact", "status")

MOST_CONTACTS = 5
HEAD = ("column", "unit", "mean", "least", "most", "empty rows")

EXTERNAL = "external_torque_"
ALL = "all runs"
TITLE = "Errors of the external torque: the estimate less reference_torque"
RUNS_HEAD = ("run", "estimate", "rows", *(f"{name} [Nm]" for name in SIZES))


@dataclass(frozen=True, eq=False, repr=False)
class Estimate:
    """Estimates of one log, arrays (N,); NaN where a stage had nothing to work with.

    All torques are at the output, positive when the joint pushes the outside in +q.

    Parameters
    ----------
    name : of the run.
    columns : `COLUMNS`, those of both observers, compliance, merged and contact where the model
        has the estimator. `status` holds the bits of `flexspline.estimation.Status`.
    notes : sentences on what was derived, missing, extrapolated or held.
    adapted : parameters that an adaptation learned, with their units: columns behind all others,
        each row with what was known behind it.
    doubts : sentences on what makes these estimates wrong, of the model, the log or both, such as
        rows outside of what a part in use was fitted to; `warnings` has them too.
    """

    name: str
    columns: Mapping[str, Array]
    notes: tuple[str, ...] = ()
    adapted: Mapping[str, str] = field(default_factory=dict)
    doubts: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        names = (*COLUMNS, *self.adapted)
        ordered = {name: self.columns[name] for name in names if name in self.columns}
        for data in ordered.values():
            data.flags.writeable = False
        object.__setattr__(self, "columns", MappingProxyType(ordered))

    def __reduce__(self) -> tuple[Any, ...]:
        kept = (self.name, dict(self.columns), self.notes, dict(self.adapted), self.doubts)
        return (Estimate, kept)

    def __len__(self) -> int:
        return len(self.columns["time"])

    def __contains__(self, column: object) -> bool:
        return column in self.columns

    def __getitem__(self, column: str) -> Array:
        """Return one column, (N,), in the unit of `COLUMNS`."""
        if column in self.columns:
            return self.columns[column]
        near = did_you_mean(column, COLUMNS)
        raise InputError(
            f"estimate of '{self.name}': no column '{column}'{near}; it has {listed(self.columns)}"
        )

    @property
    def status(self) -> NDArray[np.int64]:
        """Bits of `flexspline.estimation.Status`, (N,)."""
        return self.columns["status"].astype(np.int64)

    def flagged(self, bit: Status) -> NDArray[np.bool_]:
        """Rows with this bit, (N,)."""
        return np.asarray((self.status & int(bit)) != 0)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is wrong with the model, and each kind of rows outside of what it was made for."""
        beyond = (Status.EXTRAPOLATED, Status.SATURATED, Status.OUT_OF_RANGE)
        return (*self.doubts, *(f"{self.name}: {said}" for said in _flagged(self, beyond)))

    @property
    def contacts(self) -> tuple[tuple[float, float], ...]:
        """(first, last) time of each contact, s; empty without a detector.

        Rows in which contact is not decided do not end one, as on a device, which stays with what
        it decided last.
        """
        if "contact" not in self:
            return ()
        decided = np.isfinite(self["contact"])
        time = self["time"][decided]
        contacts = true_ranges(self["contact"][decided] == 1.0)
        return tuple((float(time[first]), float(time[last - 1])) for first, last in contacts)

    def to_frame(self) -> pandas.DataFrame:
        """Return a table; `contact` and `status` hold whole numbers."""
        import pandas

        frame = pandas.DataFrame({name: np.array(data) for name, data in self.columns.items()})
        return frame.astype({name: "Int64" for name in WHOLE if name in frame})

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a CSV, one row for each row of the log, whole or not at all.

        Raises
        ------
        InputError
            Where the file cannot be written.
        """
        whole = {name: _whole(self.columns[name]) for name in WHOLE if name in self.columns}
        save_columns({**self.columns, **whole}, path)

    def __repr__(self) -> str:
        return f"<Estimate of '{self.name}': {len(self)} rows, {listed(self.columns)}>"

    def __str__(self) -> str:

        return estimate_text(self)

    def _repr_html_(self) -> str:

        return estimate_html(self)

    def plot(self) -> Any:
        """Return a figure: the external torques over time, contacts shaded, flags below."""
        return render("estimate", "figure", self)


class Status(IntFlag):
    """Bits of the column `status`; 0 is a row in which every stage of the model did its work.

    A bit that begins with NO stands for a stage whose estimate is empty in this row: a channel
    that it reads is missing, not finite or out of range. Only stages that the model holds
    set one. A bit that ends with FAULT is of a reading that limits or the model's checks took out,
    or that these found beside another one. OUT_OF_RANGE is of a reading beyond its limit, far from
    all that the model was fitted to.
    """

    EXTRAPOLATED = 1
    SATURATED = 2
    NO_TEMPERATURE = 4
    NO_SENSOR = 8
    NO_OBSERVER = 16
    NO_COMPLIANCE = 32
    NO_MERGED = 64
    NO_CONTACT = 128
    RESTARTED = 256
    NO_COMPLIANT_OBSERVER = 512
    NO_VELOCITY = 1024
    SENSOR_FAULT = 2048
    MOTOR_FAULT = 4096
    SPEED_FAULT = 8192
    MOTION_FAULT = 16384
    ENCODERS_FAULT = 32768
    TORQUES_FAULT = 65536
    TEMPERATURE_FAULT = 131072
    OUT_OF_RANGE = 262144


MEANING = {
    Status.EXTRAPOLATED: "voltage or temperature lies outside the range of calibration or fit",
    Status.SATURATED: "the torsion is at the end of the compliance model: its torque is held there",
    Status.NO_TEMPERATURE: "no temperature",
    Status.NO_SENSOR: "no external torque from the sensor",
    Status.NO_OBSERVER: "no torque from the observer",
    Status.NO_COMPLIANCE: "no torque from the compliance",
    Status.NO_MERGED: "no merged torque",
    Status.NO_CONTACT: "contact is not decided",
    Status.NO_COMPLIANT_OBSERVER: "no torque from the observer of the link",
    Status.NO_VELOCITY: "no velocity from the angle: it is missing, or its filter starts",
    Status.SENSOR_FAULT: "the sensor's voltage or torque is out of its range and was taken out",
    Status.MOTOR_FAULT: "the motor's torque is out of its range and was taken out",
    Status.SPEED_FAULT: "the joint cannot be so fast: angle or velocity were taken out",
    Status.MOTION_FAULT: "angle and velocity disagree: both were taken out",
    Status.ENCODERS_FAULT: "both encoders disagree: angles and velocity were taken out",
    Status.TORQUES_FAULT: "sensor and observer disagree on the external torque",
    Status.TEMPERATURE_FAULT: "temperature or thermistor is out of its range and was taken out",
    Status.OUT_OF_RANGE: "a reading is far beyond all that the model knows: it counts as missing",
    Status.RESTARTED: "observer, lags and detector start here: the first row, or one behind a gap; "
    "an observer comes up from zero for 5 / K",
}


def estimate_text(made: Estimate) -> str:
    """Return what `print(estimate)` shows."""
    table = rows_text([HEAD, *_rows(made)], left=(0, 1))
    said = sentences_text(_sentences(made))
    return "\n".join([_title(made), "", table, *([""] if said else []), *said])


def estimate_html(made: Estimate) -> str:
    """Return the same as a fragment of HTML, for notebooks light and dark."""
    return table_html(_title(made), [HEAD, *_rows(made)], _sentences(made))


def _title(made: Estimate) -> str:
    time = made["time"]
    return f"Estimate of {made.name}: {len(made)} rows, {time[-1] - time[0]:.6g} s"


def _rows(made: Estimate) -> list[tuple[str, ...]]:
    found = []
    for name, data in made.columns.items():
        if name in ("time", "contact", "status"):
            continue
        good = data[np.isfinite(data)]
        sizes = (good.mean(), good.min(), good.max()) if good.size else (np.nan,) * 3
        empty = len(data) - good.size
        unit = COLUMNS.get(name) or made.adapted[name]
        found.append((name, unit, *(short(float(s), 4) for s in sizes), str(empty)))
    return found


def _sentences(made: Estimate) -> list[str]:
    """Contacts, what is flagged and in how many rows, then the notes."""
    said = []
    if "contact" in made and np.isfinite(made["contact"]).any():
        said.append(_contacts(made))
    return [*said, *_flagged(made, MEANING), *made.doubts, *made.notes]


def _flagged(made: Estimate, bits: Iterable[Status]) -> Iterator[str]:
    """Yield what is flagged, and in how many rows."""
    for bit in bits:
        rows = int(np.count_nonzero(made.flagged(bit)))
        if rows:
            yield f"status {int(bit)} in {rows} of {len(made)} rows: {MEANING[bit]}"


def _contacts(made: Estimate) -> str:
    found = made.contacts
    if not found:
        decided = int(np.count_nonzero(np.isfinite(made["contact"])))
        return "no contact" + (f" in {decided} rows" if decided < len(made) else "")
    first = ", ".join(f"{start:.4g}–{end:.4g} s" for start, end in found[:MOST_CONTACTS])
    more = f" and {len(found) - MOST_CONTACTS} more" if len(found) > MOST_CONTACTS else ""
    return f"{len(found)} contact{'s' if len(found) > 1 else ''}: {first}{more}"


def _whole(data: Array) -> NDArray[np.object_]:
    """Whole numbers, None where there is none."""
    return np.array([None if cell != cell else int(cell) for cell in data.tolist()], dtype=object)


@dataclass(frozen=True, eq=False, repr=False)
class Estimates(OfRuns[Estimate]):
    """Estimates of several runs by one model.

    Parameters
    ----------
    runs : at least one.
    references : `reference_torque` of each run, (N,) in Nm, or None where it has none; NaN in rows
        that are left out of the errors.
    speed_above : rad/s of the output, below which they were left out; None for none.
    slow_rows : how many.
    """

    runs: tuple[Estimate, ...]
    references: tuple[Array | None, ...]
    speed_above: float | None = None
    slow_rows: int = 0

    @property
    def estimators(self) -> tuple[str, ...]:
        """Columns of the external torque that any run has."""
        return tuple(
            dict.fromkeys(c for run in self.runs for c in run.columns if c.startswith(EXTERNAL))
        )

    def errors(self, column: str) -> tuple[Array, ...]:
        """Return one external torque less the reference, (rows,) for each run.

        Rows without either are left out; a run without a reference has none.
        """
        return tuple(
            _error(run, column, reference)
            for run, reference in zip(self.runs, self.references, strict=True)
        )

    @property
    def rmse(self) -> dict[str, float]:
        """Root mean square error over all rows of all runs [Nm], by column; NaN without a row."""
        return {c: error_sizes(np.concatenate(self.errors(c)))[0] for c in self.estimators}

    def to_frame(self) -> pandas.DataFrame:
        """Return a table of the errors, a row for each run that has a reference and estimate."""
        import pandas

        return pandas.DataFrame(list(self._of_runs()), columns=RUNS_HEAD)

    def __repr__(self) -> str:
        return f"<Estimates of {len(self)} runs: {listed(self.estimators)}>"

    def __str__(self) -> str:
        blocks = [str(run) for run in self.runs]
        if self._has_reference:
            said = "\n".join(sentences_text(self._sentences()))
            blocks += [f"{TITLE}\n\n{rows_text(self._rows(), left=(0, 1))}\n\n{said}"]
        return "\n\n".join(blocks)

    def _repr_html_(self) -> str:
        whole = "".join(run._repr_html_() for run in self.runs)
        if self._has_reference:
            whole += table_html(TITLE, self._rows(), self._sentences())
        return whole

    @property
    def _has_reference(self) -> bool:
        return any(reference is not None for reference in self.references)

    def _of_runs(self) -> Iterator[tuple[str, str, int, float, float, float]]:
        for column in self.estimators:
            each = self.errors(column)
            for run, errors, known in zip(self.runs, each, self.references, strict=True):
                if known is not None and column in run:
                    yield run.name, column, len(errors), *error_sizes(errors)

    def _pooled(self) -> Iterator[tuple[str, str, int, float, float, float]]:
        for column in self.estimators:
            whole = np.concatenate(self.errors(column))
            yield ALL, column, len(whole), *error_sizes(whole)

    def _rows(self) -> list[tuple[str, ...]]:
        return [
            RUNS_HEAD,
            *(
                (run, column, str(rows), *(short(size, 4) for size in sizes))
                for run, column, rows, *sizes in (*self._of_runs(), *self._pooled())
            ),
        ]

    def _sentences(self) -> list[str]:
        said = []
        for column in self.estimators:
            sizes = [
                (error_sizes(errors)[0], run.name)
                for run, errors in zip(self.runs, self.errors(column), strict=True)
                if len(errors)
            ]
            if len(sizes) > 1:
                largest, name = max(sizes)
                said.append(f"the worst run of {column} is {name}: RMSE {largest:.4g} Nm")
        bare = [
            run.name
            for run, reference in zip(self.runs, self.references, strict=True)
            if reference is None
        ]
        if bare:
            said.append(f"no reference_torque to compare with: {listed(bare)}")
        if self.speed_above is not None:
            said.append(
                f"{self.slow_rows} rows are slower than {self.speed_above:g} rad/s and left out of "
                "these errors"
            )
        return said


def _error(run: Estimate, column: str, reference: Array | None) -> Array:
    if reference is None or column not in run:
        return np.zeros(0)
    error = run[column] - reference
    return error[np.isfinite(error)]


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
OUT_OF_RANGE = np.uint8(4)  # bit of the core's flags
FAULTS = 11  # places from the bits of the core's faults to those of the status

Said = dict[str, None]  # sentences, each once, in order

LOAD = "reference_torque"  # the channel through which the effects of a part get their load

VOLTAGES = ("sensor_voltage", "thermistor_voltage")
MOST_VOLTS = 1e6  # above every bridge and supply
COLDEST, HOTTEST = -273.15, 1e4  # °C: those of the device, `flexspline/estimators/chain.hpp`

RANGE_OF = {
    "sensor_voltage": "voltage_range",
    "thermistor_voltage": "thermistor_voltage_range",
    "temperature": "temperature_range",
}


@overload  # a name of a file is one log
def estimate(  # type: ignore[overload-overlap]
    model: Model, log: LogLike, *, bandwidth: float | None = None
) -> Estimate: ...


@overload
def estimate(
    model: Model,
    log: Iterable[LogLike],
    *,
    bandwidth: float | None = None,
    speed_above: float | None = None,
) -> Estimates: ...
def estimate(
    model: Model,
    log: LogLike | Iterable[LogLike],
    *,
    bandwidth: float | None = None,
    speed_above: float | None = None,
) -> Estimate | Estimates:
    """Run a model's estimators over a log, sample by sample, by the code that the joint runs.

    The chain is the core's: reading checks, differentiator, thermistor, temperature compensation,
    calibration, the sensor's intrinsic part, observer, compliance, the link's observer, merge,
    collision, each where the model holds it. A value is NaN where its stage had nothing to work
    with, and `status` says so; filters, observer, lags and detector start again behind a gap, a
    step of more than 2.5 median ones. An observer starts at zero, and a torque that lasts is seen
    in full 5 / K later; until then `Status.RESTARTED` is set.
    Nothing that looks ahead is used: a velocity that the log lacks is the causal derivative of its
    position, and a note says so.

    Parameters
    ----------
    model : with estimators, a part for sensor_torque, or both.
    log : time must increase. `sensor_voltage` is read where the model has a calibration, else
        `sensor_torque`; `thermistor_voltage` where it has a thermistor, else `temperature`. A
        voltage or temperature that no instrument measures counts as none.
        A reference torque is never read. Or several logs, such as a list.
    bandwidth : Hz, of the causal differentiator where the model has none; None for 20 Hz, or a
        quarter of a low rate.
    speed_above : rad/s, of several logs; rows whose output is slower are left out of the errors.
        The speed is that of `output_velocity`, else of the derivative of `output_position`.

    Returns
    -------
    Columns of (N,): time [s], temperature [°C], sensor_torque [Nm], external torques [Nm at the
    output, positive outward] by sensor, observer, compliance, compliant_observer and merged,
    contact, status, and the coefficients that an `Adaptation` learned, by their names, each as it
    was behind the row and on over gaps.
    Bits of the status (`flexspline.estimation.Status`): 1 extrapolated, 2 saturated, 4 no
    temperature, 8 no sensor, 16 no observer, 32 no compliance, 64 no merged torque,
    128 contact not decided, 256 started again, 512 no observer of the link, 1024 no velocity from
    the angle; what limits and reading checks took out: 2048 sensor, 4096 motor, 8192 speed, 16384
    motion, 32768 encoders, 131072 temperature; 65536 sensor and observer disagree; 262144 a reading
    is beyond its limit, which a device takes for missing, and so does this.
    Of several logs, a list of one included, their `Estimates`: one for each, and the errors of the
    external torques beside the `reference_torque` of the runs that have one.

    Raises
    ------
    InputError
        Where the model has nothing to estimate with or lacks what an estimator reads, the log
        lacks every channel that they read, its time does not increase, or the observer's gain is
        not stable at its rate; for a `speed_above` with one log, or with none that has a reference.

    Sources
    -------
    zhang_disturbance_elimination (6)–(11), (16)–(25); full_range_torque_estimation (7), (8),
    (14)–(20).
    """
    if bandwidth is not None:
        number(bandwidth, "estimate: bandwidth", "Hz")
    plan, logs = plan_of(model), as_logs(log)
    if not logs:
        raise InputError("there is no log to estimate from; give at least one")
    compared = not is_one(log) and any(LOAD in one.channels for one in logs)
    if speed_above is not None and not compared:
        raise InputError(
            f"speed_above is of errors beside {LOAD}; give a list of logs, one of which has it, or "
            "leave speed_above out"
        )
    made = tuple(_estimate(model, plan, one, bandwidth) for one in logs)
    if is_one(log):
        return made[0]
    if speed_above is None:
        return Estimates(made, tuple(_reference(one) for one in logs))
    known = [one for one in logs if LOAD in one.channels]
    slow = sum(int(np.count_nonzero(_slow(one, speed_above))) for one in known)
    return Estimates(made, tuple(_reference(one, speed_above) for one in logs), speed_above, slow)


def with_sensor_torque(model: Model, log: Log) -> Log:
    """Return a log with the torque that a calibrated model reads from its sensor's voltage, Nm.

    Compensated for temperature where the model does that; what its part for the sensor tells is
    still in it. A log that has a sensor_torque, or no voltage, stays as it is, and so does any
    beside a model without a calibration.

    Raises
    ------
    InputError
        As `estimate` does.
    """
    made = "sensor_torque" in log or "sensor_voltage" not in log
    if made or "calibration" not in model.estimators:
        return log
    found = estimate(model, log)
    return log.with_columns(
        {"sensor_torque": found["sensor_torque"]},
        note="sensor_torque from sensor_voltage by the calibration of the model that it is for",
    )


def _slow(log: Log, least: float) -> NDArray[np.bool_]:
    return output_speed(log, least) < least


def _reference(log: Log, least: float | None = None) -> NDArray[np.float64] | None:
    """The reference, NaN in rows slower than `least`; None where the log has none."""
    if LOAD not in log.channels:
        return None
    return log[LOAD] if least is None else np.where(_slow(log, least), np.nan, log[LOAD])


def _estimate(model: Model, plan: Plan, log: Log, bandwidth: float | None) -> Estimate:
    _require_increasing(log)
    _require_stable(plan, log)
    said: dict[str, None] = {}  # sentences, each once, in order
    plan = with_stage(plan, log, bandwidth, said)
    log = measurable(with_motor_torque(log), said, plan.preprocessing.get("reading_checks", {}))
    found = run_joint(model, plan, log, said)
    columns = _columns(model, plan, log, found)
    _require_something(columns, plan, log, tuple(said))
    doubts = doubts_of(model, plan, log, found)
    return Estimate(log.name, columns, tuple(said), adapted_units(model, plan), doubts)


def _require_increasing(log: Log) -> None:
    require_clock(log)
    bad = np.flatnonzero(~(np.diff(log["time"]) > 0.0))
    if bad.size:
        raise InputError(
            f"log '{log.name}': time does not increase at row {bad[0] + 1}; repair it with "
            "sort_time or drop_duplicates"
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


def _columns(model: Model, plan: Plan, log: Log, found: Mapping[str, Any]) -> dict[str, Array]:
    columns = {"time": np.array(log["time"])}
    columns |= {name: found[name] for name in ("temperature", "sensor_torque")}
    units = adapted_units(model, plan)
    columns |= {name: found["adapted"][:, place] for place, name in enumerate(units)}
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
    status |= found["flags"] & ~OUT_OF_RANGE
    status[(found["flags"] & OUT_OF_RANGE) != 0] |= Status.OUT_OF_RANGE
    status |= found["faults"].astype(np.int64) << FAULTS
    if plan.sensing.keys() & {"thermistor", "temperature_compensation"}:
        status[np.isnan(found["temperature"])] |= Status.NO_TEMPERATURE
    status[_starting(plan, log["time"], found)] |= Status.RESTARTED
    return {**columns, "status": status.astype(np.float64)}


def _starting(plan: Plan, time: Array, found: Mapping[str, Any]) -> NDArray[np.bool_]:
    """Rows (N,) in which a run starts, or an observer has not forgotten that it started at zero."""
    starting = np.zeros(len(time), dtype=bool)
    for first, last in runs(time):
        starting[first] = True
        for key in OBSERVERS & plan.estimating.keys():
            good = np.flatnonzero(np.isfinite(found[f"external_{key}"][first:last]))
            if good.size:
                begun = first + good[0]
                forgotten = time[begun] + FORGOTTEN / plan.estimating[key]["gain"]
                starting[begun:last] |= time[begun:last] < forgotten
    return starting


def _require_something(
    columns: Mapping[str, Array], plan: Plan, log: Log, said: tuple[str, ...]
) -> None:
    estimates = [name for name in columns if name.startswith("external") or name == "contact"]
    if any(np.isfinite(columns[name]).any() for name in estimates):
        return
    lacks = f"log '{log.name}': no row has all that {listed(estimates)} read"
    read = reads_of(plan) | readings_of(plan)
    if plan.has_sensor and "sensor_voltage" not in log:  # see `_sensing`
        read.add("sensor_torque")
    empty = [n for n in log.channels if n in read and not np.isfinite(log[n]).any()]
    if empty:
        raise InputError(
            f"{lacks}: {listed(empty)} {'is' if len(empty) == 1 else 'are'} NaN in all "
            f"{len(log)} rows; map columns that hold values"
        )
    why = f" ({said[-1]})" if said else ""
    missing = listed(_not_mapped(plan, log)) or "what is missing"
    raise InputError(f"{lacks}{why}; it has {listed(log.channels)}; map columns to {missing}")


def _not_mapped(plan: Plan, log: Log) -> list[str]:
    """Return the readings that a chain needs and a log lacks, with what does as well."""
    other = {"thermistor_voltage": "temperature", "sensor_voltage": "sensor_torque"}
    words = {name: f"{name} (or {another})" for name, another in other.items()}
    return [
        words.get(name, name)
        for name in sorted(readings_of(plan))
        if name not in log and other.get(name) not in log
    ]


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
        limits=_limits(plan),
        **_temperatures(plan),
    )
    _say_of_models(model, plan, log, said)
    columns = {name: log[name] for name in ("time", *READINGS) if name in log}
    return joint.run(columns, runs(log["time"])[:, 0].tolist(), inputs=inputs)


def _model(model: Model, part: Part) -> tuple[_core.Design, Array]:
    by_motor_encoder = "motor_position" in part.record.get("channels", ())
    effects = [effect.for_core() for effect in part.effects]
    return _core.Design(effects, **gear_of(model.facts, by_motor_encoder)), part.coefficients


def _limits(plan: Plan) -> dict[str, float]:
    limits = joint_limits(plan)
    return {name: sys.float_info.max if most is None else most for name, most in limits.items()}


def _temperatures(plan: Plan) -> dict[str, float]:
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
    if not plan.has_sensor and plan.observed is not None and reads_load(plan.observed):
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
            "it reads what the joint has, with nothing that looks ahead"
        ] = None
    try:
        channels_for(log, part.effects, None)
    except InputError as error:
        said[str(error)] = None
    else:
        model.require_scales(log, part)


def measurable(log: Log, said: dict[str, None], checks: Mapping[str, Any] | None = None) -> Log:
    """Return the log with NaN for values that no instrument measures; `said` gets a sentence each.

    Parameters
    ----------
    log : the channels are V and °C.
    said : sentences, each once, in order.
    checks : the model's reading checks; a channel that they hold to a range is left to them, for
        they say in which rows it was outside.
    """
    volts = (-MOST_VOLTS, MOST_VOLTS, "V")
    ranges = {**dict.fromkeys(VOLTAGES, volts), "temperature": (COLDEST, HOTTEST, "°C")}
    made = {}
    for name, (low, high, unit) in ranges.items():
        if name not in log or (checks or {}).get(RANGE_OF[name]) is not None:
            continue
        values = log[name]
        bad = np.flatnonzero(np.isfinite(values) & ((values < low) | (values > high)))
        if bad.size:
            made[name] = values.copy()
            made[name][bad] = np.nan
            said[
                f"{name} is {values[bad[0]]:.4g} {unit} in row {bad[0]}, which no instrument "
                f"measures: {bad.size} such row{'' if bad.size == 1 else 's'} count as empty; look "
                "for an overload"
            ] = None
    return log.with_columns(made, note="overloads are empty") if made else log
