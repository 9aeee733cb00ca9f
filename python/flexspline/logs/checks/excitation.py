"""Whether a run contains what given effects need: channels, motion, load, temperature, rate.

A missing channel is an error, for the effect cannot be computed. A run that does not excite the
effect is a note: it may be one of several runs that do together. What an effect reads and demands
it declares itself (`effects/effect.hpp`); here is what each demand means of a log: a need looks at
a log and its motion and returns None, or the amount found and what to record.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from flexspline.effects import CATALOGUE, EffectInfo
from flexspline.errors import InputError, did_you_mean, listed
from flexspline.logs.checks.findings import Finding
from flexspline.logs.checks.motion import Motion, motion_of
from flexspline.logs.log import Log
from flexspline.logs.quantisation import white_noise
from flexspline.logs.splitting import ROWS_PER_UNKNOWN

TARGETS = ("sensor_torque", "motor_torque", "motor_current", "torsion")

POSITION, MOTOR, KNOWN = "output_position", "motor_position", "reference_torque"
MOTION = "output_position or output_velocity"
DRIVE = "motor_torque or motor_current"
FROM_LOG = {
    "output_velocity": MOTION,
    "output_acceleration": f"{POSITION} or output_acceleration",
    "motor_position": f"{POSITION} or {MOTOR}",
    "motor_torque": DRIVE,
    "load": f"{KNOWN} or {MOTION}",
}
"""What a log may give a channel of the core by, where that is not the channel itself."""
ALWAYS = ("period", "time")

Lack = tuple[float, str, str, str]
"""Size, its unit, what the run lacks, what to record."""

Need = Callable[[Log, Motion | None], Lack | None]


def channels_asked(info: EffectInfo) -> tuple[str, ...]:
    """Channels that a log must have for an effect, each one or an alternative ("a or b").

    Which of several paths drives an effect is its user's choice, so none of them is asked for. The
    load of a torsion is one from outside: the joint's own mass is no part of its model.
    """
    of_torsion = info.targets == "D"
    asked = [POSITION, MOTOR] if of_torsion else []
    paths = {channel for channel, _ in info.paths}
    for channel in info.reads:
        if channel not in paths and channel not in ALWAYS:
            known = channel == "load" and (info.traits.known_load or of_torsion)
            asked.append(KNOWN if known else FROM_LOG.get(channel, channel))
    return tuple(dict.fromkeys(asked))


def excitation(log: Log, effects: Sequence[str], target: str | None) -> Iterator[Finding]:
    """Missing channels and lacking excitation for these effects and this target."""
    if target is not None:
        yield from _target(log, target)
    if not effects:
        return
    motion = motion_of(_with_position(log))
    if len(log) < ROWS_PER_UNKNOWN * (len(effects) + 1) or log.duration < 1.0:
        yield Finding(
            "too_short",
            "note",
            "time",
            (0, len(log)),
            log.duration,
            "s",
            f"the run has {len(log)} rows in {log.duration:.3g} s, little for "
            f"{len(effects)} effect{'' if len(effects) == 1 else 's'}.",
            "Record a longer run, or fit several together.",
        )
    for effect in effects:
        yield from _effect(log, effect, motion)


def _with_position(log: Log) -> Log:
    """The log with the integral of its velocity as position, where it has no position."""
    from scipy.integrate import cumulative_trapezoid

    if "output_position" in log or "output_velocity" not in log:
        return log
    path = cumulative_trapezoid(np.nan_to_num(log["output_velocity"]), log["time"], initial=0.0)
    return log.with_columns({"output_position": path}, note="position integrated from velocity")


def _target(log: Log, target: str) -> Iterator[Finding]:
    if target not in TARGETS:
        raise InputError(
            f"'{target}' is no target{did_you_mean(target, TARGETS)}; the targets are "
            f"{listed(TARGETS)}"
        )
    needed = ("output_position", "motor_position") if target == "torsion" else (target,)
    for channel in needed:
        if channel not in log:
            yield _missing(log, channel, f"the target {target}")


def _effect(log: Log, effect: str, motion: Motion | None) -> Iterator[Finding]:
    if effect not in CATALOGUE:
        raise InputError(
            f"'{effect}' is no effect{did_you_mean(effect, CATALOGUE)}; the effects are "
            f"{listed(CATALOGUE, most=40)}"
        )
    info = CATALOGUE[effect]
    channels = channels_asked(info)
    for channel in channels:
        if not any(name in log for name in channel.split(" or ")):
            yield _missing(log, channel, effect)
            return
    for demand, amount in info.demands:
        need, shown_in = NEEDS[demand]
        lack = need(amount)(log, motion)
        if lack is not None:
            size, unit, what, remedy = lack
            yield Finding(
                "no_excitation",
                "note",
                shown_in or next(iter(channels), "time"),
                (0, len(log)),
                size,
                unit,
                f"{effect} is hardly excited: {what}.",
                remedy,
            )
            return


def _missing(log: Log, channel: str, what: str) -> Finding:
    return Finding(
        "missing_channel",
        "error",
        channel,
        (0, len(log)),
        0.0,
        "",
        f"{what} needs {channel}, which is not in the log.",
        "Map it when reading, or leave the effect out.",
    )


def changing(channel: str, least: float, unit: str) -> Need:
    """A channel that spans at least this much."""

    def need(log: Log, _: Motion | None) -> Lack | None:
        names = [name for name in channel.split(" or ") if name in log]
        span = max((float(np.nanmax(log[n]) - np.nanmin(log[n])) for n in names), default=0.0)
        if span > least:
            return None
        return (
            span,
            unit,
            f"{listed(names)} changes by {span:.3g} {unit} only",
            f"Record a run in which {listed(names)} changes by more than {least:g} {unit}.",
        )

    return need


LOADED = changing(KNOWN, 0.0, "Nm")


def both_directions(log: Log, motion: Motion | None) -> Lack | None:
    """A tenth of the moving rows at least in each direction."""
    if motion is None:
        return 0.0, "rad/s", "the joint does not move", "Record a run that moves both ways."
    limit = 0.05 * float(np.percentile(np.abs(motion.velocity), 95))
    moving = motion.velocity[np.abs(motion.velocity) > limit]
    share = float(np.mean(moving > 0)) if moving.size else 0.0
    less = min(share, 1 - share)
    if less >= 0.1:
        return None
    return (
        less,
        "",
        f"{100 * max(share, 1 - share):.0f} % of the moving rows go one way, where a "
        "level of friction is an offset",
        "Record a run that moves both ways.",
    )


def speeds(ratio: float) -> Need:
    """Moving rows whose speeds span this ratio (10 % to 90 % of them)."""

    def need(log: Log, motion: Motion | None) -> Lack | None:
        if motion is None:
            return 0.0, "rad/s", "the joint does not move", "Record a run that moves."
        speed = np.abs(motion.velocity)
        moving = speed[speed > 0.02 * np.percentile(speed, 99)]
        low, high = (float(x) for x in np.percentile(moving, (10, 90)))
        if high >= ratio * low:
            return None
        return (
            high,
            "rad/s",
            f"the speeds lie between {low:.3g} and {high:.3g} rad/s, a factor "
            f"of {ratio:g} is needed",
            "Record several speeds.",
        )

    return need


def low_speeds(log: Log, motion: Motion | None) -> Lack | None:
    """One row in a hundred at least that moves at less than a fifth of the top speed."""
    if motion is None:
        return 0.0, "rad/s", "the joint does not move", "Record a run that moves slowly."
    speed = np.abs(motion.velocity)
    top = float(np.percentile(speed, 99))
    share = float(np.mean((speed > 0.01 * top) & (speed < 0.2 * top)))
    if share >= 0.01:
        return None
    return (
        share,
        "",
        f"only {100 * share:.2g} % of the rows move slower than {0.2 * top:.3g} rad/s",
        "Record low speeds beside high ones.",
    )


def acceleration(log: Log, motion: Motion | None) -> Lack | None:
    """An acceleration well above what the noise of the position makes of it."""
    if motion is None:
        return 0.0, "rad/s²", "the joint does not move", "Record a run that accelerates."
    size = float(np.sqrt(np.mean(motion.acceleration**2)))
    # (noise of q̈)² = noise² step ∫ (2πf)⁴ G² df = noise² · step · 2 (2π)⁴ 0.554 B⁵, see local_fit
    step = float(np.median(np.diff(motion.time)))
    gain = np.sqrt(2 * (2 * np.pi) ** 4 * 0.554 * motion.bandwidth**5 * step)
    noise = float(gain) * white_noise(motion.position)
    speed = float(np.sqrt(np.mean(motion.velocity**2)))
    if size > 5 * noise and size * float(motion.time[-1] - motion.time[0]) > speed:
        return None
    return (
        size,
        "rad/s²",
        f"the acceleration is {size:.3g} rad/s² RMS, of which noise makes {noise:.3g}",
        "Record a run that accelerates.",
    )


def turn_of(share: float) -> Need:
    """At least this share of an output turn."""

    def need(log: Log, motion: Motion | None) -> Lack | None:
        reach = float(np.ptp(motion.position)) if motion is not None else 0.0
        if reach >= 2 * np.pi * share * 0.98:
            return None
        return (
            reach,
            "rad",
            f"the output covers {reach / (2 * np.pi):.2g} of a turn, where its "
            "low harmonics look like each other and like an offset",
            f"Record at least {share:g} turn, or expect wide intervals.",
        )

    return need


def sampled(order_of: Callable[[Log, float], float | None]) -> Need:
    """Ripple of the lowest order of an effect, per turn of the output, below half the rate."""

    def need(log: Log, motion: Motion | None) -> Lack | None:
        if motion is None:
            return 0.0, "rad/s", "the joint does not move", "Record a run that moves."
        ratio = log.effective_ratio
        if ratio is None:
            return 0.0, "", "no gear ratio is stated", "State gear_ratio."
        order = order_of(log, ratio)
        if order is None:
            return 0.0, "", "the number of pole pairs is not stated", "State pole_pairs."
        fast = np.abs(motion.velocity) * order / (2 * np.pi) > 0.5 * log.rate
        share = float(np.mean(fast))
        if share < 0.1:
            return None
        return (
            share,
            "",
            f"order {order:.4g} per turn is above half the rate of {log.rate:.4g} "
            f"Hz in {100 * share:.0f} % of the rows",
            "Record faster, or move slower.",
        )

    return need


def own_or_known_load(log: Log, motion: Motion | None) -> Lack | None:
    """A known torque that changes, else motion: inertia and gravity of the model are a load too."""
    if KNOWN in log:
        return LOADED(log, motion)
    if motion is not None:
        return None
    return 0.0, "Nm", "neither a known torque nor motion loads it", "Record a run under load."


def both_torques(log: Log, _: Motion | None) -> Lack | None:
    """A known torque that takes both signs, each in a tenth of the rows at least."""
    share = float(np.mean(log[KNOWN] > 0.0))
    less = min(share, 1.0 - share)
    if less >= 0.1:
        return None
    return (
        less,
        "",
        f"the known torque has one sign in {100 * max(share, 1 - share):.0f} % of the rows, where "
        "a dead zone is an offset",
        "Record a run that loads the joint both ways.",
    )


def there_and_back(log: Log, motion: Motion | None) -> Lack | None:
    """A known torque that rises and falls over at least a tenth of its way, else motion both ways.

    The way is counted over a few hundred means, so that noise is no way.
    """
    if KNOWN not in log:
        return both_directions(log, motion)
    load = log[KNOWN]
    means = np.array([part.mean() for part in np.array_split(load, min(200, len(load)))])
    steps = np.diff(means)
    up, down = float(steps[steps > 0].sum()), float(-steps[steps < 0].sum())
    less, way = min(up, down), up + down
    if less > 0.1 * way:
        return None
    return (
        less,
        "Nm",
        f"the known torque goes {max(up, down):.3g} Nm one way and {less:.3g} Nm back",
        "Record a run that loads and unloads.",
    )


def lasting(seconds: float) -> Need:
    """A run of at least this length."""

    def need(log: Log, _: Motion | None) -> Lack | None:
        if log.duration >= seconds:
            return None
        return (
            log.duration,
            "s",
            f"the run lasts {log.duration:.3g} s",
            f"Record {seconds:g} s or more.",
        )

    return need


def teeth(log: Log, ratio: float) -> float | None:
    """Lowest order of cogging per turn of the output; None where the pole pairs are not stated."""
    return ratio * float(log.facts["pole_pairs"]) if "pole_pairs" in log.facts else None


NEEDS: dict[str, tuple[Callable[[float], Need], str]] = {
    "both_directions": (lambda _: both_directions, ""),
    "speed_ratio": (speeds, ""),
    "low_speeds": (lambda _: low_speeds, ""),
    "acceleration": (lambda _: acceleration, ""),
    "turn": (turn_of, ""),
    "resolved_order": (lambda amount: sampled(lambda _, ratio: amount * ratio), ""),
    "resolved_poles": (lambda _: sampled(teeth), ""),
    "temperature": (lambda amount: changing("temperature", amount, "°C"), "temperature"),
    "duration": (lasting, "time"),
    "known_load": (lambda _: LOADED, KNOWN),
    "any_load": (lambda _: own_or_known_load, ""),
    "both_torques": (lambda _: both_torques, KNOWN),
    "there_and_back": (lambda _: there_and_back, ""),
    "motor_torque": (lambda _: changing(DRIVE, 0.0, ""), DRIVE),
}
"""What an effect may demand of a run, by the amount, and the channel that lacks it: "", the first
that the effect reads."""
