"""Sticking, slipping, touching: the simulation against solutions with located events."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from flexspline import simulation as sim

Array = NDArray[np.float64]
DIRECT = sim.Gear(1.0, "")  # no gear: the output alone


def located(
    push: Callable[[float, float], float],
    slide: Callable[[float], float],
    level: float,
    inertia: float,
    start: tuple[float, float],
    end: float,
) -> tuple[Array, list[float]]:
    """One body with friction, by solve_ivp with events: (q, q̇) at `end`, times of its events.

    J q̈ = push(t, q) − s slide(|q̇|); at rest it stays while |push| ≤ level.
    """

    def stops(_: float, y: Array) -> float:
        return float(y[1])

    stops.terminal = True  # type: ignore[attr-defined]
    now, state, events = 0.0, np.array(start), []
    while now < end:
        force = push(now, state[0])
        if state[1] == 0.0 and abs(force) <= level * (1 + 1e-13):

            def leaves(t: float, y: Array) -> float:
                return abs(push(t, y[0])) - level

            leaves.terminal, leaves.direction = True, 1  # type: ignore[attr-defined]
            still = solve_ivp(
                lambda t, y: [0.0], (now, end), [state[0]], events=leaves, max_step=0.02, rtol=1e-12
            )
            now = float(still.t[-1])
            if not len(still.t_events[0]):
                break
            events.append(now)
            now, force = now + 1e-12, push(now + 1e-9, state[0])
        s = np.sign(force) if state[1] == 0.0 else np.sign(state[1])

        def rate(t: float, y: Array, s: float = float(s)) -> list[float]:
            return [y[1], (push(t, y[0]) - s * slide(s * y[1])) / inertia]

        stops.direction = -s  # type: ignore[attr-defined]
        run = solve_ivp(
            rate, (now, end), state, "DOP853", events=stops, rtol=1e-12, atol=1e-14, max_step=0.01
        )
        now, state = float(run.t[-1]), run.y[:, -1].copy()
        if len(run.t_events[0]):
            events.append(now)
            state[1] = 0.0
    return state, events


def stribeck(v: float) -> float:
    return 1.0 + 0.5 * float(np.exp(-((v / 0.1) ** 2))) + 0.3 * v


FRICTION = sim.Friction.both_ways(1.0, stribeck=0.5, stribeck_velocity=0.1, viscous=0.3)


def stretches(stuck: Array) -> list[tuple[int, int]]:
    """First and last row of each stretch in which a body sticks."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0.0], stuck, [0.0]])))
    return [(int(a), int(b) - 1) for a, b in edges.reshape(-1, 2)]


def test_a_pendulum_comes_to_rest_where_the_event_located_one_does() -> None:
    joint = sim.Joint(DIRECT, sim.Motor(), sim.Output(inertia=0.5, gravity=20.0, friction=FRICTION))
    reference, events = located(lambda t, q: -20 * np.sin(q), stribeck, 1.5, 0.5, (1.0, 0.0), 6.0)
    errors = []
    for steps in (1, 2, 4):
        time = np.linspace(0, 6, 3001)
        run = joint.simulate(time, start=sim.Start(output_position=1.0), steps_per_sample=steps)
        errors.append(abs(run["output_position"][-1] - reference[0]))
        (rest,) = stretches(run["output_stuck"])
        assert time[rest[0] - 1] <= events[-1] <= time[rest[0]]
        assert np.ptp(run["output_position"][rest[0] :]) == 0.0
        assert np.all(run["output_velocity"][rest[0] :] == 0.0)
    assert errors[0] < 1e-7
    assert errors[0] / errors[1] == pytest.approx(16, rel=0.2)  # fourth order through the events
    assert errors[1] / errors[2] == pytest.approx(16, rel=0.2)


def test_a_block_on_a_spring_pulled_slowly_sticks_and_slips_as_the_event_located_one() -> None:
    """Stick-slip: J q̈ = k (v t − q) − friction."""
    stiffness, speed = 40.0, 0.05
    joint = sim.Joint(
        DIRECT,
        sim.Motor(),
        sim.Output(inertia=0.5, friction=FRICTION, presliding=[sim.SlipElement(stiffness, 1e9)]),
    )
    reference, events = located(
        lambda t, q: stiffness * (speed * t - q), stribeck, 1.5, 0.5, (0.0, 0.0), 4.0
    )
    time = np.linspace(0, 4, 4001)
    run = joint.simulate(time, load_torque=-stiffness * speed * time, steps_per_sample=2)
    assert len(events) >= 6  # it broke away and stuck several times
    assert run["output_position"][-1] == pytest.approx(reference[0], abs=1e-8)
    at_rest = stretches(run["output_stuck"])
    assert len(at_rest) == (len(events) + 2) // 2
    edges = [row for stretch in at_rest for row in (stretch[0], stretch[1] + 1)][1:]
    for row, event in zip(edges, events, strict=False):
        assert time[row - 1] - 1e-9 <= event <= time[row] + 1e-9
    for first, last in at_rest:
        assert np.ptp(run["output_position"][first : last + 1]) == 0.0


