"""Repairs happen only when asked for, and say what they did."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flexspline.errors import InputError
from flexspline.logs import REPAIRS, Log, read_log, read_runs, repaired

TIME = np.arange(200) / 100


def turning(**more: object) -> Log:
    """A joint that turns once in 2 s, forward, and its motor."""
    return Log.from_arrays(time=TIME, output_position=np.pi * TIME, **more)  # type: ignore[arg-type]


def test_nothing_is_repaired_unasked() -> None:
    run = {"time": [0, 2, 1, 1], "output_position": [6.2, 0.1, np.nan, 0.2]}
    log = read_log(run)
    np.testing.assert_array_equal(log["time"], run["time"])
    np.testing.assert_array_equal(log["output_position"], run["output_position"])


def test_repairs_are_done_in_the_order_asked() -> None:
    run = {"time": [0, 2, 1, 1, 3], "output_position": [6.2, 0.2, 0.1, 0.1, np.nan]}
    log = read_log(run, repair=("drop_invalid", "sort_time", "drop_duplicates", "unwrap"))
    np.testing.assert_array_equal(log["time"], [0, 1, 2])
    np.testing.assert_allclose(log["output_position"], [6.2, 0.1 + 2 * np.pi, 0.2 + 2 * np.pi])
    assert log.history[-4:] == (
        "drop_invalid: rows dropped: 1; not finite: 1 in output_position",
        "sort_time: rows put elsewhere: 3",
        "drop_duplicates: rows that repeat the time stamp before them, dropped: 1",
        "unwrap: jumps of 2π in output_position undone: 1",
    )


def test_repairs_of_a_call_come_behind_those_of_the_map_and_none_is_done_twice(
    tmp_path: Path,
) -> None:
    angle = np.linspace(6.0, 7.0, 40)
    rows = [f"{t},{q % (2 * np.pi)}" for t, q in enumerate(angle)]
    (tmp_path / "run.csv").write_text("t,q\n" + "\n".join(rows) + "\n")
    columns = tmp_path / "map.toml"
    columns.write_text(
        '[read]\nrepair = ["unwrap=output_position", "drop_start=1"]\n'
        '[columns]\ntime = "t"\noutput_position = {source = "q", unit = "rad"}\n'
    )
    asked = ["drop_end=1", "drop_start=1"]
    log = read_log(tmp_path / "run.csv", columns, repair=asked)
    (cut,) = read_runs(tmp_path / "run.csv", columns, repair=asked, split_gaps=10.0)
    for one in (log, cut):
        np.testing.assert_allclose(one["output_position"], angle[1:-1])
    assert [line.split(":")[0] for line in log.history[-3:]] == ["unwrap", "drop_end", "drop_start"]


def test_a_repair_is_a_name_a_name_with_a_value_or_a_mapping() -> None:
    log = turning()
    ways = ("drop_start=0.5", ["drop_start=0.5"], {"drop_start": 0.5})
    assert [len(repaired(log, way)) for way in ways] == [150, 150, 150]
    assert len(repaired(log, {"drop_start": 0.5, "drop_end": 0.5})) == 100
    assert repaired(log, {"unwrap": False}) is log


def test_unwrapping_finds_the_angle_that_was_wrapped() -> None:
    whole = 20 * np.sin(TIME)
    log = turning(motor_position=np.angle(np.exp(1j * whole)))
    # an angle of 20 rad is known to 20 eps, and some roundings of exp and angle
    np.testing.assert_allclose(
        repaired(log, "unwrap=motor_position")["motor_position"], whole, atol=1e-13
    )


def test_signs_are_turned_for_one_channel_or_all_of_the_motor() -> None:
    log = turning(motor_position=TIME, motor_current=TIME, sensor_torque=TIME)
    assert repaired(log, "flip_sign=sensor_torque")["sensor_torque"][1] == -TIME[1]
    back = repaired(log, "reverse_motor")
    assert back["motor_position"][1] == back["motor_current"][1] == -TIME[1]
    assert back["sensor_torque"][1] == TIME[1]
    assert back.history[-1] == "reverse_motor: motor_position, motor_current times -1"


@pytest.mark.parametrize(("repair", "times"), [
    ("flip_sign=motor_current", -1.0),
    ("flip_sign=motor_torque", -1.0),
    (["flip_sign=motor_torque", "flip_sign=motor_current"], -1.0),  # as check says of both
    ({"scale": ("motor_current", 0.5)}, 0.5),
    (["scale=motor_current:0.5", "scale=motor_current:3"], 1.5),  # asked twice of one channel
    (["scale=motor_torque:0.5", "flip_sign=motor_current"], -0.5),
])  # fmt: skip
def test_a_torque_that_is_made_of_the_current_is_repaired_with_it(
    repair: Any, times: float, tmp_path: Path
) -> None:
    path, current = tmp_path / "run.csv", np.sin(np.arange(50.0))
    np.savetxt(path, np.column_stack([np.arange(50.0), current]), delimiter=",",
               header="time,motor_current", comments="")  # fmt: skip
    log = read_log(path, torque_constant=0.1, repair=repair)
    np.testing.assert_allclose(log["motor_current"], times * current)
    np.testing.assert_allclose(log["motor_torque"], 0.1 * times * current)
    limit = float(0.1 * current[7])
    inside = read_log(path, torque_constant=0.1, repair=f"drop_clipped=motor_torque:{limit!r}")
    np.testing.assert_array_equal(inside["motor_current"], np.delete(current, 7))


def test_repeated_rows_go_and_those_of_a_joint_at_rest_stay() -> None:
    torque = np.random.default_rng(0).normal(size=200)
    log = turning(sensor_torque=torque, output_velocity=np.full(200, np.pi))
    again = log.rows(np.sort(np.concatenate([np.arange(200), np.arange(50, 53)])))
    made = repaired(again, "drop_repeated")
    np.testing.assert_array_equal(made["sensor_torque"], torque)
    note = "drop_repeated: rows that repeat all values of the row before them, dropped: 3"
    assert made.history[-1] == note
    still = Log.from_arrays(time=TIME, output_position=np.minimum(TIME, 1.0))
    assert len(repaired(still, "drop_repeated")) == 200


def test_a_stuck_end_goes_for_one_channel_or_where_all_are_stuck() -> None:
    held = np.minimum(TIME, TIME[149])
    log = turning(sensor_torque=held, temperature=np.full(200, 25.0))
    assert len(repaired(log, "drop_stuck")) == 200
    made = repaired(log, "drop_stuck=sensor_torque")
    np.testing.assert_array_equal(made["time"], TIME[:150])
    said = "drop_stuck: the last rows, which repeat sensor_torque; rows dropped: 50"
    assert made.history[-1] == said
    whole = Log.from_arrays(time=TIME, sensor_torque=held, temperature=TIME)
    assert len(repaired(whole, "drop_stuck")) == 150


def test_rows_at_the_limit_of_a_channel_go() -> None:
    made = repaired(turning(sensor_torque=np.minimum(TIME, 1.5)), "drop_clipped=sensor_torque:1.5")
    np.testing.assert_array_equal(made["time"], TIME[TIME < 1.5])


@pytest.mark.parametrize(
    ("span", "rows"), [("0.5:1", 51), ("0.5:", 150), (":1", 101), ("-1:9", 200), (" 0.5 : 1 ", 51)]
)
def test_a_span_of_the_runs_clock_is_kept_with_both_ends(span: str, rows: int) -> None:
    assert len(repaired(turning(), f"keep={span}")) == rows
    first, _, last = span.partition(":")
    if first.strip() and last.strip():
        assert len(repaired(turning(), {"keep": (float(first), float(last))})) == rows


def test_scale_multiplies_one_channel() -> None:
    assert repaired(turning(duty=TIME), {"scale": ("duty", 2)})["duty"][1] == 2 * TIME[1]


def test_a_late_channel_is_moved_and_rows_without_a_value_go() -> None:
    log = turning(output_velocity=np.sin(TIME - 0.035))
    moved = repaired(log, "shift=output_velocity:0.035")
    # linear interpolation over h = 0.01 s errs by h²/8 of the second derivative, which is ≤ 1
    np.testing.assert_allclose(moved["output_velocity"], np.sin(moved["time"]), atol=0.01**2 / 8)
    assert len(moved) == 196
    note = "output_velocity moved 0.035 s earlier; rows without a value, dropped: 4"
    assert moved.history[-1] == note


def test_nothing_is_put_into_a_gap() -> None:
    time = np.concatenate([TIME, TIME + 10])
    log = Log.from_arrays(time=time, output_velocity=time)
    moved = repaired(log, "shift=output_velocity:0.05")
    assert len(moved) == 390
    np.testing.assert_allclose(moved["output_velocity"], moved["time"] + 0.05, rtol=1e-14)


def test_a_wrong_velocity_is_computed_anew_from_the_position() -> None:
    log = repaired(turning(output_velocity=np.zeros(200)), "velocity_from_position")
    # the derivative of a straight line is exact up to rounding: eps · 2π / 0.01 s
    np.testing.assert_allclose(log["output_velocity"], np.pi, rtol=1e-11)
    assert "output_acceleration" not in log
    assert "velocity_from_position" in log.history[-1]


def test_a_log_is_resampled_only_when_asked() -> None:
    log = repaired(turning(), "resample=50")
    assert log.rate == pytest.approx(50)


@pytest.mark.parametrize(
    ("repair", "sentence"),
    [
        (
            "mend",
            r"repair 'mend' is not known; the repairs are drop_invalid\[=channel\], sort_time",
        ),
        ("drop_start", "is written 'drop_start=seconds'"),
        ("sort_time=1", "is written 'sort_time'"),
        ("drop_start=soon", "'soon' is no number"),
        ("drop_start=-1", "'-1' is no number that it can take"),
        ("drop_start=99", "drop_start leaves no row of 200; give it less"),
        ("keep=3", "'keep=3': no span of time; write keep=from:to"),
        ("keep=:", "no span of time"),
        ("keep=a:1", "'a' is no number"),
        ("keep=5:9", "keep leaves no row of 200"),
        ("drop_clipped=output_position", "write drop_clipped=channel:limit"),
        ("drop_stuck=torque", "no channel 'torque'"),
        ("flip_sign=torque", "no channel 'torque'"),
        ("shift=torque:1", "'torque' is no channel"),
        ("shift=output_position", "write shift=channel:seconds"),
        ("shift=output_position:9", "leaves no row"),
        ("unwrap=motor_position", "no channel 'motor_position'"),
        ("reverse_motor", "finds no channel of the motor"),
        ("velocity_from_position=duty", "give output_velocity or motor_velocity"),
        ("velocity_from_position=motor_velocity", "no channel 'motor_position'"),
        ("resample=0", "above 0"),
    ],
)
def test_an_impossible_repair_says_how_it_is_written(repair: str, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        repaired(turning(), repair)


@pytest.mark.parametrize(
    "repair", ["shift=output_position:0.1", "velocity_from_position", "resample=50"]
)
def test_what_needs_increasing_time_says_what_to_repair_first(repair: str) -> None:
    log = Log.from_arrays(time=TIME[::-1], output_position=TIME)
    with pytest.raises(InputError, match=r"time does not increase at row 1, .*sort_time"):
        repaired(log, repair)


def test_unwrapping_over_a_missing_angle_is_refused() -> None:
    log = Log.from_arrays(time=[0, 1, 2], output_position=[0, np.nan, 1])
    with pytest.raises(InputError, match=r"row 1 of .*ask for drop_invalid before unwrap"):
        repaired(log, "unwrap")


def test_every_repair_is_described() -> None:
    assert all(repair.meaning for repair in REPAIRS.values())
