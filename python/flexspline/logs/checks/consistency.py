"""Channels against each other: velocity and position, motor and output side, torque and motion.

Velocity: unit, sign, scale and delay against the derivative of the position. The position's
zero-phase derivative and the velocity behind the same low pass are compared. The factor is the
median of their ratio where the joint moves fast, unaffected by lag and bias; the delay is that of
`find_delay`.

Motor side against output side: ratio, sense of rotation, delay between the two encoders.

    θ(t) = θ₀ + R q(t) + R δ q̇(t) + h sign q̇(t)

by least squares: R is the ratio, δ the time by which the output's encoder is late (its reading
belongs to an earlier moment than the motor's). A gear's own angle errors are orthogonal to both
over enough turns. h is a hysteresis of the torsion, a step between the directions; one that builds
up gradually would be taken for a part of δ. Torsion under a load that grows with velocity, of a
brake with b Nm s/rad on a gear of K Nm/rad, is the same as δ = b / K. So δ counts as a delay only
where it is there beside a torque τ behind the gear, as columns τ and τ³ of a stiffness that need
not be linear. Where τ is hardly more than b v, or where there is none, the run does not tell which.

Which of them has the wrong unit: a position, its velocity and the position of the other side
through the stated ratio are three readings of one motion. Where two agree, the third is wrong;
where there are two only, either may be.

Where all of them are in one wrong unit they agree, and the motor turns faster than any.

Torque against motion: its sign, and its delay.

    τ = o + c tanh(v / v_d) + b v + J q̈ + s sin q + k cos q (+ g τ_ref)

by least squares, every column behind the low pass of the target. Friction at working speed v_rms
is c + b v_rms. A drive has to push against it: it is positive. A sensor reads it with either sign,
depending on where it sits: there the sign is reported, never judged. The delay D is that with which
all columns at t - D explain the reading best. Presliding delays friction, near reversals alone: a
drive is late where rows far from them are late as well, by as much, or by what explains most that
is left of them. What remains is worth knowing, of a sensor or where the joint gives: there b and J
are left out of it too, for a delay of gravity and of c looks like them; inertia makes D smaller.

g says whether torque and load have one sign and unit: it is 1 of a sensor, 1 / Ñ of a motor. It is
judged where the load is nearly all that the motion leaves of the torque, and where it is such a
factor as a slip of sign, unit or side of the gear makes; otherwise it is the joint's. Units are
those in which load cells are sold; efficiency and torque constant make a drive's less sure.

The delay of any channel y behind the columns X that make it up:

    y(t) = X(t - D) c        D minimises the sum of squares, c solved for each D

D comes from a coarse scan over some of the rows, a descent from its best step over all of them, and
a bounded search around the lowest. Its error comes from sixteen blocks of time: the correction that
each block alone asks for, weighted by its information, so that autocorrelated noise does not make
it too small.

A recorder does the same to all of its runs, and only some of them show it for sure. A velocity, or
a drive, that a recorder delays is late in each of its runs by the same. Where the delay is about as
large as the least that is told, or where a run's motion hardly shows it, single runs would be
called late and others not.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from flexspline.formatting import plus_minus
from flexspline.logs.channels import CHANNELS
from flexspline.logs.checks.findings import Finding, Findings, Severity, sorted_findings
from flexspline.logs.checks.samples import Motion, motion_of, unwrapped
from flexspline.logs.columns import to_si
from flexspline.logs.log import Log, emptied
from flexspline.logs.quantisation import quantum, white_noise
from flexspline.logs.segments import median_step
from flexspline.logs.units import canonical_unit

PAIRS = {"output_velocity": "output_position", "motor_velocity": "motor_position"}

VELOCITY_DELAY, TORQUE_DELAY, POSITION_DELAY = "velocity_delay", "torque_delay", "position_delay"

FACTOR_LIMIT = 0.03
"""Factors nearer to one than this are let pass."""

WITHIN = 0.3
"""Delays up to this [s] are looked for."""

RATIO_LIMIT = 0.002
"""Relative deviation of the ratio that is let pass; N and N + 1 differ by more up to N = 400."""

FASTEST = 2_000.0
"""rad/s of the motor, 19 000 rpm, that no strain wave joint reaches. The smallest sizes in
catalogues are allowed 14 000 rpm at the input, with oil. Degrees that are read as radians are 57
times as fast: they are told where a motor turns faster than 330 rpm in truth."""

TWIST = 0.005
"""rad at the output that the torsion of a gear under load may turn of itself."""

LEAST_TRAVEL = 10 * TWIST
"""rad of the output, below which the motor's angle says more of torsion than of the ratio. A stated
ratio is judged where either encoder shows as much, for a wrong unit makes the other's small."""

TOLD = 4.0  # standard errors of a delay between encoders, from which it is one
MIXED = 0.5
"""What is left of a torque beside its part that grows with velocity, over that part, from which
torsion is told from a delay by the torque. A brake's sensor that reads inertia and gravity too has
0.16 to 0.24, and twice of that is let pass; loads that do not follow velocity have 1.8 and more."""

DIRECTION = 0.001
"""Half width of the change of direction, as a share of the 95 % speed."""

DRIVE = ("motor_torque", "motor_current")

MOVED = ("output_position", "output_velocity", "output_acceleration", "motor_position",
         "motor_velocity")  # fmt: skip
"""Channels that move together where a motion is late."""

SENSOR = "sensor_torque"

EARLY = 0.1
"""Rows by which a torque is early at least. One that is late may be by half a row, for a command is
held for one; nothing makes a torque early but a motion that is late."""

BESIDE_NOISE = 10.0
"""Times its smoothed noise, that a model may leave of a sensor's torque whose delay is a fault:
simulated rigs behind filters and slow buses leave 1.4 to 7. At half of this a torque that is held
for three rows stays untold; twice changes none of these."""

SURE = 5.0
"""Standard errors at which a sign counts as known."""

LOAD = "reference_torque"

OF_THE_LOAD = 0.9
"""Share of what motion leaves of a torque that the load has to explain, for its factor to count."""

NEAR = 0.25
"""Relative deviation from the factor of a slip; efficiency and torque constant make as much."""

TORQUE_UNITS = ("kgf·m", "kgf·cm", "lbf·ft", "lbf·in", "ozf·in", "cNm", "daNm")
"""Units in which load cells and torque sensors are sold, beside those of a slip by 1000. Two of
them are 2 % apart, kgf·m and daNm: both are named."""

CONSTANT = 0.1
"""Share within which data sheets state a motor's torque constant. Half of it misses drives whose
constant is off; twice of it names lbf·in beside kgf·cm, which are 15 % apart."""

INEFFICIENT = 0.6
"""Least efficiency of a strain wave gear at its rated torque in catalogues. A drive that lifts its
load and never lowers it needs as much more: a factor of lbf·ft is no sure fault of it. At half of
this the other units, which differ by nine times and more, are as sure as before."""

TORQUE_WITHIN = 0.15
"""Delays up to this [s] are looked for."""

SLID = 4.0
"""Travel behind a reversal, in delays at the 95 % speed, from which presliding is over. Friction
that rises over a travel looks late by half of it, in the middle; twice of that is let pass. Of 36
joints driven to and fro at one speed none is late, none at half and at twice of this, 4 at zero."""

FAR = 0.1
"""Share of the rows, that must be far from reversals for their delay to be told: sixteen blocks of
fewer are shorter than the noise's memory, and make its error too small."""

Array = NDArray[np.float64]

MOST_ROWS = 6_000
SCANNED = 3  # every so many rows of these, for the scan
BLOCKS = 16

ALIKE = 0.1
"""Share of a delay by which it may differ between runs of one recorder, beside its errors."""

ALIKE_DRIVE = 0.25
"""The same of a drive: the form of its friction, which is not known here, moves what a run tells.
In strokes 6 ms are 5.2 and 6.4 ms, in waves 6.0."""


