"""Forward simulation against scipy.integrate.solve_ivp at equal accuracy, in one process.

    python tests/bench/simulation_speed.py

Two joints, both smooth, so that scipy has nothing to locate: the gear of the third paper between
two masses, and a rigid gear. For each of our step lengths, every method of solve_ivp is tried at
falling tolerances until the largest error of its rows is no larger than ours; the fastest one
counts. Errors are those of the output's angle at all rows, against DOP853 at 1e-13; rows lie as far
apart as our longest step. The right-hand side in Python is plain arithmetic, without numpy. Times
are of the process, best of three for scipy; ours best and worst of five. The last column
is the ratio for RK45, the default method. A last table gives steps per second.
"""

from __future__ import annotations

import math
import time as clock
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from flexspline.simulation import Friction, Gear, Joint, Motor, Output, Start

Array = NDArray[np.float64]

METHODS = ("DOP853", "RK45", "Radau", "LSODA")
TOLERANCES = tuple(10.0**-k for k in range(3, 13))
STEPS = (1, 2, 4)
GEAR = Gear(100, mesh_stiffness=15548.0, mesh_shape=0.0487, damping=5.0)
OUTPUT = Output(inertia=0.5, gravity=20.0, friction=Friction(viscous=2.0, cubic=3.0))


def two_mass(t: float, y: Sequence[float]) -> list[float]:
    theta, q, omega, v = y
    mesh = math.tan((theta / 101 - q) * 0.0487 * 15548.0) / 0.0487
    out = mesh + 5.0 * (omega / 101 - v)
    on_output = out - 20 * math.sin(q) - 2 * v - 3 * v**3 - (5.0 - 0.2 * t)
    return [omega, v, (0.3 - 0.02 * t - out / 101 - 1e-4 * omega) / 1e-4, on_output / 0.5]


def one_mass(t: float, y: Sequence[float]) -> list[float]:
    q, v = y
    on_output = -20 * math.sin(q) - 2 * v - 3 * v**3 - (5.0 - 0.2 * t)
    return [v, (101 * (0.3 - 0.02 * t - 1e-4 * 101 * v) + on_output) / (0.5 + 101**2 * 1e-4)]


@dataclass(frozen=True)
class Case:
    """A joint, the same in Python, its start, which state is q, seconds and rows per second."""

    name: str
    joint: Joint
    rate: Callable[[float, Sequence[float]], list[float]]
    start: tuple[float, ...]
    output: int
    seconds: float
    rate_of_rows: float

    @property
    def time(self) -> Array:
        return np.arange(round(self.seconds * self.rate_of_rows) + 1) / self.rate_of_rows


ROTOR = Motor(inertia=1e-4, friction=Friction(viscous=1e-4))
CASES = (
    Case(
        "two masses, stiffening mesh",
        Joint(GEAR, ROTOR, OUTPUT),
        two_mass,
        (30.32, 0.3, 0, 0),
        1,
        5.0,
        250.0,
    ),
    Case(
        "rigid gear, one mass", Joint(Gear(100), ROTOR, OUTPUT), one_mass, (0.3, 0.0), 0, 20.0, 25.0
    ),
)


def best(run: Callable[[], object], times: int) -> tuple[float, float]:
    """Seconds of the process: least and most."""
    spent = []
    for _ in range(times):
        start = clock.process_time()
        run()
        spent.append(clock.process_time() - start)
    return min(spent), max(spent)


def theirs(case: Case, method: str, tolerance: float) -> Array:
    warnings.simplefilter("ignore", RuntimeWarning)  # loose tolerances overflow in v³
    done = solve_ivp(
        case.rate,
        (0.0, case.time[-1]),
        case.start,
        method,
        t_eval=case.time,
        rtol=tolerance,
        atol=tolerance * 1e-2,
    )
    return np.asarray(done.y[case.output])


