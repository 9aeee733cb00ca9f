"""Is a velocity the derivative of its position? If not: unit, sign, scale or delay, and how much.

The position's zero-phase derivative and the velocity behind the same low pass are compared. The
factor is the median of their ratio where the joint moves fast, blind to lag and bias; the delay is
that of `find_delay`.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from flexspline.logs.checks.delay import find_delay
from flexspline.logs.checks.findings import Finding
from flexspline.logs.checks.motion import Array, Motion, motion_of
from flexspline.logs.log import Log
from flexspline.logs.quantisation import quantum
from flexspline.logs.segments import median_step

PAIRS = {"output_velocity": "output_position", "motor_velocity": "motor_position"}

FACTOR_LIMIT = 0.03
"""Factors nearer to one than this are let pass."""

WITHIN = 0.3
"""Delays up to this [s] are looked for."""


def velocity_of_position(log: Log) -> Iterator[Finding]:
    """Each velocity channel against the derivative of its position."""
    for channel, position in PAIRS.items():
        if channel in log and position in log:
            motion = motion_of(log, position)
            if motion is not None:
                yield from _compare(log, channel, motion)


def _compare(log: Log, channel: str, motion: Motion) -> Iterator[Finding]:
    velocity = motion.smooth(log[channel])
    duration = float(motion.time[-1] - motion.time[0])
    within = min(WITHIN, duration / 8)
    valid = motion.inside(within)
    step = median_step(motion.time)
    late = find_delay(
        motion.time, velocity, motion.velocity[:, None], valid, within, max(step, 0.005)
    )
    if late is None:
        return
    # Sure of a delay where the motion changes and the delay explains what is otherwise left.
    left, left_without = 1 - late.explained, 1 - late.explained_without
    known = late.explained > 0.5 and left < 0.9 * left_without
    delay = late.seconds if known and abs(late.seconds) > 4 * late.error else 0.0
    aligned = np.interp(motion.time - delay, motion.time, motion.velocity)
    grain = quantum(log[channel][motion.rows])
    factor, error, related = _factor(velocity[valid], aligned[valid], grain)
    if not related:
        yield _unrelated(log, channel, late.explained)
        return
    yield from _wrong_factor(log, channel, factor, error)
    if abs(delay) > max(0.5 * step, 0.001):
        yield _late(log, channel, delay, late.error)


def _factor(velocity: Array, derivative: Array, grain: float) -> tuple[float, float, bool]:
    """Velocity over derivative where it is fast, its error, and whether the two are related.

    Rounding to `grain` [rad/s] may be up, down or towards zero: a bias that counts as error.
    """
    fast = np.abs(derivative) >= 0.5 * np.percentile(np.abs(derivative), 95)
    ratio = velocity[fast] / derivative[fast]
    factor = float(np.median(ratio))
    blocks = [float(np.median(part)) for part in np.array_split(ratio, 8) if part.size]
    bias = grain / float(np.median(np.abs(derivative[fast])))
    error = float(np.std(blocks) / np.sqrt(len(blocks))) + 0.2 * bias
    left = float(np.sum((velocity - factor * derivative) ** 2))
    return factor, error, factor != 0 and left < 0.5 * float(np.sum(velocity**2))


def _wrong_factor(log: Log, channel: str, factor: float, error: float) -> Iterator[Finding]:
    size, everywhere = abs(factor), (0, len(log))
    if factor < 0:
        yield Finding(
            "velocity_sign",
            "fault",
            channel,
            everywhere,
            factor,
            "",
            f"{channel} has the opposite sign of the derivative of {PAIRS[channel]} (factor "
            f"{factor:.4g}).",
            f"Ask for the repair flip_sign={channel}.",
        )
    if abs(size - 1) <= max(FACTOR_LIMIT, 5 * error):
        return
    unit = next((w for k, w in _known_factors(log) if abs(size / k - 1) <= FACTOR_LIMIT), None)
    yield Finding(
        "velocity_unit" if unit else "velocity_scale",
        "fault",
        channel,
        everywhere,
        size,
        "",
        f"{channel} is {size:.4g} times the derivative of {PAIRS[channel]}"
        + (f": {unit}." if unit else ": scale or sampling rate is wrong."),
        f"Give the right unit or rate when reading, or ask for the repair "
        f"scale={channel}:{1 / size:.6g}.",
    )


def _known_factors(log: Log) -> Iterator[tuple[float, str]]:
    turn = 2 * np.pi
    yield 360 / turn, "it is in deg/s, or its unit was given twice"
    yield turn / 360, "the position is in degrees"
    yield 60 / turn, "it is in rpm"
    yield 1 / turn, "it is in turns per second"
    yield 1000.0, "time is in milliseconds, or the velocity in mrad/s"
    yield 0.001, "the position is in mrad, or time was divided by 1000 twice"
    if log.effective_ratio:
        yield log.effective_ratio, "it is that of the other side of the gear"
        yield 1 / log.effective_ratio, "it is that of the other side of the gear"


def _late(log: Log, channel: str, delay: float, error: float) -> Finding:
    way = "late" if delay > 0 else "early"
    return Finding(
        "velocity_delay",
        "fault",
        channel,
        (0, len(log)),
        delay,
        "s",
        f"{channel} is {1e3 * abs(delay):.3g} ± {1e3 * error:.1g} ms {way} against the derivative "
        f"of {PAIRS[channel]}.",
        f"Ask for the repair velocity_from_position={channel}, or shift={channel}:{delay:.4g}.",
    )


def _unrelated(log: Log, channel: str, explained: float) -> Finding:
    return Finding(
        "velocity_unrelated",
        "fault",
        channel,
        (0, len(log)),
        max(explained, 0.0),
        "",
        f"{channel} is not the derivative of {PAIRS[channel]}: that explains "
        f"{100 * max(explained, 0.0):.0f} % of its variance at any delay up to 0.3 s.",
        f"Check the column map, or ask for the repair velocity_from_position={channel}.",
    )