def velocity_of_position(log: Log) -> Iterator[Finding]:
    """Each velocity channel against the derivative of its position."""
    for channel, position in PAIRS.items():
        if channel in log and position in log:
            motion = motion_of(log, position)
            if motion is not None:
                yield from _compare(log, channel, motion)


def velocity_delay(log: Log, channel: str) -> Delay | None:
    """Delay of a velocity behind the derivative of its position; None where no run tells it.

    Once for each log: checks and fits ask for the same.
    """
    kept = _DELAYS.setdefault(log, {})
    if channel not in kept:
        kept[channel] = _behind(log, channel)
    return kept[channel]


_DELAYS: WeakKeyDictionary[Log, dict[str, Delay | None]] = WeakKeyDictionary()


def is_delay(late: Delay) -> bool:
    """Whether the motion changes and the delay explains what is otherwise left."""
    known = late.explained > 0.5 and late.gain > 0.1
    return known and abs(late.seconds) > 4 * late.error


def _behind(log: Log, channel: str) -> Delay | None:
    if channel not in log or PAIRS[channel] not in log:
        return None
    motion = motion_of(log, PAIRS[channel])
    if motion is None:
        return None
    within, step = _within(motion), median_step(motion.time)
    valid, velocity = motion.inside(within), motion.smooth(log[channel])
    return find_delay(
        motion.time, velocity, motion.velocity[:, None], valid, within, max(step, 0.005)
    )


def _within(motion: Motion) -> float:
    return min(WITHIN, float(motion.time[-1] - motion.time[0]) / 8)


def _compare(log: Log, channel: str, motion: Motion) -> Iterator[Finding]:
    scale = _scale(log, channel, motion)
    if scale is None:
        return
    if not scale.related:
        yield _unrelated(log, channel, scale.late.explained)
        return
    yield from _wrong_factor(log, channel, scale)
    if abs(scale.delay) > max(0.5 * median_step(motion.time), 0.001):
        yield late_velocity(log, channel, scale.late)


class Scale(NamedTuple):
    """Velocity over the derivative of its position, its error, and the delay between them.

    `related`: whether the velocity is that derivative but for factor and delay. `delay` [s] is
    zero where none is known.
    """

    factor: float
    error: float
    related: bool
    late: Delay
    delay: float

    @property
    def right(self) -> bool:
        """Whether the factor may be one, but for its sign."""
        return abs(abs(self.factor) - 1) <= self.slack

    @property
    def slack(self) -> float:
        """Relative deviation of the factor that is let pass."""
        return max(FACTOR_LIMIT, 5 * self.error)


def _scale(log: Log, channel: str, motion: Motion) -> Scale | None:
    """Compare a velocity with its position's derivative; None where their delay is not told."""
    late = velocity_delay(log, channel)
    if late is None:
        return None
    velocity, valid = motion.smooth(log[channel]), motion.inside(_within(motion))
    delay = late.seconds if is_delay(late) else 0.0
    aligned = np.interp(motion.time - delay, motion.time, motion.velocity)
    grain = quantum(log[channel][motion.rows])
    return Scale(*_factor(velocity[valid], aligned[valid], grain), late, delay)


def _scale_of(log: Log, channel: str) -> Scale | None:
    """Return how a velocity goes with its position; None where there is no telling."""
    if channel not in log or (motion := motion_of(log, PAIRS[channel])) is None:
        return None
    scale = _scale(log, channel, motion)
    return scale if scale is not None and scale.related else None


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


def _wrong_factor(log: Log, channel: str, scale: Scale) -> Iterator[Finding]:
    factor, everywhere = scale.factor, (0, len(log))
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
    if scale.right:
        return
    told = _beside_stated(log)
    if told is not None and _position_is_wrong(told, channel, scale):
        yield _wrong_position(log, channel, abs(factor), told)
    else:
        known = told is not None and told.right
        yield _wrong_velocity(log, channel, abs(factor), of_position=not known)


def _wrong_velocity(log: Log, channel: str, size: float, *, of_position: bool) -> Finding:
    """Blame the velocity; `of_position`: its position may be what is wrong as well."""
    position, said = PAIRS[channel], _units(log, size)
    readings = [text for text in (said.velocity, said.time) if text]
    if of_position and said.position:
        readings.append(f"{position} {said.position}")
    other = f", or scale={position}:{size:.6g} if {position} is wrong" if of_position else ""
    if said.time:
        other += f", or scale=time:{0.001 if size > 1.0 else 1000} if time is wrong"
    beside = "" if of_position else ", which the other side of the gear confirms"
    why = ", or ".join(readings) or "scale or sampling rate is wrong"
    return Finding(
        "velocity_unit" if readings else "velocity_scale",
        "fault",
        channel,
        (0, len(log)),
        size,
        "",
        f"{channel} is {size:.4g} times the derivative of {position}{beside}: {why}.",
        f"Give the right unit or rate when reading, or ask for the repair "
        f"scale={channel}:{1 / size:.6g}{other}.",
    )


def _wrong_position(log: Log, channel: str, size: float, told: Told) -> Finding:
    """Blame a position that its velocity and the other side of the gear both contradict."""
    position, said = PAIRS[channel], _units(log, size).position
    return Finding(
        "position_unit" if said else "position_scale",
        "fault",
        position,
        (0, len(log)),
        1 / size,
        "",
        f"{position} is {1 / size:.4g} times what {channel} and the other side of the gear say "
        f"(motor to output {told.ratio:.5g}, stated {told.stated:.5g})"
        + (f": it {said}." if said else ": its scale is wrong."),
        f"Give the right unit when reading, or ask for the repair scale={position}:{size:.6g}.",
    )


class Told(NamedTuple):
    """Measured ratio of motor to output without its sign, the stated one, and what is let pass."""

    ratio: float
    stated: float
    slack: float

    @property
    def factor(self) -> float:
        """Measured over stated ratio."""
        return self.ratio / self.stated

    @property
    def right(self) -> bool:
        """Whether the ratio may be the stated one."""
        return abs(self.factor - 1) <= self.slack


def _beside_stated(log: Log, found: Gear | None = None) -> Told | None:
    """Return the ratio beside the stated one; None where either is not known.

    `found` : what `measured_gear` returns, where that is known.
    """
    stated, found = log.effective_ratio, found or measured_gear(log)
    if stated is None or found is None or found.ratio == 0:
        return None
    travel = _travel(log, "output_position")
    if max(travel, _travel(log, "motor_position") / stated) < LEAST_TRAVEL:
        return None
    slack = max(RATIO_LIMIT, 5 * found.ratio_error / stated, TWIST / travel)
    return Told(abs(found.ratio), stated, slack)


def _travel(log: Log, position: str) -> float:
    angle = unwrapped(log, position)
    return float(np.nanmax(angle) - np.nanmin(angle))


def _position_is_wrong(told: Told, channel: str, scale: Scale) -> bool:
    """Whether a velocity differs from its position by what the other side of the gear does."""
    beside = told.factor if channel == "output_velocity" else 1 / told.factor
    return not told.right and abs(abs(scale.factor) / beside - 1) <= scale.slack


class Units(NamedTuple):
    """What a factor between velocity and derivative would be of the one, the other, or time."""

    velocity: str = ""
    position: str = ""
    time: str = ""


def _units(log: Log, size: float) -> Units:
    """Return what is known to make this factor; nothing where it is none of these."""
    turn = 2 * np.pi
    known = {
        360 / turn: Units(
            "it is in deg/s, or its unit was given twice", "was in radians and converted again"
        ),
        turn / 360: Units("it was converted from deg/s twice", "is in degrees"),
        60 / turn: Units("it is in rpm"),
        1 / turn: Units("it is in turns per second"),
        turn: Units(position="is in turns"),
        1000.0: Units("it is in mrad/s", time="time is in milliseconds"),
        0.001: Units(position="is in mrad", time="time was divided by 1000 twice"),
    }
    if log.effective_ratio:
        other = "that of the other side of the gear"
        known[log.effective_ratio] = Units(f"it is {other}")
        known[1 / log.effective_ratio] = Units(f"it is {other}", f"is {other}")
    return next((w for k, w in known.items() if abs(size / k - 1) <= FACTOR_LIMIT), Units())


