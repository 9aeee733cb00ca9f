"""Rows that were stamped when they arrived, several at once, and the repair of their time."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from flexspline import fit
from flexspline.errors import InputError
from flexspline.logs import Log, repaired
from flexspline.logs.checks import check

Array = NDArray[np.float64]

STEP = 0.005
ROWS = 4000


def measured(time: Array, *, position: bool = True) -> dict[str, Array]:
    rng = np.random.default_rng(8)
    angle = 0.5 * np.sin(1.7 * time)
    velocity = 0.85 * np.cos(1.7 * time)
    torque = 0.03 * np.tanh(velocity / 0.005) + 0.04 * velocity
    columns = {"output_position": angle} if position else {}
    return {**columns, "motor_torque": torque + 0.001 * rng.standard_normal(len(time))}


def logged(stamps: Array, time: Array, *, position: bool = True) -> Log:
    columns = {"time": stamps, **measured(time, position=position)}
    return Log.from_arrays(facts={"gear_ratio": 100}, **columns)


def even() -> Array:
    return STEP * np.arange(ROWS)


def arrivals(burst: int, apart: float = 2e-5) -> Array:
    """Stamps of rows that come so many at once, late by chance, and so far apart [s]."""
    rng = np.random.default_rng(9)
    row = np.arange(ROWS)
    late = rng.exponential(0.0008, ROWS // burst + 1)[row // burst]
    return (row // burst + 1) * burst * STEP + late + (row % burst) * apart


@pytest.mark.parametrize("position", [True, False])
@pytest.mark.parametrize(("burst", "apart"), [(2, 2e-5), (4, 2e-5), (4, 0.0), (40, 2e-5)])
def test_stamps_of_arrival_are_an_error_with_its_repair(
    burst: int, apart: float, position: bool
) -> None:
    log = logged(arrivals(burst, apart), even(), position=position)
    (finding,) = check(log).errors
    assert finding.name == "arrival_time" and finding.size == burst
    assert "repair even_time" in finding.remedy
    assert not check(log).named("dropped_samples")


@pytest.mark.parametrize("burst", [2, 4, 40])
def test_even_time_gives_the_rows_their_time_back(burst: int) -> None:
    log = repaired(logged(arrivals(burst), even()), "even_time")
    late = log["time"] - even()
    assert np.ptp(late) < 2e-4 * STEP * ROWS
    assert not check(log).errors and not check(log).faults


def test_even_time_leaves_a_gap_between_two_runs() -> None:
    stamps = arrivals(4)
    stamps[2000:] += 30.0
    log = repaired(logged(stamps, even()), "even_time")
    steps = np.diff(log["time"])
    assert np.ptp(np.delete(steps, 1999)) < 1e-9
    assert steps[1999] == pytest.approx(30.0 + STEP, abs=0.1 * STEP)


def test_even_time_needs_a_time_that_goes_on() -> None:
    stamps = arrivals(4)
    stamps[7] = 0.0
    with pytest.raises(InputError, match="sort_time before it"):
        repaired(logged(stamps, even()), "even_time")


def test_a_fit_says_that_rows_were_stamped_when_they_arrived() -> None:
    log = logged(arrivals(4), even())
    with pytest.raises(InputError, match=r"stamped when they arrived.*repair even_time"):
        fit(["offset", "viscous_friction"], log, "motor_torque")


def test_rows_that_were_measured_in_bursts_are_no_error() -> None:
    """The angle goes on as the stamps do."""
    stamps = arrivals(4)
    assert not check(logged(stamps, stamps)).named("arrival_time")


def test_rows_that_are_there_twice_are_no_arrivals() -> None:
    """Their repair is that of a time that stands."""
    twice = np.repeat(np.arange(ROWS // 2), 2)
    for position in (True, False):
        log = logged(even(), even(), position=position).rows(twice)
        assert [finding.name for finding in check(log).errors] == ["duplicate_time"]


@pytest.mark.parametrize("jitter", [0.1, 0.3])
def test_a_clock_that_jitters_has_no_arrivals(jitter: float) -> None:
    rng = np.random.default_rng(2)
    stamps = np.sort(even() + jitter * STEP * rng.standard_normal(ROWS))
    assert not check(logged(stamps, even())).named("arrival_time")
