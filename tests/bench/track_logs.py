"""Six kinds of wear, from the motor to what `track` says: simulated runs, fitted one by one.

    python tests/bench/track_logs.py [--joints 2] [--seed 1] [--kinds coulomb,zero] [--out DIR]

A joint turns, or is loaded, once a week for a year and a half, and from some week on one thing in
it wears at a constant rate. The physics is the joint simulation's, with more in it than is fitted:
friction sticks, fades with temperature and differs from week to week by 3 % (grease), the zero by
0.03 Nm (mounting), the room by its season; the recorder rounds and adds coloured noise. Backlash is
laid over the simulated torsion, as the simulation has none. Runs are fitted with the shapes that
the first tells; no session is looked at before. `--out` keeps the histories for another look.
"""

from __future__ import annotations

import argparse
import time
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flexspline import simulation as sim
from flexspline.logs.log import Log
from flexspline.tracking import History, history_of, track

Sizes = dict[str, float]
Array = NDArray[np.float64]

WEEKS = 78
RATIO = 101.0
FIRST = datetime(2026, 3, 2)
FACTS = {"gear_ratio": 100, "output_spline": "circular"}
RATES = {  # a year, of what it was at first; of the zero Nm
    "coulomb": 0.3,
    "load": 0.4,
    "ripple": 0.8,
    "zero": 0.2,
    "stiffness": 0.1,
    "backlash": 0.5,
}
NAMES = {
    "coulomb": "coulomb_friction.level",
    "load": "load_dependent_friction.factor",
    "ripple": "output_ripple, order 2",
    "zero": "offset.offset",
    "stiffness": "mesh_compliance.compliance",
    "backlash": "backlash.half_gap",
}
DRIVE = [
    "offset", "coulomb_friction", "viscous_friction", "stribeck_friction",
    "load_dependent_friction", "gravity", "inertia", "output_ripple",
]  # fmt: skip
TORSION = ["offset", "mesh_compliance", "backlash", "kinematic_error"]


def drive(rng: np.random.Generator, made: Sizes, worn: Sizes, room: float) -> Log:
    """Return a run that turns under a load."""
    friction = sim.Friction.both_ways(
        made["coulomb"] * (1.0 + worn["coulomb"]) * rng.normal(1.0, 0.03),
        load=made["load"] * (1.0 + worn["load"]),
        viscous=made["viscous"] * rng.normal(1.0, 0.04),
        stribeck=0.2,
        stribeck_velocity=0.08,
        coulomb_fade=0.003,
        viscous_fade=0.015,
    )
    ripple = (
        sim.Harmonic(2, made["ripple"] * (1.0 + worn["ripple"]), 0.7),
        sim.Harmonic(5, 0.03, 0.2),
    )
    joint = sim.Joint(
        sim.Gear(100.0, "circular"),
        sim.Motor(inertia=1e-4),
        sim.Output(inertia=0.5, gravity=6.0, gravity_angle=0.3, friction=friction, ripple=ripple),
    )
    t = np.arange(0.0, 60.0, 1.0 / 200.0)
    q = 2.0 * np.sin(2.0 * np.pi * t / 20.0) * (1.0 + 0.3 * np.sin(2.0 * np.pi * t / 7.0))
    load = 8.0 * np.sin(2.0 * np.pi * t / 11.0 + 1.0) + 3.0 * np.sin(2.0 * np.pi * t / 3.7)
    log = _servoed(joint, t, q, load, room).log(
        output_encoder=sim.Encoder(19),
        noise={"motor_torque": sim.Noise(0.1 / RATIO, 0.02), "reference_torque": sim.Noise(0.02)},
        seed=int(rng.integers(1 << 30)),
        facts=FACTS,
        channels=("output_position", "motor_torque", "reference_torque", "temperature"),
    )
    zero = 0.05 + worn["zero"] + rng.normal(0.0, 0.03) + 0.004 * (room - 25.0)
    return log.with_columns({"motor_torque": log["motor_torque"] + zero / RATIO}, note="zero")