def late_velocity(log: Log, channel: str, late: Delay, others: str = "") -> Finding:
    """Return the finding of a velocity that is late or early; `others`: what other runs say."""
    delay, way = late.seconds, "late" if late.seconds > 0 else "early"
    return Finding(
        VELOCITY_DELAY,
        "fault",
        channel,
        (0, len(log)),
        delay,
        "s",
        f"{channel} is {_milliseconds(abs(delay), late.error)} {way} against the derivative of "
        f"{PAIRS[channel]}.{others}",
        f"Ask for the repair velocity_from_position={channel}, or shift={channel}:{delay:.4g}.",
    )


def _milliseconds(seconds: float, error: float) -> str:
    return f"{plus_minus(1e3 * seconds, 1e3 * error)} ms"


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


class Gear(NamedTuple):
    """Ratio R and delay δ [s] of the output's encoder, each with its standard error."""

    ratio: float
    ratio_error: float
    delay: float
    delay_error: float


def measured_gear(log: Log) -> Gear | None:
    """Ratio of motor to output side (with its sign) and the delay between the encoders.

    None without both positions, or where the output hardly moves.
    """
    angles = _angles(log)
    return None if angles is None else _gear_of(*solve_with_error(angles.design, angles.motor))


def _gear_of(solved: Array, error: Array) -> Gear:
    ratio = float(solved[0])
    if ratio == 0:
        return Gear(0.0, float(error[0]), 0.0, float("inf"))
    return Gear(ratio, float(error[0]), float(solved[1] / ratio), float(error[1] / abs(ratio)))


class Angles(NamedTuple):
    """The motor's angle, (N,) rad, and what makes it up: columns q, v, 1 and direction, (N, 4).

    `motion` of the output; `valid`, of its rows: the N that count.
    """

    motor: Array
    design: Array
    motion: Motion
    valid: NDArray[np.bool_]


def _angles(log: Log) -> Angles | None:
    """Both angles; None without one of them, or where the output hardly moves."""
    motion = motion_of(log)
    if motion is None or "motor_position" not in log:
        return None
    motor = unwrapped(log, "motor_position")[motion.rows]
    valid = motion.inside(0.0)
    if np.count_nonzero(valid) < 200:
        return None
    v = motion.velocity
    direction = np.tanh(v / max(DIRECTION * float(np.percentile(np.abs(v), 95)), 1e-12))
    design = np.column_stack(
        (motion.position - np.mean(motion.position), v, np.ones(len(v)), direction)
    )
    return Angles(motor[valid], design[valid], motion, valid)


class Damping(NamedTuple):
    """Part of a torque that grows with velocity [Nm s/rad at the output, or the channel's unit].

    Its standard error, and the RMS of what position, velocity and direction leave of the torque
    over that of this part.
    """

    size: float
    error: float
    other: float

    @property
    def alone(self) -> bool:
        """Whether the torque does hardly anything else, so that its torsion is not told from it."""
        return abs(self.size) > TOLD * self.error and self.other < MIXED


def _damping(angles: Angles, torque: Array) -> Damping:
    """Return how a torque, (N,), grows with velocity."""
    solved, error = solve_with_error(angles.design, torque)
    velocity, beside = angles.design[:, 1], np.delete(angles.design, 1, axis=1)
    own = velocity - beside @ np.linalg.lstsq(beside, velocity, rcond=1e-12)[0]
    size = abs(float(solved[1])) * float(np.std(own))
    left = float(np.std(torque - angles.design @ solved))
    return Damping(float(solved[1]), float(error[1]), left / size if size else np.inf)


class Torsion(NamedTuple):
    """Torsion under a torque `channel` that may be what looks like a delay between encoders.

    `stiffness`: of the gear that twists by as much [Nm/rad]; zero where other parts of the torque
    show that it twists.
    """

    channel: str
    stiffness: float


def _beside_torsion(log: Log, found: Gear) -> Gear | Torsion:
    """Return what is left of a delay beside torsion, or the torsion that explains it."""
    angles = _angles(log)
    if angles is None:
        return found
    for channel in _behind_the_gear(log, angles.motion):
        torque = angles.motion.smooth(log[channel])[angles.valid]
        damping = _damping(angles, torque)
        if damping.alone:
            return Torsion(channel, abs(damping.size / found.delay))
        bent = torque**3 / max(float(np.mean(torque**2)), np.finfo(float).tiny)
        design = np.column_stack((angles.design, torque, bent))
        left = _gear_of(*solve_with_error(design, angles.motor))
        if not _is_late(log, left):
            return Torsion(channel, 0.0)
        found = min(found, left, key=lambda gear: gear.delay_error)
    return found


def _behind_the_gear(log: Log, motion: Motion) -> list[str]:
    """Torque channels of what the gear carries: friction in front of it twists nothing."""
    return [channel for channel in (LOAD, "sensor_torque") if _is_read(log, channel, motion)]


def _is_late(log: Log, found: Gear) -> bool:
    least = max(TOLD * found.delay_error, 0.05 * median_step(log["time"]))
    return abs(found.delay) > least


def too_fast(log: Log) -> Iterator[Finding]:
    """Motors that turn faster than any joint's: the unit of angle or time, or the ratio is wrong.

    All angles and velocities have to say so: what one of them contradicts is told of that pair.
    """
    speeds = {name: _high_speed(log, name) for pair in PAIRS.items() for name in pair[::-1]
              if name in log}  # fmt: skip
    ratio = log.effective_ratio or 1.0
    motor = {name: v * (ratio if "output" in name else 1.0) for name, v in speeds.items()}
    if not motor or min(motor.values()) <= FASTEST:
        return
    channel, turns = next(iter(motor.items()))
    repairs = ", ".join(f"scale={name}:{np.pi / 180:.6g}" for name in speeds)
    yield Finding(
        "impossible_speed",
        "fault",
        channel,
        (0, len(log)),
        speeds[channel],
        "rad/s",
        f"{channel} goes at {speeds[channel]:.3g} rad/s, the motor at {turns:.3g} rad/s "
        f"({turns * 30 / np.pi:.2g} rpm), faster than any of a strain wave joint: the angle is in "
        "degrees, or the unit of time or the gear ratio is wrong.",
        f"Give the right units when reading; of degrees, ask for the repairs {repairs}.",
    )


def _high_speed(log: Log, channel: str) -> float:
    """Speed that a hundredth of the rows exceed [rad/s]; zero where none is known."""
    if channel in PAIRS:
        values = log[channel][np.isfinite(log[channel])]
    else:
        motion = motion_of(log, channel)
        values = motion.velocity[motion.inside(0.0)] if motion is not None else np.zeros(0)
    return float(np.percentile(np.abs(values), 99)) if values.size else 0.0


def drive_beside_current(log: Log) -> Iterator[Finding]:
    """A torque of the drive beside its current and torque constant, off by what a slip makes."""
    constant, motion = log.facts.get("torque_constant"), motion_of(log)
    if constant is None or motion is None or not all(_is_read(log, c, motion) for c in DRIVE):
        return
    torque, current = (log[channel][motion.rows] for channel in DRIVE)
    factor = float(np.std(torque) / np.std(float(constant) * current))
    if abs(np.corrcoef(torque, current)[0, 1]) < np.sqrt(OF_THE_LOAD):
        return
    slips = {1000.0: "it is in mNm, or motor_current in kA", 0.001: "motor_current is in mA"}
    if log.effective_ratio is not None and log.effective_ratio * (1 - NEAR) > 1 + NEAR:
        slips[log.effective_ratio] = "it is the torque at the output, not at the motor"
    for slip, why in slips.items():
        if abs(factor / slip - 1) <= NEAR:
            yield Finding(
                "torque_scale",
                "fault",
                "motor_torque",
                (0, len(log)),
                factor,
                "",
                f"motor_torque is {factor:.4g} times motor_current and torque_constant: {why}, or "
                "the torque constant is stated in another unit.",
                f"Correct the column map, or ask for the repair scale=motor_torque:{1 / slip:.6g}, "
                f"or scale=motor_current:{slip:.6g} if that is wrong.",
            )


