"""Effects of a joint as MuJoCo's passive DC motors, which have no winding and no control.

An actuator `dcmotor` with input="none" and motorconst="0 0" has two torques on its joint, and any
number of such actuators may act on one. MuJoCo has it so from version 4 on. Its formulas are those
of "MuJoCo DC Motor Model" (https://mujoco.readthedocs.io/en/latest/_static/dcmotor.pdf).

Cogging, of one order each:

    τ = A sin(p q + φ)

which is an order of a ripple that turns with the joint, with the motor or with the wave generator.

LuGre friction, z the stretch of a bristle:

    τ = −σ₀ z,    dz/dt = v − σ₀ |v| z / g(v),    g(v) = F_c + (F_s − F_c) exp(−(v / v_s)²)

In steady motion that is g(v) sgn(v): Stribeck's friction with F_c = 0 and F_s its level, where the
speed is far above direction_width. Coulomb friction stays the joint's frictionloss, so that it
counts once, and `PATH`, from which σ₀ comes, hardly shows.

With F_s = F_c = c and σ₀ = c / w it is a spring of presliding friction, of level c and width w,
that gives way gradually: after a reversal it has 1 − 2 exp(−x / w) of its level, where the spring
has x / w − 1 until it slips at 2 w. Both take the same energy. Swung to and fro below its level the
bristle creeps, and the spring does not.

σ₁, the bristle's damping, is zero: with it LuGre friction can drive a joint where F_c is zero.
"""

from __future__ import annotations

import importlib.metadata
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from flexspline.effects import Effect
from flexspline.effects.causes import (
    COGGING,
    MOTOR_RIPPLES,
    OUTPUT_RIPPLE,
    PRESLIDING,
    SPRINGS,
    STRIBECK,
)
from flexspline.exporting.header import by_motor_encoder
from flexspline.logs.log import Log
from flexspline.logs.segments import runs
from flexspline.model import Model, Part
from flexspline.signals import gear_of

__all__ = ["LUGRE", "PassiveMotor", "has_dcmotor", "motors_of"]

Array = NDArray[np.float64]

LUGRE = "lugre"  # MuJoCo's attribute; that of a ripple has the name of the effect, COGGING
PACKAGES = ("mujoco", "mujoco-core")  # either brings the module
FIRST = 4  # version of MuJoCo whose dcmotor may lack a winding
PATH = 1e-5
"""rad, over which Stribeck's friction builds up after a reversal: less than an encoder resolves.
From 1e-4 to 1e-8 the motion of six joints is the same within a few mrad at MuJoCo's timestep of
2 ms and at 0.5 ms; at 1e-3 it is off by up to 0.6 rad."""
MOST_DECAY = 500.0  # of the exponents of one sum, which stay below the largest double, e^709


@dataclass(frozen=True)
class PassiveMotor:
    """One dcmotor: `values` of its `kind`, COGGING or LUGRE, as MJCF has them.

    `effect`: whose torque it is; `part`: which of the effect's orders or springs.
    `level` [Nm], `width` [rad]: of a spring of presliding friction; else zero.
    """

    effect: str
    part: str
    kind: str
    values: tuple[float, ...]
    level: float = 0.0
    width: float = 0.0


@dataclass(frozen=True, eq=False)
class Motors:
    """What dcmotors take of an effect.

    `taken`, (P,): of its coefficients. `largest` [Nm]: by which their torque is off right after a
    reversal, zero where it is the effect's own; `why` says how. `hinders` says why none can.
    """

    made: tuple[PassiveMotor, ...] = ()
    taken: Array = field(default_factory=lambda: np.zeros(0))
    largest: float = 0.0
    why: str = ""
    hinders: str = ""

    def torque(self, log: Log) -> Array:
        """Return what the bristles of presliding friction brake with along a run, (N,) Nm."""
        total = np.zeros(len(log))
        for motor in self.made:
            if motor.width:
                total += motor.level * _stretch(log, motor.width)
        return total


def has_dcmotor() -> bool:
    """Whether the MuJoCo of this Python has passive dcmotors; it is not imported."""
    for package in PACKAGES:
        try:
            major = importlib.metadata.version(package).partition(".")[0]
        except importlib.metadata.PackageNotFoundError:
            continue
        return major.isdigit() and int(major) >= FIRST
    return False


