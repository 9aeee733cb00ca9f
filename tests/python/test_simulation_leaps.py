"""Power series over rows: as exact as asked at every row, to every kink, with every channel."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from flexspline import simulation as sim
from flexspline.errors import InputError

Array = NDArray[np.float64]

START = sim.Start(output_position=0.3, motor_position=30.32)
MESH = sim.Joint(
    sim.Gear(100, mesh_stiffness=15548.0, mesh_shape=0.0487, damping=5.0),
    sim.Motor(inertia=1e-4, friction=sim.Friction(viscous=1e-4, cubic=1e-9), brake=2.0),
    sim.Output(
        inertia=0.5, gravity=20.0, gravity_angle=0.1, friction=sim.Friction(viscous=2, cubic=3)
    ),
)
RIGID = replace(MESH, gear=sim.Gear(100))
LINEAR = replace(MESH, gear=sim.Gear(100, mesh_stiffness=15548.0, damping=5.0))
JOINTS = pytest.mark.parametrize("joint", [MESH, LINEAR, RIGID], ids=["mesh", "linear", "rigid"])
MOTION = ("output_position", "output_velocity", "motor_position", "motor_velocity")


def truth(joint: sim.Joint, time: Array) -> Array:
    """The joint written down a second time, between straight torques: rows of `MOTION`."""
    n, gear = 101.0, joint.gear

    def rate(t: float, y: Array) -> list[float]:
        theta, q, omega, v = y
        twist = theta / n - q
        shape = gear.mesh_shape * gear.mesh_stiffness
        tau = np.tan(twist * shape) / gear.mesh_shape if shape else twist * gear.mesh_stiffness
        tau += gear.damping * (omega / n - v)
        drive = 0.3 - 0.02 * t - 1e-4 * omega - 1e-9 * omega**3
        out = -20 * np.sin(q - 0.1) - 2 * v - 3 * v**3 - (5.0 - 0.2 * t)
        if gear.rigid:
            acceleration = (n * drive + out) / (0.5 + n**2 * 1e-4)
            return [omega, v, n * acceleration, acceleration]
        return [omega, v, (drive - tau / n) / 1e-4, (tau + out) / 0.5]

    begin = [n * 0.3 if gear.rigid else 30.32, 0.3, 0.0, 0.0]
    done = solve_ivp(rate, (0.0, time[-1]), begin, "DOP853", t_eval=time, rtol=3e-14, atol=1e-15)
    return np.asarray(done.y[[1, 3, 0, 2]])


def furthest(
    one: sim.Trajectory, other: sim.Trajectory, channels: tuple[str, ...] = MOTION
) -> float:
    """The largest difference, in units of what a channel moves."""
    return max(float(np.max(np.abs(one[c] - other[c])) / np.ptp(other[c])) for c in channels)


@JOINTS
def test_every_row_on_the_way_is_as_exact_as_asked(joint: sim.Joint) -> None:
    time = np.linspace(0.0, 1.0, 751)
    drive = {"motor_torque": 0.3 - 0.02 * time, "load_torque": 5.0 - 0.2 * time}
    exact = truth(joint, time)
    moves = np.ptp(exact, axis=1)
    for accuracy in (1e-4, 1e-6, 1e-8, 1e-10):
        run = joint.simulate(time, start=START, accuracy=accuracy, channels=MOTION, **drive)
        rows = np.array([run[c] for c in MOTION])
        error = np.max(np.abs(rows - exact).T / moves)
        assert error < 2 * accuracy
        assert run.longest_step > 5 * (time[1] - time[0])


@JOINTS
def test_torques_with_kinks_and_curves_are_met_as_row_by_row(joint: sim.Joint) -> None:
    time = np.linspace(0.0, 1.0, 401)
    kinked = np.interp(time, [0.0, 0.2475, 0.5, 0.7325, 1.0], [0.0, 0.6, 0.6, -0.4, 0.2])
    bent = np.where(time < 0.6, 4.0 - time, 3.4 + np.sin(9 * (time - 0.6)))
    for inputs in ("linear", "hold"):
        drive = {"motor_torque": kinked, "load_torque": bent, "inputs": inputs, "start": START}
        leaps = joint.simulate(time, accuracy=1e-11, **drive)
        steps = joint.simulate(time, accuracy=1e-11, order=6, **drive)
        assert furthest(leaps, steps) < 1e-9
        np.testing.assert_allclose(leaps["motor_torque"], kinked, rtol=0, atol=1e-15)


def test_a_kink_of_a_billionth_is_not_stepped_over() -> None:
    time = np.arange(513) / 256.0
    straight = 0.5 * time
    bent = straight + 1e-9 * np.maximum(time - 1.0, 0.0)
    runs = [RIGID.simulate(time, motor_torque=t, accuracy=1e-13) for t in (straight, bent)]
    steps = [
        RIGID.simulate(time, motor_torque=t, accuracy=1e-13, order=6) for t in (straight, bent)
    ]
    by_leaps = runs[1]["output_position"] - runs[0]["output_position"]
    by_steps = steps[1]["output_position"] - steps[0]["output_position"]
    assert np.max(np.abs(by_steps)) > 5e-10
    assert np.max(np.abs(by_leaps - by_steps)) < 1e-12


@JOINTS
def test_all_channels_on_the_way_are_those_of_small_steps(joint: sim.Joint) -> None:
    time = np.linspace(0.0, 1.0, 201)
    drive = {"motor_torque": 0.3 - 0.2 * time, "load_torque": 5.0 - time, "start": START}
    leaps = joint.simulate(time, accuracy=1e-10, **drive)
    steps = joint.simulate(time, steps_per_sample=120, **drive)
    moving = tuple(c for c in leaps.columns if np.ptp(steps[c]) > 0)
    assert len(moving) >= 15
    plain = tuple(c for c in moving if "heat" not in c and "work" not in c)
    assert furthest(leaps, steps, plain) < 2e-9
    assert furthest(leaps, steps, moving) < 2e-5  # energies of steps are of second order
    through = leaps["motor_friction_heat"][-1] + leaps["output_friction_heat"][-1]
    assert np.max(np.abs(leaps.balance)) < 1e-9 * through


def test_servo_stop_brake_and_heat_go_on_between_leaps() -> None:
    servo = sim.Servo(rate=500.0, position_gain=20.0, velocity_gain=0.02, torque_limit=3.0)
    thermal = sim.Thermal(5.0, 20.0, motor_to_body=1.5, motor_to_room=0.5, body_to_room=1.0)
    rotor = replace(MESH.motor, torque_constant=0.1, resistance=0.5)
    joint = replace(MESH, motor=rotor, thermal=thermal)
    time = np.linspace(0.0, 1.0, 301)
    drive = {
        "servo": servo,
        "position_command": 0.3 + 0.2 * np.sin(4 * time),
        "stop": sim.Stop(time=0.7, reaction="brake"),
        "start": START,
    }
    leaps = joint.simulate(time, accuracy=1e-10, **drive)
    steps = joint.simulate(time, accuracy=1e-10, order=4, **drive)
    # the brake goes by steps in both
    channels = (*MOTION, "motor_temperature", "body_temperature", "copper_heat", "stopped")
    assert furthest(leaps, steps, channels) < 1e-6
    assert leaps["stopped"][-1] == 1.0 and leaps["motor_stuck"][-1] == 1.0


def test_a_run_goes_on_where_it_ended() -> None:
    time = np.linspace(0.0, 1.0, 401)
    torque = 0.3 - 0.1 * time
    whole = MESH.simulate(time, motor_torque=torque, start=START, accuracy=1e-11)
    first = MESH.simulate(time[:150], motor_torque=torque[:150], start=START, accuracy=1e-11)
    rest = MESH.simulate(time[149:], motor_torque=torque[149:], start=first.end, accuracy=1e-11)
    for channel in (*MOTION, "motor_work", "output_friction_heat"):
        np.testing.assert_allclose(rest[channel], whole[channel][149:], rtol=1e-9, atol=1e-10)


def test_a_joint_at_rest_stays() -> None:
    time = np.linspace(0.0, 10.0, 1001)
    still = replace(MESH, output=replace(MESH.output, gravity=0.0)).simulate(time)
    assert np.all(still["output_position"] == 0.0) and np.all(still["motor_velocity"] == 0.0)


def test_a_gear_wound_up_to_the_end_of_its_spring_is_told_so() -> None:
    time = np.linspace(0.0, 2.0, 21)
    with pytest.raises(InputError, match="wound up to the end of its spring"):
        MESH.simulate(time, motor_torque=3e3, load_torque=3e5)
