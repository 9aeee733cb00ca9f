"""A known effect of known size, added to logs that others recorded, is found and sized.

The noise, the form of what is left and the channels are the joint's own; nothing of them was made
here. An effect is added to the target as the catalogue has it, by a model of its own, and is looked
for beside a model to which the log's own missing effect belongs already.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
from measured import KINOVA_SPEEDS, kinova, two_encoder, ur10e

import flexspline
from flexspline.effects import Effect, effect
from flexspline.logs.checks.consistency import measured_gear
from flexspline.logs.checks.ends import resting
from flexspline.logs.log import Log
from flexspline.logs.repairs import repaired
from flexspline.model import Model
from flexspline.part import Part

pytestmark = pytest.mark.usefixtures("data_folder")

ARM = ("offset", "coulomb_friction", "viscous_friction", "inertia", "gravity")
SURE = 3.0  # standard errors by which a size may be off


@dataclass(frozen=True)
class Case:
    """Effect and its coefficients, the logs it is added to, and the model it is looked for beside.

    `within`: share of a coefficient by which the log's own dynamics may move it beyond its error.
    """

    hidden: Effect
    values: tuple[float, ...]
    logs: str
    base: tuple[str, ...]
    target: str
    lowpass: float | None = None
    within: float = 0.1


@cache
def recorded(name: str) -> tuple[Log, ...]:
    if name == "UR10e joint 4":
        log = ur10e(4)
        return (log.rows(~resting(log)),)
    if name == "Kinova":
        return tuple(repaired(kinova(speed), "drop_start=1.0") for speed in KINOVA_SPEEDS[4::2])
    log = two_encoder(1)
    gear = measured_gear(log)
    assert gear is not None
    shifted = repaired(log, f"shift=output_position:{gear.delay}")
    return (shifted.with_facts({"gear_ratio": gear.ratio}),)


CASES = {
    "Stribeck friction in a UR10e": Case(
        effect("stribeck_friction", stribeck_velocity=0.15), (0.12,), "UR10e joint 4", ARM,
        "motor_current", 5.0,
    ),
    "ripple of the output in a UR10e": Case(
        effect("output_ripple", orders=[3]), (0.03, -0.04), "UR10e joint 4", ARM,
        "motor_current", 5.0,
    ),
    "cogging of a Kinova's motor": Case(
        effect("cogging", orders=[(5, "motor_on_stator")]), (0.03, 0.02), "Kinova",
        ("coulomb_friction", "viscous_friction"), "motor_current",
    ),
    "angle error of a gear with two encoders": Case(
        effect("kinematic_error", orders=[(5, "motor_on_stator")]), (0.012, -0.009),
        "two encoders", ("offset",), "torsion",
    ),
}  # fmt: skip


def with_it(case: Case) -> list[Log]:
    """The logs with the effect's torque, current or torsion added to their target."""
    logs = recorded(case.logs)
    part = Part(case.target, (case.hidden,), np.array(case.values))
    facts = {k: v for k, v in logs[0].facts.items() if k == "gear_ratio"}
    model = Model({"torsion" if case.target == "torsion" else "drive": part}, facts)
    made = []
    for log in logs:
        added = model.predict(log).predicted
        channel, sign = ("motor_position", -1.0) if case.target == "torsion" else (case.target, 1.0)
        made.append(log.with_columns({channel: log[channel] + sign * added}, note="injected"))
    return made


@pytest.mark.parametrize("name", list(CASES))
def test_what_is_added_to_a_measured_log_is_found_and_sized(name: str) -> None:
    case = CASES[name]
    made = flexspline.discover(case.base, with_it(case), target=case.target, lowpass=case.lowpass)
    assert case.hidden.name in made.names
    found = {p.name: p for p in made.fit.parameters}
    for value, term in zip(case.values, case.hidden.terms, strict=True):
        one = found[f"{case.hidden.name}.{term.name}"]
        room = SURE * one.standard_error + case.within * max(map(abs, case.values))
        assert one.value == pytest.approx(value, abs=room), one.name
