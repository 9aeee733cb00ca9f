"""Segments: constant speed, standstill, reversals with and without dwell, gaps."""

from __future__ import annotations

import numpy as np
import pytest

from flexspline.errors import InputError
from flexspline.logs import Log
from flexspline.logs.segments import (
    Segment,
    constant_speed,
    gaps,
    near_reversal,
    reversal_times,
    reversals,
    runs,
    segments,
    standstill,
)


def trapezoid(dwell: float = 0.0) -> Log:
    """0.5 rad/s for 2 s, a ramp of 0.2 s (with a dwell at zero), -0.5 rad/s for 2 s; 1 kHz."""
    ramp = np.linspace(0.5, 0, 100, endpoint=False)
    still = np.zeros(round(1000 * dwell))
    velocity = np.concatenate((np.full(2000, 0.5), ramp, still, -ramp[::-1], np.full(2000, -0.5)))
    return Log.from_arrays(time=np.arange(len(velocity)) / 1000, output_velocity=velocity)


def test_the_reversal_is_where_the_velocity_passes_zero() -> None:
    assert reversal_times(trapezoid()) == pytest.approx([2.1], abs=0.002)


def test_a_dwell_belongs_to_its_reversal() -> None:
    (found,) = reversals(trapezoid(dwell=0.3))
    assert (found.start, found.stop) == pytest.approx((2098, 2403), abs=3)
    assert len(found) == found.stop - found.start


def test_a_stop_that_goes_on_the_same_way_is_no_reversal() -> None:
    velocity = np.concatenate((np.full(500, 0.3), np.zeros(200), np.full(500, 0.3)))
    log = Log.from_arrays(time=np.arange(1200) / 1000, output_velocity=velocity)
    assert reversals(log) == ()
    assert standstill(log).sum() == 200


def test_noise_about_zero_makes_no_reversal() -> None:
    rng = np.random.default_rng(0)
    velocity = np.concatenate((np.full(500, 0.3), np.zeros(500), np.full(500, 0.3)))
    velocity += 1e-4 * rng.standard_normal(1500)
    log = Log.from_arrays(time=np.arange(1500) / 1000, output_velocity=velocity)
    assert reversals(log) == ()


def test_rows_near_a_reversal_are_within_the_stated_time_of_it() -> None:
    log = trapezoid()
    near = log["time"][near_reversal(log, 0.1)]
    assert near[[0, -1]] == pytest.approx([1.998, 2.202], abs=0.003)


def test_without_a_reversal_no_row_is_near_one() -> None:
    log = Log.from_arrays(time=np.arange(100) / 100, output_velocity=np.full(100, 0.2))
    assert not near_reversal(log).any()


def test_constant_speed_is_found_on_both_sides_of_a_reversal() -> None:
    found = constant_speed(trapezoid())
    assert [(s.start, s.stop) for s in found] == [
        pytest.approx((0, 2000), abs=130),
        pytest.approx((2200, 4200), abs=260),
    ]


def test_a_gap_ends_a_run_and_a_stretch() -> None:
    time = np.concatenate((np.arange(1000), np.arange(1500, 2500))) / 1000
    log = Log.from_arrays(time=time, output_velocity=np.full(2000, 0.5))
    assert gaps(log) == (Segment(999, 1001, "gap"),)
    assert runs(time).tolist() == [[0, 1000], [1000, 2000]]
    assert not any(s.start < 1000 < s.stop for s in constant_speed(log))


def test_velocity_is_derived_where_only_the_position_is_known() -> None:
    time = np.arange(4000) / 1000
    log = Log.from_arrays(time=time, output_position=np.cos(2 * np.pi * 0.5 * time))
    assert reversal_times(log) == pytest.approx([1.0, 2.0, 3.0], abs=0.01)


def test_segments_come_in_the_order_of_rows() -> None:
    found = segments(trapezoid(dwell=0.3))
    assert [s.start for s in found] == sorted(s.start for s in found)
    assert {s.kind for s in found} == {"constant_speed", "standstill", "reversal"}


def test_a_log_without_motion_is_refused() -> None:
    with pytest.raises(InputError, match="output_velocity or output_position"):
        standstill(Log.from_arrays(time=np.arange(10.0), sensor_torque=np.zeros(10)))
