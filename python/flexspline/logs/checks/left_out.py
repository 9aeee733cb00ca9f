"""Rows that belong to no experiment are left out before anything is searched, and said so.

So are those of a drive in which its joint rests: friction that sticks is undetermined within its
level, so what a model leaves of the motor torque at rest names nothing, however large it is. A
joint rests where its angle stays for half a second within a hundredth of the way that it covers at
speed in that time; a reversal is no rest. With it go a quarter of a second before, in which a stop
may come from a brake, and a quarter after.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, maximum_filter1d, minimum_filter1d

from flexspline.logs.checks.ends import drive_disabled, homing_move, stuck_tail
from flexspline.logs.checks.findings import Finding
from flexspline.logs.log import Log

__all__ = ["DRIVES", "LeftOut", "at_work", "only_experiments", "resting"]

DRIVES = ("motor_torque", "motor_current")
REASONS = {
    "stuck_tail": "in a stuck tail",
    "homing_move": "in a homing move",
    "drive_disabled": "while the drive was off",
}
SECONDS = 0.5
STILL = 0.01  # of the way that a joint covers at speed in that time
FEWEST = 100  # rows: a log of which less is left stays as it is


@dataclass(frozen=True)
class LeftOut:
    """What was left out of one run: `finding` says it; `rows` counts each row under one reason."""

    run: str
    finding: Finding
    reason: str
    rows: int

    @property
    def sentence(self) -> str:
        return f"{self.run}: {self.finding.sentence} They are left out."


@dataclass(frozen=True)
class Kept:
    """A run without the rows that were left out; `rows` are those of the recording, (N,)."""

    log: Log
    rows: NDArray[np.intp]
    left: tuple[LeftOut, ...] = ()

    def as_recorded(self, rows: tuple[int, int]) -> tuple[int, int]:
        """Return rows [first, last) of the kept log as rows of the recording."""
        first, last = rows
        if not self.left or not 0 <= first < last <= len(self.rows):
            return rows
        return int(self.rows[first]), int(self.rows[last - 1]) + 1


def only_experiments(logs: Sequence[Log], target: str) -> list[Kept]:
    """Return the runs without stuck tails, homing moves and, of a drive, rows in which it is off.

    Parameters
    ----------
    logs : runs as recorded, or as repaired.
    target : "motor_torque" and "motor_current" are a drive's; a sensor reads on while it is off.
    """
    return [_only(log, target) for log in logs]


def _only(log: Log, target: str) -> Kept:
    everything = Kept(log, np.arange(len(log)))
    found = [*homing_move(log), *stuck_tail(log)]
    found += drive_disabled(log) if target in DRIVES else ()
    keep, left = np.ones(len(log), dtype=bool), []
    for one in found:
        first, last = one.rows
        count = int(keep[first:last].sum())
        keep[first:last] = False
        if count:
            left.append(LeftOut(log.name, one, REASONS[one.name], count))
    if not left or keep.sum() < FEWEST:
        return everything
    said = ", ".join(f"{one.rows} {one.reason}" for one in left)
    rows = np.flatnonzero(keep)
    contiguous = rows[-1] + 1 - rows[0] == len(rows)
    which = slice(int(rows[0]), int(rows[-1]) + 1) if contiguous else keep
    return Kept(log.rows(which, note=f"rows left out: {said}"), rows, tuple(left))


def resting(log: Log) -> NDArray[np.bool_]:
    """Return where the joint of a log rests, (N,); nowhere if the log has no joint angle."""
    if "output_position" not in log or log.rate * log.duration < 2.0:
        return np.zeros(len(log), dtype=bool)
    angle = log["output_position"]
    width = max(2, round(SECONDS * log.rate)) | 1
    way = maximum_filter1d(angle, width) - minimum_filter1d(angle, width)
    middle = way <= STILL * np.quantile(way, 1.0 - STILL)
    return np.asarray(binary_dilation(middle, np.ones(2 * width + 1, dtype=bool)))


def at_work(logs: Sequence[Log], target: str) -> list[NDArray[np.bool_]] | None:
    """Return where the joint of a drive moves in each log, (N,); None where all rows do.

    Of a log that rests throughout all rows do.
    """
    if target not in DRIVES:
        return None
    still = [resting(log) for log in logs]
    if not any(one.any() for one in still):
        return None
    return [np.ones(len(one), dtype=bool) if one.all() else ~one for one in still]
