"""Column maps of common recorders, each tried on a file in that recorder's format."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas
import pytest
from bags import joint_state, write_bag2
from cli_calls import call
from foreign_files import refused
from recorded_presets import (
    STEPS,
    TIME,
    angle,
    current,
    odrive_status,
    speed,
    torque,
    write_columns,
    write_dynamixel_bag,
    write_dynamixel_csv,
    write_franka,
    write_joint_states,
    write_kortex,
    write_lbr,
    write_moteus_csv,
    write_rtde,
    write_servo_stats,
)

from flexspline import InputError, convert, joints_of, read_log, read_runs
from flexspline.logs.channels import CHANNELS
from flexspline.logs.columns import ColumnSource, to_si
from flexspline.logs.log import Log
from flexspline.logs.presets import OPEN, preset_names, preset_of

NAMES = (
    "dynamixel", "franka-fci", "iiwa-fri", "kinova-kortex", "moteus", "odrive", "ros-jointstate",
    "ur-rtde",
)  # fmt: skip


def same(log: Log, channel: str, values: Any, atol: float = 1e-12) -> None:
    np.testing.assert_allclose(log[channel], values, rtol=1e-12, atol=atol)


def left_open(log: Log) -> list[str]:
    """The channels and facts that a log's history says to be open."""
    return [said.removeprefix(OPEN).partition(":")[0] for said in log.history
            if said.startswith(OPEN)]  # fmt: skip


@pytest.mark.parametrize("separator", [" ", ","])
def test_a_recording_of_rtde_is_read_joint_by_joint(separator: str, tmp_path: Path) -> None:
    path = tmp_path / "robot.csv"
    write_rtde(path, separator)
    assert joints_of(path, preset="ur-rtde") == tuple("012345")
    log = read_log(path, preset="ur-rtde", joint=2)
    same(log, "time", 1297.4 + TIME)
    same(log, "output_position", angle(2))
    same(log, "output_velocity", speed(2))
    same(log, "commanded_position", angle(2) + 0.01)
    same(log, "temperature", 31.5)
    assert "motor_current" not in log
    assert left_open(log) == ["motor_current", "gear_ratio", "torque_constant"]


def test_what_is_open_is_read_once_it_is_said(tmp_path: Path) -> None:
    path = tmp_path / "robot.csv"
    write_rtde(path)
    said = {"motor_current": {"unit": "A", "sign": -1}}
    log = read_log(path, said, preset="ur-rtde", joint=2, gear_ratio=101, torque_constant=0.1)
    same(log, "motor_current", -current(2))
    assert left_open(log) == []
    half = read_log(path, {"motor_current": {"sign": -1}}, preset="ur-rtde", joint=2)
    assert "motor_current" not in half and "(unit: " in "".join(half.history)


def test_entries_of_the_map_win(tmp_path: Path) -> None:
    path = tmp_path / "robot.csv"
    write_rtde(path)
    columns = {
        "output_position": {"source": "target_q_{joint}", "unit": "deg"},
        "commanded_position": "actual_q_{joint}",
        "output_velocity": {"sign": -1},
    }
    log = read_log(path, columns, preset="ur-rtde", joint=3)
    same(log, "output_position", np.radians(angle(3) + 0.01))
    same(log, "commanded_position", angle(3))
    same(log, "output_velocity", -speed(3))


