"""A log as rows of the device's program; `cpp/firmware/certify/rows.hpp` has the layout."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from flexspline.logs.log import Log
from flexspline.logs.segments import median_step, runs

__all__ = ["CHANNELS", "RESULT", "ROW", "rows_of"]

Rows = NDArray[np.void]

CHANNELS = (
    "period",
    "time",
    "output_velocity",
    "output_acceleration",
    "motor_torque",
    "sensor_voltage",
    "sensor_torque",
    "thermistor_voltage",
    "temperature",
    "known_load",
)
ANGLES = ("output_position", "motor_position")
MOST_TURNS = 2**30


def _row(real: str, fraction: str) -> np.dtype[np.void]:
    numbers = [(name, real) for name in CHANNELS]
    angles = [("fractions", fraction, 2), ("turns", "<i4", 2)]
    return np.dtype([*numbers, *angles, ("marks", "<u4"), ("spare", "<u4")])


def _result(real: str) -> np.dtype[np.void]:
    marks = [(name, "u1") for name in ("contact", "flags", "faults", "status")]
    ticks = [("spare", "<u2"), ("ticks", "<u4"), ("unused", "<u4")]
    return np.dtype([("values", real, 8), ("missed", "<u2"), *marks, *ticks])


ROW = {"float": _row("<f4", "<u4"), "double": _row("<f8", "<u8")}
RESULT = {"float": _result("<f4"), "double": _result("<f8")}


def rows_of(log: Log, scalar: str, known_load: str | None = None) -> Rows:
    """Return the log as a device reads it, (N,) of `ROW[scalar]`.

    Parameters
    ----------
    log : channels that it lacks are missing in every row.
    scalar : "float", numbers rounded to single precision and angles to 2⁻³² turns, as an encoder
        counts; or "double", as the analysis has them.
    known_load : the channel of the load [Nm]; None is none: zero.
    """
    rows = np.zeros(len(log), dtype=ROW[scalar])
    numbers = {name: log[name] for name in CHANNELS if name in log} | _times(log)
    for name in CHANNELS:
        rows[name] = _real(numbers, name, rows.dtype[name])
    if known_load is None:
        rows["known_load"] = 0.0
    else:
        rows["known_load"] = log[known_load].astype(rows.dtype["known_load"])
    rows["marks"][runs(log["time"])[:, 0]] = 1
    for place, name in enumerate(ANGLES):
        if name in log:
            _set_angle(rows, place, log[name], bits=32 if scalar == "float" else 52)
    return rows


def _times(log: Log) -> dict[str, NDArray[np.float64]]:
    """Time [s] since the first row and the period [s] since the row before; usual at a start."""
    time = log["time"]
    period = np.diff(time, prepend=time[:1])
    period[runs(time)[:, 0]] = median_step(time)
    return {"time": time - time[0], "period": period}


def _real(
    numbers: Mapping[str, NDArray[np.float64]], name: str, to: np.dtype[np.void]
) -> NDArray[np.floating] | float:
    if name not in numbers:
        return np.nan
    with np.errstate(over="ignore"):
        return numbers[name].astype(to)


def _set_angle(rows: Rows, place: int, radians: NDArray[np.float64], bits: int) -> None:
    """Write an angle as turns and a fraction of `bits` bits, and its mark where it is finite."""
    with np.errstate(invalid="ignore"):
        good = np.isfinite(radians) & (np.abs(radians) < MOST_TURNS * 2.0 * np.pi)
    turns = np.where(good, radians, 0.0) / (2.0 * np.pi)
    whole = np.floor(turns)
    counts = np.minimum(np.floor((turns - whole) * 2.0**bits), 2.0**bits - 1.0)
    spare = 0 if bits == 32 else 64 - bits
    rows["turns"][:, place] = whole
    rows["fractions"][:, place] = counts.astype(np.uint64) << np.uint64(spare)
    rows["marks"] |= np.where(good, 2 << place, 0).astype(np.uint32)
