"""Runs of a servo with a pendulum whose parameters are known, and its law."""

from __future__ import annotations

from functools import cache

import numpy as np

import flexspline
from flexspline.effects import effect
from flexspline.forward import PositionServo
from flexspline.logs.derive import differentiate
from flexspline.logs.log import Log
from flexspline.model import Model, Part

EFFECTS = ["inertia", "gravity", "coulomb_friction", "load_dependent_friction"]
TRUE = {
    "inertia.inertia": 0.03,
    "coulomb_friction.level": 0.08,
    "load_dependent_friction.factor": 0.2,
    "controller.torque": 0.25,
    "controller.back_emf": 0.06,
}
KNOWN = {"gravity.sine": 1.0, "gravity.cosine": 0.0}
STEP = 2.0 * np.pi / 4096
FACTS = {"gear_ratio": 1.0}


def true_model() -> Model:
    values = [TRUE["inertia.inertia"], 1.0, 0.0, 0.08, 0.2]
    return Model({"drive": Part("motor_torque", tuple(map(effect, EFFECTS)), values)}, FACTS)


def law(*, torque: float = 0.25, back_emf: float = 0.06) -> PositionServo:
    return PositionServo("kp", torque=torque, back_emf=back_emf, supply=True, encoder_step=STEP)


def _run(number: int, seed: int) -> Log:
    time = np.arange(0.0, 4.0, 0.005)
    draw = np.random.default_rng([seed, number])
    way = sum(
        a * np.sin(2.0 * np.pi * f * time + p)
        for a, f, p in zip(
            draw.uniform(0.3, 0.8, 3), draw.uniform(0.2, 1.6, 3), draw.uniform(0, 6.3, 3),
            strict=True,
        )
    )  # fmt: skip
    asked = Log.from_arrays(
        time=time,
        output_position=np.zeros(len(time)),
        commanded_position=way - way[0],
        supply_voltage=np.full(len(time), 7.4),
        enabled=np.where((number % 3 == 2) & (time > 3.0), 0.0, 1.0),
        facts={**FACTS, "kp": 1.0 + 0.5 * number, "name": f"run {number}"},
    )
    made = flexspline.simulate(true_model(), asked, controller=law()).log
    noise = draw.normal(0.0, 1e-3, len(time))
    measured = STEP * np.round((made["output_position"] + noise) / STEP)
    volts = asked["supply_voltage"] * law().torque
    duty = (made["motor_torque"] + law().back_emf * made["output_velocity"]) / volts
    duty = np.where(asked["enabled"] == 0.0, 0.0, duty)
    seen = asked.with_columns({"output_position": measured, "duty": duty}, note="measured")
    velocity = differentiate(seen)["output_velocity"]
    return seen.with_columns({"output_velocity": velocity}, note="derived")


@cache
def runs(count: int = 6, seed: int = 1) -> tuple[Log, ...]:
    return tuple(_run(number, seed) for number in range(count))