def late_alike(gears: Sequence[Gear]) -> bool:
    """Return whether an encoder is late by the same in all runs: by its recorder, not torsion."""
    if len(gears) < 2:
        return True
    delay = np.array([gear.delay for gear in gears])
    weight = np.array([max(gear.delay_error, np.finfo(float).tiny) for gear in gears]) ** -2.0
    mean = np.average(delay, weights=weight)
    scatter = np.average((delay - mean) ** 2, weights=weight) / (len(delay) - 1)
    return bool(abs(mean) > TOLD * np.sqrt(max(1.0 / weight.sum(), scatter)))


def gear(log: Log) -> Iterator[Finding]:
    """Ratio and sense against the facts, and the delay between the encoders."""
    found = measured_gear(log)
    if found is None:
        return
    yield from _ratio(log, found)
    if _travel(log, "output_position") < LEAST_TRAVEL:
        return
    rows = (0, len(log))
    if found.ratio < 0:
        yield Finding(
            "motor_reversed",
            "fault",
            "motor_position",
            rows,
            found.ratio,
            "",
            f"the motor side runs the other way: θ is {found.ratio:.5g} times q.",
            _turn_motor(log),
        )
    if log.effective_ratio is None:
        yield _not_stated(log, found)
    if _is_late(log, found):
        yield _late_encoder(log, found)


def _late_encoder(log: Log, found: Gear) -> Finding:
    """Return the finding of encoders whose difference grows with velocity."""
    made, motion = _beside_torsion(log, found), motion_of(log)
    torsion, found = (made, found) if isinstance(made, Torsion) else (None, made)
    severity: Severity = "fault" if torsion is None else "note"
    known = _behind_the_gear(log, motion) if motion is not None else []
    which = "output_position" if found.delay > 0 else "motor_position"
    late = f"{_milliseconds(abs(found.delay), found.delay_error)} late"
    repair = f"ask for the repair shift={which}:{abs(found.delay):.3g}"
    if torsion is not None:
        gear = f" of a gear of {torsion.stiffness:.3g} Nm/rad" if torsion.stiffness else ""
        said = (
            f"the encoders differ as if {which} were {late}: torsion{gear} under "
            f"{torsion.channel} explains as much."
        )
        remedy = f"Leave it as torsion; only if runs without load show the same, {repair}."
    elif known:
        said = (
            f"{which} is {late} against the other encoder: their difference grows with velocity, "
            f"more than torsion under {' or '.join(known)} explains."
        )
        remedy = f"A{repair[1:]}."
    else:
        cause = "a brake or friction" if found.delay > 0 else "a load that drives it"
        bound, sure = _softer_than(log, found)
        said = (
            f"{which} is {late} against the other encoder, or the gear twists under {cause}: "
            f"their difference grows with velocity, as of both, and no torque at the output is in "
            f"the log.{bound}"
        )
        remedy = f"If {sure}, {repair}; torsion is to be left as it is."
    size, rows = abs(found.delay), (0, len(log))
    return Finding("encoder_delay", severity, which, rows, size, "s", said, remedy)


def _softer_than(log: Log, found: Gear) -> tuple[str, str]:
    """Return of which gear the drive's torque would make a delay, and what excludes torsion."""
    nothing = "", "nothing at the output does so"
    angles = _angles(log)
    if angles is None or found.delay <= 0:
        return nothing
    for channel in DRIVE:
        scale = _at_the_output(log, channel)
        if scale is not None and _is_read(log, channel, angles.motion):
            damping = _damping(angles, angles.motion.smooth(log[channel])[angles.valid])
            if damping.size > TOLD * damping.error:
                size = scale * damping.size
                return (
                    f" {channel} grows by {size:.3g} Nm s/rad, seen from the output: only a gear "
                    f"softer than {size / found.delay:.2g} Nm/rad twists by as much.",
                    "the gear is stiffer",
                )
    return nothing


def _turn_motor(log: Log) -> str:
    """Return what to ask for where the motor's encoder runs the other way: its drive may not."""
    signs = _drive_signs(log)
    if _all_turned(signs):
        return "Ask for the repair reverse_motor."
    angles = ["motor_position", *(["motor_velocity"] if "motor_velocity" in log else [])]
    alone = " and ".join(f"the repair flip_sign={name}" for name in angles)
    right = [name for name, sign in signs.items() if sign > 0]
    if right:
        return (
            f"Ask for {alone}; reverse_motor would turn {' and '.join(right)} too, which is right."
        )
    return (
        f"Ask for {alone}, or for the repair reverse_motor where {' and '.join(signs)} has the "
        "wrong sign too: this run does not tell."
    )


def _not_stated(log: Log, found: Gear) -> Finding:
    return Finding(
        "gear_ratio_not_stated",
        "note",
        "motor_position",
        (0, len(log)),
        abs(found.ratio),
        "",
        f"the motor side turns {_measured(found)} times per turn of the output; no gear ratio was "
        f"stated.",
        f"State gear_ratio={abs(found.ratio):.5g}.",
    )


def _measured(found: Gear) -> str:
    return plus_minus(abs(found.ratio), max(found.ratio_error, 1e-6))


def _ratio(log: Log, found: Gear) -> Iterator[Finding]:
    """Whether the ratio is the stated one; if not, which of ratio and positions may be wrong."""
    told = _beside_stated(log, found)
    if told is None or told.right:
        return
    sound = list[str]()
    for channel, position in PAIRS.items():
        scale = _scale_of(log, channel)
        if scale is None:
            continue
        if not scale.right and _position_is_wrong(told, channel, scale):
            return  # said of the position
        sound += [position] if scale.right else []
    n = float(log.facts["gear_ratio"])
    other = n if log.facts.get("output_spline") == "circular" else n + 1
    open_ = [position for position in PAIRS.values() if position not in sound]
    channel, why = "motor_position", ""
    remedy = f"State gear_ratio={told.ratio:.5g}, or check the encoders' units."
    if abs(told.ratio / other - 1) <= max(0.1 * RATIO_LIMIT, 5 * found.ratio_error / other):
        why = ": the other spline is the output"
        remedy = f"State output_spline={'flex' if other == n else 'circular'}."
    elif _is_degrees(told.factor):
        channel = open_[0] if len(open_) == 1 else channel
        slipped, repairs = _slipped(told.factor, sound)
        why = f": degrees and radians are mixed up in {slipped}"
        remedy = f"Give the encoders' right units when reading, or ask for the repair {repairs}."
    yield Finding(
        "gear_ratio",
        "fault",
        channel,
        (0, len(log)),
        told.ratio,
        "",
        f"the motor side turns {_measured(found)} times per turn of the output, not "
        f"{told.stated:.5g} as stated{why}.",
        remedy,
    )


def _is_degrees(factor: float) -> bool:
    """Whether a factor is that between degrees and radians, either way."""
    degrees = 180 / np.pi
    return any(abs(factor / k - 1) <= FACTOR_LIMIT for k in (degrees, 1 / degrees))


