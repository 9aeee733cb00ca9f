"""Models of the drift (refs. 16 and 17 beside the paper's) on the runs of one bench."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flexspline import _core
from flexspline.baselines import compare_drift_methods
from flexspline.logs.log import Log
from flexspline.reproduce.zhang.study import Study
from flexspline.rigs.zhang_sensor import THERMISTOR

if TYPE_CHECKING:
    import pandas

__all__ = ["drift_methods"]

EVERY = slice(0, None, 10)  # neighbours say the same, and a kernel takes its time


def drift_methods(study: Study) -> pandas.DataFrame:
    """Return what each model of the drift leaves of the warming that no fit saw.

    All learn from the same two runs, brake and oven. The polynomial is fitted together with the
    line here, as the others are; the paper fits it after the line.
    """
    bench = study.rig.bench
    brake, oven = bench.calibration(unloading=True), bench.oven()
    return compare_drift_methods([_warm(brake), _warm(oven)], _warm(study.held_out))


def _warm(log: Log) -> Log:
    """Every tenth row, with the temperature [°C] by the thermistor; without load where none is."""
    thin = log.rows(EVERY, note="every tenth row")
    columns = {
        "temperature": _core.thermistor_temperature(thin["thermistor_voltage"], **THERMISTOR)
    }
    if "reference_torque" not in log:
        columns["reference_torque"] = np.zeros(len(thin))
    return thin.with_columns(columns, note="temperature by the thermistor")
