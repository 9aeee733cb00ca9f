"""Forward simulation against scipy.integrate.solve_ivp at equal accuracy, in one process.

    python tests/bench/simulation_speed.py              # half an hour; both tables
    python tests/bench/simulation_speed.py formula      # the one with torques as formulas

Two joints, both smooth, so that scipy has nothing to locate: the gear of the third paper between
two masses, and a rigid gear. Rows at three rates each, and for each the accuracies that one may
ask for. The torques come in two ways:

- recorded: columns of a log, linear between rows, for both. scipy's right-hand side looks them up
  in plain Python, the fastest way there is. This is what the simulation is for.
- formula: scipy gets them as formulas that are linear in time, so that it steps over rows; ours
  still gets columns, sees that they are straight lines, and goes over rows as well. The hardest
  comparison that could be thought of.

For each of our runs every method of solve_ivp is tried at falling tolerances until the largest
error of its rows is no larger than ours; the fastest one counts. Errors are those of the output's
angle at all rows, against DOP853 at 1e-13, started anew at every row where torques are recorded.
The right-hand sides in Python are plain arithmetic, without numpy. Seconds are of the process:
scipy once (best of three where a run takes less than 0.2 s), ours best, median and worst of 25.
Ratios are of scipy's best to our best, median and worst; the last one is RK45, the default method,
to our best. "longest" is our longest step, in rows. Recorded torques have a kink at every row,
where a step has to end, so that dense rows get more digits than were asked for. A last table gives
steps of fixed length per second.
"""

from __future__ import annotations

import argparse
import math
import time as clock
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from flexspline.simulation import Friction, Gear, Joint, Motor, Output, Start, Trajectory

Array = NDArray[np.float64]

METHODS = ("DOP853", "RK45", "Radau", "LSODA")
TOLERANCES = tuple(10.0**-k for k in range(3, 13))
ACCURACIES = (1e-5, 1e-7, 1e-9)
GEAR = Gear(100, mesh_stiffness=15548.0, mesh_shape=0.0487, damping=5.0)
OUTPUT = Output(inertia=0.5, gravity=20.0, friction=Friction(viscous=2.0, cubic=3.0))


Torque = Callable[[float], float]
Rate = Callable[[float, Sequence[float]], list[float]]


def two_mass(motor: Torque, load: Torque) -> Rate:
    def rate(t: float, y: Sequence[float]) -> list[float]:
        theta, q, omega, v = y
        mesh = math.tan((theta / 101 - q) * 0.0487 * 15548.0) / 0.0487
        out = mesh + 5.0 * (omega / 101 - v)
        on_output = out - 20 * math.sin(q) - 2 * v - 3 * v**3 - load(t)
        return [omega, v, (motor(t) - out / 101 - 1e-4 * omega) / 1e-4, on_output / 0.5]

    return rate


def one_mass(motor: Torque, load: Torque) -> Rate:
    def rate(t: float, y: Sequence[float]) -> list[float]:
        q, v = y
        on_output = -20 * math.sin(q) - 2 * v - 3 * v**3 - load(t)
        return [v, (101 * (motor(t) - 1e-4 * 101 * v) + on_output) / (0.5 + 101**2 * 1e-4)]

    return rate


def column(values: Array, rate: int) -> Torque:
    """A recorded torque, linear between rows."""
    heights = values.tolist()
    rises = np.diff(values).tolist()
    last = len(rises) - 1

    def at(t: float) -> float:
        x = t * rate
        row = min(int(x), last)
        return float(heights[row] + (x - row) * rises[row])

    return at


@dataclass(frozen=True)
class Case:
    """A joint, the same in Python, its start, which state is q, seconds, rows per second."""

    name: str
    joint: Joint
    equation: Callable[[Torque, Torque], Rate]
    start: tuple[float, ...]
    output: int
    seconds: float
    rates: tuple[int, ...]


