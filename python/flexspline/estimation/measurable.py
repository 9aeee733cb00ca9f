"""Voltages and temperatures that no instrument measures: marks of an overload, not readings.

SCPI instruments write 9.9e37 for an overload and 9.91e37 for "not a number" (SCPI-99, 7.2.1.4 and
7.2.1.5). Only a log has them: the joint's own converter cannot give such a number.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from flexspline.logs.log import Log

__all__ = ["measurable"]

VOLTAGES = ("sensor_voltage", "thermistor_voltage")
MOST_VOLTS = 1e6  # above every bridge and supply
COLDEST, HOTTEST = -273.15, 1e4  # °C: absolute zero, and above every thermocouple


RANGE_OF = {
    "sensor_voltage": "voltage_range",
    "thermistor_voltage": "thermistor_voltage_range",
    "temperature": "temperature_range",
}


def measurable(log: Log, said: dict[str, None], checks: Mapping[str, Any] | None = None) -> Log:
    """Return the log with NaN in place of such values; a sentence on each channel goes to `said`.

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