def _slipped(factor: float, sound: Sequence[str]) -> tuple[str, str]:
    """Where the unit may be wrong that makes this factor of the ratio, and the repairs.

    A position in `sound` agrees with its velocity: it is wrong only where that is wrong too, so it
    comes last.
    """
    repairs = {"output_position": factor, "motor_position": 1 / factor}
    velocities = {position: velocity for velocity, position in PAIRS.items()}
    places, asked = list[str](), list[str]()
    for position in sorted(repairs, key=lambda one: one in sound):
        names = [position, velocities[position]] if position in sound else [position]
        places.append(" and ".join(names) + (" alike" if len(names) > 1 else ""))
        asked.append(" with ".join(f"scale={name}:{repairs[position]:.6g}" for name in names))
    return ", or in ".join(places), ", or ".join(asked)


class Reaction(NamedTuple):
    """Friction at working speed [Nm or A] and inertia [per rad/s²], with their standard errors."""

    friction: float
    friction_error: float
    inertia: float
    inertia_error: float


def torque(log: Log) -> Iterator[Finding]:
    """Sign, scale and delay of each torque channel, where the joint moves both ways."""
    motion = motion_of(log)
    if motion is None or not _both_ways(motion):
        return
    columns = motion_columns(log, motion)
    beside, late = list[Finding](), list[Finding]()
    for channel in (*DRIVE, SENSOR):
        if _is_read(log, channel, motion):
            reading = motion.smooth(log[channel])
            reaction = _reaction(motion, columns, reading)
            yield from _sign(log, channel, reaction)
            late += _late_torque(log, channel, motion, columns, reading)
            if LOAD in log:
                factor = _load_factor(log, channel, motion, columns, reading)
                beside += _beside_load(log, channel, factor, reaction)
    yield from {finding.channel: finding for finding in late}.values()  # a sensor's comes last
    known = {finding.channel: finding for finding in reversed(beside)}
    yield from known.values()  # the load is wrong once, beside however many torques


def _is_read(log: Log, channel: str, motion: Motion) -> bool:
    return channel in log and bool(np.ptp(log[channel][motion.rows]) > 0)


def _both_ways(motion: Motion) -> bool:
    limit = 0.1 * float(np.percentile(np.abs(motion.velocity), 95))
    moving = motion.velocity[np.abs(motion.velocity) > limit]
    return moving.size > 200 and 0.1 < float(np.mean(moving > 0)) < 0.9


def motion_columns(log: Log, motion: Motion) -> Array:
    """Columns tanh, sin q, cos q, the reference torque where there is one, v and q̈."""
    q, v = motion.position, motion.velocity
    direction = np.tanh(v / (0.02 * float(np.percentile(np.abs(v), 95))))
    bent = motion.low_passed(np.column_stack((direction, np.sin(q), np.cos(q))))
    known = [motion.smooth(log[LOAD])] if LOAD in log else []
    return np.column_stack((bent, *known, v, motion.acceleration))


def _reaction(motion: Motion, columns: Array, reading: Array) -> Reaction:
    valid = motion.inside(0.0)
    speed = float(np.sqrt(np.mean(motion.velocity[valid] ** 2)))
    # One column for all friction at this speed keeps its error honest: c + b v as c' tanh + b slip.
    slip = columns[:, -2] / speed - columns[:, 0]
    design = np.column_stack((columns[:, :-2], slip, columns[:, -1], np.ones(len(columns))))
    solved, error = solve_with_error(design[valid], reading[valid])
    return Reaction(float(solved[0]), float(error[0]), float(solved[-2]), float(error[-2]))


def _drive_signs(log: Log) -> dict[str, int]:
    """Return of each torque of the drive whether its sign is right, 1, or turned, -1; 0: unknown.

    Friction is judged, and a mass: a load that drives its motor makes friction alone negative.
    """
    motion, known = motion_of(log), [name for name in DRIVE if name in log]
    if motion is None or not _both_ways(motion):
        return dict.fromkeys(known, 0)
    columns, signs = motion_columns(log, motion), dict.fromkeys(known, 0)
    for name in (name for name in known if _is_read(log, name, motion)):
        found = _reaction(motion, columns, motion.smooth(log[name]))
        if _is_turned(found, drive=True):
            signs[name] = -1
        elif found.friction > SURE * found.friction_error or _is_mass(found):
            signs[name] = 1
    return signs


def _all_turned(signs: Mapping[str, int]) -> bool:
    return all(sign < 0 for sign in signs.values())


def _is_mass(found: Reaction) -> bool:
    return found.inertia > SURE * found.inertia_error


def _is_turned(found: Reaction, *, drive: bool) -> bool:
    """Whether friction is negative for sure; a load drives the motor where its mass is not."""
    return found.friction <= -SURE * found.friction_error and not (drive and _is_mass(found))


def _turn_torque(log: Log, channel: str, *, drive: bool) -> str:
    """Return what to ask for where a torque's sign is flipped: its encoder's may be too."""
    if not drive:
        return f"If it is flipped, ask for the repair flip_sign={channel}."
    gear = measured_gear(log)
    if gear is not None and gear.ratio < 0 and _all_turned(_drive_signs(log)):
        return "Ask for the repair reverse_motor, for the motor's angle has the wrong sign too."
    return f"Ask for the repair flip_sign={channel}."


def _sign(log: Log, channel: str, found: Reaction) -> Iterator[Finding]:
    unit, drive = CHANNELS[channel].unit, channel in DRIVE
    if not _is_turned(found, drive=drive):
        return
    level = f"friction of {plus_minus(found.friction, found.friction_error)} {unit}"
    if found.inertia < -SURE * found.inertia_error:
        inertia = plus_minus(found.inertia, found.inertia_error)
        level += f", inertia of {inertia} {unit}/(rad/s²)"
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
        _turn_torque(log, channel, drive=drive),
    )


class Factor(NamedTuple):
    """What a torque is times its load, of either sign, and the relative standard error."""

    size: float
    error: float


def _load_factor(
    log: Log, channel: str, motion: Motion, columns: Array, reading: Array
) -> Factor | None:
    """Return g, of a sensor 1 and of a motor 1 of its own side; None where the load is not told."""
    valid = motion.inside(0.0)
    design = np.column_stack((columns[valid], np.ones(np.count_nonzero(valid))))
    y, at = reading[valid], columns.shape[1] - 3  # v and q̈ come behind it
    solved, error = solve_with_error(design, y)
    rest = np.delete(design, at, axis=1)
    without = y - rest @ np.linalg.lstsq(rest, y, rcond=1e-12)[0]
    left = float(np.sum((y - design @ solved) ** 2))
    if abs(solved[at]) < SURE * error[at] or left > (1 - OF_THE_LOAD) * float(without @ without):
        return None
    factor, relative = float(solved[at]), float(error[at] / abs(solved[at]))
    scale = _at_the_output(log, channel)
    if scale is None:
        return Factor(float(np.sign(factor)), 0.0)  # what its size should be is not known
    return Factor(factor * scale, relative)


def _at_the_output(log: Log, channel: str) -> float | None:
    """Nm at the output per unit of a torque channel; None where that is not stated."""
    if channel not in DRIVE:
        return 1.0
    constant = 1.0 if channel == "motor_torque" else log.facts.get("torque_constant")
    ratio = log.effective_ratio
    return None if ratio is None or constant is None else ratio * float(constant)


