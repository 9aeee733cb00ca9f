"""The forward simulation's steps against tight solutions: their order, and the choice of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from flexspline.errors import InputError
from flexspline.simulation import Friction, Gear, Harmonic, Joint, Motor, Output, Start

Array = NDArray[np.float64]

MESH = Gear(100, mesh_stiffness=15548.0, mesh_shape=0.0487)
ERROR = (
    Harmonic(2, 3.0e-3, 0.4, "output_on_housing"),
    Harmonic(1, 2.0e-3, 1.4, "wave_generator_on_circular_spline"),
)
ROTOR = Motor(inertia=1e-4)


def smooth_joint() -> Joint:
    """Everything that is smooth at once."""
    return Joint(
        replace(MESH, damping=5.0, kinematic_error=ERROR),
        Motor(inertia=1e-4, friction=Friction(viscous=1e-4, cubic=1e-9)),
        Output(inertia=0.5, gravity=20.0, gravity_angle=0.1, friction=Friction(viscous=2, cubic=3)),
    )


def smooth_reference(start: Array, end: float, error: tuple[Harmonic, ...]) -> Array:
    """The same joint written down a second time: θ, q, θ̇, q̇ at `end`."""
    n, stiffness, shape, on = 101.0, 15548.0, 0.0487, float(bool(error))

    def rate(t: float, y: Array) -> list[float]:
        theta, q, omega, v = y
        beta = theta - q
        wave = on * (3e-3 * np.cos(2 * q + 0.4) + 2e-3 * np.cos(beta + 1.4))
        by_theta = -2e-3 * on * np.sin(beta + 1.4)
        by_q = -6e-3 * on * np.sin(2 * q + 0.4) - by_theta
        mesh = np.tan((theta - n * q + wave) / n * shape * stiffness) / shape
        tau = mesh / n
        damping = 5.0 * (omega / n - v)
        on_motor = 0.5 + 0.6 * t - tau * (1 + by_theta) - damping / n
        on_output = tau * (n - by_q) + damping - 20 * np.sin(q - 0.1) - (3 - t)
        return [
            omega,
            v,
            (on_motor - 1e-4 * omega - 1e-9 * omega**3) / 1e-4,
            (on_output - 2 * v - 3 * v**3) / 0.5,
        ]

    done = solve_ivp(rate, (0.0, end), start, method="DOP853", rtol=1e-13, atol=1e-15)
    return np.asarray(done.y[:, -1])


def plain_joint() -> Joint:
    """The smooth joint without kinematic error: the leanest code for two masses."""
    joint = smooth_joint()
    return replace(joint, gear=replace(joint.gear, kinematic_error=()))


def rigid_joint() -> Joint:
    """One mass whose friction is felt within a step."""
    joint = smooth_joint()
    return replace(joint, gear=Gear(100), output=replace(joint.output, gravity=60.0))


def rigid_reference(start: Array, end: float) -> Array:
    """The same written down a second time: q, q̇ at `end`."""
    n = 101.0

    def rate(t: float, y: Array) -> list[float]:
        q, v = y
        drive = n * (0.5 + 0.6 * t - 1e-4 * n * v - 1e-9 * (n * v) ** 3)
        torque = drive - 60 * np.sin(q - 0.1) - 2 * v - 3 * v**3 - (3 - t)
        return [v, torque / (0.5 + n**2 * 1e-4)]

    done = solve_ivp(rate, (0.0, end), start, method="DOP853", rtol=3e-14, atol=1e-16)
    return np.asarray(done.y[:, -1])


@pytest.mark.parametrize(("order", "counts"), [(4, (2, 4, 8)), (6, (1, 2, 4))])
@pytest.mark.parametrize("error", [ERROR, ()], ids=["kinematic error", "plain"])
def test_the_smooth_joint_converges_with_its_order_to_a_tight_solution(
    order: int, counts: tuple[int, ...], error: tuple[Harmonic, ...]
) -> None:
    time = np.linspace(0.0, 0.1, 51)
    start = Start(output_position=0.3, motor_position=30.32)
    reference = smooth_reference(np.array([30.32, 0.3, 0.0, 0.0]), 0.1, error)
    errors = []
    for steps in counts:
        run = (smooth_joint() if error else plain_joint()).simulate(
            time,
            motor_torque=0.5 + 0.6 * time,
            load_torque=3.0 - time,
            start=start,
            steps_per_sample=steps,
            order=order,
        )
        end = [run[c][-1] for c in ("motor_position", "output_position", "motor_velocity")]
        errors.append(np.abs(np.array(end) - reference[:3]))
    # halving the step divides the error by 2^order; the next term is two orders higher
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert np.all(np.abs(orders[1:, :2] - order) < (0.1 if order == 4 else 0.3))
    assert errors[-1][1] < 1e-10  # rad at the output


@pytest.mark.parametrize(("order", "counts"), [(4, (1, 2, 4)), (6, (1, 2, 4))])
def test_a_rigid_joint_converges_with_its_order_to_a_tight_solution(
    order: int, counts: tuple[int, ...]
) -> None:
    time = np.linspace(0.0, 1.0, 101 if order == 4 else 26)
    reference = rigid_reference(np.array([0.3, 0.0]), 1.0)
    errors = []
    for steps in counts:
        run = rigid_joint().simulate(
            time,
            motor_torque=0.5 + 0.6 * time,
            load_torque=3.0 - time,
            start=Start(output_position=0.3),
            steps_per_sample=steps,
            order=order,
        )
        end = [run[c][-1] for c in ("output_position", "output_velocity")]
        errors.append(np.abs(np.array(end) - reference))
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert np.all(np.abs(orders[1:] - order) < (0.1 if order == 4 else 0.3))


def test_the_order_that_is_chosen_costs_no_more_and_errs_no_more_than_order_four() -> None:
    time = np.linspace(0.0, 1.0, 26)
    start = Start(output_position=0.3, motor_position=30.32)
    fine = plain_joint().simulate(time, start=start, accuracy=1e-12)["output_position"]
    for accuracy in (1e-6, 1e-8, 1e-10):
        chosen = plain_joint().simulate(time, start=start, accuracy=accuracy)
        fourth = plain_joint().simulate(time, start=start, accuracy=accuracy, order=4)
        assert 10 / chosen.longest_step <= 4 / fourth.longest_step
        error = np.max(np.abs(chosen["output_position"] - fine))
        assert error <= 2 * np.max(np.abs(fourth["output_position"] - fine))


def test_order_six_is_refused_where_something_may_stick() -> None:
    joint = Joint(MESH, replace(ROTOR, friction=Friction.both_ways(0.1)))
    with pytest.raises(InputError, match="order 6 is for joints in which nothing sticks"):
        joint.simulate([0.0, 0.1], order=6)
    with pytest.raises(InputError, match="order is 5; give 4, 6 or None"):
        joint.simulate([0.0, 0.1], order=5)
    with pytest.raises(InputError, match="accuracy and steps_per_sample are both given"):
        joint.simulate([0.0, 0.1], accuracy=1e-6, steps_per_sample=3)
    with pytest.raises(InputError, match=r"accuracy is 0\.1; give a number from 1e-13 to 1e-4"):
        joint.simulate([0.0, 0.1], accuracy=0.1)
