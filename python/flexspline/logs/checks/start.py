"""Start transients of runs that are meant to hold one speed."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from flexspline.logs.channels import CHANNELS
from flexspline.logs.checks.findings import Finding
from flexspline.logs.checks.motion import Array
from flexspline.logs.log import Log

WINDOW = 0.1
"""s, the stretches that are compared."""

CHANNELS_CHECKED = ("output_velocity", "motor_velocity", "motor_current", "motor_torque")

FAR = 2.5
"""A stretch is transient where its RMS deviation is this many times the usual."""


def start_transient(log: Log) -> Iterator[Finding]:
    """A start that differs from the steady run behind it: the longest among the channels."""
    found = [(transient_rows(log, c), c) for c in CHANNELS_CHECKED if c in log]
    rows, channel = max(found, default=(0, ""))
    if rows == 0:
        return
    time, values = log["time"], log[channel]
    seconds = float(np.ceil(10 * (time[rows - 1] - time[0]) - 1e-6) / 10)
    level = float(np.nanmedian(values[rows:]))
    worst = float(np.nanmax(np.abs(values[:rows] - level)))
    unit = CHANNELS[channel].unit
    yield Finding(
        "start_transient",
        "fault",
        channel,
        (0, rows),
        seconds,
        "s",
        f"the first {seconds:.1f} s differ from the steady run behind them: {channel} is up to "
        f"{worst:.3g} {unit} away from its {level:.3g} {unit}.",
        f"Ask for the repair drop_start={seconds:.1f}.",
    )


def transient_rows(log: Log, channel: str) -> int:
    """Rows at the start in which a channel is far from its steady level; 0 without any.

    Only where the run holds one speed: in its last two thirds nine rows of ten keep within 40 %
    of the median velocity, and its last half is no part of a slow swing. Stretches of 0.1 s are
    compared by their RMS deviation from the level of the last two thirds; the transient is the far
    ones that the run begins with.
    """
    velocity = next((log[c] for c in ("output_velocity", "motor_velocity") if c in log), None)
    if velocity is None or not _one_speed(velocity[len(log) // 3 :]):
        return 0
    if _swings(velocity[len(log) // 2 :]):
        return 0
    width = max(4, round(WINDOW * log.rate)) if np.isfinite(log.rate) else 0
    count = len(log) // width if width else 0
    if count < 10:
        return 0
    blocks = log[channel][: count * width].reshape(count, width)
    steady = blocks[count // 3 :]
    level = float(np.nanmedian(steady))
    spread = np.sqrt(np.nanmean((blocks - level) ** 2, axis=1))
    usual = float(np.nanmedian(spread[count // 3 :]))
    highest = float(np.nanmax(spread[count // 2 :]))
    far = spread > max(FAR * usual, 1.25 * highest, 1e-6 * abs(level))
    return int(np.argmin(far[: count // 2])) * width


def _one_speed(velocity: Array) -> bool:
    level = float(np.nanmedian(velocity)) if velocity.size else 0.0
    off = np.abs(velocity - level)
    return level != 0 and float(np.nanpercentile(off, 90)) < 0.4 * abs(level)


def _swings(velocity: Array) -> bool:
    """Whether a velocity (N,) bends smoothly by more than a twentieth of its level."""
    values = velocity[np.isfinite(velocity)]
    if len(values) < 4:
        return False
    place = np.linspace(-1.0, 1.0, len(values))
    bend = np.polyval(np.polyfit(place, values, 2), place)
    smooth = float(np.std(bend))
    return smooth > max(0.05 * abs(float(np.median(values))), float(np.std(values - bend)))
