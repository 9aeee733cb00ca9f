"""A joint driven by hand, made by its equations: what the third paper's rig records.

The motor's side turns by a profile of bumps with stops between; the outside gives what friction
and inertia ask for (τ_m ≈ 0), and pushes less than friction while the motor's side stands. The
output gives way by the mesh, so it moves a little where the motor's side does not. More physics
than the models under test: a friction level that drifts and grows with load, torsional
hysteresis, and encoders with a resolution.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.ndimage import gaussian_filter1d

from flexspline.effects import effect
from flexspline.full_range import GearCompliance, torsion_part
from flexspline.logs.log import Log
from flexspline.model import Model
from flexspline.part import Part
from flexspline.rigs import play

Array = NDArray[np.float64]

FACTS = {"joint": "hand-driven joint", "gear_ratio": 100.0, "output_spline": "circular"}
RATIO = 101.0
LINK_INERTIA, ROTOR_INERTIA = 0.7, 1.2e-4  # kg m², at the output; at the motor
INERTIA = LINK_INERTIA + RATIO**2 * ROTOR_INERTIA
GEAR = GearCompliance(26431.0, 0.0487, 21.9931, 3.1250)
COULOMB, VISCOUS, WIDTH = 5.4, 8.0, 0.01
ERROR = {(2, "output_on_housing"): 3.1e-3, (2, "wave_generator_on_circular_spline"): 4.3e-3}
RATE = 500.0


@dataclass(frozen=True)
class Rig:
    """One run and what went in: Nm outward, rad at the motor."""

    log: Log
    external: Array
    mesh_torque: Array


def rig(seed: int, *, pushes: int = 8, extra: bool = True) -> Rig:
    """Return a run of `pushes` motions and as many pushes at rest; `extra`: physics unknown."""
    rng = np.random.default_rng(seed)
    rows = int(RATE * 3.0 * pushes)
    time = np.arange(rows) / RATE
    speed, at_rest = np.zeros(rows), np.zeros(rows)
    for k in range(pushes):
        start = int(RATE * 3.0 * k)
        moving = slice(start + int(0.4 * RATE), start + int(1.6 * RATE))
        still = slice(start + int(1.9 * RATE), start + int(2.9 * RATE))
        speed[moving] = rng.uniform(0.1, 0.9) * rng.choice([-1, 1]) * _bump(moving)
        at_rest[still] = rng.uniform(1.0, 4.8) * rng.choice([-1, 1]) * _bump(still)
    level = COULOMB * (1 + (0.12 * np.sin(2 * np.pi * time / 40.0 + seed) if extra else 0.0))
    friction = level * np.tanh(speed / 1e-3) + VISCOUS * speed
    turned = RATIO**2 * ROTOR_INERTIA * np.gradient(speed, time)
    through = gaussian_filter1d(at_rest - friction - turned, 0.02 * RATE)
    torsion = (
        -RATIO * np.arctan(GEAR.mesh_shape * through) / (GEAR.mesh_shape * GEAR.mesh_stiffness)
    )
    if extra:
        torsion = torsion + 2e-3 * (play(through, 0.5) - through)
    driven = cumulative_trapezoid(speed, time, initial=0.0) + rng.uniform(0, 2 * np.pi)
    for (order, pair), size in ERROR.items():
        turns = driven if pair == "output_on_housing" else 100.0 * driven
        torsion = torsion + size * np.cos(order * turns + 0.7)
    output = driven + torsion / RATIO
    acceleration = np.gradient(np.gradient(output, time), time)
    external = through - LINK_INERTIA * acceleration
    motor_torque = rng.normal(0.0, 1e-3, rows)
    motor = RATIO * driven
    return Rig(_log(time, output, motor, motor_torque, external, rng, seed), external, through)


def model(*, stiffness: float = GEAR.mesh_stiffness) -> Model:
    """The model under test: friction (21), inertia; compliance (15), (16), kinematic error."""
    drive = Part(
        "motor_torque",
        (
            effect("inertia"),
            effect("coulomb_friction", direction_width=WIDTH),
            effect("viscous_friction"),
        ),
        np.array([INERTIA, COULOMB, VISCOUS]),
    )
    gear = GearCompliance(stiffness, *list(vars(GEAR).values())[1:])
    return Model({"drive": drive, "torsion": _with_error(torsion_part(gear, RATIO))}, dict(FACTS))


def _with_error(part: Part) -> Part:
    orders = tuple(sorted(ERROR, key=lambda harmonic: (harmonic[1], harmonic[0])))
    error = effect("kinematic_error", orders=orders)
    values = [x for o in orders for x in (ERROR[o] * np.cos(0.7), -ERROR[o] * np.sin(0.7))]
    coefficients = np.concatenate([part.coefficients, values])
    return Part("torsion", (*part.effects, error), coefficients, part.known_load, part.record)


def _bump(rows: slice) -> Array:
    count = rows.stop - rows.start
    return np.asarray(np.sin(np.pi * np.arange(count) / count) ** 2)


def _log(
    time: Array,
    output: Array,
    motor: Array,
    motor_torque: Array,
    external: Array,
    rng: np.random.Generator,
    seed: int,
) -> Log:
    step, motor_step = 2 * np.pi / 2**19, 2 * np.pi / 2**14
    velocity = gaussian_filter1d(np.gradient(output, time), 0.008 * RATE)
    return Log.from_arrays(
        facts={**FACTS, "name": f"hand {seed}"},
        time=time,
        output_position=step * np.round(output / step),
        motor_position=motor_step * np.round(motor / motor_step),
        output_velocity=velocity + rng.normal(0.0, 2e-4, len(time)),
        motor_velocity=np.gradient(motor, time),
        motor_torque=motor_torque,
        reference_torque=external + rng.normal(0.0, 0.02, len(time)),
    )
