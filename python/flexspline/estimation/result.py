"""The result of `estimate`: of one run its columns, the bits of their status, and text and HTML.

Of several runs it is also how far their external torques are from a reference. The error is the
estimate less `reference_torque`, which has the same sign: positive where the joint pushes the
outside world in +q. No estimator ever reads the reference.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntFlag
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import InputError, did_you_mean, listed
from flexspline.files import save_columns
from flexspline.formatting import rows_text, sentences_text, short, table_html
from flexspline.lazy import render
from flexspline.prediction import SIZES, error_sizes

if TYPE_CHECKING:
    import pandas

__all__ = ["COLUMNS", "MEANING", "Estimate", "Estimates", "Status"]

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
    """

    name: str
    columns: Mapping[str, Array]
    notes: tuple[str, ...] = ()
    adapted: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        names = (*COLUMNS, *self.adapted)
        ordered = {name: self.columns[name] for name in names if name in self.columns}
        for data in ordered.values():
            data.flags.writeable = False
        object.__setattr__(self, "columns", MappingProxyType(ordered))

    def __reduce__(self) -> tuple[Any, ...]:
        return (Estimate, (self.name, dict(self.columns), self.notes, dict(self.adapted)))

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
        """A sentence on each kind of rows outside of what the model was made for."""
        beyond = (Status.EXTRAPOLATED, Status.SATURATED, Status.OUT_OF_RANGE)
        return tuple(f"{self.name}: {said}" for said in _flagged(self, beyond))

    @property
    def contacts(self) -> tuple[tuple[float, float], ...]:
        """(first, last) time of each contact, s; empty without a detector."""
        if "contact" not in self:
            return ()
        touched = np.concatenate(([False], self["contact"] == 1.0, [False])).astype(np.int8)
        edges = np.flatnonzero(np.diff(touched)).reshape(-1, 2)
        time = self["time"]
        return tuple((float(time[first]), float(time[last - 1])) for first, last in edges)

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
    Status.EXTRAPOLATED: "voltage or temperature lies outside the range of the calibration",
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
    Status.RESTARTED: "observer, lags and detector start here: the first row, or one behind a gap",
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
    if "contact" in made:
        said.append(_contacts(made))
    return [*said, *_flagged(made, MEANING), *made.notes]


def _flagged(made: Estimate, bits: Iterable[Status]) -> Iterator[str]:
    """Yield what is flagged, and in how many rows."""
    for bit in bits:
        rows = int(np.count_nonzero(made.flagged(bit)))
        if rows:
            yield f"status {int(bit)} in {rows} of {len(made)} rows: {MEANING[bit]}"


def _contacts(made: Estimate) -> str:
    found = made.contacts
    if not found:
        return "no contact"
    first = ", ".join(f"{start:.4g}–{end:.4g} s" for start, end in found[:MOST_CONTACTS])
    more = f" and {len(found) - MOST_CONTACTS} more" if len(found) > MOST_CONTACTS else ""
    return f"{len(found)} contact{'s' if len(found) > 1 else ''}: {first}{more}"


def _whole(data: Array) -> NDArray[np.object_]:
    """Whole numbers, None where there is none."""
    return np.array([None if cell != cell else int(cell) for cell in data.tolist()], dtype=object)


@dataclass(frozen=True, eq=False, repr=False)
class Estimates(Sequence[Estimate]):
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

    def __len__(self) -> int:
        return len(self.runs)

    @overload
    def __getitem__(self, index: int) -> Estimate: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Estimate, ...]: ...
    def __getitem__(self, index: int | slice) -> Estimate | tuple[Estimate, ...]:
        return self.runs[index]

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
