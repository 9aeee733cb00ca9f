"""The joint of the third paper: Tables II and III, and what they do not print.

Ranges and where they come from: the head of `full_range.py`.
"""

from __future__ import annotations

import numpy as np

from flexspline.simulation import (
    Friction,
    Gear,
    Harmonic,
    Joint,
    Motor,
    Output,
    SlipElement,
    Thermal,
)

__all__ = ["COULOMB", "INERTIA", "KINEMATIC_ERROR", "RATIO", "VISCOUS", "drawn_joint", "harmonic"]

RATIO = 100.0
INERTIA = 1.9221  # kg m², rotor and link at the output
COULOMB = (5.1586, 5.7429)  # Nm, forward and backward
VISCOUS = (10.3207, -5.1580, 1.2135)  # Nm (s/rad)^k
STIFFNESS, SHAPE = 26431.0, 0.0487  # of c2: Nm/rad, 1/Nm
WAVE_GENERATOR = (21.9931, 3.1250)  # Nm/rad, 1/Nm at the motor
SLIPS = (50e-6, 150e-6, 300e-6)  # rad at the output
OUTPUT, CIRCULAR = "output_on_housing", "wave_generator_on_circular_spline"
FLEX = "wave_generator_on_flexspline"

#: Table III: order, pair, amplitude [rad at the motor], phase of (23).
KINEMATIC_ERROR = (
    Harmonic(1, 0.5725e-3, -0.9089, OUTPUT),
    Harmonic(2, 3.0897e-3, 1.7965, OUTPUT),
    Harmonic(4, 2.5476e-3, -1.3968, OUTPUT),
    Harmonic(1, 0.4770e-3, -0.9092, CIRCULAR),
    Harmonic(1, 0.1289e-3, -1.2547, FLEX),
    Harmonic(2, 4.3530e-3, 2.2575, CIRCULAR),
    Harmonic(201, 0.6327e-3, -2.5073, OUTPUT),
    Harmonic(2, 0.7937e-3, 1.7018, FLEX),
    Harmonic(4, 2.3372e-3, 0.8252, CIRCULAR),
    Harmonic(4, 0.1693e-3, 0.9262, FLEX),
)


def drawn_joint(rng: np.random.Generator, temperature: float) -> Joint:
    """Return a joint whose friction is that of Table II at a temperature [°C]."""
    ratio = RATIO + 1.0
    bearings, load = rng.uniform(0.1, 0.5), rng.uniform(0.01, 0.06)
    fades = {
        "coulomb_fade": rng.uniform(0.002, 0.008),
        "viscous_fade": rng.uniform(0.01, 0.025),
        "reference_temperature": temperature,
    }
    forward, backward = ((1.0 - load) * level - bearings for level in COULOMB)
    drive = Friction(
        forward,
        backward,
        load,
        load,
        stribeck=rng.uniform(0.2, 1.0),
        stribeck_velocity=rng.uniform(0.02, 0.1),
        viscous=VISCOUS[0],
        quadratic=VISCOUS[1],
        cubic=VISCOUS[2],
        **fades,
    )
    rotor = INERTIA * rng.uniform(0.65, 0.9)
    motor = Motor(
        inertia=rotor / ratio**2,
        friction=drive.at_motor(ratio),
        current_ripple=[harmonic(rng, 24, 0.5e-3, 3e-3, "motor_on_stator")],
        cogging=[harmonic(rng, int(rng.choice([36, 48, 60])), 1e-3, 4e-3, "motor_on_stator")],
    )
    return Joint(
        _gear(rng),
        motor,
        Output(inertia=INERTIA - rotor, friction=Friction.both_ways(bearings, **fades)),
        Thermal(300.0, 900.0, motor_to_body=1.5, motor_to_room=0.3, body_to_room=1.0),
        name="UR joint size 2.5",
    )


def _gear(rng: np.random.Generator) -> Gear:
    stiffness = STIFFNESS * rng.uniform(0.95, 1.05)
    levels = rng.uniform(0.4, 1.9) * rng.dirichlet(np.full(len(SLIPS), 4.0))
    return Gear(
        RATIO,
        "circular",
        mesh_stiffness=stiffness,
        mesh_shape=SHAPE * rng.uniform(0.9, 1.1),
        wave_generator_stiffness=WAVE_GENERATOR[0] / rng.uniform(0.3, 1.0),
        wave_generator_shape=WAVE_GENERATOR[1],
        damping=rng.uniform(3.0, 12.0),
        kinematic_error=KINEMATIC_ERROR,
        hysteresis=[
            SlipElement(float(z / x), float(z)) for z, x in zip(levels, SLIPS, strict=True)
        ],
    )


def harmonic(
    rng: np.random.Generator, order: int, least: float, most: float, pair: str = OUTPUT
) -> Harmonic:
    """Return a harmonic of a size drawn between two, of any phase."""
    return Harmonic(order, rng.uniform(least, most), rng.uniform(-np.pi, np.pi), pair)
