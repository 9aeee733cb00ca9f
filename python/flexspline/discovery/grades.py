"""How much a fault of the data matters: what it makes of the target, against the noise floor.

A fault of size r [target's unit, RMS] beside a floor σ raises the error from σ to √(σ² + r²). One
that raises it by less than a hundredth is worth knowing, and no reason to doubt a name.

    delay of a velocity          r: prediction with the velocity as recorded less with the right one
    rows that repeat others      r: each is wrong by one step of the target, √(share · mean step²)

What another fault makes of the target is not known, and it counts as grave. Where the rows read a
velocity that is derived from a position, the recorded one has made nothing of what is found: it
matters to whoever reads it, and the sentence says so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexspline.discovery.faults import DataFault
from flexspline.discovery.settings import SETTINGS
from flexspline.errors import InputError
from flexspline.fit.result import Fit
from flexspline.logs.log import Log
from flexspline.logs.repairs import move_earlier
from flexspline.model import Model
from flexspline.report.numbers import short
from flexspline.signals import target_of

__all__ = ["graded"]

Array = NDArray[np.float64]

VELOCITY = "output_velocity"


def graded(
    faults: Sequence[DataFault], logs: Sequence[Log], fit: Fit, floor: float
) -> tuple[DataFault, ...]:
    """Return the faults with what each makes of the target, and whether that matters.

    Parameters
    ----------
    logs : the runs as recorded, the rows that count.
    fit : of the extended model.
    floor : noise floor, in the unit of the target.
    """
    look = _Look(tuple(logs), fit, floor)
    return tuple(look.graded(fault) for fault in faults)


@dataclass(frozen=True)
class _Look:
    logs: tuple[Log, ...]
    fit: Fit
    floor: float

    def graded(self, fault: DataFault) -> DataFault:
        try:
            makes = self._makes(fault)
        except InputError:  # where the fault cannot be taken off, its size is not known
            makes = None
        if makes is None or not np.isfinite(makes):
            return fault
        grave = bool(np.hypot(self.floor, makes) > (1.0 + SETTINGS.negligible) * self.floor)
        unit, source = self.fit.unit, self._read_instead(fault)
        said = f"It makes {short(makes)} {unit} RMS, the noise floor is {short(self.floor)} {unit}"
        said += "." if grave else ": too little to matter."
        if source:
            said = (
                f"Names are looked for with a velocity derived from {source}; as recorded it makes "
                f"{short(makes)} {unit} RMS, the noise floor is {short(self.floor)} {unit}."
            )
        return replace(fault, makes=makes, grave=grave, sentence=f"{fault.sentence} {said}")

    def _read_instead(self, fault: DataFault) -> str:
        """The position that a velocity is derived from where a fault is one of the velocity's."""
        sources = {p.channel: p.source for p in self.fit.part.preparations}
        source = sources.get(VELOCITY, VELOCITY)
        return source if fault.channel == VELOCITY and source != VELOCITY else ""

    def _makes(self, fault: DataFault) -> float | None:
        own = [log for log in self.logs if log.name == fault.run]
        if len(own) != 1:
            return None
        log = own[0]
        if fault.name == "velocity_delay" and fault.channel == VELOCITY:
            return self._moved(log, move_earlier(log, VELOCITY, fault.size))
        if fault.name == "repeated_rows":
            steps = np.diff(target_of(log, self.fit.target, self.fit.part.known_load))
            return float(np.sqrt(fault.size / len(log) * np.mean(steps**2)))
        return None

    def _moved(self, log: Log, mended: Log) -> float:
        """RMS by which the prediction changes with a mended channel, on the rows that both have."""
        both = [self._predicted(one) for one in (log, mended)]
        _, first, second = np.intersect1d(log["time"], mended["time"], return_indices=True)
        return float(np.sqrt(np.nanmean((both[0][first] - both[1][second]) ** 2)))

    def _predicted(self, log: Log) -> Array:
        """The prediction with the channels as they are, low-passed as the fit's rows were."""
        part = self.fit.part
        record = {name: value for name, value in part.record.items() if name != "prepared"}
        plain: Model = self.fit.model.with_part(replace(part, record=record), {})
        return plain.predict(log, part.target, lowpass_hz=self.fit.lowpass).predicted
