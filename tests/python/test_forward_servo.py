"""A drive under a servo law: closed loop, encoder counts, back-EMF, and what is switched off."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from forward_runs import FACTS, RATIO, drive
from numpy.typing import NDArray

import flexspline
from flexspline.errors import InputError
from flexspline.forward import PositionServo
from flexspline.logs.log import Log
from flexspline.simulation import Gear, Joint, Motor, Output, Servo

Array = NDArray[np.float64]

PENDULUM = drive([("inertia", [0.5]), ("gravity", [8.0, 0.0]), ("viscous_friction", [3.0])])
TIME = np.arange(0.0, 8.0, 0.005)


def told(command: Array, time: Array = TIME, **more: Any) -> Log:
    """A run in which a servo was told a position, from rest at zero."""
    facts = {**FACTS, **more.pop("facts", {})}
    rest = np.zeros(len(time))
    return Log.from_arrays(
        time=time, commanded_position=command, output_position=rest, facts=facts, **more
    )


def test_a_proportional_servo_ends_where_it_balances_gravity() -> None:
    servo = PositionServo(position_gain=0.9, torque=1.0)  # 90 Nm/rad at the output
    made = flexspline.simulate(PENDULUM, told(np.full(len(TIME), 0.4)), controller=servo)
    q = made.simulated[-1]
    assert RATIO * 0.9 * (0.4 - q) == pytest.approx(8.0 * np.sin(q), rel=1e-6)
    assert made.log["motor_torque"][-1] == pytest.approx(0.9 * (0.4 - q), rel=1e-9)


def test_an_integral_ends_on_the_command_and_the_limit_is_kept() -> None:
    servo = PositionServo(0.9, velocity_gain=0.02, integral_gain=1.5, limit=0.2)
    made = flexspline.simulate(PENDULUM, told(np.full(len(TIME), 0.4)), controller=servo)
    assert made.simulated[-1] == pytest.approx(0.4, abs=1e-4)
    assert np.max(np.abs(made.log["motor_torque"])) == 0.2
    # an integral that stood while the limit held lets go at once: 4 s of 1.5 · 2.7 did not gather
    servo = PositionServo(0.9, integral_gain=1.5, limit=0.02)
    late = TIME >= 4.0
    log = told(np.where(late, 0.0, 3.0))
    torque = flexspline.simulate(PENDULUM, log, controller=servo).log["motor_torque"]
    assert np.all(torque[~late] == 0.02)
    assert torque[late][0] == -0.02


def test_counts_of_the_encoder_hold_the_torque_until_the_next_one() -> None:
    count = 0.02
    servo = PositionServo(0.9, encoder_step=count)
    made = flexspline.simulate(PENDULUM, told(0.4 * np.sin(TIME)), controller=servo)
    read = count * np.round(made.simulated[:-1] / count)
    expected = np.clip(0.9 * (0.4 * np.sin(TIME[:-1]) - read), -1, 1)
    assert np.allclose(made.log["motor_torque"][:-1], expected, atol=1e-12)


def test_duty_supply_and_back_emf_give_the_torque_of_a_motor() -> None:
    """τ = k V u − k_e q̇, all of it only while enabled."""
    volts = 7.0 + np.sin(TIME)
    enabled = (TIME < 4.0).astype(float)
    servo = PositionServo(
        "kp", gain_scale=0.01, torque=0.05, supply=True, back_emf=0.004, encoder_step=0.0
    )
    log = told(0.5 * np.sin(2 * TIME), supply_voltage=volts, enabled=enabled, facts={"kp": 400})
    made = flexspline.simulate(PENDULUM, log, controller=servo)
    moved = made.log
    duty = np.clip(4.0 * (log["commanded_position"] - moved["output_position"]), -1, 1)
    expected = enabled * (0.05 * volts * duty - 0.004 * moved["output_velocity"])
    assert np.allclose(moved["motor_torque"][:-1], expected[:-1], atol=1e-12)
    assert np.any(np.abs(duty) == 1.0)


def test_a_run_that_is_switched_off_swings_freely() -> None:
    servo = PositionServo(0.9, back_emf=0.5)
    log = told(np.zeros(len(TIME)), enabled=np.zeros(len(TIME)))
    log = log.with_columns(
        {"output_position": 0.7 * np.cos(TIME), "output_velocity": -0.7 * np.sin(TIME)}, note="up"
    )
    made = flexspline.simulate(PENDULUM, log, controller=servo)
    torque = {"motor_torque": np.zeros(len(TIME))}
    free = flexspline.simulate(PENDULUM, log.with_columns(torque, note="off"))
    assert np.array_equal(made.simulated, free.simulated)
    assert made.simulated[0] == 0.7


def test_the_loop_is_that_of_the_simulated_rigs_servo() -> None:
    """Other code: a cascade K_p, K_v at the motor is K_p K_v and K_v at the angle."""
    joint = Joint(Gear(RATIO, "flex"), Motor(inertia=2e-5), Output(inertia=0.3, gravity=8.0))
    time = np.arange(0.0, 2.0, 0.002)
    command = np.full(len(time), 0.5)
    cascade = Servo(rate=500.0, position_gain=12.0, velocity_gain=0.003, torque_limit=0.15,
                    feedback="output", encoder_bits=32)  # fmt: skip
    expected = joint.simulate(time, servo=cascade, position_command=command)["output_position"]
    model = drive([("inertia", [0.5]), ("gravity", [8.0, 0.0])])
    servo = PositionServo(12.0 * 0.003 * RATIO, velocity_gain=0.003 * RATIO, limit=0.15,
                          encoder_step=2 * np.pi / 2**32)  # fmt: skip
    made = flexspline.simulate(model, told(command, time), controller=servo)
    assert np.max(np.abs(made.simulated - expected)) < 1e-5
    assert np.max(np.abs(expected)) > 0.4


def test_a_servo_file_is_read_as_it_was_written(tmp_path: Path) -> None:
    servo = PositionServo("kp", velocity_gain=0.1, limit=0.9, supply=True, gain_scale=2.5e-3)
    servo.save(tmp_path / "servo.json")
    assert PositionServo.load(tmp_path / "servo.json") == servo
    assert json.loads((tmp_path / "servo.json").read_text())["position_gain"] == "kp"


WRONG: list[tuple[Any, str]] = [
    ({"position_gain": 1.0, "velocity_gian": 2.0}, "did you mean 'velocity_gain'"),
    ({"velocity_gain": 1.0}, "has no position_gain"),
    ([1.0], "has no position_gain"),
    ({"position_gain": 1.0, "limit": 0.0}, "limit must be above 0"),
    ({"position_gain": 1.0, "torque": None}, "torque is None; give a finite number"),
    ({"position_gain": 1.0, "supply": "yes"}, "supply is 'yes'; give true or false"),
]


@pytest.mark.parametrize(("content", "says"), WRONG)
def test_a_wrong_servo_is_named_with_its_file(content: Any, says: str, tmp_path: Path) -> None:
    path = tmp_path / "servo.json"
    path.write_text(json.dumps(content))
    with pytest.raises(InputError, match=says) as caught:
        PositionServo.load(path)
    assert str(path) in str(caught.value)


def test_a_servo_says_what_a_run_lacks() -> None:
    log = told(np.zeros(len(TIME)))
    with pytest.raises(InputError, match="supply_voltage"):
        flexspline.simulate(PENDULUM, log, controller=PositionServo(1.0, supply=True))
    with pytest.raises(InputError, match="its fact 'kp', which is None"):
        flexspline.simulate(PENDULUM, log, controller=PositionServo("kp"))
    bare = Log.from_arrays(time=TIME, output_position=TIME, facts=FACTS)
    with pytest.raises(InputError, match="commanded_position"):
        flexspline.simulate(PENDULUM, bare, controller=PositionServo(1.0))
    with pytest.raises(InputError, match="cannot be read"):
        flexspline.simulate(PENDULUM, log, controller="no/servo.json")