@dataclass(frozen=True)
class Drive:
    """Torques of motor and load at the rows, and how scipy reads them."""

    time: Array
    motor: Array
    load: Array
    rate: Rate
    recorded: bool


def drive(case: Case, rate: int, recorded: bool) -> Drive:
    time = np.arange(round(case.seconds * rate) + 1) / rate
    if not recorded:
        equation = case.equation(lambda t: 0.3 - 0.02 * t, lambda t: 5.0 - 0.2 * t)
        return Drive(time, 0.3 - 0.02 * time, 5.0 - 0.2 * time, equation, False)
    motor = 0.3 + 0.1 * np.sin(3 * time) + 0.05 * np.sin(11 * time)
    load = 5.0 + 2.0 * np.sin(2 * time + 1)
    return Drive(time, motor, load, case.equation(column(motor, rate), column(load, rate)), True)


ROTOR = Motor(inertia=1e-4, friction=Friction(viscous=1e-4))
MESH, RIGID = Joint(GEAR, ROTOR, OUTPUT), Joint(Gear(100), ROTOR, OUTPUT)
CASES = (
    Case("two masses, stiffening mesh", MESH, two_mass, (30.32, 0.3, 0, 0), 1, 5.0,
         (100, 250, 1000)),
    Case("rigid gear, one mass", RIGID, one_mass, (0.3, 0.0), 0, 20.0, (25, 100, 1000)),
)  # fmt: skip


def spent(run: Callable[[], object], times: int) -> Array:
    """Seconds of the process for each run."""
    seconds = []
    for _ in range(times):
        start = clock.process_time()
        run()
        seconds.append(clock.process_time() - start)
    return np.array(seconds)


def theirs(case: Case, given: Drive, method: str, tolerance: float) -> Array:
    warnings.simplefilter("ignore", RuntimeWarning)  # loose tolerances overflow in v³
    done = solve_ivp(
        given.rate,
        (0.0, given.time[-1]),
        case.start,
        method,
        t_eval=given.time,
        rtol=tolerance,
        atol=tolerance * 1e-2,
    )
    return np.asarray(done.y[case.output])


def reference(case: Case, given: Drive) -> Array:
    """The output's angle at the rows, as exactly as it goes."""
    if not given.recorded:
        return theirs(case, given, "DOP853", 1e-13)
    y: Array = np.array(case.start, dtype=float)
    made = [y]
    for ends in pairwise(given.time):
        y = solve_ivp(given.rate, ends, y, "DOP853", rtol=1e-13, atol=1e-15).y[:, -1]
        made.append(y)
    return np.array(made)[:, case.output]


class Rivals:
    """Errors and seconds of solve_ivp on one grid of rows, each worked out once."""

    def __init__(self, case: Case, given: Drive) -> None:
        self.case, self.given = case, given
        self.reference = reference(case, given)
        self._known: dict[tuple[str, float], tuple[float, float]] = {}

    def result(self, method: str, tolerance: float) -> tuple[float, float]:
        """Largest error, and seconds of one run."""
        key = (method, tolerance)
        if key not in self._known:
            begun = clock.process_time()
            got = theirs(self.case, self.given, method, tolerance)
            seconds = clock.process_time() - begun
            whole = len(got) == len(self.reference)
            error = float(np.max(np.abs(got - self.reference))) if whole else math.inf
            self._known[key] = (error, seconds)
        return self._known[key]

    def seconds(self, method: str, tolerance: float) -> float:
        once = self.result(method, tolerance)[1]
        if once > 0.2:
            return once
        run = spent(lambda: theirs(self.case, self.given, method, tolerance), 3)
        return float(run.min())

    def as_good(self, error: float) -> dict[str, tuple[float, str]]:
        """Seconds and name of each method with at most this error."""
        found = {}
        for method in METHODS:
            for tolerance in TOLERANCES:
                if self.result(method, tolerance)[0] <= error:
                    seconds = self.seconds(method, tolerance)
                    found[method] = (seconds, f"{method} {tolerance:.0e}")
                    break
        return found