def torsion(rng: np.random.Generator, made: Sizes, worn: Sizes, room: float) -> Log:
    """Return a run whose motor holds or creeps while the load rises and falls."""
    softer = (1.0 - worn["stiffness"]) * (1.0 - 4e-4 * (room - 25.0))
    joint = sim.Joint(
        sim.Gear(
            100.0,
            "circular",
            mesh_stiffness=made["stiffness"] * softer,
            mesh_shape=0.03,
            damping=40.0,
            kinematic_error=(sim.Harmonic(2, 3e-3, 1.8), sim.Harmonic(4, 2.5e-3, -1.4)),
        ),
        sim.Motor(inertia=1e-4, friction=sim.Friction.both_ways(0.01)),
        sim.Output(inertia=0.5, friction=sim.Friction.both_ways(0.05)),
    )
    t = np.arange(0.0, 60.0, 1.0 / 200.0)
    q = 1.5 * np.sin(2.0 * np.pi * t / 60.0)
    load = 25.0 * np.sin(2.0 * np.pi * t / 9.0) + 8.0 * np.sin(2.0 * np.pi * t / 2.3)
    log = _servoed(joint, t, q, load, room).log(
        output_encoder=sim.Encoder(22),
        motor_encoder=sim.Encoder(16),
        noise={"reference_torque": sim.Noise(0.05)},
        seed=int(rng.integers(1 << 30)),
        facts=FACTS,
        channels=("output_position", "motor_position", "reference_torque", "temperature"),
    )
    gap = made["backlash"] * (1.0 + worn["backlash"]) * rng.normal(1.0, 0.02)
    dead = gap * np.tanh(load / 1.0) + rng.normal(0.0, 1e-4)
    moved = {"output_position": log["output_position"] - dead / RATIO}
    return log.with_columns(moved, note="backlash")


def _servoed(joint: sim.Joint, t: Array, q: Array, load: Array, room: float) -> sim.Trajectory:
    """The run of a joint that its servo takes along q against a load."""
    return joint.simulate(
        t,
        servo=sim.Servo(position_gain=30.0, velocity_gain=0.08, integral_gain=1.0),
        position_command=q,
        velocity_command=np.gradient(q, t),
        load_torque=load,
        room_temperature=room,
        start=sim.Start(output_position=q[0], output_velocity=float(np.gradient(q, t)[0])),
    )


def history(kind: str, number: int, seed: int) -> tuple[History, datetime, float]:
    """Return the history of a joint that wears, its onset, and what it has worn at the end."""
    rng = np.random.default_rng([seed, number, [*RATES, "none"].index(kind)])
    made = {
        "coulomb": 1.0,
        "load": 0.03,
        "viscous": 0.5,
        "ripple": 0.08,
        "stiffness": 26000.0,
        "backlash": 2e-3,
    }
    made = {name: value * rng.uniform(0.7, 1.4) for name, value in made.items()}
    onset = rng.uniform(25.0, 40.0)
    turns = kind in ("stiffness", "backlash") or (kind == "none" and number % 2)
    logs = []
    for week in range(WEEKS):
        if week and rng.random() < 0.1:
            continue
        room = 22.0 + 5.0 * np.sin(2.0 * np.pi * week / 52.0 + number) + rng.normal(0.0, 1.0)
        worn = dict.fromkeys(RATES, 0.0)
        if kind != "none":
            worn[kind] = RATES[kind] * max(week - onset, 0.0) / 52.18
        log = (torsion if turns else drive)(rng, made, worn, room)
        when = (FIRST + timedelta(weeks=week)).isoformat()
        logs.append(log.with_facts({"date": when, "name": f"week {week}"}))
    given = {"kinematic_error": [2, 4]} if turns else {"output_ripple": [2, 5]}
    found = history_of(
        logs,
        target="torsion" if turns else "motor_torque",
        effects=TORSION if turns else DRIVE,
        known_load="reference_torque",
        orders=given,
    )
    worn_by = 0.0 if kind == "none" else RATES[kind] * (WEEKS - 1 - onset) / 52.18
    return found, FIRST + timedelta(weeks=onset), worn_by


def main() -> None:
    ask = argparse.ArgumentParser(description=__doc__)
    ask.add_argument("--joints", type=int, default=2)
    ask.add_argument("--seed", type=int, default=1)
    ask.add_argument("--kinds", default=",".join([*RATES, "none"]))
    ask.add_argument("--out", default="")
    given = ask.parse_args()
    for kind in given.kinds.split(","):
        for number in range(given.joints):
            began = time.time()
            found, onset, worn = history(kind, number, given.seed)
            if given.out:
                Path(given.out).mkdir(exist_ok=True)
                np.savez(
                    Path(given.out) / f"{kind}_{number}.npz",
                    **{k: getattr(found, k) for k in ("dates", "names", "units", "values",
                                                      "covariance", "temperatures")},
                    onset=np.datetime64(onset), worn=worn,
                )  # fmt: skip
            made = track(found)
            truth = f"{NAMES[kind]} since {onset:%Y-%m-%d}, {worn:+.0%}" if kind in NAMES else "no"
            took = f"({len(found)} runs, {time.time() - began:.0f} s)"
            print(f"{kind} {number}: truth {truth} {took}")
            for change in made.changes:
                right = kind in NAMES and change.causes == (NAMES[kind],)
                print(f"    {'right' if right else 'WRONG'}, told {change.told_since:%Y-%m-%d}: "
                      f"{change.sentence}")  # fmt: skip
            if not made.changes:
                print("    no change is told")
            print("   ", *made.remarks, flush=True)


if __name__ == "__main__":
    main()
