"""Rows where the joint rests: there the friction of a drive is whatever the load asks for.

Friction that sticks is undetermined within its level, so what a model leaves of the motor torque
at rest names nothing, however large it is. A joint rests where its angle stays for half a second
within a hundredth of the way that it covers at speed in that time; a reversal is no rest. With it
go a quarter of a second before, in which a stop may come from a brake, and a quarter after.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, maximum_filter1d, minimum_filter1d

from flexspline.discovery.settings import SETTINGS
from flexspline.logs.log import Log

__all__ = ["DRIVES", "moving", "resting"]

SECONDS = 0.5
DRIVES = ("motor_torque", "motor_current")


def resting(log: Log) -> NDArray[np.bool_]:
    """Return where the joint of a log rests, (N,); nowhere if the log has no joint angle."""
    if "output_position" not in log or log.rate * log.duration < 2.0:
        return np.zeros(len(log), dtype=bool)
    angle = log["output_position"]
    width = max(2, round(SECONDS * log.rate)) | 1
    way = maximum_filter1d(angle, width) - minimum_filter1d(angle, width)
    middle = way <= SETTINGS.negligible * np.quantile(way, 1.0 - SETTINGS.negligible)
    return np.asarray(binary_dilation(middle, np.ones(2 * width + 1, dtype=bool)))


def moving(log: Log, target: str, *, as_in: Log | None = None) -> Log:
    """Return the rows of a drive's log in which the joint moves, and all rows of other logs.

    `as_in`: the log of the same rows that tells where; None: `log` itself.
    """
    if target not in DRIVES:
        return log
    still = resting(log if as_in is None else as_in)
    if not still.any() or still.all():
        return log
    return log.rows(~still, note=f"{int(still.sum())} rows at rest left out")
