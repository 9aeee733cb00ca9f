"""Files as the recorders of the presets write them, of joints whose motion is known."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from bags import ROS2, Sent, joint_state, write_bag2, write_mcap_json
from numpy.typing import NDArray
from rosbags.typesys import get_types_from_msg

ROWS = 200
TIME = np.arange(ROWS) * 0.002
STEPS = [2_000_000 * k for k in range(ROWS)]

LBR_STATE = """
float64 sample_time
uint32 time_stamp_sec
uint32 time_stamp_nano_sec
float64[7] measured_joint_position
float64[7] measured_torque
float64[7] commanded_torque
float64[7] external_torque
float64[7] ipo_joint_position
float64 tracking_performance
"""
CONTROLLER_STATUS = """
float32 pos_estimate
float32 vel_estimate
float32 torque_target
float32 torque_estimate
float32 iq_setpoint
float32 iq_measured
"""
DYNAMIXEL_STATE = """
string model_name
uint8  id
uint8  torque_enable
uint32 goal_position
int16  present_pwm
int16  present_current
int32  present_velocity
uint32 present_position
uint16 present_input_voltage
uint8  present_temperature
"""
DYNAMIXELS = "dynamixel_workbench_msgs/msg/DynamixelState"
for kind, text in {
    "lbr_fri_idl/msg/LBRState": LBR_STATE,
    "odrive_can/msg/ControllerStatus": CONTROLLER_STATUS,
    DYNAMIXELS: DYNAMIXEL_STATE,
    f"{DYNAMIXELS}List": f"{DYNAMIXELS}[] dynamixel_state\n",
}.items():
    ROS2.register(get_types_from_msg(text, kind))

Array = NDArray[np.float64]


def angle(joint: int) -> Array:
    """rad, of each joint another."""
    return np.asarray((0.3 + 0.1 * joint) * np.sin(5.0 * TIME + joint))


def speed(joint: int) -> Array:
    """rad/s."""
    return np.asarray((1.5 + 0.5 * joint) * np.cos(5.0 * TIME + joint))


def torque(joint: int) -> Array:
    """Nm, positive where the joint pushes in +q."""
    return np.asarray(10.0 * joint + 4.0 * np.sign(speed(joint)) + angle(joint))


def current(joint: int) -> Array:
    """A."""
    return np.asarray(0.1 * joint + 0.5 * np.sign(speed(joint)))


def stacked(of: Any, joints: Sequence[int]) -> Array:
    """Columns of several joints, (rows, joints)."""
    return np.stack([of(joint) for joint in joints], axis=1)


def write_rtde(path: Path, separator: str = " ") -> None:
    """As UR's CSVWriter: an output of six numbers is six columns; with "," as ur_rtde writes."""
    outputs = {
        "timestamp": 1297.4 + TIME[:, None],
        "target_q": stacked(angle, range(6)) + 0.01,
        "actual_q": stacked(angle, range(6)),
        "actual_qd": stacked(speed, range(6)),
        "actual_current": stacked(current, range(6)),
        "joint_temperatures": np.full((ROWS, 6), 31.5),
    }
    names = [name if values.shape[1] == 1 else f"{name}_{k}"
             for name, values in outputs.items() for k in range(values.shape[1])]  # fmt: skip
    with path.open("w", newline="") as file:
        writer = csv.writer(file, delimiter=separator)
        writer.writerow(names)
        writer.writerows(np.hstack(list(outputs.values())).tolist())


def write_franka(path: Path) -> None:
    """As franka::logToCSV: milliseconds, names with a blank behind each comma."""
    seven = range(1, 8)
    parts = {
        "state.q": stacked(angle, seven),
        "state.q_d": stacked(angle, seven) + 0.01,
        "state.dq": stacked(speed, seven),
        "state.dq_d": stacked(speed, seven),
        "state.tau_J": stacked(torque, seven),
        "state.tau_ext_hat_filtered": np.zeros((ROWS, 7)),
        "cmd.q_d": stacked(angle, seven),
        "cmd.tau_J_d": np.zeros((ROWS, 7)),
    }
    heads = (", ".join(f"{name}[{k}]" for k in range(7)) for name in parts)
    lines = ["time, success_rate, " + ",".join(heads)]
    rows = np.hstack(list(parts.values()))
    lines += [f"{2 * k + 7},1," + ",".join(map(repr, row.tolist())) for k, row in enumerate(rows)]
    path.write_text("\n".join(lines) + "\n")


def write_kortex(path: Path) -> None:
    """Messages of BaseCyclic.Feedback as JSON; degrees, torques the other way round."""
    seven = range(1, 8)

    def actuator(joint: int, k: int) -> dict[str, float]:
        return {
            "position": float(np.degrees(angle(joint)[k]) % 360.0),
            "velocity": float(np.degrees(speed(joint)[k])),
            "torque": float(-torque(joint)[k]),
            "current_motor": float(current(joint)[k]),
            "voltage": 24.0,
            "temperature_motor": 33.0,
            "temperature_core": 40.0,
        }

    records = [(step, {"frame_id": k, "actuators": [actuator(joint, k) for joint in seven]})
               for k, step in enumerate(STEPS)]  # fmt: skip
    write_mcap_json(path, "/my_gen3/base_feedback", records)


