"""Does a run contain what the effects asked for need? Channels, motion, load, temperature, rate.

A missing channel is an error, for the effect cannot be computed. A run that does not excite the
effect is a note: it may be one of several runs that do together.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.integrate import cumulative_trapezoid

from flexspline.effects import CATALOGUE
from flexspline.errors import InputError, did_you_mean, listed
from flexspline.logs.checks.findings import Finding
from flexspline.logs.checks.motion import Motion, motion_of
from flexspline.logs.checks.needs import (
    Need,
    acceleration,
    both_directions,
    both_torques,
    changing,
    lasting,
    low_speeds,
    own_or_known_load,
    sampled,
    speeds,
    teeth,
    there_and_back,
    turn_of,
)
from flexspline.logs.log import Log

TARGETS = ("sensor_torque", "motor_torque", "motor_current", "torsion")


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


MOVES = ("output_position or output_velocity",)
ANGLE = ("output_position",)
BOTH_ANGLES = ("output_position", "motor_position")
HEAT = ("temperature", "output_position or output_velocity")
KNOWN = ("reference_torque",)
LOAD = ("reference_torque or output_position or output_velocity",)
WARM = changing("temperature", 2.0, "°C")
LOADED = changing("reference_torque", 0.0, "Nm")

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