@pytest.mark.parametrize("share", [-0.999, 0.5, 0.999])
def test_a_joint_held_by_friction_does_not_creep(share: float) -> None:
    friction = sim.Friction.both_ways(0.1, stribeck=0.05, stribeck_velocity=5.0)
    joint = sim.Joint(
        sim.Gear(100, mesh_stiffness=15548.0, mesh_shape=0.0487),
        sim.Motor(inertia=1e-4, friction=friction),
        sim.Output(inertia=0.5, friction=sim.Friction.both_ways(0.5)),
    )
    load = share * 0.15 * 101
    run = joint.simulate(np.linspace(0, 100, 1001), load_torque=load, steps_per_sample=40)
    assert np.all(run["motor_stuck"] == 1.0) and np.all(run["output_stuck"] == 1.0)
    assert np.ptp(run["motor_position"]) == 0.0 and np.ptp(run["output_position"]) == 0.0
    over = joint.simulate(np.linspace(0, 1, 101), load_torque=np.sign(load) * (0.151 * 101 + 0.5))
    assert abs(over["motor_position"][-1] - over["motor_position"][0]) > 0.1


def test_levels_of_both_directions_hold_what_they_say() -> None:
    output = sim.Output(
        inertia=0.5, friction=sim.Friction(coulomb_forward=3.0, coulomb_backward=1.0)
    )
    joint = sim.Joint(DIRECT, sim.Motor(), output)
    time = np.linspace(0, 1, 101)
    moved = [
        abs(joint.simulate(time, load_torque=load)["output_position"][-1])
        for load in (-2.99, -3.01, 0.99, 1.01)
    ]
    assert moved[0] == 0.0 and moved[1] > 1e-3 and moved[2] == 0.0 and moved[3] > 1e-3


def test_a_position_where_friction_is_higher_holds_more() -> None:
    output = sim.Output(
        friction=sim.Friction.both_ways(2.0), friction_ripple=[sim.Harmonic(1, 0.5)]
    )
    joint = sim.Joint(DIRECT, sim.Motor(), output)
    time = np.linspace(0, 1, 101)
    held = joint.simulate(time, load_torque=-2.5)  # level 3 at q = 0
    slides = joint.simulate(
        time, load_torque=-2.5, start=sim.Start(output_position=np.pi)
    )  # level 1
    assert held["output_position"][-1] == 0.0 and slides["output_position"][-1] > np.pi + 0.1


def test_warmth_loosens_what_cold_holds() -> None:
    friction = sim.Friction.both_ways(2.0, coulomb_fade=0.01)
    joint = sim.Joint(DIRECT, sim.Motor(), sim.Output(friction=friction))
    time = np.linspace(0, 1, 101)
    cold = joint.simulate(time, load_torque=-2.0, room_temperature=20.0)
    warm = joint.simulate(time, load_torque=-2.0, room_temperature=30.0)
    assert cold["output_position"][-1] == 0.0 and warm["output_position"][-1] > 0.01


def test_a_slow_cycle_loses_the_area_of_the_maxwell_loop() -> None:
    """Per cycle of torsion ±X each element loses 4 L (X − L/k)."""
    elements = (sim.SlipElement(4000.0, 0.4), sim.SlipElement(1500.0, 0.9))
    joint = sim.Joint(
        DIRECT,
        sim.Motor(),
        sim.Output(inertia=0.02, presliding=(*elements, sim.SlipElement(3000.0, 1e9))),
    )
    time = np.linspace(0, 20, 20001)
    drive = -6.0 * np.sin(2 * np.pi * time / 4) * np.minimum(time / 4, 1.0)
    joint = sim.Joint(
        DIRECT,
        sim.Motor(),
        sim.Output(
            inertia=0.02,
            friction=sim.Friction(viscous=0.5),
            presliding=(*elements, sim.SlipElement(3000.0, 1e9)),
        ),
    )
    run = joint.simulate(time, load_torque=drive)
    rows = (time >= 12) & (time < 16)
    far = (run["output_position"][rows].max() - run["output_position"][rows].min()) / 2
    area = sum(4 * e.level * (far - e.level / e.stiffness) for e in elements)
    lost = np.interp(16.0, time, run["gear_heat"]) - np.interp(12.0, time, run["gear_heat"])
    assert far > elements[1].level / elements[1].stiffness
    assert lost == pytest.approx(area, rel=2e-3)  # the load's own speed: not quite static


def test_a_ball_on_an_obstacle_keeps_what_hunt_and_crossley_leave_it() -> None:
    joint = sim.Joint(DIRECT, sim.Motor(), sim.Output(inertia=0.5), obstacle=sim.Obstacle(1.0, 5e3))
    time = np.linspace(0, 2, 2001)
    run = joint.simulate(time, start=sim.Start(output_velocity=1.0))
    assert run["output_velocity"][-1] == pytest.approx(-1.0, abs=1e-7)
    # ½ J v² = ½ k δ²
    assert run["contact_torque"].max() == pytest.approx(np.sqrt(0.5 * 5e3), rel=1e-3)
    damped = sim.Joint(
        DIRECT, sim.Motor(), sim.Output(inertia=0.5), obstacle=sim.Obstacle(1.0, 5e3, 0.2)
    )

    def rate(_: float, y: Array) -> list[float]:
        depth = max(0.0, y[0] - 1.0)
        return [y[1], -5e3 * depth * (1 + 0.2 * y[1]) / 0.5]

    reference = solve_ivp(rate, (0, 2), [0, 1.0], "DOP853", rtol=1e-10, atol=1e-12, max_step=1e-3)
    run = damped.simulate(time, start=sim.Start(output_velocity=1.0))
    assert run["output_velocity"][-1] == pytest.approx(reference.y[1, -1], abs=1e-6)
    assert run["contact_torque"].min() >= 0.0
    assert abs(run.balance[-1]) < 1e-3
