"""What drives, stops and reads a simulated joint, and what wrong calls are told."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from flexspline import simulation as sim
from flexspline.errors import InputError

FRICTION = sim.Friction.both_ways(2.0, viscous=3.0)
JOINT = sim.Joint(
    sim.Gear(100, mesh_stiffness=15548.0, mesh_shape=0.0487, damping=5.0),
    sim.Motor(inertia=1e-4, friction=FRICTION.at_motor(101), brake=1.0),
    sim.Output(inertia=0.5, link_inertia=0.4, gravity=5.0, friction=sim.Friction.both_ways(0.3)),
)
SERVO = sim.Servo(position_gain=20.0, velocity_gain=0.03, integral_gain=0.3, torque_limit=2.0)
TIME = np.arange(4001) / 1000.0


def test_a_servo_with_integral_ends_on_its_command() -> None:
    run = JOINT.simulate(TIME, servo=SERVO, position_command=0.5, inputs="hold")
    assert run["motor_position"][-1] == pytest.approx(0.5 * 101, abs=2e-3)
    assert np.max(np.abs(run["motor_torque"])) <= 2.0


def test_a_servo_reads_the_motor_of_a_rigid_gear() -> None:
    rigid = replace(JOINT, gear=sim.Gear(100), output=sim.Output(inertia=0.5, gravity=5.0))
    run = rigid.simulate(TIME, servo=SERVO, position_command=np.full(len(TIME), 0.3))
    assert run["output_position"][-1] == pytest.approx(0.3, abs=1e-3)


def test_a_servo_holds_its_torque_from_tick_to_tick_and_comes_late_by_its_delay() -> None:
    command = np.where(TIME >= 1.0, 0.1, 0.0)
    slow = replace(SERVO, rate=100.0, velocity_gain=0.004, integral_gain=0.0)
    joint = replace(JOINT, output=replace(JOINT.output, gravity=0.0))
    for delay in (0, 3):
        servo = replace(slow, delay=delay)
        run = joint.simulate(TIME, servo=servo, position_command=command)
        torque = run["motor_torque"]
        assert np.ptp(torque[1001:1010]) == 0.0
        first = float(TIME[np.flatnonzero(torque)[0]])
        assert first == pytest.approx(1.0 + delay / 100.0, abs=0.0105)


def test_a_coarse_encoder_makes_the_servo_restless() -> None:
    quiet = JOINT.simulate(TIME, servo=SERVO, velocity_command=0.3, position_command=0.3 * TIME)
    coarse = replace(SERVO, encoder_bits=10)
    rough = JOINT.simulate(TIME, servo=coarse, velocity_command=0.3, position_command=0.3 * TIME)
    rows = slice(3000, None)
    assert np.std(np.diff(rough["motor_torque"][rows])) > 10 * np.std(
        np.diff(quiet["motor_torque"][rows])
    )


def test_a_stop_at_the_contact_lowers_its_peak() -> None:
    joint = replace(JOINT, obstacle=sim.Obstacle(0.5, 2e3, 0.2))
    told: dict[str, Any] = {"position_command": np.minimum(0.6 * TIME, 1.2), "servo": SERVO}
    peaks = {"none": joint.simulate(TIME, **told)["contact_torque"].max()}
    for reaction in ("release", "brake", "hold"):
        stop = sim.Stop(threshold=20.0, delay=2e-3, reaction=reaction)
        run = joint.simulate(TIME, stop=stop, **told)
        first = int(np.flatnonzero(run["stopped"])[0])
        alarm = int(np.flatnonzero(np.abs(run["link_torque"]) > 20.0)[0])
        assert first - alarm in (2, 3)
        if reaction != "hold":
            assert np.all(run["motor_torque"][first:] == 0.0)
        peaks[reaction] = run["contact_torque"].max()
    assert max(peaks["release"], peaks["brake"], peaks["hold"]) < 0.7 * peaks["none"]


def test_a_stop_in_time_changes_nothing_before_it() -> None:
    told: dict[str, Any] = {"position_command": 0.4 * TIME, "servo": SERVO}
    free = JOINT.simulate(TIME, steps_per_sample=4, **told)
    stopped = JOINT.simulate(TIME, steps_per_sample=4, stop=sim.Stop(2.0, reaction="brake"), **told)
    np.testing.assert_array_equal(free["motor_position"][:2001], stopped["motor_position"][:2001])
    assert np.all(stopped["motor_stuck"][-500:] == 1.0)


def test_encoders_read_what_their_bits_leave_late_and_with_eccentricity() -> None:
    run = JOINT.simulate(TIME, servo=SERVO, velocity_command=0.5, position_command=0.5 * TIME)
    encoder = sim.Encoder(18, (sim.Harmonic(1, 1e-3, 0.5),), delay=5e-3)
    log = run.log(output_encoder=encoder)
    q = np.interp(TIME - 5e-3, TIME, run["output_position"])
    seen = q + 1e-3 * np.cos(q + 0.5)
    step = 2 * np.pi / 2**18
    # the delay is taken between rows: half a row squared times acceleration and order
    assert np.all(np.abs(log["output_position"] + step / 2 - seen) <= step / 2 + 1e-6)
    assert len(np.unique(np.round(log["output_position"] / step, 6) % 1)) == 1
    np.testing.assert_array_equal(log["motor_position"], run["motor_position"])


def test_a_sensor_is_gain_offset_ripple_drift_and_lag_of_the_torque_at_its_place() -> None:
    thermal = sim.Thermal(body_capacity=20.0, body_to_room=0.5)
    run = replace(JOINT, thermal=thermal).simulate(
        TIME, servo=SERVO, velocity_command=1.0, position_command=TIME, room_temperature=21.0
    )
    sensor = sim.TorqueSensor(
        "gear", 1.1, -0.2, (sim.Harmonic(2, 0.3, 0.1, "motor_on_stator"),), (0.01,)
    )
    expected = 1.1 * run["transmitted_torque"] - 0.2
    expected += 0.3 * np.cos(2 * run["motor_position"] + 0.1)
    expected += 0.01 * (run["body_temperature"] - 25.0)
    assert np.ptp(run["body_temperature"]) > 0.01
    np.testing.assert_allclose(run.log(sensor=sensor)["sensor_torque"], expected, atol=1e-12)
    ramp = replace(run, columns={**run.columns, "link_torque": 3.0 * TIME})
    late = ramp.log(sensor=sim.TorqueSensor(time_constant=0.05))["sensor_torque"]
    exact = 3.0 * (TIME - 0.05 * (1 - np.exp(-TIME / 0.05)))
    np.testing.assert_allclose(late, exact, atol=1e-9)


def test_the_link_torque_is_load_gravity_and_inertia_of_the_link() -> None:
    run = JOINT.simulate(TIME, motor_torque=0.3 * np.sin(5 * TIME), load_torque=2.0)
    expected = 2.0 + 5.0 * np.sin(run["output_position"]) + 0.4 * run["output_acceleration"]
    np.testing.assert_allclose(run["link_torque"], expected, atol=1e-9)
    drive = (
        run["transmitted_torque"]
        - run["output_friction"]
        - 2.0
        - 5.0 * np.sin(run["output_position"])
    )
    np.testing.assert_allclose(0.5 * run["output_acceleration"], drive, atol=1e-9)


def test_noise_has_its_deviation_and_memory_and_its_own_seed() -> None:
    still = JOINT.simulate(np.arange(40001) / 1000.0, channels=None)
    noise = {"sensor_torque": sim.Noise(0.2, memory=0.01), "temperature": sim.Noise(0.1)}
    log = still.log(noise=noise, seed=5)
    error = log["sensor_torque"] - still["link_torque"]
    # 40 s of a memory of 10 ms: 2000 independent values, five deviations
    assert np.std(error) == pytest.approx(0.2, rel=5 / np.sqrt(2 * 2000))
    correlation = np.mean(error[10:] * error[:-10]) / np.var(error)
    assert correlation == pytest.approx(np.exp(-1.0), abs=5 / np.sqrt(2000))
    alone = still.log(noise={"sensor_torque": noise["sensor_torque"]}, seed=5)
    np.testing.assert_array_equal(alone["sensor_torque"], log["sensor_torque"])
    other = still.log(noise=noise, seed=6)
    assert not np.array_equal(other["sensor_torque"], log["sensor_torque"])


def test_a_log_says_what_it_is_and_keeps_every_second_row_at_half_the_rate() -> None:
    run = JOINT.simulate(TIME, motor_torque=0.2)
    log = run.log(name="run 7", rate=500.0, facts={"operator": "nobody"})
    assert (log.name, log.facts["gear_ratio"], log.facts["output_spline"]) == (
        "run 7",
        100,
        "circular",
    )
    assert len(log) == 2001 and log.rate == pytest.approx(500.0)
    assert "output_velocity" not in log and "motor_current" not in log
    assert log.effective_ratio == JOINT.effective_ratio


def test_a_simulation_has_the_same_bits_twice() -> None:
    torque = 0.5 * np.sin(7 * TIME)
    one, two = (JOINT.simulate(TIME, motor_torque=torque) for _ in range(2))
    for name in one.columns:
        np.testing.assert_array_equal(one[name], two[name])


NAN = np.where(TIME == 1.0, np.nan, 0.0)


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        ({"motor_torque": NAN}, "motor_torque is nan in row 1000; give finite numbers"),
        ({"load_torque": np.zeros(7)}, r"load_torque has shape \(7,\) where time has 4001 rows"),
        ({"room_temperature": np.inf}, "room_temperature is inf in row 0"),
        ({"position_command": TIME}, "position_command is given without a servo"),
        ({"servo": SERVO}, "the servo has a position_gain but no position_command"),
        ({"inputs": "cubic"}, "inputs is 'cubic'; give 'linear' or 'hold'"),
        ({"steps_per_sample": 0}, "steps_per_sample is 0; give a whole number"),
        ({"steps_per_sample": 1.5}, "steps_per_sample is 1.5; give a whole number"),
        ({"channels": ["ouput_position"]}, r"did you mean 'output_position'\?"),
        ({"stop": sim.Stop(1.0, reaction="hold")}, "'hold' needs a servo with a position_gain"),
    ],
)
def test_a_wrong_call_is_told_what_to_do(call: dict[str, Any], sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        JOINT.simulate(TIME, **call)


@pytest.mark.parametrize(
    ("times", "sentence"),
    [
        ([0.0, 1.0, 1.0], "does not increase from row 1 to row 2"),
        ([0.0, np.nan], "time is not finite in row 1"),
        ([0.0], r"time has shape \(1,\)"),
    ],
)
def test_a_wrong_time_is_named_with_its_row(times: list[float], sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        JOINT.simulate(times)


@pytest.mark.parametrize(
    ("build", "sentence"),
    [
        (
            lambda: sim.Friction(coulomb_forward=-1.0),
            "Friction.coulomb_forward is -1.0; give a number",
        ),
        (lambda: sim.Friction(viscous=np.nan), "Friction.viscous is nan; give a finite number"),
        (lambda: sim.Friction(load_forward=1.0), "could never be driven back"),
        (lambda: sim.Gear(0.0), "Gear.ratio is 0.0; give a number above 0"),
        (lambda: sim.Gear(output_spline="flexspline"), "give 'circular', 'flex' or ''"),
        (lambda: sim.Gear(damping=1.0), "damping but no stiffness"),
        (lambda: sim.Joint(sim.Gear(mesh_stiffness=1e4)), "compliant but Motor.inertia is 0"),
        (lambda: sim.Output(link_inertia=2.0), "give a part of it"),
        (lambda: sim.Output(friction_ripple=[sim.Harmonic(1, 1.5)]), "so the friction could push"),
        (lambda: sim.Harmonic(0, 1.0), "Harmonic.order is 0; give a whole number"),
        (lambda: sim.Harmonic(1, 1.0, pair="output"), "is no pair of parts"),
        (lambda: sim.Motor(resistance=1.0), "give torque_constant as well"),
        (lambda: sim.Obstacle(direction=0), "Obstacle.direction is 0"),
        (lambda: sim.Obstacle(direction=-2), "Obstacle.direction is -2"),
        (lambda: sim.Servo(delay=65), "Servo.delay is 65; give a whole number from 0 to 64"),
        (lambda: sim.Servo(feedback="link"), "give 'motor' or 'output'"),
        (lambda: sim.Stop(reaction="panic"), "give 'release', 'brake' or 'hold'"),
        (lambda: sim.Stop(threshold=0.0), "Stop.threshold is 0.0 Nm"),
        (lambda: sim.SlipElement(0.0, 1.0), "SlipElement.stiffness is 0.0"),
        (lambda: sim.Start(output_position=np.inf), "Start.output_position is inf"),
        (
            lambda: sim.Joint(output=sim.Output(presliding=[sim.SlipElement(1, 1)] * 17)),
            "more than 16 slip",
        ),
    ],
)
def test_a_part_that_cannot_be_is_refused(build: Any, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        build()


def test_a_servo_that_hammers_on_the_gear_is_told_so() -> None:
    unstable = replace(SERVO, rate=100.0)  # K_v T / J_m = 3
    command = np.where(TIME >= 1.0, 0.1, 0.0)
    with pytest.raises(InputError, match="wound up to the end of its spring"):
        JOINT.simulate(TIME, servo=unstable, position_command=command)


def test_a_brake_that_is_not_there_cannot_fall() -> None:
    joint = replace(JOINT, motor=replace(JOINT.motor, brake=0.0))
    with pytest.raises(InputError, match=r"give Motor\.brake"):
        joint.simulate(TIME, stop=sim.Stop(1.0, reaction="brake"))


def test_a_channel_that_no_rig_has_is_refused() -> None:
    run = JOINT.simulate(TIME[:11])
    with pytest.raises(InputError, match="'sensor_voltage' is no channel"):
        run.log(channels=["sensor_voltage"])
    with pytest.raises(InputError, match=r"motor_current needs Motor\.torque_constant"):
        run.log(channels=["motor_current"])
    with pytest.raises(InputError, match="no channel 'link_torqe'"):
        run["link_torqe"]
    with pytest.raises(InputError, match="a log at 2000 Hz of a trajectory at 1000 Hz"):
        run.log(rate=2000.0)


def test_torsion_is_the_output_s_angle_at_the_motor_less_that_of_the_motor() -> None:
    run = JOINT.simulate(TIME, motor_torque=0.3 * np.sin(5 * TIME), load_torque=2.0)
    apart = JOINT.effective_ratio * run["output_position"] - run["motor_position"]
    np.testing.assert_array_equal(run.torsion, apart)
    assert 1e-4 < np.abs(run.torsion).max() < 0.1


def test_noise_of_a_sensor_is_added_to_what_it_reads() -> None:
    run = JOINT.simulate(TIME, load_torque=2.0)
    noise = np.linspace(-0.1, 0.3, len(TIME))
    sensor = sim.TorqueSensor(gain=1.1)
    np.testing.assert_allclose(sensor.read(run, noise) - sensor.read(run), noise, atol=1e-12)


def test_a_joint_starts_in_balance_with_the_load_of_its_first_row() -> None:
    load = np.where(np.arange(len(TIME)) == 0, 2.0, 7.0)
    run = JOINT.simulate(TIME, load_torque=load)
    weight = JOINT.output.gravity * np.sin(run["output_position"][0] - JOINT.output.gravity_angle)
    assert run["transmitted_torque"][0] == pytest.approx(2.0 + weight, abs=1e-9)
