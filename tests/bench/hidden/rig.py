"""Two joints and their runs: motion, load and temperatures, each at its own pace or all tied.

    rich: "swings" (three sines), "moves" (from point to point with rests, a velocity with noise)
    poor: "tied" (one sine, the load a function of the angle, the motor's torque one of the load)

The base is what a model knows: offset, Coulomb and viscous friction, inertia; of the torsion an
offset and the mesh, in the forms of the catalogue. What is hidden has other forms.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from gear import Geared
from numpy.typing import NDArray

__all__ = ["EXCITATIONS", "JOINTS", "LOAD", "RATE", "Array", "Joint", "Scene", "scene"]

Array = NDArray[np.float64]

RATE, SECONDS = 200.0, 20.0
LOAD = "reference_torque"
EXCITATIONS = {"swings": 5, "moves": 5, "tied": 3}
"""Runs of each kind of excitation; fewer than four are validated by blocks."""


@dataclass(frozen=True)
class Joint(Geared):
    """A joint's base: Nm, Nm·s/rad, kg·m² and rad/s at the output; stiffness in Nm/rad there.

    `link`: gravity of what a robot's joint carries, Nm; `torque_constant`: Nm/A at the motor.
    """

    gear_ratio: float
    output_spline: str
    pole_pairs: int
    offset: float
    coulomb: float
    viscous: float
    inertia: float
    width: float
    stiffness: float
    mesh_shape: float
    link: float
    torque_constant: float

    @property
    def facts(self) -> dict[str, str | float | int]:
        return {
            "gear_ratio": self.gear_ratio,
            "output_spline": self.output_spline,
            "pole_pairs": self.pole_pairs,
        }


JOINTS: Mapping[str, Joint] = {
    "small": Joint(100.0, "circular", 7, -0.12, 0.3, 0.15, 0.02, 0.03, 26431.0, 0.0487, 4.0, 0.04),
    "large": Joint(50.0, "flex", 10, 0.4, 1.1, 0.55, 0.12, 0.012, 9800.0, 0.08, 10.0, 0.1),
}


@dataclass(frozen=True)
class Scene:
    """What happens in one run, arrays (N,) in SI units at the output.

    `beta`: θ against the other spline, the angle of the second pair that turns with the motor.
    `transmitted`: load and inertia, what the gear carries. `measured_velocity`: v with jitter.
    `rate`: of its rows, Hz.
    """

    joint: Joint
    time: Array
    q: Array
    v: Array
    a: Array
    load: Array
    temperature: Array
    motor_torque: Array
    measured_velocity: Array = field(repr=False)
    rate: float = RATE

    @property
    def theta(self) -> Array:
        return self.joint.ratio * self.q

    @property
    def beta(self) -> Array:
        return (
            self.theta - self.q if self.joint.output_spline == "circular" else self.theta + self.q
        )

    @property
    def transmitted(self) -> Array:
        return self.load + self.joint.inertia * self.a

    @property
    def direction(self) -> Array:
        """The change of direction as the base has it."""
        return np.asarray(np.tanh(self.v / self.joint.width))

    @property
    def friction(self) -> Array:
        """Offset, Coulomb and viscous friction, inertia: Nm."""
        own = self.joint
        friction = own.coulomb * self.direction + own.viscous * self.v
        return np.asarray(own.offset + friction + own.inertia * self.a)

    @property
    def mesh(self) -> Array:
        """Torsion of the mesh, rad at the motor."""
        own = self.joint
        bent = np.arctan(own.mesh_shape * self.load) / own.mesh_shape
        return np.asarray(-own.ratio / own.stiffness * bent)

    @property
    def columns(self) -> dict[str, Array]:
        """The channels of a log, but those of the target."""
        return {
            "time": self.time,
            "output_position": self.q,
            "output_velocity": self.measured_velocity,
            "output_acceleration": self.a,
            "temperature": self.temperature,
            "motor_torque": self.motor_torque,
            LOAD: self.load,
        }


def scene(
    joint: Joint,
    excitation: str,
    seed: int,
    number: int,
    restless: float = 0.0,
    *,
    rate: float = RATE,
    seconds: float = SECONDS,
) -> Scene:
    """Return run `number` of a seed.

    `restless`: Nm that the noise of the measured velocity makes of friction where the joint rests.
    """
    generator = np.random.default_rng(
        [20261121, seed, number, sorted(EXCITATIONS).index(excitation)]
    )
    time = np.arange(round(rate * seconds)) / rate
    path = {"swings": _swings, "moves": _moves, "tied": _sine}[excitation]
    q, v, a = path(generator, time)
    shift = generator.uniform(0, 2 * np.pi, 6)
    free = 0.2 * np.sin(1.1 * time + shift[3]) + 0.1 * np.sin(4.3 * time + shift[5])
    if excitation == "tied":
        load, free = 6.0 * np.sin(q - 0.4), 0.03 * free
        temperature = 24.0 + 6.0 * -np.expm1(-time / 8.0) + 0.05 * number
    else:
        load = 5.0 * np.sin(0.7 * time + shift[0]) + 3.0 * np.sin(2.9 * time + shift[1])
        load = load + 1.5 * np.sin(9.7 * time + shift[2])
        warming = generator.uniform(2, 10) * -np.expm1(-time / generator.uniform(6, 20))
        temperature = generator.uniform(18, 36) + warming + np.sin(0.4 * time + shift[4])
    jitter = generator.normal(size=len(time)) * restless * joint.width / joint.coulomb
    motor = free + load / joint.ratio
    return Scene(joint, time, q, v, a, load, temperature, motor, v + jitter, rate)


def _swings(generator: np.random.Generator, time: Array) -> tuple[Array, Array, Array]:
    q, v, a = np.zeros((3, len(time)))
    for frequency, share in ((0.13, 1.0), (0.083, 0.6), (0.37, 0.35)):
        omega = 2 * np.pi * frequency * generator.uniform(0.85, 1.15)
        phase, size = generator.uniform(0, 2 * np.pi), share * generator.uniform(0.5, 1.1)
        q += size / omega * np.sin(omega * time + phase)
        v += size * np.cos(omega * time + phase)
        a -= size * omega * np.sin(omega * time + phase)
    return q + generator.uniform(-2, 2), v, a


def _moves(generator: np.random.Generator, time: Array) -> tuple[Array, Array, Array]:
    """Quintic moves between random angles, with rests."""
    q, v, a = np.zeros((3, len(time)))
    clock, here = -0.5, generator.uniform(-2, 2)
    q += here
    while clock < time[-1]:
        there = generator.uniform(-2.6, 2.6)
        span = max(abs(there - here) / generator.uniform(0.25, 1.1), 0.6)
        u = np.clip((time - clock) / span, 0.0, 1.0)
        q += (there - here) * u**3 * (10 - 15 * u + 6 * u**2)
        v += (there - here) / span * 30 * u**2 * (1 - u) ** 2
        a += (there - here) / span**2 * 60 * u * (1 - u) * (1 - 2 * u)
        clock, here = clock + span + generator.uniform(0.1, 0.6), there
    return q, v, a


def _sine(generator: np.random.Generator, time: Array) -> tuple[Array, Array, Array]:
    omega, phase = 2 * np.pi * 0.21 * generator.uniform(0.97, 1.03), generator.uniform(0, 6.3)
    size = 1.1 * generator.uniform(0.95, 1.05)
    swing = np.sin(omega * time + phase)
    return 0.3 + size * swing, size * omega * np.cos(omega * time + phase), -size * omega**2 * swing
