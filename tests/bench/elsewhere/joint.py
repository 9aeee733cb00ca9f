"""Which effects a seed hides, and in what joint.

This simulator was written without sight of the package's code and of `tests/bench/hidden`, to see
whether names are right beyond the forms on which the package was developed. It has other forms
(Dahl, LuGre, Bouc-Wen, Lorentzian and exponential Stribeck curves, shear thinning, exponential
temperature laws), other orders of ripple (2, 3, 5, 8 and twice these), other motions, and brakes
and springs as load. A case is told right by the rule of that benchmark: the set of names is the set
hidden, and a declared alias, in a list of at most three, counts.

Even seeds are rigs in a laboratory, with a load cell and both encoders; odd seeds are joints of a
robot, with gravity, one encoder and a motor current. Of every six cases of either kind one hides
nothing, one a cause without a name, and four hide one or two effects of the catalogue. All that is
random comes from one generator; another order of draws is another set of cases.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from gear import Geared
from numpy.random import Generator

from elsewhere.parts import TURNS

__all__ = ["UNKNOWN", "Deal", "Joint", "dealt", "drawn"]

UNKNOWN = "?"  # begins the name of a cause that the catalogue lacks

POOLS = {
    "sensor_torque": (
        "stribeck_friction", "gain_error", "torque_hysteresis", "output_ripple",
        "temperature_drift", "presliding_friction", "sensor_lag", "wave_generator_ripple",
        "sensor_nonlinearity", "load_dependent_friction", "thermal_gradient_drift",
        "nonlinear_viscous_friction", "gain_temperature_dependence", "position_dependent_friction",
        "motor_crosstalk", "time_drift", "temperature_dependent_friction",
        "speed_dependent_ripple", "gravity",
    ),
    "motor_torque": (
        "load_dependent_friction", "stribeck_friction", "cogging", "torque_constant_error",
        "temperature_dependent_friction", "output_ripple", "presliding_friction",
        "nonlinear_viscous_friction", "wave_generator_ripple", "position_dependent_friction",
        "speed_dependent_ripple", "gravity", "inertia",
    ),
    "motor_current": (
        "stribeck_friction", "temperature_dependent_friction", "output_ripple",
        "load_dependent_friction", "wave_generator_ripple", "nonlinear_viscous_friction",
        "presliding_friction", "position_dependent_friction", "cogging", "gravity", "inertia",
        "viscous_friction", "speed_dependent_ripple",
    ),
}  # fmt: skip
"""Effects of the catalogue that are hidden, by target, in the order of their turn."""

CAUSES = {
    "lab": ("load_times_speed", "angle2_times_temperature", "bump_at_an_angle",
            "friction_with_acceleration", "load_times_sin_angle"),
    "robot": ("gravity_times_speed", "angle2_times_temperature", "bump_at_an_angle",
              "friction_with_acceleration"),
}  # fmt: skip

MOTORS = ((7, 12), (10, 12), (4, 6), (8, 9), (11, 24))  # pole pairs, slots


@dataclass(frozen=True)
class Deal:
    """What a seed stands for; `kind`: "lab" or "robot"."""

    seed: int
    kind: str
    target: str
    hidden: tuple[str, ...]

    @property
    def lab(self) -> bool:
        return self.kind == "lab"

    @property
    def thermal(self) -> bool:
        return any("temper" in name or "thermal" in name for name in self.hidden)

    def hides(self, *names: str) -> bool:
        return not {*names}.isdisjoint(self.hidden)


def dealt(seed: int, rng: Generator) -> Deal:
    kind, turn = ("robot" if seed % 2 else "lab"), seed // 2
    target = "motor_current" if seed % 2 else (
        "sensor_torque" if turn % 5 < 3 else "motor_torque")  # fmt: skip
    cycle, slot = divmod(turn, 6)
    if slot == 0:
        return Deal(seed, kind, target, ())
    if slot == 1:
        return Deal(seed, kind, target, (UNKNOWN + CAUSES[kind][cycle % len(CAUSES[kind])],))
    pool = POOLS[target]
    first = pool[(cycle * 4 + slot - 2) * (1 if seed % 2 else 5) % len(pool)]
    if slot == 2 or (slot == 3 and cycle % 2 == 0):
        others = [name for name in pool if name not in (first, "viscous_friction")]
        return Deal(seed, kind, target, (first, others[int(rng.integers(len(others)))]))
    return Deal(seed, kind, target, (first,))


@dataclass(frozen=True)
class Joint(Geared):
    """A joint, how it is moved, and how fast it is recorded; SI units at the output.

    `refined`: steps of the fine grid between two rows. `mesh_error`: of the gear's transmission,
    rad. `width`, `turn`: rad/s and number of the form in which friction turns. `asymmetry`: share
    by which friction is higher forward. `load`: largest external torque of a rig; `link`,
    `link_angle`: gravity of what a robot's joint carries. `widely`: whether temperatures differ.
    """

    gear_ratio: float
    output_spline: str
    rate: float
    runs: int
    speed: float
    acceleration: float
    reach: float
    pole_pairs: int
    slots: int
    stiffness: float
    mesh_error: float
    width: float = 0.0
    turn: int = 0
    asymmetry: float = 0.0
    load: float = 0.0
    link: float = 0.0
    link_angle: float = 0.0
    inertia: float = 0.0
    coulomb: float = 0.0
    viscous: float = 0.0
    offset: float = 0.0
    torque_constant: float = 0.0
    inertia_known: bool = True
    thermometer: bool = False
    widely: bool = False

    @property
    def largest(self) -> float:
        """Torque from outside, Nm, that others are compared with."""
        return self.link or self.load

    @property
    def refined(self) -> int:
        return 4 if self.rate <= 500 else 2

    @property
    def step(self) -> float:
        """Of the fine grid, s."""
        return 1 / self.rate / self.refined


def drawn(deal: Deal, rng: Generator) -> Joint:
    """Draw the joint of a deal."""
    joint = _turning(_drive(deal, rng), rng)
    load = rng.uniform(15, 80)
    link = 0.0 if deal.lab else rng.uniform(5, 40)
    link_angle, inertia = rng.uniform(-np.pi, np.pi), rng.uniform(0.02, 0.3)
    if not deal.lab:
        inertia = link / 9.81 * rng.uniform(0.2, 0.5) + rng.uniform(0.1, 0.5)
    sizes = {
        "sensor_torque": rng.uniform(0.01, 0.04) * load,
        "motor_torque": rng.uniform(0.05, 0.15) * load,
        "motor_current": rng.uniform(0.15, 0.5) * link,
    }
    coulomb = sizes[deal.target]
    viscous = coulomb * rng.uniform(0.4, 1.5) / joint.speed
    offset, torque_constant = rng.normal() * coulomb * 0.3, rng.uniform(0.05, 0.2)
    known = deal.target != "sensor_torque" or rng.random() < 0.5
    return replace(
        joint, load=load, link=link, link_angle=link_angle, inertia=inertia if known else 0.0,
        coulomb=coulomb, viscous=viscous, offset=offset, torque_constant=torque_constant,
        inertia_known=known,
        thermometer=deal.thermal or rng.random() < (0.9 if deal.lab else 0.4),
        widely=deal.thermal or rng.random() < 0.5,
    )  # fmt: skip


def _turning(joint: Joint, rng: Generator) -> Joint:
    """A joint whose friction turns in one of TURNS, and in half of all cases differs by side."""
    width = rng.uniform(0.004, 0.02) * (1 if joint.speed < 1.5 else 1.5)
    turn, sided = int(rng.integers(len(TURNS))), rng.random() < 0.5
    share = float(rng.uniform(0.025, 0.075) * rng.choice([-1, 1])) if sided else 0.0
    return replace(joint, width=width, turn=turn, asymmetry=share)


def _drive(deal: Deal, rng: Generator) -> Joint:
    """A joint as yet without friction and load."""
    gear_ratio = float(rng.choice([50, 80, 100, 120, 160]))
    spline = "circular" if rng.random() < 0.4 else "flex"
    rate = float(rng.choice([250, 500, 1000] if deal.lab else [100, 125, 250, 500]))
    runs = int(rng.integers(3, 7))
    speed = rng.uniform(0.5, 2.5) * (0.5 if deal.hides("cogging") else 1)
    acceleration = speed * rng.uniform(3, 10)
    reach = rng.uniform(0.4, 3) if deal.lab else rng.uniform(0.6, 2.5)
    pole_pairs, slots = MOTORS[int(rng.integers(len(MOTORS)))]
    gear = np.random.default_rng([deal.seed, 778])
    stiffness, mesh_error = gear.uniform(8e3, 3e4), gear.uniform(1e-5, 1e-4)
    return Joint(gear_ratio, spline, rate, runs, speed, acceleration, reach, pole_pairs, slots,
                 stiffness, mesh_error)  # fmt: skip