def write_lbr(path: Path) -> None:
    """A bag of lbr_fri_idl/LBRState."""
    seven = range(1, 8)
    zeros = np.zeros(7)
    sent = [
        Sent("/lbr/state", step, "lbr_fri_idl/msg/LBRState", {
            "sample_time": 0.002,
            "time_stamp_sec": 1_800_000_000,
            "time_stamp_nano_sec": step,
            "measured_joint_position": stacked(angle, seven)[k],
            "measured_torque": stacked(torque, seven)[k],
            "commanded_torque": zeros,
            "external_torque": zeros,
            "ipo_joint_position": np.full(7, np.nan),
            "tracking_performance": 1.0,
        })
        for k, step in enumerate(STEPS)
    ]  # fmt: skip
    write_bag2(path, sent)


def write_joint_states(path: Path, names: Sequence[str]) -> None:
    """A bag of sensor_msgs/JointState."""
    joints = range(1, len(names) + 1)
    q, w, tau = (stacked(of, joints) for of in (angle, speed, torque))
    write_bag2(path, [joint_state("/joint_states", step, names, q[k], w[k], tau[k])
                      for k, step in enumerate(STEPS)])  # fmt: skip


def odrive_status(axis: int, topic: str) -> list[Sent]:
    """odrive_can/ControllerStatus of an axis: turns and turns per second."""
    turns, rate = angle(axis) / (2.0 * np.pi), speed(axis) / (2.0 * np.pi)
    return [
        Sent(topic, step, "odrive_can/msg/ControllerStatus", {
            "pos_estimate": float(turns[k]), "vel_estimate": float(rate[k]),
            "torque_target": 0.0, "torque_estimate": float(0.1 * torque(axis)[k]),
            "iq_setpoint": 0.0, "iq_measured": float(current(axis)[k]),
        })
        for k, step in enumerate(STEPS)
    ]  # fmt: skip


def write_moteus_csv(path: Path) -> None:
    """Registers of one servo by their names, with the time at which they were asked for."""
    columns = {
        "time": TIME,
        "MODE": np.full(ROWS, 10),
        "POSITION": angle(1) / (2.0 * np.pi),
        "VELOCITY": speed(1) / (2.0 * np.pi),
        "TORQUE": torque(1),
        "Q_CURRENT": current(1),
        "D_CURRENT": np.zeros(ROWS),
        "VOLTAGE": np.full(ROWS, 23.5),
        "TEMPERATURE": np.full(ROWS, 30.0),
    }
    write_columns(path, columns)


def write_servo_stats(path: Path) -> None:
    """Telemetry of moteus, servo_stats."""
    stats = {
        "position": angle(1) / (2.0 * np.pi),
        "velocity": speed(1) / (2.0 * np.pi),
        "torque_Nm": torque(1),
        "q_A": current(1),
        "bus_V": np.full(ROWS, 23.5),
        "motor_temp_C": np.full(ROWS, 35.0),
    }
    records = [(step, {"servo_stats": {name: float(values[k]) for name, values in stats.items()}})
               for k, step in enumerate(STEPS)]  # fmt: skip
    write_mcap_json(path, "servo_stats", records)


def dynamixel_items(joint: int) -> dict[str, NDArray[Any]]:
    """Items of the control table as whole numbers, positions as they lie in 32 bits."""
    counts = np.round(angle(joint) / (2.0 * np.pi) * 4096.0).astype(np.int64)
    return {
        "torque_enable": np.arange(ROWS) > 20,
        "goal_position": (counts + 3) % 2**32,
        "present_pwm": np.round(885 * 0.2 * np.sign(speed(joint))).astype(np.int64),
        "present_current": np.round(1000.0 * current(joint) / 2.69).astype(np.int64),
        "present_velocity": np.round(speed(joint) * 60 / (2 * np.pi) / 0.229).astype(np.int64),
        "present_position": counts % 2**32,
        "present_input_voltage": np.full(ROWS, 118),
        "present_temperature": np.full(ROWS, 36),
    }


def write_dynamixel_csv(path: Path) -> None:
    """Items of one servo, and the time."""
    write_columns(path, {"time": TIME, **dynamixel_items(1)})


def write_dynamixel_bag(path: Path, joints: Sequence[int]) -> None:
    """A bag of dynamixel_workbench_msgs/DynamixelStateList."""
    every = [dynamixel_items(joint) for joint in joints]
    made = ROS2.types[DYNAMIXELS]

    def state(number: int, k: int) -> Any:
        items = {name: int(values[k]) for name, values in every[number].items()}
        return made(model_name="XM430-W350", id=number + 1, **items)

    sent = [
        Sent("/dynamixel_state", step, f"{DYNAMIXELS}List",
             {"dynamixel_state": [state(number, k) for number in range(len(every))]})
        for k, step in enumerate(STEPS)
    ]  # fmt: skip
    write_bag2(path, sent)


def write_columns(path: Path, columns: Mapping[str, NDArray[Any]]) -> None:
    """A CSV of columns."""
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(zip(*(values.tolist() for values in columns.values()), strict=True))
