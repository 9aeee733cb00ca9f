"""Each effect of the drive torque is found in runs that hide it and not in runs that do not."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from fit_logs import WIDTH
from hidden_logs import (
    BASE,
    FACTS,
    LOAD,
    RATIO,
    Array,
    Channels,
    Truth,
    by_position,
    by_temperature,
    closes_the_gap,
    fitted,
    floor_of,
    friction_of,
    gains_nothing,
    log_of,
    noise,
    of_each_seed,
    presliding,
    slipping,
    torque_hiding,
)

import flexspline
from flexspline.effects import effect
from flexspline.least_squares.result import Fit
from flexspline.logs.log import Log


def mistaken(c: Channels) -> Array:
    """A torque constant that is 4 % too low makes the drive report more torque than it gives."""
    return np.asarray(0.04 * (c[LOAD] + friction_of(c)))


HIDDEN: dict[str, Truth] = {
    "presliding_friction": presliding,
    "temperature_dependent_friction": by_temperature,
    "position_dependent_friction": by_position,
    "torque_constant_error": mistaken,
}


@of_each_seed
def runs(name: str, seed: int) -> Log:
    """A run that hides an effect; "" hides none."""
    c, torque = torque_hiding(HIDDEN.get(name), seed)
    c["motor_torque"] = torque / RATIO
    return log_of(c)


@cache
def with_it(name: str) -> Fit:
    return fitted([*BASE, name], runs(name), "motor_torque")


@pytest.mark.parametrize("name", HIDDEN)
def test_a_hidden_effect_closes_the_gap(name: str) -> None:
    base = fitted(BASE, runs(name), "motor_torque")
    closes_the_gap(base, with_it(name), name, floor_of())


@pytest.mark.parametrize("name", HIDDEN)
def test_an_effect_that_is_not_there_gains_nothing(name: str) -> None:
    base = fitted(BASE, runs(""), "motor_torque")
    made = fitted([*BASE, name], runs(""), "motor_torque")
    gains_nothing(base, made, name)


def test_the_level_of_presliding_is_what_was_put_in() -> None:
    level, together = with_it("presliding_friction").derived
    coulomb = next(
        p for p in with_it("presliding_friction").parameters if p.name == "coulomb_friction.level"
    )
    assert level.unit == "Nm"
    assert level.value == pytest.approx(0.2, abs=4 * level.standard_error)
    assert coulomb.value == pytest.approx(0.3, abs=4 * coulomb.standard_error)
    assert together.name == "coulomb_friction + presliding_friction once they slide"
    assert together.value == pytest.approx(0.5, abs=4 * together.standard_error)
    assert together.standard_error < min(level.standard_error, coulomb.standard_error)


@pytest.mark.parametrize("speeds", [(0.4,), (0.2, 0.4)])
def test_a_sum_that_slides_stands_only_where_its_frictions_are_known(
    speeds: tuple[float, ...],
) -> None:
    """Friction at one speed is Coulomb or viscous friction, and the latter is not in the sum."""

    def to_and_fro(seed: int) -> Log:
        time = np.arange(8000) / 200.0
        stroke = (time // 2.0).astype(int)
        v = np.where(stroke % 2 == 0, 1.0, -1.0) * np.take(speeds, stroke // 2, mode="wrap")
        q = np.concatenate([[0.0], np.cumsum(v)[:-1] / 200.0])
        torque = 0.3 * np.sign(v) + 0.15 * v + slipping(q, 0.2, 0.03) + noise(seed, len(time))
        return Log.from_arrays(facts=FACTS, time=time, output_position=q, motor_torque=torque)

    terms = [effect("coulomb_friction", direction_width=WIDTH), "viscous_friction"]
    made = flexspline.fit(
        [*terms, "presliding_friction"],
        [to_and_fro(seed) for seed in (1, 2)],
        "motor_torque",
        fixed={"direction_width": WIDTH},
    )
    mixed = {"coulomb_friction.level", "viscous_friction.viscosity"}
    assert any(mixed <= {*group.names} for group in made.confounded) == (len(speeds) == 1)
    sums = [one.value for one in made.derived if one.name.endswith("once they slide")]
    assert sums == ([] if len(speeds) == 1 else [pytest.approx(0.5 * RATIO, rel=0.02)])
    assert not any("level of" in one.name for one in made.derived if len(speeds) == 2)


def test_no_sum_slides_where_the_width_of_its_friction_ends_at_the_upper_bound() -> None:
    """Friction that bends over the fastest speed never reaches its level."""
    logs = []
    for seed in (1, 2):
        c, _ = torque_hiding(None, seed)
        v = c["output_velocity"]
        bent = 3.0 * np.tanh(v / (4.0 * np.abs(v).max())) + presliding(c)
        logs.append(log_of({**c, "motor_torque": (bent + noise(seed, len(v))) / RATIO}))
    terms = ["offset", "coulomb_friction", "presliding_friction"]
    made = flexspline.fit(terms, logs, "motor_torque", bounds={"direction_width": (1e-3, 1.0)})
    assert made["direction_width"].state == "at upper bound"
    assert not any(one.name.endswith("once they slide") for one in made.derived)


def test_the_error_of_a_torque_constant_comes_out() -> None:
    factor = next(
        p for p in with_it("torque_constant_error").parameters if "torque_constant" in p.name
    )
    assert factor.unit == "1"
    assert factor.value == pytest.approx(0.04, abs=4 * factor.standard_error)


def test_the_error_of_a_torque_constant_of_a_current_is_in_amperes_for_each_newton_metre() -> None:
    constant, taken_for = 0.05, 0.04  # Nm/A
    logs = []
    for log in runs(""):
        current = log["motor_torque"] / constant
        log = log.with_facts({"torque_constant": taken_for})
        logs.append(log.with_columns({"motor_current": current}, note="simulated"))
    made = flexspline.fit(
        [*BASE, "torque_constant_error"],
        logs,
        "motor_current",
        known_load=LOAD,
        fixed={"direction_width": WIDTH},
    )
    factor = next(p for p in made.parameters if "torque_constant" in p.name)
    assert factor.unit == "A/Nm"
    truth = (1 / constant - 1 / taken_for) / RATIO
    assert factor.value == pytest.approx(truth, abs=4 * factor.standard_error)