def _beside_load(
    log: Log, channel: str, found: Factor | None, reaction: Reaction
) -> Iterator[Finding]:
    """Sign and scale of a torque beside the load, where its factor is one that a slip makes."""
    if found is None:
        return
    factor, slips = found.size, _slips(log, channel)
    near = [k for k in (1.0, *slips) if abs(abs(factor) / k - 1) <= NEAR]
    right = near[:1] == [1.0] and abs(factor) >= 1.0  # no loss makes a drive's torque smaller
    units = [] if right else _units_of_torque(channel, found)
    if not (near or units):
        return
    if (wrong := _turned(channel, factor, reaction)) is not None:
        yield _slipped_load(
            log,
            "load_sign",
            wrong[0],
            factor,
            f"{channel} falls where {LOAD} rises (factor {factor:.3g}): the sign of "
            f"{' or '.join(wrong)} is flipped.",
            ", or ".join(f"flip_sign={name}" for name in wrong),
        )
    made = [k for k in near if k != 1.0] + [unit.factor for unit in units]
    if made:
        why = [slips[k] for k in near if k != 1.0] + _in_units(units)
        lossy = channel in DRIVE and max(made[0], 1 / made[0]) < 1 / INEFFICIENT
        why += ["the gear loses as much"] if lossy else []
        yield _slipped_load(
            log,
            "load_scale",
            channel,
            abs(factor),
            f"{channel} is {abs(factor):.4g} times what {LOAD} makes it: {', or '.join(why)}.",
            f"scale={channel}:{1 / made[0]:.6g}, or scale={LOAD}:{made[0]:.6g} if that is wrong",
            sure=not lossy,
        )


def _slipped_load(
    log: Log,
    name: str,
    channel: str,
    size: float,
    sentence: str,
    repair: str,
    *,
    sure: bool = True,
) -> Finding:
    remedy = f"Correct the column map, or ask for the repair {repair}."
    severity: Severity = "fault" if sure else "note"
    return Finding(name, severity, channel, (0, len(log)), size, "", sentence, remedy)


class InUnit(NamedTuple):
    """A factor that a unit makes which is taken for Nm: of the load or of the other torque."""

    factor: float
    unit: str
    of_load: bool


def _units_of_torque(channel: str, found: Factor) -> list[InUnit]:
    """Return the units of torque that make a factor, the nearest first.

    Nothing is said where the factor is too uncertain to be told from one, and from another unit's.
    """
    if found.error * SURE > NEAR:
        return []
    slack = max(CONSTANT if channel in DRIVE else FACTOR_LIMIT, 2 * found.error)
    made = [
        InUnit(newton_metres if of_load else 1 / newton_metres, unit, of_load)
        for unit in TORQUE_UNITS
        for newton_metres in (to_si(LOAD, str(canonical_unit(unit)))[0],)
        for of_load in (True, False)
    ]
    off = {one: abs(float(np.log(abs(found.size) / one.factor))) for one in made}
    return sorted((one for one in made if off[one] <= slack), key=lambda one: off[one])


def _in_units(units: Sequence[InUnit]) -> list[str]:
    """Return what makes such a factor, in words."""
    load, own = (
        " or ".join(one.unit for one in units if one.of_load == of_load)
        for of_load in (True, False)
    )
    said = [f"{LOAD} is in {load}, or it is in Nm and was taken for such"] if load else []
    return said + ([f"it is in {own}, or {LOAD} is in Nm and was taken for such"] if own else [])


def _slips(log: Log, channel: str) -> dict[float, str]:
    """Return the factors that a wrong unit or side of the gear makes, and how each comes about."""
    slips = {
        1000.0: f"it is in thousandths of its unit, or {LOAD} in kNm",
        0.001: f"{LOAD} is in mNm, or it is in thousands of its unit",
    }
    ratio = log.effective_ratio
    if ratio is not None and ratio * (1 - NEAR) > 1 + NEAR:  # else one side looks like the other
        at = "output, not at the motor" if channel in DRIVE else "output times the gear ratio"
        slips[ratio] = f"it is the torque at the {at}, or {LOAD} is divided by the gear ratio"
        slips[1 / ratio] = f"it is divided by the gear ratio, or {LOAD} is multiplied by it"
    return slips


def _turned(channel: str, factor: float, reaction: Reaction) -> tuple[str, ...] | None:
    """Return whose sign is wrong, or may be; None where that of the load goes with the torque's.

    Friction tells the sign of a drive, and is said of it as a whole, unless inertia denies it, as
    where the load drives the motor; inertia tells that of a sensor.
    """
    if factor >= 0:
        return None
    inertia = _way(reaction.inertia, reaction.inertia_error)
    if channel not in DRIVE:
        return {1.0: (LOAD,), -1.0: (channel,)}.get(inertia, (LOAD, channel))
    friction = _way(reaction.friction, reaction.friction_error)
    if friction < 0:
        return (LOAD, channel) if inertia > 0 else None
    return (LOAD,) if friction > 0 else (LOAD, channel)


def _way(size: float, error: float) -> float:
    """Sign of what is told from zero, else 0."""
    return float(np.sign(size)) if abs(size) > SURE * error else 0.0


def _late_torque(
    log: Log, channel: str, motion: Motion, columns: Array, reading: Array
) -> Iterator[Finding]:
    step, within = median_step(motion.time), _torque_within(motion)
    whole = _behind_motion(motion, columns, reading)
    if whole is None or abs(whole.seconds) < SURE * whole.error:
        return
    if whole.seconds < -EARLY * step:
        yield from _early_torque(log, channel, motion, columns, reading)
        return
    if whole.seconds < 0.5 * step:
        return
    most = 0.98 * within
    told = channel in DRIVE or _is_all(log, channel, motion, reading, whole)
    if told and whole.seconds < most and is_delay(whole):
        late = _of_a_drive(log, motion, columns, reading)
        if late is not None:
            yield _late_drive(log, channel, late)
            return
    found = _behind_motion(motion, columns[:, :-2], reading)
    if found is None or found.explained < 0.5:
        return
    sure = max(0.5 * step, SURE * found.error) < found.seconds < most
    if not sure or found.gain < 0.01:
        return
    yield Finding(
        TORQUE_DELAY,
        "note",
        channel,
        (0, len(log)),
        found.seconds,
        "s",
        f"{channel} is {_milliseconds(found.seconds, found.error)} late against the motion: a "
        f"sensor or filter lags, or the joint gives before it slips (presliding).",
        f"If it is a lag, ask for the repair shift={channel}:{found.seconds:.3g}.",
    )


def _is_all(log: Log, channel: str, motion: Motion, reading: Array, late: Delay) -> bool:
    """Whether motion and delay leave hardly more than noise of a sensor's torque.

    A sensor reads what moves no motor, too, such as other joints: what is left of that may look
    like a delay. Beside a load a sensor's lag is an effect.
    """
    if LOAD in log:
        return False
    values = log[channel]
    new = values[np.append(True, np.diff(values) != 0.0)]
    noise = max(white_noise(new), quantum(values) / np.sqrt(12.0))
    spread = float(np.std(reading[motion.inside(_torque_within(motion))]))
    left = spread * np.sqrt(max(1.0 - late.explained, 0.0))
    return bool(left <= BESIDE_NOISE * noise * np.sqrt(2.0 * motion.bandwidth / log.rate))


def _torque_within(motion: Motion) -> float:
    return min(TORQUE_WITHIN, float(motion.time[-1] - motion.time[0]) / 8)


def _position_delay(log: Log, channel: str) -> Delay | None:
    """Delay of a position behind the sensor's torque; None where the run tells none."""
    found = _delay_of_torque(log, SENSOR) if SENSOR in log else None
    return None if found is None else replace(found, seconds=-found.seconds)


def _behind_motion(motion: Motion, columns: Array, reading: Array) -> Delay | None:
    """Delay of a reading behind the columns that make it up, of the whole run."""
    within, scan = _torque_within(motion), max(median_step(motion.time), 0.005)
    return find_delay(motion.time, reading, columns, motion.inside(within), within, scan)


def _delay_of_torque(log: Log, channel: str) -> Delay | None:
    """Delay of a torque behind its motion, of the whole run; None where the run tells none.

    Nor does that of a sensor beside a load, which may be late itself.
    """
    motion = motion_of(log) if channel != SENSOR or LOAD not in log else None
    if motion is None or not _both_ways(motion) or not np.ptp(log[channel][motion.rows]) > 0:
        return None
    return _behind_motion(motion, motion_columns(log, motion), motion.smooth(log[channel]))