def motors_of(model: Model, part: Part, effect: Effect, nm: Array) -> Motors:
    """Return the dcmotors of an effect whose coefficients, (P,), are in Nm at the output."""
    nothing = np.zeros(len(nm))
    if effect.name in (OUTPUT_RIPPLE, *MOTOR_RIPPLES):
        if _lacks_ratio(model, part, effect):
            return Motors(taken=nothing, hinders="a dcmotor turns with the joint: no gear_ratio")
        return Motors(tuple(_ripple(model, effect, nm)), nm)
    if effect.name == STRIBECK and nm[0] > 0.0:
        level, fades = float(nm[0]), effect.shapes["stribeck_velocity"]
        made = PassiveMotor(effect.name, "", LUGRE, (level / PATH, 0.0, 0.0, level, fades))
        return Motors((made,), nm)
    if effect.name == PRESLIDING and (nm > 0.0).any():
        return _springs(effect, np.maximum(nm, 0.0))
    return Motors(taken=nothing)


def _lacks_ratio(model: Model, part: Part, effect: Effect) -> bool:
    """Whether a ripple turns with a motor whose angle the joint's does not tell."""
    of_motor = "motor_position" in effect.reads and by_motor_encoder(part)
    return of_motor and "gear_ratio" not in model.facts


def _ripple(model: Model, effect: Effect, nm: Array) -> Iterator[PassiveMotor]:
    gear = gear_of(model.facts, motor_encoder=False)
    ratio, output = float(gear["effective_ratio"]), gear["output_spline"]
    turns = {  # of a pair for one of the output, as in gear.hpp
        "output_on_housing": 1.0,
        "motor_on_stator": ratio,
        "wave_generator_on_flexspline": ratio + (output == "flex"),
        "wave_generator_on_circular_spline": ratio - (output == "circular"),
    }
    for (order, pair), (cosine, sine) in zip(effect.harmonics, nm.reshape(-1, 2), strict=True):
        amplitude = float(np.hypot(cosine, sine))
        if amplitude > 0.0:  # the model's torque is what the drive takes, the motor's what it gives
            values = (amplitude, order * turns[pair], float(np.arctan2(-cosine, -sine)))
            label = f"{order} {pair}" if pair != effect.info.pairs[0] else str(order)
            yield PassiveMotor(effect.name, label, COGGING, values)


def _springs(effect: Effect, levels: Array) -> Motors:
    widths = effect.shapes["presliding_width"] / SPRINGS
    made = tuple(
        PassiveMotor(
            effect.name,
            term.name,
            LUGRE,
            (float(level / width), 0.0, float(level), float(level), 1.0),
            float(level),
            float(width),
        )
        for term, level, width in zip(effect.terms, levels, widths, strict=True)
        if level > 0.0
    )
    x = np.linspace(0.0, 4.0 * widths[0], 4001)[:, None] / widths
    off = (np.minimum(x - 1.0, 1.0) - (1.0 - 2.0 * np.exp(-x))) @ levels
    why = "gives way gradually instead of slipping: so far off after a reversal, and it creeps"
    return Motors(made, levels, float(np.abs(off).max()), why)


def _stretch(log: Log, width: float) -> Array:
    """The stretch of a bristle along the angle of a run, (N,), as a share of the largest.

    z ← z e^(−|Δq|/w) + sgn(Δq) (1 − e^(−|Δq|/w)), from zero at the first row and behind each gap.
    """
    share = np.zeros(len(log))
    for first, last in runs(log["time"]):
        angle = log["output_position"][first:last]
        moved = np.diff(angle, prepend=angle[:1]) / width
        moved[~np.isfinite(moved)] = 0.0
        far = np.cumsum(np.abs(moved))
        pull = np.sign(moved) * -np.expm1(-np.abs(moved))
        start, z = 0, 0.0
        while start < len(moved):
            stop = max(start + 1, int(np.searchsorted(far, far[start] + MOST_DECAY)))
            decay = far[start:stop] - far[start]
            here = np.exp(-decay) * np.cumsum(pull[start:stop] * np.exp(decay))
            here += z * np.exp(-np.abs(moved[start]) - decay)
            share[first + start : first + stop] = here
            start, z = stop, float(here[-1])
    return share
