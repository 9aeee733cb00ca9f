"""Whether a run contains what given effects need: channels, motion, load, temperature, rate.

A missing channel is an error, for the effect cannot be computed. A run that does not excite the
effect is a note: it may be one of several runs that do together. A need looks at a log and its
motion and returns None, or the amount found and what to record.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.integrate import cumulative_trapezoid

from flexspline.effects import CATALOGUE
from flexspline.errors import InputError, did_you_mean, listed
from flexspline.logs.checks.findings import Finding
from flexspline.logs.checks.motion import Motion, motion_of
from flexspline.logs.log import Log
from flexspline.logs.quantisation import white_noise

TARGETS = ("sensor_torque", "motor_torque", "motor_current", "torsion")

MOVES = ("output_position or output_velocity",)
ANGLE = ("output_position",)
BOTH_ANGLES = ("output_position", "motor_position")
HEAT = ("temperature", "output_position or output_velocity")
KNOWN = ("reference_torque",)
LOAD = ("reference_torque or output_position or output_velocity",)

Lack = tuple[float, str, str, str]
"""Size, its unit, what the run lacks, what to record."""

Need = Callable[[Log, Motion | None], Lack | None]


@dataclass(frozen=True)
class Asked:
    """What an effect asks of a run: channels (each one or an alternative) and excitation."""

    channels: tuple[str, ...] = ()
    needs: tuple[Need, ...] = ()


def excitation(log: Log, effects: Sequence[str], target: str | None) -> Iterator[Finding]:
    """Missing channels and lacking excitation for these effects and this target."""
    if target is not None:
        yield from _target(log, target)
    if not effects:
        return
    motion = motion_of(_with_position(log))
    if len(log) < 20 * (len(effects) + 1) or log.duration < 1.0:
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
    known = {**EFFECTS, **dict.fromkeys(CATALOGUE.keys() - EFFECTS.keys(), Asked())}
    if effect not in known:
        raise InputError(
            f"'{effect}' is no effect{did_you_mean(effect, known)}; the effects are "
            f"{listed(known, most=40)}"
        )
    asked = known[effect]
    for channel in asked.channels:
        if not any(name in log for name in channel.split(" or ")):
            yield _missing(log, channel, effect)
            return
    for need in asked.needs:
        lack = need(log, motion)
        if lack is not None:
            size, unit, what, remedy = lack
            yield Finding(
                "no_excitation",
                "note",
                asked.channels[0] if asked.channels else "time",
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


WARM = changing("temperature", 2.0, "°C")
LOADED = changing("reference_torque", 0.0, "Nm")


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
    """Ripple of the lowest order of an effect below half the rate."""

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
    if "reference_torque" in log:
        return changing("reference_torque", 0.0, "Nm")(log, motion)
    if motion is not None:
        return None
    return 0.0, "Nm", "neither a known torque nor motion loads it", "Record a run under load."


def both_torques(log: Log, _: Motion | None) -> Lack | None:
    """A known torque that takes both signs, each in a tenth of the rows at least."""
    share = float(np.mean(log["reference_torque"] > 0.0))
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
    if "reference_torque" not in log:
        return both_directions(log, motion)
    load = log["reference_torque"]
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


EFFECTS: dict[str, Asked] = {
    "offset": Asked(),
    "coulomb_friction": Asked(MOVES, (both_directions,)),
    "coulomb_friction_per_direction": Asked(MOVES, (both_directions,)),
    "viscous_friction": Asked(MOVES, (speeds(1.5),)),
    "direction_dependent_friction": Asked(MOVES, (both_directions, speeds(1.5))),
    "nonlinear_viscous_friction": Asked(MOVES, (speeds(3.0),)),
    "stribeck_friction": Asked(MOVES, (both_directions, low_speeds)),
    "presliding_friction": Asked(ANGLE, (both_directions,)),
    "load_dependent_friction": Asked(MOVES, (both_directions,)),
    "temperature_dependent_friction": Asked(HEAT, (WARM, speeds(1.5))),
    "position_dependent_friction": Asked(ANGLE, (both_directions,)),
    "inertia": Asked(MOVES, (acceleration,)),
    "gravity": Asked(ANGLE, (turn_of(0.5),)),
    "output_ripple": Asked(ANGLE, (turn_of(1.0),)),
    "wave_generator_ripple": Asked(ANGLE, (sampled(lambda _, ratio: 2 * ratio),)),
    "speed_dependent_ripple": Asked(ANGLE, (speeds(1.5), sampled(lambda _, ratio: 2 * ratio))),
    "cogging": Asked(ANGLE, (sampled(teeth),)),
    "temperature_drift": Asked(("temperature",), (WARM,)),
    "thermal_gradient_drift": Asked(("temperature",), (WARM,)),
    "time_drift": Asked((), (lasting(60.0),)),
    "gain_error": Asked(KNOWN, (LOADED,)),
    "gain_temperature_dependence": Asked((*LOAD, "temperature"), (own_or_known_load, WARM)),
    "sensor_nonlinearity": Asked(LOAD, (own_or_known_load,)),
    "torque_hysteresis": Asked(LOAD, (own_or_known_load, there_and_back)),
    "motor_crosstalk": Asked(
        ("motor_current or motor_torque",), (changing("motor_current or motor_torque", 0.0, ""),)
    ),
    "sensor_lag": Asked(LOAD, (own_or_known_load,)),
    "torque_constant_error": Asked(KNOWN, (LOADED,)),
    "mesh_compliance": Asked((*BOTH_ANGLES, *KNOWN), (LOADED,)),
    "wave_generator_compliance": Asked(
        (*BOTH_ANGLES, "motor_torque or motor_current"),
        (changing("motor_torque or motor_current", 0.0, ""),),
    ),
    "kinematic_error": Asked(BOTH_ANGLES, (turn_of(1.0),)),
    "torsional_hysteresis": Asked(BOTH_ANGLES, (there_and_back,)),
    "backlash": Asked((*BOTH_ANGLES, *KNOWN), (both_torques,)),
    "temperature_dependent_stiffness": Asked((*BOTH_ANGLES, *KNOWN, "temperature"), (LOADED, WARM)),
}
"""What effects ask of a run. An effect of the catalogue that is not here asks nothing more than
the channels it reads."""
