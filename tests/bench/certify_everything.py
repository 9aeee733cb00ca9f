"""Has every effect, every estimator and every measured log the host's bits on a device?

    python tests/bench/certify_everything.py [--device cortex-m4f] [--rows 1000200] [--only NAME…]

A line for each effect of the catalogue alone, for all of a target, for each estimator with what it
needs, and for the measured logs of a joint, one behind the other, through a chain fitted to them:
rows, whether all bits are those of the host's float run, what float costs against double, and
instructions of a step.
Ends with an error if any bit differs. Measured logs are read from FLEXSPLINE_DATA.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "python"))
sys.path.insert(0, str(Path(__file__).parents[1] / "firmware"))

import chain_rig as rig
import measured
import numpy as np
from every_effect import all_of, exported, rich

import flexspline
from flexspline.certification.program import DEVICES
from flexspline.effects import CATALOGUE, TARGETS, effect
from flexspline.logs.log import Log
from flexspline.model import Model, Part

Case = tuple[str, Callable[[int], tuple[Model, Log]]]

CALIBRATED = (rig.CALIBRATION,)
BY_MOTOR = (*CALIBRATED, rig.BY_MOTOR)
TWISTED = (*BY_MOTOR, flexspline.Compliance())
CHAINS = {
    "calibration": CALIBRATED,
    "temperature_compensation": (*CALIBRATED, rig.COMPENSATION),
    "thermistor": (*CALIBRATED, rig.COMPENSATION, rig.THERMISTOR),
    "observer": BY_MOTOR,
    "compliance": TWISTED,
    "compliant_observer": (*TWISTED, rig.BY_GEAR),
    "merge, logistic": (*TWISTED, rig.MERGE),
    "merge, Kalman": (*TWISTED, rig.KALMAN),
    "collision": (*TWISTED, rig.MERGE, rig.COLLISION),
    "reading_checks": (*TWISTED, rig.MERGE, rig.COLLISION, rig.CHECKS),
    "differentiator": (*TWISTED, rig.MERGE, rig.COLLISION, rig.ANGLE_CHECKS, rig.DIFFERENTIATOR),
}
IIWA = {1: ("1", "p15", "p25", "p3", "p35", "p4", "p45", "p5", "p55", "p6"),
        2: ("p1", "p2", "p3", "p4", "p5", "p6", "p7", "p8"),
        5: ("p1", "p2", "p3", "p4", "p5", "p6", "p7", "p8", "p9"),
        7: ("p1", "p2", "p3", "p4", "p5", "p7", "p8", "p9")}  # fmt: skip


def main() -> None:
    given = _arguments()
    heads = f"{'rows':>9}{'same bits':>11}{'double less float':>19}{'instructions':>14}{'s':>6}"
    print(f"{given.device}\n{'':<38}{heads}")
    other = []
    for name, made in cases():
        if given.only and name not in given.only:
            continue
        start = time.perf_counter()
        found = flexspline.certify(*made(given.rows), given.device)
        cost, instructions = found.quantisation, found.cost.instructions_per_step or 0
        if not found.bit_identical:
            other.append(name)
        print(
            f"{name:<38}{found.samples:>9}{'yes' if found.bit_identical else 'NO':>11}"
            f"{cost.quantisation:>14.1e} {cost.unit:<4}{instructions:>14.0f}"
            f"{time.perf_counter() - start:>6.0f}",
            flush=True,
        )
    if other:
        raise SystemExit(f"other bits than the host's: {', '.join(other)}")


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--device", choices=sorted(DEVICES), default="cortex-m4f")
    parser.add_argument("--rows", type=int, default=1_000_200)
    parser.add_argument("--only", nargs="+", metavar="NAME")
    return parser.parse_args()


def cases() -> Iterator[Case]:
    """Yield a name, and what makes a model and its log of so many rows."""
    for name in CATALOGUE:
        yield name, lambda rows, name=name: alone(name, rows)
    for target in TARGETS:
        yield f"all effects: {target}", lambda rows, target=target: _all(target, rows)
    for name, stages in CHAINS.items():
        yield name, lambda rows, stages=stages: (rig.joint(*stages), rig.raw_channels(rows))
    yield "every estimator", lambda rows: (rig.whole_joint(), rig.raw_channels(rows))
    yield "without a sensor", lambda rows: (_blind(), rig.raw_channels(rows))
    yield "measured: Kinova", lambda rows: _kinova()
    for joint in IIWA:
        yield f"measured: iiwa joint {joint}", lambda rows, joint=joint: _iiwa(joint)


def alone(name: str, rows: int) -> tuple[Model, Log]:
    """An effect with three orders of each of its pairs, on the first target that it has."""
    info = CATALOGUE[name]
    target = next(t for t, letter in TARGETS.items() if letter in info.targets)
    orders = [(order, pair) for pair in info.pairs for order in (1, 2, 5)]
    return exported((effect(name, orders=orders),), target), rich(5, rows)


def _all(target: str, rows: int) -> tuple[Model, Log]:
    return exported(all_of(target), target), rich(5, rows)


def _blind() -> Model:
    return rig.blind_joint(rig.BY_MOTOR, flexspline.Compliance(), rig.KALMAN)


def _kinova() -> tuple[Model, Log]:
    """Motor and sensor: the current's friction and ripple, the sensor's own error, a detector."""
    logs = [measured.kinova(speed) for speed in measured.KINOVA_SPEEDS]
    ripple = effect("output_ripple", orders=[2, 4, 8])
    friction = ["inertia", "offset", "coulomb_friction", "viscous_friction"]
    sensor = flexspline.fit(["offset", ripple], logs, target="sensor_torque")
    drive = flexspline.fit(
        [*friction, effect("output_ripple", orders=[100, 700, 1200, 1400])],
        logs,
        target="motor_torque",
    )
    return _watched([sensor.model, drive.model], "motor_torque"), _joined(logs)


def _iiwa(joint: int) -> tuple[Model, Log]:
    """The joint's torque sensor: friction, then the observer behind it and a detector."""
    logs = [measured.iiwa(joint, speed) for speed in IIWA[joint]]
    friction = ["inertia", "offset", "coulomb_friction", "viscous_friction", "gravity"]
    fitted = flexspline.fit(friction, logs, target="sensor_torque")
    return _watched([fitted.model], "sensor_torque"), _joined(logs)


def _watched(models: list[Model], by: str) -> Model:
    parts: dict[str, Part] = {}
    for model in models:
        parts |= model.parts
    made = Model(parts, models[0].facts)
    limits = ((0.5,), (1.0, 2.0), (1.0, 2.0), 0.8, 0.05)
    watched = flexspline.Collision("observer", *limits)
    return made.with_estimator(flexspline.Observer(20.0, by)).with_estimator(watched)


def _joined(logs: list[Log]) -> Log:
    """One log behind the other, a second of nothing between them: memory starts anew there."""
    kept = [name for name in logs[0].channels if all(name in log.channels for log in logs)]
    columns = {name: np.concatenate([log[name] for log in logs]) for name in kept}
    starts, end = [], 0.0
    for log in logs:
        starts.append(log["time"] - log["time"][0] + end)
        end = starts[-1][-1] + 1.0
    columns["time"] = np.concatenate(starts)
    return Log.from_arrays(facts=dict(logs[0].facts), **columns)


if __name__ == "__main__":
    main()
