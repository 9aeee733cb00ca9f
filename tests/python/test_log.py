"""The Log itself: read-only columns of known names, and what it says about itself."""

from __future__ import annotations

import dataclasses
import pickle

import numpy as np
import pytest

from flexspline.errors import InputError
from flexspline.logs import CHANNELS, Log


def run(rows: int = 5, **more: object) -> Log:
    return Log.from_arrays(
        time=np.arange(rows) / 100,
        output_position=np.linspace(0, 1, rows),
        facts={"name": "run 1", "gear_ratio": 100},
        **more,  # type: ignore[arg-type]
    )


def test_a_log_cannot_be_changed() -> None:
    log = run()
    with pytest.raises(ValueError, match="read-only"):
        log["output_position"][0] = 1
    with pytest.raises(TypeError):
        log.columns["duty"] = np.zeros(5)  # type: ignore[index]
    with pytest.raises(dataclasses.FrozenInstanceError):
        log.history = ()  # type: ignore[misc]


def test_changing_the_array_it_was_made_of_does_not_change_a_log() -> None:
    angle = np.zeros(5)
    log = run(motor_position=angle)
    angle[0] = 7
    assert log["motor_position"][0] == 0


def test_a_missing_channel_is_named_with_those_that_are_there() -> None:
    with pytest.raises(
        InputError,
        match=r"'run 1'.*'output_positon' \(did you mean "
        r"'output_position'\?\); it has time, output_position",
    ):
        run()["output_positon"]


def test_a_channel_that_is_spelled_right_is_not_taken_for_a_slip() -> None:
    with pytest.raises(InputError, match="no channel 'duty'; it has"):
        run()["duty"]


@pytest.mark.parametrize(
    ("columns", "sentence"),
    [
        ({"torque": [1, 2]}, "'torque' is no channel of a log"),
        ({"duty": [1]}, "'duty' has 1 rows where 'time' has 2"),
        ({"duty": ["a", "b"]}, "'duty' holds something that is no number"),
        ({"duty": [[1], [2]]}, "'duty' has shape"),
        ({"time": []}, "no rows"),
        ({"duty": np.array([1.0, 1j])}, "'duty' holds complex numbers; give real ones"),
        ({"duty": [1.0, 1j]}, "'duty' holds complex numbers"),
    ],
)
def test_impossible_columns_are_refused(columns: dict[str, object], sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        Log.from_arrays(**{"time": [0, 1], **columns})  # type: ignore[arg-type]


def test_a_log_without_time_is_refused() -> None:
    with pytest.raises(InputError, match=r"no channel 'time'.*time stamps or a rate"):
        Log.from_arrays(duty=[0, 1])


@pytest.mark.parametrize(
    ("facts", "sentence"),
    [
        ({"gear_ratio": -1}, "gear_ratio is -1; give a positive number"),
        ({"gear_ratio": "big"}, "gear_ratio is 'big'"),
        ({"gear_ratio": True}, "gear_ratio is True; give a positive number"),
        ({"pole_pairs": np.True_}, "pole_pairs is .*True.*; give a positive"),
        ({"output_spline": "round"}, "give 'circular' or 'flex'"),
        ({"pole_pairs": 7.5}, "pole_pairs is 7.5; give a positive whole number"),
    ],
)
def test_impossible_facts_are_refused(facts: dict[str, object], sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        run().with_facts(facts)  # type: ignore[arg-type]


def test_a_name_is_one_line_that_no_terminal_obeys() -> None:
    log = Log.from_arrays(time=[0.0, 1.0], facts={"name": "run\x1b[31m 1\n\u202e"})
    assert log.name == "run\ufffd[31m 1 \ufffd" and log.name.isprintable()


def test_one_tooth_more_counts_where_the_circular_spline_is_the_output() -> None:
    assert run().effective_ratio == 100
    assert run().with_facts({"output_spline": "circular"}).effective_ratio == 101
    assert Log.from_arrays(time=[0, 1]).effective_ratio is None


def test_a_slice_shares_memory_and_says_so_in_the_history() -> None:
    log = run()
    part = log.rows(slice(1, 3))
    assert np.shares_memory(part["time"], log["time"])
    assert part.history[-1] == "kept 2 of 5 rows"


def test_rate_is_the_median_and_survives_a_gap() -> None:
    log = Log.from_arrays(time=[0, 0.01, 0.02, 5.0, 5.01])
    assert log.rate == pytest.approx(100)
    assert log.duration == 5.01


def test_a_log_survives_pickling() -> None:
    log = pickle.loads(pickle.dumps(run()))
    assert log.channels == ("time", "output_position")
    assert log.facts["gear_ratio"] == 100
    assert not log["time"].flags.writeable


def test_masked_samples_are_missing_ones() -> None:
    whole = np.ma.masked_array(np.arange(4), mask=[False, True, False, True])
    log = Log({"time": np.arange(4.0), "sensor_torque": whole})
    assert log.history == ("masked samples are empty: 2 of sensor_torque",)
    for made in (log, Log.from_arrays(time=np.arange(4.0), sensor_torque=1.0 * whole)):
        np.testing.assert_array_equal(made["sensor_torque"], [0.0, np.nan, 2.0, np.nan])
    assert whole[2] == 2 and np.ma.count_masked(whole) == 2
    plain = Log({"time": np.arange(4.0), "sensor_torque": np.ma.masked_array(np.arange(4))})
    assert plain.history == () and type(plain["sensor_torque"]) is np.ndarray


def test_printing_shows_every_channel_with_its_unit() -> None:
    log = run(sensor_torque=[1, np.nan, 3, 4, 5])
    text, page = str(log), log._repr_html_()
    assert "run 1: 5 rows, 0.04 s at 100 Hz" in text
    for channel in log.channels:
        assert channel in text
        assert f"<td>{CHANNELS[channel].unit}</td>" in page
    assert "sensor_torque    Nm" in text and "1 not finite" in text


def test_a_frame_is_a_copy_that_may_be_changed() -> None:
    log = run()
    frame = log.to_frame()
    frame.loc[0, "output_position"] = 9
    assert log["output_position"][0] == 0