def as_good(case: Case, reference: Array, error: float) -> dict[str, tuple[float, str]]:
    """Seconds and name of each method of scipy with at most this error."""
    found = {}
    for method in METHODS:
        for tolerance in TOLERANCES:
            got = theirs(case, method, tolerance)
            if len(got) == len(reference) and np.max(np.abs(got - reference)) <= error:
                spent, _ = best(lambda m=method, k=tolerance: theirs(case, m, k), 3)
                found[method] = (spent, f"{method} {tolerance:.0e}")
                break
    return found


def compare(case: Case) -> list[float]:
    start, time = Start(output_position=0.3, motor_position=30.32), case.time
    done = solve_ivp(
        case.rate,
        (0, case.time[-1]),
        case.start,
        "DOP853",
        t_eval=case.time,
        rtol=1e-13,
        atol=1e-15,
    )
    reference, ratios = done.y[case.output], []
    for steps in STEPS:

        def run(n: int = steps) -> Array:
            return case.joint.simulate(
                time,
                motor_torque=0.3 - 0.02 * time,
                load_torque=5.0 - 0.2 * time,
                start=start,
                steps_per_sample=n,
                channels=["output_position"],
            )["output_position"]

        error = float(np.max(np.abs(run() - reference)))
        least, most = best(run, 5)
        found = as_good(case, reference, error)
        seconds, who = min(found.values(), default=(math.nan, "none"))
        usual = found.get("RK45", (math.nan, ""))[0] / least
        ratios.append(seconds / least)
        print(
            f"{case.name:<28}{steps:>6}{error:>11.1e}{1e3 * least:>9.2f}{1e3 * most:>9.2f}"
            f"{1e3 * seconds:>10.1f}  {who:<14}{ratios[-1]:>7.0f}{seconds / most:>8.0f}"
            f"{usual:>8.0f}"
        )
    return ratios


def steps_per_second() -> None:
    friction = Friction.both_ways(2.0, stribeck=1.0, viscous=3.0, load=0.03)
    lost = replace(GEAR, wave_generator_stiffness=21.9931, wave_generator_shape=3.125)
    rotor = replace(ROTOR, friction=friction.at_motor(101))
    output = replace(OUTPUT, friction=friction)
    linear = Gear(100, mesh_stiffness=15548.0)
    joints = {
        "two masses, linear spring": Joint(linear, Motor(inertia=1e-4), Output(inertia=0.5)),
        "two masses, Coulomb and viscous": Joint(
            linear,
            replace(ROTOR, friction=Friction.both_ways(0.02, viscous=3e-4)),
            Output(inertia=0.5, friction=Friction.both_ways(2.0, viscous=3.0)),
        ),
        "two masses, stiffening mesh": CASES[0].joint,
        "two masses, everything": Joint(lost, rotor, output),
        "one mass, all friction": Joint(Gear(100), rotor, output),
    }
    time = np.arange(20001) / 1000.0
    torque = 0.4 * np.sign(np.sin(time))
    print(f"\n{'million steps per second':<34}{'best':>8}{'worst':>8}")
    for name, joint in joints.items():

        def run(one: Joint = joint) -> object:
            return one.simulate(
                time, motor_torque=torque, steps_per_sample=20, channels=["output_position"]
            )

        least, most = best(run, 5)
        count = 20 * (len(time) - 1) / 1e6
        print(f"{name:<34}{count / least:>8.2f}{count / most:>8.2f}")


def main() -> None:
    print(
        f"{'':<28}{'steps':>6}{'error':>11}{'ours':>9}{'worst':>9}{'scipy':>10}  {'method':<14}"
        f"{'ratio':>7}{'worst':>8}{'RK45':>8}"
    )
    print(f"{'':<28}{'a row':>6}{'rad':>11}{'ms':>9}{'ms':>9}{'ms':>10}")
    ratios = [ratio for case in CASES for ratio in compare(case)]
    print(f"scipy / ours: median {np.nanmedian(ratios):.0f}, worst {np.nanmin(ratios):.0f}")
    steps_per_second()


if __name__ == "__main__":
    main()