def ours(case: Case, given: Drive, accuracy: float) -> Trajectory:
    return case.joint.simulate(
        given.time,
        motor_torque=given.motor,
        load_torque=given.load,
        start=Start(output_position=0.3, motor_position=30.32),
        accuracy=accuracy,
        channels=["output_position"],
    )


def compare(case: Case, rate: int, recorded: bool) -> list[float]:
    given = drive(case, rate, recorded)
    ratios = []
    rivals = Rivals(case, given)
    for accuracy in ACCURACIES:
        run = ours(case, given, accuracy)
        longest = run.longest_step / (given.time[1] - given.time[0])
        error = float(np.max(np.abs(run["output_position"] - rivals.reference)))
        times = spent(lambda a=accuracy: ours(case, given, a), 25)
        least, middle, most = times.min(), np.median(times), times.max()
        found = rivals.as_good(error)
        seconds, who = min(found.values(), default=(math.nan, "none as good"))
        usual = found.get("RK45", (math.nan, ""))[0] / least
        ratios.append(seconds / middle)
        print(
            f"{case.name:<28}{rate:>6}{longest:>8.1f}{accuracy:>9.0e}{error:>10.1e}"
            f"{1e3 * least:>8.2f}{1e3 * middle:>8.2f}{1e3 * most:>8.2f}"
            f"{1e3 * seconds:>9.1f}  {who:<14}{seconds / least:>6.0f}{ratios[-1]:>7.0f}"
            f"{seconds / most:>7.0f}{usual:>7.0f}",
            flush=True,
        )
    return ratios


def steps_per_second() -> None:
    friction = Friction.both_ways(2.0, stribeck=1.0, viscous=3.0, load=0.03)
    lost = replace(GEAR, wave_generator_stiffness=21.9931, wave_generator_shape=3.125)
    rotor = replace(ROTOR, friction=friction.at_motor(101))
    output = replace(OUTPUT, friction=friction)
    linear = Gear(100, mesh_stiffness=15548.0)
    slow = replace(ROTOR, friction=Friction.both_ways(0.02, viscous=3e-4))
    held = Output(inertia=0.5, friction=Friction.both_ways(2.0, viscous=3.0))
    joints = {
        "two masses, linear spring": Joint(linear, Motor(inertia=1e-4), Output(inertia=0.5)),
        "two masses, Coulomb and viscous": Joint(linear, slow, held),
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

        times = spent(run, 5)
        least, most = times.min(), times.max()
        count = 20 * (len(time) - 1) / 1e6
        print(f"{name:<34}{count / least:>8.2f}{count / most:>8.2f}")


def table(recorded: bool) -> None:
    print(f"\ntorques: {'recorded' if recorded else 'formula'}")
    print(
        f"{'':<28}{'rows':>6}{'longest':>8}{'asked':>9}{'error':>10}{'ours':>8}{'median':>8}"
        f"{'worst':>8}{'scipy':>9}  {'method':<14}{'ratio':>6}{'median':>7}{'worst':>7}{'RK45':>7}"
    )
    print(f"{'':<28}{'a s':>6}{'rows':>8}{'':>9}{'rad':>10}{'ms':>8}{'ms':>8}{'ms':>8}{'ms':>9}")
    ratios = [r for case in CASES for rate in case.rates for r in compare(case, rate, recorded)]
    none = sum(math.isnan(r) for r in ratios)
    print(
        f"scipy / our median: median {np.nanmedian(ratios):.0f}, worst {np.nanmin(ratios):.0f}, "
        f"in {none} of {len(ratios)} rows no method gets as exact"
    )


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("torques", nargs="*", choices=["recorded", "formula", []])
    for torques in parser.parse_args().torques or ("recorded", "formula"):
        table(recorded=torques == "recorded")
    steps_per_second()


if __name__ == "__main__":
    main()
