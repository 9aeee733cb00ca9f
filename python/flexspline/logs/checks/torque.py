"""The sign of a torque, and whether it is late behind the motion.

    τ = o + c tanh(v / v_d) + b v + J q̈ + s sin q + k cos q (+ g τ_ref)

by least squares, every column behind the low pass of the target. Friction at working speed v_rms
is c + b v_rms. A drive has to push against it: it is positive. A sensor sees it with either sign,
depending on where it sits: there the sign is reported, never judged.

The delay D is that with which c, s and k at t - D explain the reading best. b and J are left out
of it, for they are what a delay of gravity and of c look like: inertia makes D smaller. It is
reported where the delay is there with them as well.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from flexspline.logs.channels import CHANNELS
from flexspline.logs.checks.blocks import solve_with_error
from flexspline.logs.checks.delay import find_delay
from flexspline.logs.checks.findings import Finding
from flexspline.logs.checks.motion import Array, Motion, motion_of
from flexspline.logs.log import Log
from flexspline.logs.segments import median_step

DRIVE = ("motor_torque", "motor_current")

SURE = 5.0
"""Standard errors at which a sign counts as known."""

WITHIN = 0.15
"""Delays up to this [s] are looked for."""


class Reaction(NamedTuple):
    """Friction at working speed [Nm or A] and inertia [per rad/s²], with their standard errors."""

    friction: float
    friction_error: float
    inertia: float
    inertia_error: float


def torque(log: Log) -> Iterator[Finding]:
    """Sign and delay of each torque channel, where the joint moves both ways."""
    motion = motion_of(log)
    if motion is None or not _both_ways(motion):
        return
    columns = motion_columns(log, motion)
    for channel in (*DRIVE, "sensor_torque"):
        if channel in log and np.ptp(log[channel][motion.rows]) > 0:
            reading = motion.smooth(log[channel])
            yield from _sign(log, channel, _reaction(motion, columns, reading))
            yield from _late(log, channel, motion, columns, reading)


def _both_ways(motion: Motion) -> bool:
    limit = 0.1 * float(np.percentile(np.abs(motion.velocity), 95))
    moving = motion.velocity[np.abs(motion.velocity) > limit]
    return moving.size > 200 and 0.1 < float(np.mean(moving > 0)) < 0.9


def motion_columns(log: Log, motion: Motion) -> Array:
    """Columns tanh, sin q, cos q, the reference torque where there is one, v and q̈."""
    q, v = motion.position, motion.velocity
    direction = np.tanh(v / (0.02 * float(np.percentile(np.abs(v), 95))))
    bent = motion.low_passed(np.column_stack((direction, np.sin(q), np.cos(q))))
    known = [motion.smooth(log["reference_torque"])] if "reference_torque" in log else []
    return np.column_stack((bent, *known, v, motion.acceleration))


def _reaction(motion: Motion, columns: Array, reading: Array) -> Reaction:
    valid = motion.inside(0.0)
    speed = float(np.sqrt(np.mean(motion.velocity[valid] ** 2)))
    # One column for all friction at this speed keeps its error honest: c + b v as c' tanh + b slip.
    slip = columns[:, -2] / speed - columns[:, 0]
    design = np.column_stack((columns[:, :-2], slip, columns[:, -1], np.ones(len(columns))))
    solved, error = solve_with_error(design[valid], reading[valid])
    return Reaction(float(solved[0]), float(error[0]), float(solved[-2]), float(error[-2]))


def _sign(log: Log, channel: str, found: Reaction) -> Iterator[Finding]:
    unit = CHANNELS[channel].unit
    if found.friction > -SURE * found.friction_error:
        return
    level = f"friction of {found.friction:.3g} ± {found.friction_error:.1g} {unit}"
    if found.inertia < -SURE * found.inertia_error:
        level += f", inertia of {found.inertia:.3g} ± {found.inertia_error:.1g} {unit}/(rad/s²)"
    drive = channel in DRIVE
    if drive and found.inertia > SURE * found.inertia_error:
        return  # a flipped mass is negative: the load drives this motor
    yield Finding(
        "torque_sign",
        "fault" if drive else "note",
        channel,
        (0, len(log)),
        found.friction,
        unit,
        f"{channel} shows {level}: "
        + (
            "its sign is flipped."
            if drive
            else "its sign is flipped, or the sensor sees friction from the other side."
        ),
        f"{'Ask' if drive else 'If it is flipped, ask'} for the repair flip_sign={channel}.",
    )


def _late(
    log: Log, channel: str, motion: Motion, columns: Array, reading: Array
) -> Iterator[Finding]:
    step = median_step(motion.time)
    within = min(WITHIN, float(motion.time[-1] - motion.time[0]) / 8)
    valid = motion.inside(within)
    scan = max(step, 0.005)
    found = find_delay(motion.time, reading, columns[:, :-2], valid, within, scan)
    if found is None or found.explained < 0.5:
        return
    gain = 1 - (1 - found.explained) / max(1 - found.explained_without, 1e-12)
    sure = max(0.5 * step, SURE * found.error) < found.seconds < 0.98 * within
    if not sure or gain < 0.01:
        return
    whole = find_delay(motion.time, reading, columns, valid, within, scan)
    if whole is None or whole.seconds < max(0.5 * step, SURE * whole.error):
        return
    yield Finding(
        "torque_delay",
        "note",
        channel,
        (0, len(log)),
        found.seconds,
        "s",
        f"{channel} is {1e3 * found.seconds:.3g} ± {1e3 * found.error:.1g} ms late against the "
        f"motion: a sensor or filter lags, or the joint gives before it slips (presliding).",
        f"If it is a lag, ask for the repair shift={channel}:{found.seconds:.3g}.",
    )
