"""Each effect of the torsion is found in runs that hide it and not in runs that do not."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hidden_logs import (
    Array,
    Channels,
    Truth,
    closes_the_gap,
    floor_of,
    gains_nothing,
    of_each_seed,
)
from torsion_logs import C_M, K_M0, LOAD, RATIO, log_of, noise, stiffness_run

import flexspline
from flexspline.discovery.faults import DataFault, with_measured_ratio
from flexspline.effects import effect
from flexspline.least_squares.result import Fit
from flexspline.logs.log import Log

BASE = ["offset", effect("mesh_compliance", mesh_shape=C_M)]


def mesh(c: Channels) -> Array:
    return np.asarray(-RATIO * np.arctan(C_M * c[LOAD]) / (C_M * K_M0))


def dead_zone(c: Channels) -> Array:
    """Straight through the zone and then at its end, where the core bends."""
    return -2e-3 * np.clip(c[LOAD] / 0.6, -1.0, 1.0)


def softening(c: Channels) -> Array:
    return np.asarray(mesh(c) * np.expm1(0.004 * (c["temperature"] - 25.0)))


def creeping(c: Channels) -> Array:
    return np.asarray(3e-3 * -np.expm1(-c["time"] / 25.0))


HIDDEN: dict[str, Truth] = {
    "backlash": dead_zone,
    "temperature_dependent_stiffness": softening,
    "time_drift": creeping,
}


@of_each_seed
def runs(name: str, seed: int) -> Log:
    """A run that hides an effect; "" hides none."""
    c = stiffness_run(seed)
    c["temperature"] = 20.0 + 10.0 * -np.expm1(-c["time"] / 10.0)
    torsion = 0.02 + mesh(c) + noise(seed, len(c["time"]))
    if name:
        torsion = torsion + HIDDEN[name](c)
    return log_of(c, torsion, f"run {seed}")


def fitted(effects: list[object], name: str) -> Fit:
    return flexspline.fit(effects, runs(name), "torsion", known_load=LOAD)


@cache
def with_it(name: str) -> Fit:
    return fitted([*BASE, name], name)


@pytest.mark.parametrize("name", HIDDEN)
def test_a_hidden_effect_closes_the_gap(name: str) -> None:
    base = fitted(BASE, name)
    closes_the_gap(base, with_it(name), name, floor_of(noise, 12_000))


@pytest.mark.parametrize("name", HIDDEN)
def test_an_effect_that_is_not_there_gains_nothing(name: str) -> None:
    base = fitted(BASE, "")
    made = fitted([*BASE, name], "")
    gains_nothing(base, made, name)


def test_the_dead_zone_comes_out_on_both_sides_of_the_gear() -> None:
    zone = {d.name: d for d in with_it("backlash").derived}
    motor = zone["dead zone of the backlash, at the motor"]
    output = zone["dead zone of the backlash, at the output"]
    assert motor.value == pytest.approx(4e-3, rel=0.05)
    assert output.value == pytest.approx(motor.value / RATIO)


def test_a_mesh_that_warms_up_has_one_shape() -> None:
    names = [p.name for p in with_it("temperature_dependent_stiffness").parameters]
    assert [name for name in names if "mesh_shape" in name] == ["mesh_compliance.mesh_shape"]
    shapes = {
        e.shapes["mesh_shape"]
        for e in with_it("temperature_dependent_stiffness").part.effects
        if "mesh_shape" in e.shapes
    }
    assert len(shapes) == 1


@pytest.mark.parametrize(
    ("shown", "used"),
    [(RATIO + 1.0, RATIO + 1.0), (1.042 * RATIO, 1.042 * RATIO), (1.0024 * RATIO, RATIO)],
)
def test_a_ratio_is_replaced_by_teeth_or_by_far_but_not_by_a_torsion(shown, used):
    """A drift of 5 mrad that follows the angle over two radians shows 101.24 turns."""
    channels = stiffness_run(1)
    log = log_of(channels, mesh(channels))
    fault = DataFault("run", "gear_ratio", "motor_position", shown, "", (0, len(log)), "It is off.")
    (mended,), (told,) = with_measured_ratio([log], [fault], "torsion")
    assert mended.effective_ratio == pytest.approx(used)
    assert ("What follows" in told.sentence) == (used != RATIO)