def _of_a_drive(log: Log, motion: Motion, columns: Array, reading: Array) -> Delay | None:
    """Return the delay of a drive that is there where presliding is over too; None without one.

    It is that of the whole run where both agree. Where they do not, friction that rises over a
    travel is in the whole of it, and what its other rows say of most that is left of them is the
    delay.
    """
    within = _torque_within(motion)
    whole = _beside_place(log, motion, columns, reading)
    if whole is None or not 0.0 < whole.seconds < 0.98 * within:
        return None
    speed, step = np.abs(motion.velocity), median_step(motion.time)
    usual = float(np.percentile(speed, 95))
    sticks = motion.time[_travel_since_reversal(motion) <= SLID * whole.seconds * usual]
    most, valid = min(2.0 * whole.seconds, within), motion.inside(within)
    fast = valid & (speed > 0.5 * usual) & motion.away_from(sticks, most)
    if np.count_nonzero(fast) < FAR * np.count_nonzero(valid):
        return None
    scan = min(max(step, 0.005), 0.5 * most)
    there = find_delay(motion.time, reading, columns, fast, most, scan)
    if there is None or not there.seconds > max(0.5 * step, SURE * there.error):
        return None
    if there.gain >= 0.01 and 0.5 < there.seconds / whole.seconds < 2.0:
        return whole
    return there if is_delay(there) else None


def _beside_place(log: Log, motion: Motion, columns: Array, reading: Array) -> Delay | None:
    """Return the delay that is there beside friction that grows with a load or changes with the
    angle, a part of which a delay explains too; None without one."""
    beside = np.column_stack((_friction_of_place(log, motion, columns[:, 0]), columns))
    whole = _behind_motion(motion, beside, reading)
    return whole if whole is not None and is_delay(whole) else None


def _early_torque(
    log: Log, channel: str, motion: Motion, columns: Array, reading: Array
) -> Iterator[Finding]:
    """The motion is late where a torque is early, unless that is the load's, which may be late.

    Friction that gives before it slips is late and never early. A drive is ahead of its output by
    torsion, too; a sensor at the output is not.
    """
    early = _beside_place(log, motion, columns, reading) if LOAD not in log else None
    if early is None or not -0.98 * _torque_within(motion) < early.seconds < 0.0:
        return
    if channel not in DRIVE and not _is_all(log, channel, motion, reading, early):
        return
    late = replace(early, seconds=-early.seconds)
    if channel not in DRIVE:
        yield _late_position(log, "output_position", late)
        return
    twists = ", or the gear twists under friction at the output"
    found = _late_position(log, "output_position", late, behind=channel, unless=twists)
    yield replace(found, severity="note", remedy=f"If it is late, a{found.remedy[1:]}")


def _friction_of_place(log: Log, motion: Motion, direction: Array) -> Array:
    """Columns of friction that depends on the angle, such as that of a weight, or on a load."""
    turns = [wave(k * motion.position) for k in (1, 2) for wave in (np.sin, np.cos)]
    loads = [np.abs(motion.smooth(log[LOAD]))] if LOAD in log else []
    return np.asarray(direction[:, None] * np.column_stack((*turns, *loads)))


def _travel_since_reversal(motion: Motion) -> Array:
    """What the joint has turned since its velocity last changed its sign, (N,) rad."""
    reversals = np.flatnonzero(np.diff(np.signbit(motion.velocity), prepend=motion.velocity[0] < 0))
    turned = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(motion.position)))))
    last = np.zeros(len(turned), int)
    last[reversals] = reversals
    return np.asarray(turned - turned[np.maximum.accumulate(last)])


def _late_drive(log: Log, channel: str, late: Delay, others: str = "") -> Finding:
    """Return the fault of a torque that is late behind the whole of its motion, fast or slow.

    No effect of a drive is a lag, and that of a sensor is one of its load, not of friction as well;
    and presliding is no delay far from reversals.
    """
    return Finding(
        TORQUE_DELAY,
        "fault",
        channel,
        (0, len(log)),
        late.seconds,
        "s",
        f"{channel} is {_milliseconds(late.seconds, late.error)} late against the motion at all "
        f"speeds: its filter or its recorder delays it, and a fit takes that for inertia and "
        f"friction.{others}",
        f"Ask for the repair shift={channel}:{late.seconds:.3g}.",
    )


def _late_position(
    log: Log,
    channel: str,
    late: Delay,
    others: str = "",
    behind: str = "the torque",
    unless: str = "",
) -> Finding:
    """Return the fault of a motion that is late behind a torque; `unless`: what else may be."""
    asked = " with ".join(f"shift={name}:{late.seconds:.3g}" for name in MOVED if name in log)
    return Finding(
        POSITION_DELAY,
        "fault",
        channel,
        (0, len(log)),
        late.seconds,
        "s",
        f"{channel} is {_milliseconds(late.seconds, late.error)} late against {behind}: "
        f"its encoder, its filter or its bus delays it, and friction seems to turn over before the "
        f"joint does{unless}.{others}",
        f"Ask for the repair {asked}, for all channels of the motion.",
    )


@dataclass(frozen=True, eq=False)
class Delay:
    """A delay [s] with its standard error, and how well X explains y with it and without."""

    seconds: float
    error: float
    coefficients: Array
    explained: float
    explained_without: float

    @property
    def gain(self) -> float:
        """Share of what is left without the delay that it explains."""
        return 1 - (1 - self.explained) / max(1 - self.explained_without, 1e-12)


