"""Columns that were sampled at instants of their own, laid on one clock."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from flexspline.errors import InputError
from flexspline.logs.columns import picked
from flexspline.logs.one_clock import MARK, on_one_clock, with_time
from flexspline.logs.table import Series, Table

FAST = np.arange(1000) * 0.001
SLOW = np.arange(-3, 120) * 0.01 + 0.0004


def table(*series: tuple[str, np.ndarray, dict[str, Any]]) -> Table:
    """A table of several series: name, stamps, columns by name."""
    columns = [
        (k, name, data) for k, (_, _, own) in enumerate(series) for name, data in own.items()
    ]
    return with_time(
        Table(
            "a.mf4",
            tuple(np.asarray(data) for _, _, data in columns),
            tuple(name for _, name, _ in columns),
            series=tuple(Series(f"'{name}'", stamps) for name, stamps, _ in series),
            of_series=tuple(k for k, _, _ in columns),
        )
    )


def laid(values: Any, stamps: np.ndarray = SLOW, channel: str = "temperature") -> np.ndarray:
    """Values of a slow series, on the clock of a fast one; NaN where they are missing."""
    made = table(("fast", FAST, {"output_position": FAST}), ("slow", stamps, {channel: values}))
    return picked(made, None).channels[channel]


def test_numbers_lie_on_lines_between_samples() -> None:
    assert laid(20.0 + SLOW) == pytest.approx(20.0 + FAST, abs=1e-12)
    fine = np.sin(2.0 * np.pi * SLOW)
    assert laid(fine) == pytest.approx(np.interp(FAST, SLOW, fine), abs=1e-12)


def test_the_fastest_chosen_series_is_the_clock_and_says_so() -> None:
    made = table(
        ("fast", FAST, {"output_position": FAST}),
        ("slow", SLOW, {"temperature": 20.0 + SLOW}),
        ("faster", np.arange(9000) * 1e-4, {"else": np.zeros(9000)}),
    )
    chosen = picked(made, None)
    assert np.array_equal(chosen.channels["time"], FAST)
    assert np.array_equal(chosen.channels["output_position"], FAST)
    (said,) = [note for note in chosen.table.notes if note.startswith(MARK)]
    assert "1000 samples of 'fast'" in said and "of 'slow'" in said and "'faster'" not in said


def test_the_series_of_the_column_that_is_time_is_the_clock_before_the_fastest() -> None:
    made = table(
        ("fast", FAST, {"output_position": np.sin(FAST)}),
        ("slow", SLOW, {"t": 1e3 * SLOW, "temperature": SLOW}),
    )
    chosen = picked(made, {"time": ("t", "ms")}).channels
    inside = SLOW[(SLOW >= 0.0) & (FAST[-1] >= SLOW)]
    assert chosen["time"] == pytest.approx(inside, abs=1e-12)
    assert chosen["output_position"] == pytest.approx(np.sin(inside), abs=1e-6)


def test_one_series_is_left_as_it_is() -> None:
    made = table(("fast", FAST, {"output_position": FAST}), ("slow", SLOW, {"else": SLOW}))
    chosen = picked(made, None)
    assert np.array_equal(chosen.channels["time"], FAST)
    assert not any(note.startswith(MARK) for note in chosen.table.notes)


def test_only_the_time_that_all_have_is_kept() -> None:
    late = 0.25 + np.arange(50) * 0.01
    made = table(("fast", FAST, {"output_position": FAST}), ("late", late, {"temperature": late}))
    time = picked(made, None).channels["time"]
    assert time[0] == pytest.approx(0.25) and time[-1] == pytest.approx(0.74)


def test_no_number_is_made_across_a_gap() -> None:
    torn = np.delete(SLOW, slice(40, 60))
    made = laid(20.0 + torn, torn)
    gap = (torn[39] < FAST) & (torn[40] > FAST)
    assert np.isnan(made[gap]).all() and gap.sum() == 210  # 361 to 570 ms
    assert made[~gap] == pytest.approx(20.0 + FAST[~gap], abs=1e-12)


def test_a_number_at_both_ends_of_a_gap_is_there() -> None:
    stamps = np.delete(np.arange(101) * 0.01, slice(40, 60))
    made = laid(stamps, stamps)
    assert made[390] == pytest.approx(0.39) and made[600] == pytest.approx(0.6)
    assert np.isnan(made[391:600]).all() and np.isfinite(made[[390, 600]]).all()


def test_counts_are_held_but_not_across_a_gap() -> None:
    counts = np.arange(len(SLOW))
    assert np.array_equal(laid(counts), np.searchsorted(SLOW, FAST, "right") - 1.0)
    torn = np.delete(SLOW, slice(40, 60))
    made = laid(np.arange(len(torn)), torn)
    assert np.isnan(made[(torn[39] < FAST) & (torn[40] > FAST)]).all()


def test_states_are_held_across_anything() -> None:
    stamps = np.array([-1.0, 0.3, 0.31, 2.0])
    for values in (np.array([0, 1, 0, 1]), np.array([False, True, False, True])):
        made = laid(values, stamps, "enabled")
        assert np.array_equal(np.flatnonzero(made), np.arange(300, 310))


def test_an_angle_that_wraps_gets_no_angle_between_its_ends() -> None:
    turning = np.mod(40.0 * SLOW, 2.0 * np.pi)
    made = laid(turning, channel="motor_position")
    wrong = np.abs(np.angle(np.exp(1j * (made - 40.0 * FAST))))
    assert wrong.max() < 0.41  # one slow step, where held
    assert np.mean(wrong > 1e-9) < 0.1


def test_empty_cells_stay_empty() -> None:
    values = 20.0 + SLOW
    values[50] = np.nan
    made = laid(values)
    assert np.isnan(made).sum() == np.sum((SLOW[49] < FAST) & (SLOW[51] > FAST))


def test_nanoseconds_since_1970_keep_their_digits() -> None:
    zero = 1_800_000_000_123_456_789
    fast, slow = zero + np.arange(1000) * 1_000_000, zero + np.arange(120) * 10_000_000
    made = table(("f", fast, {"output_position": FAST}), ("s", slow, {"temperature": np.ones(120)}))
    time = picked(made, None).channels["time"]
    assert time == pytest.approx(FAST, abs=1e-12)


def test_rows_are_dropped_behind_the_common_start() -> None:
    made = table(("fast", FAST, {"output_position": FAST}), ("slow", SLOW, {"temperature": SLOW}))
    chosen = picked(made.without_first(100), None).channels
    assert np.array_equal(chosen["time"], FAST[100:])
    assert chosen["temperature"] == pytest.approx(FAST[100:], abs=1e-12)


def test_text_is_held() -> None:
    stamps = np.array([-1.0, 0.5])
    made = table(
        ("fast", FAST, {"output_position": FAST}),
        ("slow", stamps, {"mode": np.array(["a", "b"], dtype=object)}),
    )
    mode = on_one_clock(made, {"output_position": 1}).column(2)
    assert list(mode[[0, 499, 500, 999]]) == ["a", "a", "b", "b"]


def test_clocks_that_go_back_or_never_meet_are_refused() -> None:
    back = SLOW.copy()
    back[10] = 5.0
    with pytest.raises(InputError, match=r"a\.mf4: the clock of 'slow' goes back .* row 11, and"):
        laid(SLOW, back)
    with pytest.raises(InputError, match="'fast', 'slow' have no two samples of the clock in comm"):
        laid(SLOW, SLOW + 10.0)
    with pytest.raises(InputError, match="have no two samples"):
        laid(np.zeros(0), np.zeros(0))
