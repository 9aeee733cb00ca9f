"""Stuck tails, homing moves and a drive that is off are found; a joint at rest is none of them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from checks_logs import sound_log
from numpy.typing import NDArray

from flexspline.logs import Log
from flexspline.logs.checks import check
from flexspline.logs.checks.ends import drive_disabled, homing_move, only_experiments, stuck_tail
from flexspline.logs.repairs import repaired
from flexspline.logs.segments import true_ranges

Array = NDArray[np.float64]
Columns = dict[str, Array]

RATE = 200.0
LOOKS = (stuck_tail, homing_move, drive_disabled)
TAIL = 300  # rows
SEEDS = range(4)


def recorded(seed: int, *, rest: int = 0, exact: bool = False) -> Columns:
    """A joint that swings, or that moves there and rests: coarse encoder, noise, late velocity."""
    rng = np.random.default_rng([seed, 11])
    time = np.arange(4000) / RATE
    moving = np.minimum(time, time[-1 - rest])
    size, hertz = rng.uniform(0.3, 1.5), rng.uniform(0.2, 0.7)
    angle = 2.0 * np.pi * hertz * moving
    # phase such that it stands still where the rest begins
    swing = size * np.cos(angle - angle[-1] + (0.0 if rest else 2.0))
    speed = np.gradient(swing, time)
    torque = 4.0 * np.tanh(speed / 0.02) + 2.0 * speed + 3.0 * swing
    grain = 0.0 if exact else 1.0
    encoder = 2.0 * np.pi / 2 ** rng.integers(12, 20)
    return {
        "time": time,
        "output_position": swing if exact else encoder * np.round(swing / encoder),
        "output_velocity": np.interp(time - grain * rng.uniform(0, 0.08), time, speed)
        + grain * 1e-3 * rng.normal(size=4000),
        "motor_position": 100.0 * swing + grain * 1e-3 * rng.normal(size=4000),
        "sensor_torque": torque + grain * 0.05 * rng.normal(size=4000),
        "motor_current": torque / 7.0 + grain * 0.02 * rng.normal(size=4000),
        "temperature": np.round(25.0 + 0.01 * time, 1),
    }


def log_of(columns: Columns) -> Log:
    return Log.from_arrays(facts={"gear_ratio": 100.0, "output_spline": "flex"}, **columns)


def findings(log: Log) -> list[str]:
    return [one.name for look in LOOKS for one in look(log)]


def frozen(columns: Columns, *channels: str) -> Columns:
    made = {name: values.copy() for name, values in columns.items()}
    for name in channels or [name for name in columns if name != "time"]:
        made[name][-TAIL:] = made[name][-TAIL - 1]
    return made


def without(columns: Columns, *channels: str) -> Columns:
    return {name: values for name, values in columns.items() if name not in channels}


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(
    "channels",
    [(), ("sensor_torque",), ("motor_current",), ("output_position",), ("output_velocity",),
     ("motor_position",), ("output_position", "sensor_torque")],
)  # fmt: skip
def test_a_tail_that_is_stuck_while_the_joint_moves_is_found(
    seed: int, channels: tuple[str, ...]
) -> None:
    log = log_of(frozen(recorded(seed), *channels))
    (tail,) = stuck_tail(log)
    first, last = tail.rows
    assert last == len(log)
    assert abs(first - (len(log) - TAIL)) <= 60  # a coarse position may have stood there before
    assert all(name in tail.sentence for name in channels)
    assert f"{first} to {last}" in tail.sentence


@pytest.mark.parametrize(
    ("channels", "asked"),
    [
        ((), "drop_stuck"),
        (("sensor_torque",), "drop_stuck=sensor_torque"),
        (("output_position", "sensor_torque"), "drop_stuck=sensor_torque"),
    ],
)
def test_the_repair_that_a_stuck_tail_names_drops_its_rows_and_no_others(
    channels: tuple[str, ...], asked: str
) -> None:
    log = log_of(frozen(recorded(0), *channels))
    (tail,) = stuck_tail(log)
    assert tail.remedy == f"Ask for the repair {asked}, or record again."
    made = repaired(log, asked)
    assert len(made) == tail.rows[0]
    assert list(stuck_tail(made)) == []


@pytest.mark.parametrize("seed", SEEDS)
def test_noise_does_not_stop_where_no_velocity_is_recorded(seed: int) -> None:
    kept = without(recorded(seed), "output_velocity", "motor_position")
    assert findings(log_of(frozen(kept))) == ["stuck_tail"]


def test_a_recorder_without_noise_stops_more_abruptly_than_the_joint_ever_does() -> None:
    kept = without(recorded(0, exact=True), "output_velocity", "motor_position")
    assert findings(log_of(frozen(kept))) == ["stuck_tail"]


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("exact", [True, False])
def test_a_joint_that_comes_to_rest_is_sound(seed: int, exact: bool) -> None:
    """Also where its velocity is late and rings out behind the rest of its angle."""
    columns = recorded(seed, rest=TAIL, exact=exact)
    assert findings(log_of(columns)) == []
    assert findings(log_of(without(columns, "output_velocity"))) == []
    assert findings(log_of(without(columns, "output_velocity", "motor_position"))) == []


@pytest.mark.parametrize("seed", range(12))
def test_a_sound_log_keeps_all_its_rows(seed: int) -> None:
    log = sound_log(seed)
    (kept,) = only_experiments([log], "motor_torque")
    assert kept.log is log


def plateau(columns: Columns) -> None:
    """One ramp up to a speed that is held to the end, without noise."""
    time = columns["time"]
    speed = np.minimum(0.5 * time, 0.5)
    columns["output_velocity"] = speed
    columns["output_position"] = np.cumsum(speed) / RATE
    columns["motor_position"] = 100.0 * columns["output_position"]
    columns["sensor_torque"] = 1.0 + 2.0 * speed
    columns["motor_current"] = columns["sensor_torque"] / 7.0


def glitch(columns: Columns) -> None:
    columns["output_position"][300] += 1.0


def wraps(columns: Columns) -> None:
    angle = 2.0 * columns["output_position"]
    columns["motor_position"] = 100.0 * angle
    columns["output_velocity"] = 2.0 * columns["output_velocity"]
    columns["output_position"] = np.mod(angle, 2.0 * np.pi)


def clips(columns: Columns) -> None:
    torque = columns["sensor_torque"]
    torque[:] = np.minimum(torque, np.quantile(torque, 0.8))
    torque[-60:] = torque.max()


def drops(columns: Columns) -> None:
    """A second is missing; and two time stamps lie close together."""
    for name in columns:
        columns[name] = np.delete(columns[name], slice(500, 700))
    columns["time"][1000] = columns["time"][999] + 1e-6


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("change", [plateau, glitch, wraps, clips, drops])
def test_what_has_another_reason_is_neither_stuck_nor_homed(
    seed: int, change: Callable[[Columns], None]
) -> None:
    columns = recorded(seed)
    change(columns)
    assert findings(log_of(columns)) == []


def homed(seed: int, rows: int, smeared: int) -> Columns:
    """The angle is set anew behind `rows` rows, over `smeared` of them."""
    columns = recorded(seed)
    jump = np.clip((np.arange(4000) - rows + 1) / smeared, 0.0, 1.0)
    columns["output_position"] = columns["output_position"] + 0.8 * jump
    columns["output_velocity"] = np.gradient(columns["output_position"], columns["time"])
    return columns


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(("rows", "smeared"), [(40, 1), (700, 1), (700, 2)])
def test_a_homing_move_ends_where_the_angle_is_set_anew(seed: int, rows: int, smeared: int) -> None:
    log = log_of(homed(seed, rows, smeared))
    (move,) = homing_move(log)
    assert move.rows[0] == 0
    assert rows - 1 <= move.rows[1] <= rows + smeared + 2
    assert move.size == pytest.approx(0.8, abs=0.2)
    (kept,) = only_experiments([log], "sensor_torque")
    speed = np.abs(np.diff(kept.log["output_position"])) * RATE
    assert speed.max() < 20.0
    assert kept.as_recorded((0, 5)) == (move.rows[1], move.rows[1] + 5)


@pytest.mark.parametrize("behind", [False, True])
def test_the_repair_that_a_homing_move_names_keeps_all_other_rows(behind: bool) -> None:
    log = log_of(homed(1, 3500 if behind else 700, 1))
    (move,) = homing_move(log)
    made = repaired(log, move.remedy.removeprefix("Ask for the repair ").rstrip("."))
    kept = slice(0, move.rows[0]) if behind else slice(move.rows[1], None)
    np.testing.assert_array_equal(made["time"], log["time"][kept])
    assert list(homing_move(made)) == []


@pytest.mark.parametrize(("times", "told"), [(6.0, False), (15.0, True)])
def test_an_angle_was_set_anew_where_it_goes_far_faster_than_the_joint_does_elsewhere(
    times: float, told: bool
) -> None:
    columns = recorded(1, exact=True)
    jump = times * np.abs(np.diff(columns["output_position"])).max()
    columns["output_position"][700:] += jump
    found = list(homing_move(log_of(without(columns, "output_velocity"))))
    assert bool(found) == told
    assert all(one.size == pytest.approx(jump, rel=0.5) for one in found)  # beside its own motion


def test_a_drive_that_was_off_in_between_leaves_what_was_before_and_after() -> None:
    columns = recorded(1)
    rows = np.arange(4000)
    columns["enabled"] = ((rows < 1000) | (rows >= 1600)).astype(float)
    log = log_of(columns)
    (kept,) = only_experiments([log], "motor_torque")
    assert kept.rows.tolist() == [*range(1000), *range(1600, 4000)]
    assert np.array_equal(kept.log["motor_current"], log["motor_current"][kept.rows])


def test_rows_of_a_drive_that_is_off_say_nothing_of_a_drive_but_of_a_sensor() -> None:
    columns = recorded(1)
    columns["enabled"] = (np.arange(4000) < 3000).astype(float)
    log = log_of(columns)
    (off,) = check(log).named("drive_disabled")
    assert off.severity == "note"
    assert off.rows == (3000, 4000)
    assert only_experiments([log], "sensor_torque")[0].log is log
    (kept,) = only_experiments([log], "motor_current")
    assert len(kept.log) == 3000
    (left,) = kept.left
    assert left.rows == 1000
    assert "3000 to 4000" in left.sentence


def test_a_current_of_exactly_zero_to_the_end_of_a_motion_is_a_drive_that_is_off() -> None:
    columns = recorded(2)
    columns["motor_current"][-TAIL:] = 0.0
    log = log_of(columns)
    assert findings(log) == ["drive_disabled"]
    (kept,) = only_experiments([log], "motor_current")
    assert len(kept.log) == len(log) - TAIL


def test_rows_that_two_reasons_share_are_counted_once() -> None:
    columns = frozen(recorded(3))
    columns["enabled"] = (np.arange(4000) < 3500).astype(float)
    (kept,) = only_experiments([log_of(columns)], "motor_current")
    assert sum(one.rows for one in kept.left) == 4000 - len(kept.log)
    assert true_ranges(np.isin(np.arange(4000), kept.rows)).tolist() == [[0, 3500]]