def find_delay(
    time: Array, target: Array, columns: Array, valid: NDArray[np.bool_], within: float, step: float
) -> Delay | None:
    """Delay of `target` behind the linear combination of `columns` that explains it best.

    Parameters
    ----------
    time : array (N,), s
    target : array (N,), any unit
    columns : array (N, M), any units; a column of ones is added
    valid : rows (N,) of the target to look at, at least `within` away from gaps
    within : s, delays from -within to +within are tried
    step : s, of the scan
    """
    from scipy.interpolate import CubicSpline
    from scipy.optimize import minimize_scalar

    rows = np.flatnonzero(valid)
    if rows.size < 200:
        return None
    rows = rows[:: max(1, rows.size // MOST_ROWS)]
    y, at = target[rows], time[rows]
    scale = np.sqrt(np.mean(columns[rows] ** 2, axis=0))
    used = columns[:, scale > 0] / scale[scale > 0]
    curve = CubicSpline(time, used)
    power = float(np.sum((y - y.mean()) ** 2))
    if power == 0:
        return None

    def design_at(delay: float, every: int = 1) -> Array:
        return np.asarray(np.column_stack((curve(at[::every] - delay), np.ones(len(at[::every])))))

    def loss(delay: float, every: int = 1) -> float:
        """Squares left, by the normal equations: many delays are tried."""
        design, some = design_at(delay, every), y[::every]
        solved = np.linalg.lstsq(design.T @ design, design.T @ some, rcond=1e-12)[0]
        return float(np.sum((some - design @ solved) ** 2)) / power

    def solve(delay: float) -> tuple[Array, Array, Array]:
        design = design_at(delay)
        solved = np.linalg.lstsq(design, y, rcond=1e-9)[0]
        return np.asarray(solved), y - design @ solved, design

    count = max(1, int(np.ceil(within / step)))
    grid = np.linspace(-within, within, 2 * count + 1)
    best = _lowest(loss, grid, [loss(d, SCANNED) for d in grid])
    bounds = (max(best - step, -within), min(best + step, within))
    best = float(minimize_scalar(loss, bounds=bounds, method="bounded").x)
    solved, left, design = solve(best)
    tick = 0.1 * step
    slope = (solve(best + tick)[2] - design) @ solved / tick
    error = block_error(left, slope, design)
    coefficients = np.zeros(columns.shape[1])
    coefficients[scale > 0] = solved[:-1] / scale[scale > 0]
    return Delay(best, error, coefficients, 1 - loss(best), 1 - loss(0.0))


def _lowest(loss: Callable[[float], float], grid: Array, scanned: Sequence[float]) -> float:
    """Point of the grid that is lower than both beside it, downhill from the best of a scan."""
    known: dict[int, float] = {}
    here, best = int(np.argmin(scanned)), -1
    while here != best:
        best = here
        beside = range(max(best - 1, 0), min(best + 2, len(grid)))
        known |= {k: loss(float(grid[k])) for k in beside if k not in known}
        here = min(known, key=lambda k: known[k])
    return float(grid[best])


def block_error(left: Array, slope: Array, design: Array) -> float:
    """Standard error of the delay from blocks of time."""
    slope = slope - design @ np.linalg.lstsq(design, slope, rcond=1e-9)[0]
    edges = np.linspace(0, len(left), BLOCKS + 1).astype(int)[:-1]
    pull, weight = np.add.reduceat(slope * left, edges), float(np.sum(slope**2))
    return float(np.sqrt(np.sum(pull**2)) / weight) if weight > 0 else float("inf")


def solve_with_error(design: Array, target: Array) -> tuple[Array, Array]:
    """Coefficients and their standard errors from the jackknife over sixteen blocks of rows.

    Parameters
    ----------
    design : array (N, M), any units
    target : array (N,), any unit

    Returns
    -------
    Coefficients (M,) and errors (M,), in target unit per column unit.
    """
    scale = np.sqrt(np.mean(design**2, axis=0))
    scale[scale == 0] = 1.0
    scaled = design / scale
    edges = np.linspace(0, len(target), BLOCKS + 1).astype(int)
    grams = np.array([scaled[a:b].T @ scaled[a:b] for a, b in pairwise(edges)])
    rights = np.array([scaled[a:b].T @ target[a:b] for a, b in pairwise(edges)])
    whole = _solve(grams.sum(axis=0), rights.sum(axis=0))
    left_out = np.array(
        [
            _solve(grams.sum(axis=0) - g, rights.sum(axis=0) - r)
            for g, r in zip(grams, rights, strict=True)
        ]
    )
    spread = (BLOCKS - 1) / BLOCKS * np.sum((left_out - left_out.mean(axis=0)) ** 2, axis=0)
    return whole / scale, np.sqrt(spread) / scale


def _solve(gram: Array, right: Array) -> Array:
    """Minimum-norm solution: confounded columns share what they cannot tell apart."""
    return np.asarray(np.linalg.pinv(gram, rcond=1e-10, hermitian=True) @ right)


def with_shared_delays(logs: Sequence[Log], made: Sequence[Findings]) -> list[Findings]:
    """Return the findings with a delay told of all runs that have it, and of how many.

    That of a velocity behind its position, of a drive behind its motion, and of its position.

    Parameters
    ----------
    logs, made : the runs and what was found in each.
    """
    told = list(made)
    late = dict.fromkeys(PAIRS, (VELOCITY_DELAY, velocity_delay, late_velocity))
    late |= dict.fromkeys((*DRIVE, SENSOR), (TORQUE_DELAY, _delay_of_torque, _late_drive))
    late["output_position"] = POSITION_DELAY, _position_delay, _late_position
    for channel, (name, delay_of, finding_of) in late.items():
        beside = PAIRS.get(channel, "output_position")
        has = [k for k, log in enumerate(logs) if channel in log and beside in log]
        has = [k for k in has if not told[k].errors]
        found = {k: f for k in has for f in told[k].named(name)
                 if f.channel == channel and f.severity == "fault"}  # fmt: skip
        if found and len(found) < len(has):
            slack = ALIKE if channel in PAIRS else ALIKE_DRIVE
            delays = _Delays(channel, name, delay_of, finding_of, slack)
            _share(logs, told, delays, has, found)
    return told


def without_gains(logs: Sequence[Log], made: Sequence[Findings]) -> list[Findings]:
    """Return the findings without a sensor's unit beside its load that another run contradicts.

    A unit makes one factor of each run that was recorded in it, and one of all others. Where a run
    has neither, the sensor's gain differs from run to run, and that is for a fit to tell.

    Parameters
    ----------
    logs, made : the runs and what was found in each.
    """
    channel, name, told = "sensor_torque", "load_scale", list(made)
    found = {k: f for k, of_run in enumerate(told) for f in of_run.named(name)
             if f.channel == channel}  # fmt: skip
    sizes = [1.0, *(finding.size for finding in found.values())]
    others = (k for k in range(len(logs)) if found and k not in found and not told[k].errors)
    for factor in (_sensor_factor(emptied(logs[k]), channel) for k in others):
        slack = FACTOR_LIMIT + 2.0 * factor.error if factor is not None else np.inf
        if factor and all(abs(np.log(abs(factor.size) / size)) > slack for size in sizes):
            for k, finding in found.items():
                rest = [one for one in told[k] if one is not finding]
                told[k] = sorted_findings(told[k].log_name, rest, told[k].excited)
            break
    return told


def _sensor_factor(log: Log, channel: str) -> Factor | None:
    """What a sensor is times its load; None where the run does not tell."""
    motion = motion_of(log) if LOAD in log else None
    motion_of.cache_clear()  # it would keep the log
    if motion is None or not _both_ways(motion) or not _is_read(log, channel, motion):
        return None
    columns = motion_columns(log, motion)
    return _load_factor(log, channel, motion, columns, motion.smooth(log[channel]))


class _Delays(NamedTuple):
    """A delay of a channel: name of its finding, how a run tells it and how it is said.

    `slack`: share by which it may differ between runs of one recorder.
    """

    channel: str
    name: str
    of: Callable[[Log, str], Delay | None]
    finding: Callable[[Log, str, Delay, str], Finding]
    slack: float

    def alike(self, late: Delay, usual: float) -> bool:
        """Whether a delay may be the usual one."""
        return abs(late.seconds - usual) <= max(self.slack * abs(usual), 4 * late.error)


def _share(
    logs: Sequence[Log],
    told: list[Findings],
    delays: _Delays,
    has: Sequence[int],
    found: dict[int, Finding],
) -> None:
    """Tell the delay of a channel of all runs among `has` that have it as those of `found` do."""
    usual = float(np.median([finding.size for finding in found.values()]))
    late: dict[int, Delay | None] = {}
    for k in has:
        if k not in found:
            late[k] = delays.of(emptied(logs[k]), delays.channel)
            motion_of.cache_clear()  # it would keep the log
    also = {k: one for k, one in late.items() if one and is_delay(one) and delays.alike(one, usual)}
    open_ = [one is None or delays.alike(one, usual) for k, one in late.items() if k not in also]
    said = _of_how_many(len(found) + len(also), len(has), open_)
    for k, finding in found.items():
        mine = replace(finding, sentence=f"{finding.sentence}{said}")
        rest = [one for one in told[k] if one is not finding]
        told[k] = sorted_findings(told[k].log_name, [*rest, mine], told[k].excited)
    for k, one in also.items():
        rest = [note for note in told[k] if (note.name, note.channel) != delays[1::-1]]
        more = [*rest, delays.finding(logs[k], delays.channel, one, said)]
        told[k] = sorted_findings(told[k].log_name, more, told[k].excited)


def _of_how_many(seen: int, runs: int, open_: Sequence[bool]) -> str:
    """How many runs show a delay, and whether the others contradict it; "" where all do.

    `open_`: of each other run, whether it does not tell.
    """
    if seen == runs:
        return ""
    against = len(open_) - sum(open_)
    told = [f"{sum(open_)} do{'es' if sum(open_) == 1 else ''} not tell"] if any(open_) else []
    told += [f"{against} show{'s' if against == 1 else ''} another or none"] if against else []
    return f" Seen in {seen} of {runs} runs; of the others {' and '.join(told)}."