def test_a_log_of_libfranka_is_read(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    write_franka(path)
    assert joints_of(path, preset="franka-fci") == tuple("1234567")
    log = read_log(path, preset="franka-fci", joint=4)
    same(log, "time", 0.007 + TIME)
    same(log, "output_position", angle(4))
    same(log, "output_velocity", speed(4))
    same(log, "sensor_torque", torque(4))
    same(log, "commanded_position", angle(4) + 0.01)
    assert left_open(log) == ["gear_ratio"]


def test_feedback_of_kortex_is_read_with_its_torque_turned_round(tmp_path: Path) -> None:
    path = tmp_path / "feedback.mcap"
    write_kortex(path)
    assert joints_of(path, preset="kinova-kortex") == tuple("1234567")
    log = read_log(path, preset="kinova-kortex", joint="7", repair="unwrap")
    turns = (log["output_position"] - angle(7)) / (2.0 * np.pi)
    np.testing.assert_allclose(turns, np.round(turns[0]), atol=1e-9)
    same(log, "output_velocity", speed(7))
    same(log, "sensor_torque", torque(7))
    same(log, "motor_temperature", 33.0)
    same(log, "supply_voltage", 24.0)
    assert left_open(log) == ["motor_current", "gear_ratio", "torque_constant"]
    log = read_log(path, {"motor_current": {"sign": 1}}, preset="kinova-kortex", joint="7")
    same(log, "motor_current", current(7))


def test_a_bag_of_fri_is_read_and_the_sign_of_its_torque_asked_for(tmp_path: Path) -> None:
    path = tmp_path / "state.db3"
    write_lbr(path)
    log = read_log(path, preset="iiwa-fri", joint=5)
    same(log, "output_position", angle(5))
    assert set(log.channels) == {"time", "output_position"}
    assert left_open(log) == ["sensor_torque", "gear_ratio"]
    log = read_log(path, {"sensor_torque": {"sign": -1}}, preset="iiwa-fri", joint=5)
    same(log, "sensor_torque", -torque(5))


def test_joint_states_are_read_by_the_names_of_their_joints(tmp_path: Path) -> None:
    path = tmp_path / "states.db3"
    write_joint_states(path, ["hip", "knee"])
    assert joints_of(path, preset="ros-jointstate") == ("hip", "knee")
    log = read_log(path, preset="ros-jointstate", joint="knee")
    same(log, "output_position", angle(2))
    same(log, "output_velocity", speed(2))
    assert left_open(log) == ["sensor_torque", "gear_ratio"]
    log = read_log(path, {"sensor_torque": {"sign": 1}}, preset="ros-jointstate", joint="knee")
    same(log, "sensor_torque", torque(2))
    in_amperes = {"motor_current": {"source": "effort[{joint}]", "unit": "A"}}
    same(read_log(path, in_amperes, preset="ros-jointstate", joint="knee"), "motor_current",
         torque(2))  # fmt: skip


def test_an_odrive_is_read_on_the_side_of_the_motor(tmp_path: Path) -> None:
    write_bag2(tmp_path / "one.db3", odrive_status(1, "/odrive_axis0/controller_status"))
    log = read_log(tmp_path / "one.db3", preset="odrive")
    same(log, "motor_position", angle(1), 1e-6)
    same(log, "motor_velocity", speed(1), 1e-6)
    assert left_open(log) == ["motor_torque", "motor_current", "gear_ratio", "torque_constant"]
    signs = {"motor_current": {"sign": 1}, "motor_torque": {"sign": 1}}
    log = read_log(tmp_path / "one.db3", signs, preset="odrive")
    same(log, "motor_current", current(1), 1e-6)
    same(log, "motor_torque", 0.1 * torque(1), 1e-6)


def test_axes_of_two_odrives_are_joints(tmp_path: Path) -> None:
    sent = [*odrive_status(1, "/odrive_axis0/controller_status"),
            *odrive_status(2, "/odrive_axis1/controller_status")]  # fmt: skip
    write_bag2(tmp_path / "two.db3", sent)
    assert joints_of(tmp_path / "two.db3", preset="odrive") == ("0", "1")
    log = read_log(tmp_path / "two.db3", preset="odrive", joint=1)
    same(log, "motor_position", angle(2), 1e-6)


def test_values_of_odrivetool_are_read_by_their_path(tmp_path: Path) -> None:
    columns = {"time": TIME, "axis1.encoder.pos_estimate": angle(3) / (2.0 * np.pi)}
    write_columns(tmp_path / "a.csv", columns)
    log = read_log(tmp_path / "a.csv", preset="odrive", joint=1)
    same(log, "motor_position", angle(3))


@pytest.mark.parametrize(("name", "write"), [
    ("a.csv", write_moteus_csv), ("a.mcap", write_servo_stats),
])  # fmt: skip
def test_a_moteus_is_read_on_the_side_of_its_output(name: str, write: Any, tmp_path: Path) -> None:
    write(tmp_path / name)
    log = read_log(tmp_path / name, preset="moteus")
    same(log, "time", TIME)
    same(log, "output_position", angle(1))
    same(log, "output_velocity", speed(1))
    same(log, "supply_voltage", 23.5)
    assert left_open(log)[:2] == ["motor_torque", "motor_current"]
    answers = {"motor_torque": {"scale": 0.1}, "motor_current": {"sign": 1}}
    log = read_log(tmp_path / name, answers, preset="moteus")
    same(log, "motor_torque", 0.1 * torque(1))
    same(log, "motor_current", current(1))


def assert_dynamixel(log: Log, joint: int) -> None:
    same(log, "output_position", angle(joint), 0.51 * 2 * np.pi / 4096)
    same(log, "output_velocity", speed(joint), 0.51 * 0.229 * 2 * np.pi / 60)
    same(log, "commanded_position", angle(joint) + 3 * 2 * np.pi / 4096, 0.51 * 2 * np.pi / 4096)
    same(log, "duty", 0.2 * np.sign(speed(joint)))
    same(log, "supply_voltage", 11.8)
    same(log, "temperature", 36.0)
    same(log, "enabled", np.arange(len(TIME)) > 20)


def test_counts_of_a_dynamixel_are_read_in_its_units(tmp_path: Path) -> None:
    write_dynamixel_csv(tmp_path / "a.csv")
    log = read_log(tmp_path / "a.csv", preset="dynamixel")
    assert_dynamixel(log, 1)
    assert left_open(log) == ["motor_current", "gear_ratio", "torque_constant"]
    log = read_log(tmp_path / "a.csv", {"motor_current": {"scale": 2.69}}, preset="dynamixel")
    same(log, "motor_current", current(1), 0.51 * 2.69e-3)


def test_a_bag_of_dynamixels_is_read_by_their_place_in_the_list(tmp_path: Path) -> None:
    write_dynamixel_bag(tmp_path / "a.db3", [1, 2, 3])
    assert joints_of(tmp_path / "a.db3", preset="dynamixel") == ("0", "1", "2")
    assert_dynamixel(read_log(tmp_path / "a.db3", preset="dynamixel", joint=2), 3)


def test_a_unit_that_the_file_states_is_right(tmp_path: Path) -> None:
    """Positions that somebody has already made degrees of are no counts any more."""
    frame = pandas.DataFrame({"time": TIME, "present_position": np.degrees(angle(1))})
    frame.attrs["units"] = {"present_position": "deg"}
    same(read_log(frame, preset="dynamixel"), "output_position", angle(1))


def test_the_history_names_the_preset_and_its_sources(tmp_path: Path) -> None:
    write_rtde(tmp_path / "robot.csv")
    said = "\n".join(read_log(tmp_path / "robot.csv", preset="ur-rtde", joint=0).history)
    assert "columns by the preset ur-rtde" in said and "<https://www.universal-robots.com/" in said
    assert "output_velocity is column 'actual_qd_0' in rad/s" in said


# what all presets have


def test_the_presets_are_those_that_are_promised() -> None:
    assert preset_names() == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_each_preset_has_sources_and_entries_that_can_be_read(name: str) -> None:
    preset = preset_of(name)
    assert preset.sources and preset.recorder and preset.joints
    for source in preset.sources:
        assert source.title and source.says and source.url.startswith("https://")
    assert "gear_ratio" in preset.unknown
    for channel, entry in preset.columns.items():
        assert channel in CHANNELS
        source = entry["source"]
        at = ColumnSource(**{**entry, "source": source if isinstance(source, str) else source[0]})
        assert at.unit is None or to_si(channel, at.unit)
        assert not set(preset.ask.get(channel, {})) & set(entry)
    assert set(preset.ask) <= set(preset.columns)
    assert all(set(asked) <= {"unit", "sign", "scale"} for asked in preset.ask.values())


def test_all_presets_are_listed_with_what_is_left_to_be_said() -> None:
    made = call("init", "--list-presets")
    assert made.exit_code == 0
    for name in NAMES:
        preset = preset_of(name)
        assert f"{name}\n" in made.stdout
        for source in preset.sources:
            assert source.url in made.stdout
    assert "to be said: sign of motor_current" in made.stdout
    made = call("init", "--json", "--list-presets")
    listed = json.loads(made.stdout)["presets"]
    assert tuple(listed) == NAMES
    assert listed["kinova-kortex"]["columns"]["sensor_torque"]["sign"] == -1
    assert all(each["sources"][0]["url"] for each in listed.values())
    made = call("init")
    assert made.exit_code == 2 and "Missing argument 'RECORDING'" in made.stderr


# on the command line


def test_commands_take_a_preset_and_say_what_is_open(tmp_path: Path) -> None:
    path, out = tmp_path / "robot.csv", tmp_path / "run.csv"
    write_rtde(path)
    made = call("convert", path, "--preset", "ur-rtde", "--joint", 1, "--out", out)
    assert made.exit_code == 0, made.stderr
    same(read_log(out), "output_position", angle(1))
    assert "warning: not known: motor_current: column 'actual_current_1' is not read" in made.stderr
    assert 'motor_current = {unit = "A", sign = 1}' in made.stderr
    made = call("check", path, "--preset", "ur-rtde", "--joint", "all", "--gear-ratio", 101,
                "--torque-constant", 0.1)  # fmt: skip
    assert made.exit_code in (0, 3)
    assert all(f"\n{joint}  " in made.stdout for joint in range(6)), made.stdout
    assert "gear_ratio" not in made.stderr


def test_a_preset_and_a_map_are_joined(tmp_path: Path) -> None:
    path, out, columns = tmp_path / "robot.csv", tmp_path / "run.csv", tmp_path / "map.toml"
    write_rtde(path)
    columns.write_text(
        "[facts]\ngear_ratio = 101\ntorque_constant = 0.1\n"
        '[columns]\nmotor_current = {unit = "A", sign = -1}\n[joints.2]\ngear_ratio = 50\n'
    )
    made = call("convert", path, "--preset", "ur-rtde", "--columns", columns, "--joint", 2,
                "--out", out)  # fmt: skip
    assert made.exit_code == 0 and "not known" not in made.stderr
    log = read_log(out)
    same(log, "motor_current", -current(2))
    assert log.facts["gear_ratio"] == 50
    same(convert(path, None, out, preset="ur-rtde", joint=3), "output_position", angle(3))
    made = call("check", path, "--preset", "ur-rtde", "--columns", columns, "--joint", "all")
    assert all(f"\n{joint}  " in made.stdout for joint in range(6)), made.stdout


def test_a_map_may_name_its_preset(tmp_path: Path) -> None:
    path, columns = tmp_path / "robot.csv", tmp_path / "map.toml"
    write_rtde(path)
    columns.write_text('[read]\npreset = "ur-rtde"\n[columns]\noutput_velocity = {sign = -1}\n')
    log = read_log(path, columns, joint=4)
    same(log, "output_velocity", -speed(4))
    same(log, "output_position", angle(4))
    (run,) = read_runs(path, columns, joint=4, split_gaps=True)
    same(run, "output_velocity", -speed(4))
    assert joints_of(path, columns) == tuple("012345")


# what is wrong


def test_a_wrong_name_is_answered_with_those_that_exist(tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        read_log(tmp_path / "none.csv", preset="ur-rdte")
    assert str(caught.value) == (
        "there is no preset 'ur-rdte' (did you mean 'ur-rtde'?); the presets are "
        + ", ".join(NAMES)
    )
    made = call("check", tmp_path / "none.csv", "--preset", "abb")
    assert made.exit_code == 2 and "there is no preset 'abb'; the presets are" in made.stderr


def test_a_file_of_another_recorder_is_refused_with_what_both_have(tmp_path: Path) -> None:
    write_moteus_csv(tmp_path / "a.csv")
    said = refused(tmp_path / "a.csv", preset="dynamixel")
    assert "has no column of the preset dynamixel, such as present_position" in said
    assert "it has time, MODE, POSITION" in said


def test_a_table_without_names_is_refused(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.zeros((50, 3)))
    assert "it has columns without names" in refused(tmp_path / "a.npy", preset="moteus", rate=100)


def test_a_joint_that_is_not_asked_for_or_not_there_is_said_with_those_that_are(
    tmp_path: Path,
) -> None:
    write_franka(tmp_path / "a.csv")
    said = refused(tmp_path / "a.csv", preset="franka-fci")
    assert "has columns by joint, and none is asked for; give --joint NAME" in said
    assert "one of 1, 2, 3, 4, 5, 6, 7" in said
    said = refused(tmp_path / "a.csv", preset="franka-fci", joint=8)
    assert "has no joint 8; give --joint NAME" in said
    said = refused(tmp_path / "a.csv", preset="franka-fci", joint="elbow")
    assert "counts joints, and joint 'elbow' is no number" in said
    write_moteus_csv(tmp_path / "b.csv")
    said = refused(tmp_path / "b.csv", preset="moteus", joint=1)
    assert "the file has columns of one joint alone by the preset moteus; leave it out" in said


def test_an_answer_that_does_not_fit_is_said(tmp_path: Path) -> None:
    write_rtde(tmp_path / "a.csv")
    how = {"preset": "ur-rtde", "joint": 0}
    said = refused(tmp_path / "a.csv", {"motor_current": {"unit": "A", "sign": 2}}, **how)
    assert "has sign 2; give 1 or -1" in said
    said = refused(tmp_path / "a.csv", {"motor_current": {"unit": "Nm", "sign": 1}}, **how)
    assert "unit 'Nm' does not measure what is in A" in said
    said = refused(tmp_path / "a.csv", {"output_velocity": {"sing": 1}}, **how)
    assert "has an unknown key 'sing' (did you mean 'sign'?)" in said
    said = refused(tmp_path / "a.csv", {"sensor_torque": {"sign": 1}}, **how)
    assert "'sensor_torque' has no source" in said
    write_columns(tmp_path / "b.csv", {"timestamp": TIME, "actual_q_0": angle(0)})
    said = refused(tmp_path / "b.csv", {"motor_current": {"unit": "A", "sign": 1}}, **how)
    assert "no column 'actual_current_0'" in said


def test_an_angle_of_kortex_without_a_clock_asks_for_the_rate(tmp_path: Path) -> None:
    write_columns(tmp_path / "a.csv", {"actuators[0].position": angle(1)})
    said = refused(tmp_path / "a.csv", preset="kinova-kortex", joint=1)
    assert "no time stamps; map a column to 'time' or give the rate in Hz" in said


def test_convert_asks_for_a_map_or_a_preset(tmp_path: Path) -> None:
    write_rtde(tmp_path / "a.csv")
    made = call("convert", tmp_path / "a.csv", "--out", tmp_path / "run.csv")
    assert made.exit_code == 2 and "'--columns' or '--preset'" in made.stderr
    assert not (tmp_path / "run.csv").exists()


def test_topics_of_two_robots_are_told_apart_by_variable(tmp_path: Path) -> None:
    sides = {"/left/joint_states": angle(1), "/right/joint_states": -angle(1)}
    sent = [joint_state(topic, step, ["hip"], [values[k]])
            for topic, values in sides.items() for k, step in enumerate(STEPS)]  # fmt: skip
    write_bag2(tmp_path / "a.db3", sent)
    how = {"preset": "ros-jointstate", "joint": "hip"}
    assert "it has time, /left/joint_states.log_time" in refused(tmp_path / "a.db3", **how)
    log = read_log(tmp_path / "a.db3", variable="/right/joint_states", **how)
    same(log, "output_position", -angle(1))
