"""A drive run forward against motion that is known on paper, and against located events."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from forward_runs import Given, drive, driven, run_of
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.special import ellipk

import flexspline
from flexspline.effects import effect

Array = NDArray[np.float64]

INERTIA, COULOMB = 0.5, 2.0


def test_coulomb_friction_stops_a_joint_where_its_energy_ends() -> None:
    model = drive([("inertia", [INERTIA]), ("coulomb_friction", [COULOMB])])
    time = np.arange(0.0, 2.0, 0.01)
    made = driven(model, run_of(time, np.zeros(len(time))), start=(0.3, 1.7))
    stop = INERTIA * 1.7 / COULOMB
    t = np.minimum(time, stop)
    assert np.allclose(made["position"], 0.3 + 1.7 * t - 0.5 * COULOMB / INERTIA * t**2, atol=1e-13)
    assert np.array_equal(made["stuck"] == 1.0, time > stop)
    assert np.all(made["velocity"][time > stop] == 0.0)


def test_a_joint_breaks_away_when_the_torque_passes_its_friction() -> None:
    model = drive([("inertia", [INERTIA]), ("coulomb_friction", [COULOMB])])
    time = np.arange(0.0, 1.5, 0.007)
    slope = -3.3  # Nm/s
    made = driven(model, run_of(time, slope * time))
    late = np.maximum(time - COULOMB / abs(slope), 0.0)
    assert np.allclose(made["position"], slope * late**3 / (6 * INERTIA), atol=1e-12)
    assert np.all(made["position"][late == 0.0] == 0.0)


def test_a_joint_that_friction_holds_does_not_creep_by_one_bit() -> None:
    model = drive([
        ("inertia", [INERTIA]), ("gravity", [8.0, 1.0]), ("coulomb_friction", [3.0]),
        ("stribeck_friction", [1.0]), ("viscous_friction", [0.5]),
        ("load_dependent_friction", [0.2]),
    ])  # fmt: skip
    time = np.arange(0.0, 1000.0, 0.01)
    torque = (
        8.0 * np.sin(0.4) + np.cos(0.4) + 3.9 * np.sin(7.0 * time)
    )  # below the friction at all times
    made = driven(model, run_of(time, torque), start=(0.4, 0.0))
    assert np.all(made["position"] == 0.4)
    assert np.all(made["velocity"] == 0.0)
    assert np.all(made["stuck"] == 1.0)


def test_a_pendulum_without_friction_keeps_its_period_and_its_energy() -> None:
    model = drive([("inertia", [INERTIA]), ("gravity", [8.0, 0.0])])
    amplitude = 2.0
    period = 4.0 * np.sqrt(INERTIA / 8.0) * ellipk(np.sin(amplitude / 2.0) ** 2)
    time = np.linspace(0.0, 20.0 * period, 8001)  # 400 rows a period
    made = driven(model, run_of(time, np.zeros(len(time))), start=(amplitude, 0.0), steps=4)
    energy = 0.5 * INERTIA * made["velocity"] ** 2 - 8.0 * np.cos(made["position"])
    assert np.max(np.abs(energy - energy[0])) < 1e-6
    assert np.allclose(made["position"][::400], amplitude, atol=1e-5)


def test_viscous_friction_and_a_step_of_torque_are_an_exponential() -> None:
    model = drive([("inertia", [INERTIA]), ("viscous_friction", [2.5])])
    time = np.arange(0.0, 1.0, 0.001)
    made = driven(model, run_of(time, np.full(len(time), 4.0)))
    rate = 2.5 / INERTIA
    assert np.allclose(made["velocity"], 4.0 / 2.5 * (1.0 - np.exp(-rate * time)), atol=1e-12)
    assert np.allclose(made["acceleration"], 4.0 / INERTIA * np.exp(-rate * time), atol=1e-11)


def test_friction_of_the_load_sees_what_accelerates() -> None:
    """J q̈ = T − L − c |L + J q̈|: with both forward, J q̈ = (T − L (1 + c)) / (1 + c)."""
    model = drive([("inertia", [INERTIA]), ("load_dependent_friction", [0.3])], "reference_torque")
    time = np.arange(0.0, 0.5, 0.01)
    load = np.full(len(time), 5.0)
    made = driven(model, run_of(time, np.full(len(time), 9.0), reference_torque=load))
    assert np.allclose(made["acceleration"], (9.0 / 1.3 - 5.0) / INERTIA, rtol=1e-13)
    held = driven(model, run_of(time, np.full(len(time), 6.4), reference_torque=load))
    assert np.all(held["stuck"] == 1.0)  # 6.4 < 5 · 1.3


SMOOTH: Given = [
    ("inertia", [INERTIA]),
    ("gravity", [8.0, 1.0]),
    ("viscous_friction", [0.8]),
    (effect("output_ripple", orders=[7]), [0.3, 0.2]),
    (effect("cogging", orders=[1]), [0.05, 0.1]),
]


def test_smooth_arcs_converge_with_the_fourth_power_of_the_step() -> None:
    time = np.arange(0.0, 2.0, 0.01)
    log = run_of(time, 3.0 * np.sin(2.0 * time))
    finest = driven(drive(SMOOTH), log, start=(0.2, 0.1), steps=128)["position"]
    errors = [
        np.max(np.abs(driven(drive(SMOOTH), log, start=(0.2, 0.1), steps=n)["position"] - finest))
        for n in (4, 8, 16)
    ]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(np.abs(orders - 4.0) < 0.3), (errors, orders)


ROUGH: Given = [
    ("inertia", [INERTIA]),
    ("gravity", [8.0, 0.0]),
    ("viscous_friction", [3.0]),
    ("coulomb_friction", [COULOMB]),
    (effect("stribeck_friction", stribeck_velocity=0.2), [1.0]),
    ("load_dependent_friction", [0.1]),
]


def torque_of(time: Array) -> Array:
    return np.asarray(12.0 * np.sin(3.1 * time) + 2.0 * np.sin(9.0 * time))


def test_stick_and_slip_are_those_of_an_integrator_that_locates_events() -> None:
    time = np.arange(0.0, 5.0, 2e-3)
    model, log = drive(ROUGH), run_of(time, torque_of(time))
    expected, events = by_events(time, log["motor_torque"] * 100.0, 0.1)
    assert events >= 10
    errors = []
    for steps in (1, 4):
        made = driven(model, log, start=(0.1, 0.0), steps=steps)
        assert 0.02 < np.mean(made["stuck"]) < 0.5
        errors.append(float(np.max(np.abs(made["position"] - expected))))
    assert errors[1] < 1e-8, errors  # the integrator's own tolerance over ten events
    assert errors[0] < 1e-6, errors


def acceleration(torque: float, q: float, v: float, way: int) -> float:
    """q̈ of `ROUGH` in one direction, on paper."""
    load = 8.0 * np.sin(q)
    rest = torque - load - 3.0 * v - way * (COULOMB + np.exp(-((v / 0.2) ** 2)))
    # x + way 0.1 |load + x| = rest
    solved = [(rest - way * 0.1 * side * load) / (1.0 + way * 0.1 * side) for side in (1, -1)]
    good = [x for x, side in zip(solved, (1, -1), strict=True) if side * (load + x) >= 0.0]
    return float(good[0]) / INERTIA


def by_events(time: Array, torque: Array, start: float) -> tuple[Array, int]:
    """The angle of `ROUGH` at each row, by scipy between events, and how many there were."""

    def holding(q: float) -> float:
        return COULOMB + 1.0 + 0.1 * abs(8.0 * np.sin(q))

    def free(t: float, q: float) -> float:
        return float(np.interp(t, time, torque)) - 8.0 * np.sin(q)

    q, v, way, events = start, 0.0, 0, 0
    angles = [q]
    for first, last in pairwise(time):
        now = first
        while now < last - 1e-13:
            if way == 0:
                at_end = free(last, q)
                if abs(at_end) <= holding(q):
                    break
                way = 1 if at_end > 0 else -1
                at_now = free(now, q)
                share = (way * holding(q) - at_now) / (at_end - at_now)
                now, events = now + max(share, 0.0) * (last - now), events + 1
            begun = now

            def stops(t: float, y: Array, way: int = way, begun: float = begun) -> float:
                return float(way * y[1]) + (1e-3 if t < begun + 1e-7 else 0.0)

            stops.terminal, stops.direction = True, -1  # type: ignore[attr-defined]

            def slopes(t: float, y: Array, way: int = way) -> list[float]:
                return [y[1], acceleration(float(np.interp(t, time, torque)), y[0], y[1], way)]

            found = solve_ivp(slopes, (now, last), [q, v], "DOP853", rtol=1e-10, atol=1e-12,
                              events=stops)  # fmt: skip
            q, v, now = float(found.y[0, -1]), float(found.y[1, -1]), float(found.t[-1])
            if found.status == 1:
                v, events = 0.0, events + 1
                push = free(now, q)
                way = 0 if abs(push) <= holding(q) else (1 if push > 0 else -1)
        angles.append(q)
    return np.array(angles), events


def test_half_the_steps_change_the_motion_by_what_the_result_says() -> None:
    time = np.arange(0.0, 5.0, 0.02)
    model, log = drive(ROUGH), run_of(time, torque_of(time))
    made = flexspline.simulate(model, log)
    assert made.step_error <= 1e-5
    half = flexspline.simulate(model, log, steps_per_sample=made.steps_per_sample // 2)
    change = np.sqrt(np.mean((made.simulated - half.simulated) ** 2))
    assert made.step_error == pytest.approx(change, rel=1e-9)
    assert np.isnan(half.step_error)


def test_steps_are_no_longer_halved_where_that_leads_nowhere() -> None:
    """A pendulum thrown over its top has another motion with every step size."""
    time = np.arange(0.0, 300.0, 0.02)
    model = drive([("inertia", [INERTIA]), ("gravity", [8.0, 0.0]), ("viscous_friction", [0.1])])
    made = flexspline.simulate(model, run_of(time, 8.0 * np.sin(2.5 * time)))
    assert made.step_error > 1.0
    assert made.steps_per_sample < 64


def test_a_torque_that_holds_between_rows_is_another_than_a_linear_one() -> None:
    """A staircase of torque is late by half a row."""
    model = drive([("inertia", [INERTIA])])
    time = np.arange(0.0, 1.0, 0.01)
    log = run_of(time, time)
    linear = flexspline.simulate(model, log).simulated
    held = flexspline.simulate(model, log, inputs="hold").simulated
    assert np.allclose(linear, time**3 / (6 * INERTIA), atol=1e-12)
    assert held[-1] == pytest.approx(linear[-1] - 0.005 * time[-1] ** 2 / (2 * INERTIA), rel=2e-4)
