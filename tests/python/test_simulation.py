"""The forward simulation against independent solutions: order, energy, spring, heat, signs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import brentq

from flexspline import _core
from flexspline import simulation as sim
from flexspline.errors import InputError

Array = NDArray[np.float64]

MESH = sim.Gear(100, mesh_stiffness=15548.0, mesh_shape=0.0487)
C1 = replace(MESH, wave_generator_stiffness=21.9931, wave_generator_shape=3.125)  # Table III
ERROR = (
    sim.Harmonic(2, 3.0e-3, 0.4, "output_on_housing"),
    sim.Harmonic(1, 2.0e-3, 1.4, "wave_generator_on_circular_spline"),
)
ROTOR = sim.Motor(inertia=1e-4)


@pytest.mark.parametrize(
    "gear",
    [sim.Gear(100, mesh_stiffness=15548.0), C1, replace(MESH, kinematic_error=ERROR)],
    ids=["linear", "lost motion", "kinematic error"],
)
def test_energy_does_not_drift_over_a_hundred_thousand_periods(gear: sim.Gear) -> None:
    joint = sim.Joint(gear, ROTOR, sim.Output(inertia=0.5))
    frequency, _ = _core.simulation_rates(joint.core, 0.0)
    time = np.linspace(0.0, 1e5 * 2 * np.pi / frequency, 3989)  # rows at all phases of a period
    steps = int(np.ceil((time[1] - time[0]) * frequency / 0.25))
    run = joint.simulate(time, start=sim.Start(motor_position=0.1), steps_per_sample=steps)
    change = run.energy / run.energy[0] - 1.0
    # it swings by O((ω h)⁴) within a period; what is left after means of half a run is drift
    assert np.max(np.abs(change)) < 1e-4
    drift = np.mean(change[1995:]) - np.mean(change[:1995])
    assert abs(drift) < 5 * np.std(change) / np.sqrt(1000) + 1e-10


def test_the_spring_and_its_inverse_agree_with_the_papers_formulas() -> None:
    joint = sim.Joint(C1, ROTOR)
    torque = np.array([-150.0, -20.0, -1e-3, 0.0, 1e-9, 0.3, 7.0, 60.0, 300.0])
    mesh = 101 * np.arctan(0.0487 * torque) / (0.0487 * 15548.0)
    at_motor = torque / 101
    generator = np.sign(at_motor) * -np.expm1(-3.125 * np.abs(at_motor)) / (3.125 * 21.9931)
    windup = mesh + generator
    np.testing.assert_allclose(joint.windup(torque), windup, rtol=1e-14, atol=0)
    np.testing.assert_allclose(joint.transmitted_torque(windup), torque, rtol=1e-11, atol=1e-20)
    found = [brentq(lambda x, w=w: joint.windup(x)[0] - w, -400, 400, xtol=1e-13) for w in windup]
    np.testing.assert_allclose(found, torque, rtol=1e-9, atol=1e-10)


@pytest.mark.parametrize(
    ("gear", "shape"),
    [
        (sim.Gear(100, mesh_stiffness=15548.0), {"wave_generator_shape": 3.125}),
        (MESH, {"wave_generator_shape": 3.125}),
        (sim.Gear(100, wave_generator_stiffness=22.0), {"mesh_shape": 0.0487}),
    ],
    ids=["linear mesh", "mesh", "linear wave generator"],
)
def test_a_rigid_part_of_the_gear_makes_no_difference_by_its_shape(
    gear: sim.Gear, shape: dict[str, float]
) -> None:
    time = np.linspace(0.0, 0.2, 51)
    plain, shaped = (
        sim.Joint(g, ROTOR, sim.Output(inertia=0.5)).simulate(time, motor_torque=0.3)
        for g in (gear, replace(gear, **shape))
    )
    assert np.max(np.abs(plain["transmitted_torque"])) > 1.0
    for channel in ("output_position", "motor_position", "transmitted_torque"):
        np.testing.assert_array_equal(shaped[channel], plain[channel])


def test_beyond_its_pole_the_spring_has_an_infinite_torque() -> None:
    pole = 101 * np.pi / 2 / (0.0487 * 15548.0) + 1 / (3.125 * 21.9931)
    torque = sim.Joint(C1, ROTOR).transmitted_torque([0.999 * pole, 1.001 * pole])
    assert np.isfinite(torque[0]) and np.isinf(torque[1])


def test_torsion_is_negative_where_the_joint_pushes_outward() -> None:
    joint = sim.Joint(C1, replace(ROTOR, friction=sim.Friction.both_ways(2.0)))
    run = joint.simulate(np.linspace(0, 1, 101), load_torque=30.0)  # the stuck rotor carries it
    assert np.all(run["motor_stuck"] == 1.0)
    assert run["transmitted_torque"][-1] == pytest.approx(30.0, rel=1e-9)
    assert run["link_torque"][-1] == pytest.approx(30.0, rel=1e-9)
    np.testing.assert_allclose(run.torsion, -joint.windup(30.0)[0], rtol=1e-9)


def test_a_rigid_gear_moves_as_one_mass() -> None:
    joint = sim.Joint(sim.Gear(100), sim.Motor(inertia=1e-4), sim.Output(inertia=0.5))
    time = np.linspace(0, 1, 11)
    run = joint.simulate(time, motor_torque=0.1, load_torque=4.0)
    acceleration = (101 * 0.1 - 4.0) / (0.5 + 101**2 * 1e-4)
    np.testing.assert_allclose(run["output_position"], acceleration * time**2 / 2, atol=1e-13)
    np.testing.assert_allclose(run["motor_position"], 101 * run["output_position"], rtol=1e-14)
    np.testing.assert_allclose(run["link_torque"], 4.0 + 0.5 * acceleration, rtol=1e-12)


def test_load_friction_of_a_rigid_gear_counts_the_torque_that_it_transmits() -> None:
    share, inertia, total = 0.2, 0.5, 0.5 + 101**2 * 1e-4
    joint = sim.Joint(
        sim.Gear(100),
        sim.Motor(inertia=1e-4),
        sim.Output(inertia=inertia, friction=sim.Friction.both_ways(0.0, load=share)),
    )
    for load in (4.0, -4.0, 0.0):
        run = joint.simulate([0.0, 0.1], motor_torque=0.3, load_torque=load)
        a = run["output_acceleration"][-1]
        assert run["output_friction"][-1] == pytest.approx(share * abs(load + inertia * a))
        assert total * a == pytest.approx(101 * 0.3 - load - share * abs(load + inertia * a))


def test_heat_and_energy_balance_where_everything_acts() -> None:
    friction = sim.Friction(3.0, 2.0, 0.04, 0.06, 1.0, 0.1, viscous=4.0, quadratic=-1.0, cubic=0.5)
    joint = sim.Joint(
        replace(C1, damping=5.0, kinematic_error=ERROR, hysteresis=[sim.SlipElement(900.0, 0.8)]),
        sim.Motor(
            inertia=1e-4,
            friction=friction.at_motor(101),
            cogging=[sim.Harmonic(12, 0.004, 0.3, "motor_on_stator")],
        ),
        sim.Output(
            inertia=0.5,
            gravity=10.0,
            friction=friction,
            ripple=[sim.Harmonic(3, 0.2)],
            friction_ripple=[sim.Harmonic(2, 0.3)],
            presliding=[sim.SlipElement(2000.0, 0.5)],
        ),
    )
    time = np.linspace(0, 4, 4001)
    balances = []
    for steps in (4, 8):
        run = joint.simulate(
            time,
            motor_torque=0.4 * np.sin(3 * time),
            load_torque=2 * np.cos(time),
            steps_per_sample=steps,
        )
        balances.append(np.max(np.abs(run.balance)))
    through = run["motor_friction_heat"][-1] + run["output_friction_heat"][-1]
    assert np.all(np.diff(run["output_friction_heat"]) >= -1e-12)
    assert balances[1] < 1e-4 * through
    assert balances[1] < balances[0] / 3  # second order in the step


def test_temperatures_settle_where_heat_in_is_heat_out() -> None:
    thermal = sim.Thermal(5.0, 20.0, motor_to_body=1.5, motor_to_room=0.5, body_to_room=1.0)
    joint = sim.Joint(
        sim.Gear(100),
        sim.Motor(
            inertia=1e-4,
            friction=sim.Friction.both_ways(0.05),
            torque_constant=0.1,
            resistance=0.5,
            brake=1.0,
        ),
        sim.Output(inertia=0.5, friction=sim.Friction(viscous=20.0)),
        thermal=thermal,
    )
    time = np.linspace(0, 300, 30001)
    run = joint.simulate(time, motor_torque=0.5, room_temperature=20.0)
    copper = 0.5 * (0.5 / 0.1) ** 2
    speed = run["output_velocity"][-1]
    friction = 0.05 * 101 * speed + 20 * speed**2
    assert friction == pytest.approx(0.5 * 101 * speed, rel=1e-9)
    # a rigid gear has one friction, which heats the body
    conductance = np.array([[1.5 + 0.5, -1.5], [-1.5, 1.5 + 1.0]])
    above_room = np.linalg.solve(conductance, [copper, friction])
    got = [run["motor_temperature"][-1] - 20, run["body_temperature"][-1] - 20]
    np.testing.assert_allclose(got, above_room, rtol=1e-6)


def test_a_run_cut_in_two_has_the_same_bits() -> None:
    friction = sim.Friction.both_ways(3.0, stribeck=1.0, viscous=4.0, load=0.05)
    joint = sim.Joint(
        replace(C1, hysteresis=[sim.SlipElement(900.0, 0.8)]),
        sim.Motor(inertia=1e-4, friction=friction.at_motor(101)),
        sim.Output(inertia=0.5, gravity=10.0, friction=friction),
    )
    time = np.arange(2001) / 1024.0
    torque = 0.4 * np.sin(3 * time)
    whole = joint.simulate(time, motor_torque=torque, steps_per_sample=8)
    first = joint.simulate(time[:900], motor_torque=torque[:900], steps_per_sample=8)
    rest = joint.simulate(
        time[899:], motor_torque=torque[899:], steps_per_sample=8, start=first.end
    )
    for channel in ("output_position", "motor_position", "hysteresis_torque", "motor_work"):
        np.testing.assert_array_equal(whole[channel][899:], rest[channel])


def test_a_step_that_cannot_be_stable_is_refused() -> None:
    joint = sim.Joint(MESH, sim.Motor(inertia=1e-6), sim.Output(inertia=0.5))
    with pytest.raises(InputError, match=r"1 steps per sample of 0\.01 s cannot be stable"):
        joint.simulate([0.0, 0.01], steps_per_sample=1)


def test_a_gear_that_stiffens_under_torque_is_noticed_in_the_run() -> None:
    joint = sim.Joint(MESH, ROTOR, sim.Output(inertia=0.5, gravity=0.0))
    time = np.linspace(0, 0.2, 21)
    with pytest.raises(InputError, match=r"so stiff under its torque|wound up to the end"):
        joint.simulate(time, motor_torque=3.0, load_torque=300.0, steps_per_sample=1)
    drive = {"motor_torque": 3.0, "load_torque": 300.0}
    chosen = joint.simulate(time, **drive)  # chosen by itself
    fastest, _ = _core.simulation_rates(joint.core, float(np.max(chosen["transmitted_torque"])))
    assert fastest * chosen.longest_step < 1.94 * 1.02  # rows do not see the very stiffest
    fourth = joint.simulate(time, **drive, order=4)
    assert fastest * fourth.longest_step < 0.6 * 1.02


def test_a_motion_without_bound_ends_with_a_sentence() -> None:
    joint = sim.Joint(sim.Gear(100), ROTOR, sim.Output(friction=sim.Friction(cubic=-50.0)))
    with pytest.raises(InputError, match="the motion grows without bound"):
        joint.simulate(np.linspace(0, 50, 501), motor_torque=1.0)


@pytest.mark.parametrize("speed", [0.02, 0.5, -1.3])
def test_friction_given_at_the_output_brakes_as_much_from_the_motor(speed: float) -> None:
    def torque(f: sim.Friction, v: float) -> float:
        level = f.coulomb_forward if v > 0.0 else f.coulomb_backward
        slow = f.stribeck * np.exp(-((v / f.stribeck_velocity) ** 2))
        smooth = f.viscous * v + f.quadratic * v * abs(v) + f.cubic * v**3
        return float(np.sign(v) * (level + slow) + smooth)

    ratio = 51.0
    own = sim.Friction(3.0, 2.5, stribeck=1.0, viscous=4.0, quadratic=0.7, cubic=0.3)
    there = own.at_motor(ratio)
    assert ratio * torque(there, ratio * speed) == pytest.approx(torque(own, speed))
