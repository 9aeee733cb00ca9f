"""A table of broken logs: each is noticed under its name, with its size, in one sentence."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest
from checks_logs import sound_log
from numpy.typing import NDArray

from flexspline.errors import InputError
from flexspline.logs import Log
from flexspline.logs.checks import check, must_be_repaired
from flexspline.logs.checks.samples import STRETCH_ROWS, STRETCHES, unwrapped
from flexspline.logs.repairs import REPAIRS, repaired

Array = NDArray[np.float64]
Columns = dict[str, Array]

MOTION = ["output_position", "output_velocity", "motor_torque"]
SEED = 6


def broken(change: Callable[[Columns], object]) -> Log:
    """The sound log 6 (sines, 20 s) with its columns changed in place or replaced."""
    log = sound_log(SEED)
    columns = {name: log[name].copy() for name in log.channels}
    change(columns)
    return Log(columns, log.facts)


def put(channel: str, rows: slice | int, value: float) -> Callable[[Columns], object]:
    def change(columns: Columns) -> None:
        columns[channel][rows] = value

    return change


def times(channel: str, factor: float) -> Callable[[Columns], object]:
    return lambda columns: columns.update({channel: columns[channel] * factor})


def late(channel: str, seconds: float) -> Callable[[Columns], object]:
    def change(columns: Columns) -> None:
        columns[channel] = np.interp(columns["time"] - seconds, columns["time"], columns[channel])

    return change


def without(rows: slice) -> Callable[[Columns], object]:
    return lambda columns: columns.update({c: np.delete(v, rows) for c, v in columns.items()})


def stuck(columns: Columns) -> None:
    for name in columns:
        if name != "time":
            columns[name][300:310] = columns[name][300]


def swapped(columns: Columns) -> None:
    columns["time"][[40, 41]] = columns["time"][[41, 40]]


def twice(columns: Columns) -> None:
    for name in columns:
        columns[name] = np.insert(columns[name], 50, columns[name][50])


def clip(columns: Columns) -> None:
    top = float(np.percentile(columns["sensor_torque"], 90))
    columns["sensor_torque"] = np.minimum(columns["sensor_torque"], top)


def wrap(columns: Columns) -> None:
    columns["output_position"] = np.mod(columns["output_position"] + 1.0, 2 * np.pi)


def shuffled(columns: Columns) -> None:
    columns["output_velocity"] = np.random.default_rng(0).permutation(columns["output_velocity"])


def coarse(columns: Columns) -> None:
    columns["output_position"] = np.round(columns["output_position"] / 0.00153) * 0.00153


class Case(NamedTuple):
    """What is broken, and what has to be said of it."""

    change: Callable[[Columns], object]
    name: str
    severity: str
    channel: str
    size: float | None
    words: str
    remedy: str


CASES = {
    "nan": Case(
        put("sensor_torque", slice(7, 9), np.nan),
        "not_finite",
        "error",
        "sensor_torque",
        2,
        "2 rows, first in row 7",
        "drop_invalid",
    ),
    "infinite": Case(
        put("motor_torque", 11, np.inf),
        "not_finite",
        "error",
        "motor_torque",
        1,
        "first in row 11",
        "drop_invalid",
    ),
    "time backwards": Case(
        swapped, "time_not_increasing", "error", "time", None, "first in row 41", "sort_time"
    ),
    "time twice": Case(
        twice, "duplicate_time", "error", "time", 1, "first row 51", "drop_duplicates"
    ),
    "dropped": Case(
        without(slice(100, 103)),
        "dropped_samples",
        "fault",
        "time",
        3,
        "3 rows missing in 1 place",
        "resample",
    ),
    "stuck": Case(
        stuck,
        "stuck_recorder",
        "fault",
        "all",
        9,
        "first row 301, up to 9 on end",
        "drop_repeated",
    ),
    "constant": Case(
        put("motor_current", slice(None), 1.5),
        "constant_channel",
        "fault",
        "motor_current",
        1.5,
        "in every row",
        "column map",
    ),
    "clipped": Case(
        clip,
        "clipped_channel",
        "fault",
        "sensor_torque",
        None,
        "clipped there",
        "drop_clipped=sensor_torque:",
    ),
    "wrapped": Case(
        wrap,
        "wrapped_angle",
        "fault",
        "output_position",
        None,
        "whole turn",
        "unwrap=output_position",
    ),
    "degrees": Case(
        times("output_velocity", 180 / np.pi),
        "velocity_unit",
        "fault",
        "output_velocity",
        57.3,
        "deg/s",
        "scale=output_velocity:0.01745",
    ),
    "rpm": Case(
        times("output_velocity", 30 / np.pi),
        "velocity_unit",
        "fault",
        "output_velocity",
        9.549,
        "rpm",
        "scale=output_velocity:0.1047",
    ),
    "velocity sign": Case(
        times("output_velocity", -1),
        "velocity_sign",
        "fault",
        "output_velocity",
        -1,
        "opposite sign",
        "flip_sign=output_velocity",
    ),
    "wrong rate": Case(
        times("time", 0.8),
        "velocity_scale",
        "fault",
        "output_velocity",
        0.8,
        "sampling rate",
        "scale=output_velocity:1.25",
    ),
    "late velocity": Case(
        late("output_velocity", 0.040),
        "velocity_delay",
        "fault",
        "output_velocity",
        0.040,
        "39.999",  # ms; its error is 50 ns
        "shift=output_velocity:0.0",
    ),
    "early velocity": Case(
        late("output_velocity", -0.025),
        "velocity_delay",
        "fault",
        "output_velocity",
        -0.025,
        "early",
        "velocity_from_position",
    ),
    "other velocity": Case(
        shuffled,
        "velocity_unrelated",
        "fault",
        "output_velocity",
        None,
        "not the derivative",
        "velocity_from_position",
    ),
    "motor reversed": Case(
        times("motor_position", -1),
        "motor_reversed",
        "fault",
        "motor_position",
        None,
        "the other way",
        "flip_sign=motor_position",
    ),
    "motor in degrees": Case(
        times("motor_position", 180 / np.pi),
        "gear_ratio",
        "fault",
        "motor_position",
        None,
        "as stated",
        "units",
    ),
    "late encoder": Case(
        late("output_position", 0.002),
        "encoder_delay",
        "fault",
        "output_position",
        0.002,
        "late",
        "shift=output_position",
    ),
    "flipped drive": Case(
        times("motor_torque", -1),
        "torque_sign",
        "fault",
        "motor_torque",
        None,
        "sign is flipped",
        "flip_sign=motor_torque",
    ),
    "flipped sensor": Case(
        times("sensor_torque", -1),
        "torque_sign",
        "note",
        "sensor_torque",
        None,
        "or the sensor sees",
        "flip_sign=sensor_torque",
    ),
    "coarse encoder": Case(
        coarse,
        "quantised_channel",
        "note",
        "output_position",
        0.00153,
        "steps of 0.00153 rad",
        "bandwidth",
    ),
}


def test_a_motor_that_its_load_drives_has_no_flipped_sign() -> None:
    """A load that pulls in the direction of motion: the motor brakes, and its mass is positive."""

    def pulled(columns: Columns) -> None:
        direction = np.tanh(columns["output_velocity"] / 0.02)
        columns["motor_torque"] = columns["motor_torque"] - 0.4 * direction

    found = check(broken(pulled)).named("torque_sign")
    assert "motor_torque" not in {finding.channel for finding in found}


@pytest.mark.parametrize("case", CASES.values(), ids=CASES.keys())
def test_each_broken_log_is_noticed_with_its_size(case: Case) -> None:
    log = broken(case.change)
    found = [f for f in check(log).named(case.name) if f.channel == case.channel]
    assert len(found) == 1
    (finding,) = found
    assert finding.severity == case.severity
    assert case.words in finding.sentence
    assert finding.sentence.endswith(".") and "\n" not in finding.sentence
    assert case.remedy in finding.remedy
    assert 0 <= finding.rows[0] < finding.rows[1] <= len(log)
    if case.size is not None:
        assert finding.size == pytest.approx(case.size, rel=0.05)


def turned(*channels: str) -> Callable[[Columns], object]:
    def change(columns: Columns) -> None:
        columns["motor_velocity"] = np.gradient(columns["motor_position"], columns["time"])
        for name in channels:
            columns[name] = -columns[name]

    return change


MOTOR_ANGLES, MOTOR_TORQUES = (
    ("motor_position", "motor_velocity"),
    ("motor_torque", "motor_current"),
)


def test_a_motor_s_encoder_that_is_reversed_alone_is_turned_alone() -> None:
    log = broken(turned(*MOTOR_ANGLES))
    (finding,) = check(log).named("motor_reversed")
    wanted = [f"flip_sign={name}" for name in MOTOR_ANGLES]
    assert ASKED.findall(finding.remedy) == wanted
    whole = check(repaired(log, wanted))
    assert not whole.named("motor_reversed") and not whole.named("torque_sign")
    assert not whole.named("velocity_sign")
    wrong = check(repaired(log, "reverse_motor")).named("torque_sign")
    assert {finding.channel for finding in wrong} == {*MOTOR_TORQUES}


def test_a_motor_that_is_reversed_with_its_torque_is_turned_as_a_whole() -> None:
    log = broken(turned(*MOTOR_ANGLES, *MOTOR_TORQUES))
    found = check(log)
    asked = [*found.named("motor_reversed"), *found.named("torque_sign")]
    assert len(asked) == 3
    assert {one for finding in asked for one in ASKED.findall(finding.remedy)} == {"reverse_motor"}
    whole = check(repaired(log, "reverse_motor"))
    assert not whole.named("motor_reversed") and not whole.named("torque_sign")


def test_what_one_direction_does_not_tell_of_the_torque_s_sign_is_asked_for() -> None:
    log = broken(turned(*MOTOR_ANGLES))
    one_way = log.with_columns(
        {name: np.ones(len(log)) for name in MOTOR_TORQUES}, note="no torque"
    )
    (finding,) = check(one_way).named("motor_reversed")
    assert "flip_sign=motor_position" in finding.remedy and "reverse_motor" in finding.remedy
    assert finding.remedy.endswith("this run does not tell.")


ASKED = re.compile(r"repair (\w+(?:=[\w:.+-]*\w)?)")  # the full stop ends the sentence


@pytest.mark.parametrize(
    ("change", "name", "repairs"),
    [
        (put("sensor_torque", 7, np.nan), "not_finite", "drop_invalid"),
        (swapped, "time_not_increasing", "sort_time"),
        (twice, "duplicate_time", "drop_duplicates"),
        (wrap, "wrapped_angle", "unwrap=output_position"),
        (times("output_velocity", -1), "velocity_sign", "flip_sign=output_velocity"),
        (times("output_velocity", 180 / np.pi), "velocity_unit", "scale=output_velocity:0.0174533"),
        (late("output_velocity", 0.04), "velocity_delay", "shift=output_velocity:0.04"),
        (late("output_velocity", 0.04), "velocity_delay", "velocity_from_position"),
        (times("motor_torque", -1), "torque_sign", "flip_sign=motor_torque"),
        (times("motor_position", -1), "motor_reversed", "flip_sign=motor_position"),
    ],
)
def test_the_remedy_mends_what_was_found(
    change: Callable[[Columns], object], name: str, repairs: str
) -> None:
    log = broken(change)
    assert check(log).named(name)
    assert not check(repaired(log, repairs)).named(name)


@pytest.mark.parametrize("case", CASES.values(), ids=CASES.keys())
def test_rows_that_are_to_go_have_a_repair_that_the_finding_names(case: Case) -> None:
    """Whoever reads that rows are to be dropped can do so without a program of his own."""
    for finding in check(broken(case.change)):
        said = finding.remedy.lower()
        assert not any(words in said for words in ("drop these", "leave these", "remove these"))
        assert {name.partition("=")[0] for name in ASKED.findall(said)} <= set(REPAIRS)


@pytest.mark.parametrize("case", ["nan", "infinite", "time twice", "stuck", "clipped"])
def test_the_repair_that_a_finding_names_drops_its_rows_and_no_others(case: str) -> None:
    log = broken(CASES[case].change)
    (finding,) = (f for f in check(log).named(CASES[case].name))
    (asked,) = ASKED.findall(finding.remedy)
    made = repaired(log, asked)
    assert not check(made).named(finding.name)
    first, last = finding.rows
    lost = len(log) - len(made)
    assert 0 < lost <= last - first
    if finding.unit == "rows":
        assert lost == finding.size


def test_rows_that_a_repair_left_out_as_asked_are_no_fault() -> None:
    """Those that the recorder lost beside them are one."""
    log = repaired(broken(stuck), "drop_repeated")
    (note,) = check(log).named("dropped_samples")
    assert note.severity == "note" and "nothing is to be done" in note.remedy
    assert "drop_repeated" in note.remedy and "needs no repair" not in note.remedy
    assert not must_be_repaired([(log, check(log))])
    lost = log.rows(np.delete(np.arange(len(log)), slice(500, 504)))
    (fault,) = check(lost).named("dropped_samples")
    assert fault.severity == "fault" and fault.size == note.size + 4


def test_missing_rows_alone_make_no_page_of_a_check_critical() -> None:
    """Its verdict is that the run can be fitted."""
    gap, sound = broken(without(slice(100, 103))), sound_log(SEED)
    clipped = broken(clip)
    told = [must_be_repaired([(log, check(log))]) for log in (sound, gap, clipped)]
    assert told == [False, False, True]


def test_the_other_spline_is_named_where_the_ratio_says_so() -> None:
    log = sound_log(SEED)
    other = "flex" if log.facts["output_spline"] == "circular" else "circular"
    (finding,) = check(log.with_facts({"output_spline": other})).named("gear_ratio")
    assert f"output_spline={log.facts['output_spline']}" in finding.remedy


def test_without_a_stated_ratio_the_measured_one_is_a_note() -> None:
    log = sound_log(SEED)
    bare = Log(log.columns, {"name": "bare"})
    (finding,) = check(bare).named("gear_ratio_not_stated")
    assert finding.size == pytest.approx(log.effective_ratio, rel=1e-4)
    assert finding.severity == "note"


def test_the_start_of_a_constant_speed_run_is_named_with_its_length() -> None:
    time = np.arange(3000) / 1000
    rng = np.random.default_rng(0)
    velocity = 0.5 * (1 - np.exp(-time / 0.1)) + 0.002 * rng.standard_normal(3000)
    log = Log.from_arrays(time=time, output_velocity=velocity)
    (finding,) = check(log).named("start_transient")
    # 0.5 exp(-t / 0.1 s) sinks below 2.5 times the noise of 0.002 after 0.46 s.
    assert 0.4 <= finding.size <= 0.6
    assert f"drop_start={finding.size:.1f}" in finding.remedy


def test_a_slow_swing_has_no_start_that_differs_from_a_steady_run() -> None:
    time = np.arange(4000) / 500.0
    velocity = -0.48 * np.sin(np.pi * (time + 0.1) / 11.0)
    log = Log.from_arrays(
        time=time, output_velocity=velocity, output_position=np.cumsum(velocity) / 500.0
    )
    assert not check(log).named("start_transient")


def test_nothing_is_changed_by_a_check() -> None:
    log = broken(wrap)
    before = {name: log[name].copy() for name in log.channels}
    history = log.history
    check(log)
    assert all(np.array_equal(log[name], before[name]) for name in before)
    assert log.history == history


def test_errors_are_raised_on_demand_with_remedy() -> None:
    findings = check(broken(put("sensor_torque", 7, np.nan)))
    with pytest.raises(InputError, match=r"sound 6: sensor_torque is NaN.*drop_invalid"):
        findings.raise_errors()
    check(sound_log(SEED)).raise_errors()


def test_findings_read_as_a_table_and_as_html() -> None:
    findings = check(broken(times("output_velocity", -1)))
    text = str(findings)
    assert text.startswith("sound 6: 1 fault")
    assert "velocity_sign" in text and "flip_sign=output_velocity" in text
    assert "<td>velocity_sign</td>" in findings._repr_html_()
    assert str(check(sound_log(SEED))).splitlines()[0] == "sound 6: nothing found"


def test_the_worst_comes_first() -> None:
    def several(columns: Columns) -> None:
        times("sensor_torque", -1)(columns)
        times("output_velocity", -1)(columns)
        columns["temperature"][3] = np.nan

    order = [f.severity for f in check(broken(several))]
    assert order == sorted(order, key=("error", "fault", "note").index)
    assert set(order) == {"error", "fault", "note"}


@pytest.mark.parametrize("rows", [1, 2, 3, 10, 50])
def test_a_log_of_few_rows_is_checked_without_failing(rows: int) -> None:
    assert not check(sound_log(SEED).rows(slice(rows))).errors


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("empty", [MOTION[:1], MOTION[1:2], MOTION[2:], MOTION])
def test_a_log_of_nothing_but_nan_is_checked_without_failing(empty: list[str]) -> None:
    held = np.repeat(np.arange(50.0), 2)
    there = dict.fromkeys(MOTION, held)
    log = Log.from_arrays(time=np.arange(100.0), **{**there, **dict.fromkeys(empty, held * np.nan)})
    assert {finding.channel for finding in check(log).named("not_finite")} == {*empty}


@pytest.mark.parametrize("row", [1, 2, 3, 50, 97, 98, 99])
def test_a_wrap_is_seen_in_whatever_row_it_is(row: int) -> None:
    """Beside an end of the run the steps around it lie on one side."""
    angle = 0.01 * (np.arange(100.0) - row + 0.5)
    wrapped = np.where(np.arange(100) >= row, angle - np.pi, angle + np.pi)
    log = Log.from_arrays(time=0.01 * np.arange(100.0), output_position=wrapped)
    (finding,) = check(log).named("wrapped_angle")
    assert finding.rows[0] == row
    np.testing.assert_allclose(unwrapped(log, "output_position"), angle + np.pi, atol=1e-12)


def test_a_long_log_of_which_stretches_are_looked_at_has_its_ratio() -> None:
    """From one stretch to the next the motor goes on by about a turn: that is no wrap."""
    count, ratio = 2 * STRETCHES * STRETCH_ROWS, 100.0
    first = np.linspace(0, count - STRETCH_ROWS, STRETCHES).astype(int)
    time = np.arange(count) / 1000.0
    velocity = np.sin(2.0 * np.pi * time / 2.5)  # whole periods in a stretch
    between = first[1] - (first[0] + STRETCH_ROWS - 1)
    drift = 2.0 * np.pi / ratio / between * 1000.0
    position = 2.5 / (2.0 * np.pi) * (1.0 - np.cos(2.0 * np.pi * time / 2.5)) + drift * time
    log = Log.from_arrays(
        time=time,
        output_position=position,
        output_velocity=velocity + drift,
        motor_position=ratio * position,
        facts={"gear_ratio": ratio, "output_spline": "flex"},
    )
    jumps = log["motor_position"][first[1:]] - log["motor_position"][first[:-1] + STRETCH_ROWS - 1]
    assert (abs(abs(jumps) - 2.0 * np.pi) < 0.5).any()
    assert not check(log).named("gear_ratio")


def test_a_wrapped_angle_is_unwrapped_beside_rows_without_a_value() -> None:
    true = np.linspace(0.0, 30.0, 400)
    wrapped = true % (2.0 * np.pi)
    wrapped[[40, 82, 83, 85, 251]] = np.nan  # the first wrap lies at row 84
    known = np.isfinite(wrapped)
    log = Log.from_arrays(time=0.01 * np.arange(400.0), output_position=wrapped)
    whole = unwrapped(log, "output_position")
    assert np.allclose(whole[known], true[known])
    assert np.isnan(whole[~known]).all()


@pytest.mark.parametrize("dropped", [1, 2, 3, 4, 5, 6])
def test_rows_that_a_recorder_dropped_are_no_wrap_of_a_fast_motor(dropped: int) -> None:
    """At 1.5 rad in a row four missing rows are nearly a turn; the motor has gone on."""
    time = np.arange(2000) / 100.0
    motor = 80.0 * np.sin(2.0 * np.pi * 0.3 * time)
    kept = np.ones(len(time), dtype=bool)
    for first in (1003, 1330, 1337, 1670):  # where it is fastest
        kept[first : first + dropped] = False
    log = Log.from_arrays(time=time[kept], motor_position=motor[kept])
    assert log.columns["motor_position"].shape < time.shape and np.ptp(np.diff(motor)) > 2.9
    assert not check(log).named("wrapped_angle")
    np.testing.assert_array_equal(unwrapped(log, "motor_position"), motor[kept])
    turned = Log.from_arrays(time=time[kept], motor_position=np.angle(np.exp(1j * motor[kept])))
    assert check(turned).named("wrapped_angle")
