"""What the chain made of a log."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import InputError, did_you_mean, listed
from flexspline.estimation.status import Status
from flexspline.rendering import render

if TYPE_CHECKING:
    import pandas

__all__ = ["COLUMNS", "Estimate"]

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
    """

    name: str
    columns: Mapping[str, Array]
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        ordered = {name: self.columns[name] for name in COLUMNS if name in self.columns}
        for data in ordered.values():
            data.flags.writeable = False
        object.__setattr__(self, "columns", MappingProxyType(ordered))

    def __reduce__(self) -> tuple[Any, ...]:
        return (Estimate, (self.name, dict(self.columns), self.notes))

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
        whole = {name: "Int64" for name in ("contact", "status") if name in frame}
        return frame.astype(whole)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a CSV, one row for each row of the log, whole or not at all.

        Raises
        ------
        InputError
            Where the file cannot be written.
        """
        from flexspline.files import atomic_writer

        with atomic_writer(path) as file:
            self.to_frame().to_csv(file, index=False, lineterminator="\n")

    def __repr__(self) -> str:
        return f"<Estimate of '{self.name}': {len(self)} rows, {listed(self.columns)}>"

    def __str__(self) -> str:
        from flexspline.estimation.text import estimate_text

        return estimate_text(self)

    def _repr_html_(self) -> str:
        from flexspline.estimation.text import estimate_html

        return estimate_html(self)

    def plot(self) -> Any:
        """Return a figure: the external torques over time, contacts shaded, flags below."""
        return render("estimate", "figure", self)
