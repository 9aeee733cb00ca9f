"""The second paper's rig: its protocol, its published levels, and what a fit can know of it."""

from __future__ import annotations

import numpy as np
import pytest

from flexspline.reproduce.turlapati import amplitude_left
from flexspline.rigs import turlapati_rig
from flexspline.rigs.turlapati import OFFSET, RATE, REST, RIPPLE


def test_runs_without_load_go_both_ways_and_hold_no_row_at_rest() -> None:
    for log in turlapati_rig(3).no_load():
        speed = log["output_velocity"]
        assert (speed > REST).any() and (speed < -REST).any()
        assert np.abs(speed).min() > REST
        assert log.duration < 30.0 and abs(log.rate - RATE) < 1e-6


def test_the_bearing_is_turned_about_twice_each_way_against_its_friction() -> None:
    rig = turlapati_rig(3)
    log = rig.bearing_run()
    turns = np.ptp(log["output_position"]) / (2 * np.pi)
    assert 1.6 < turns < 2.4
    forward = log["output_velocity"] > 0
    level = rig.bearing.coulomb_forward
    assert np.mean(log["reference_torque"][forward]) == pytest.approx(level, rel=0.25)
    assert np.mean(log["reference_torque"][~forward]) == pytest.approx(-level, rel=0.25)


def test_twice_the_friction_of_a_bearing_is_twice_the_load() -> None:
    rig = turlapati_rig(3)
    one, two = (rig.bearing_run(1, level)["reference_torque"] for level in (1.0, 2.0))
    assert np.mean(np.abs(two)) / np.mean(np.abs(one)) == pytest.approx(2.0, rel=0.05)


def test_the_sensor_reads_offset_and_ripple_as_printed_and_the_cell_does_not() -> None:
    rig = turlapati_rig(3)
    angle = np.linspace(0.0, 2 * np.pi, 5000)
    ripple = sum(
        h.amplitude * np.cos(h.order * angle + h.phase)
        for h in rig.sensor.ripple
        if h.pair == "output_on_housing"
    )
    assert np.abs(ripple).max() == pytest.approx(RIPPLE, rel=1e-2)
    log = rig.bearing_run()
    error = log["sensor_torque"] - log["reference_torque"]
    assert -0.5 < np.mean(error) - OFFSET < 0.5
    assert np.std(error) > 0.5 * RIPPLE


def test_the_same_seed_gives_the_same_runs_and_another_seed_others() -> None:
    one, same, other = (turlapati_rig(s).no_load((2.0,))[0]["sensor_torque"] for s in (3, 3, 4))
    assert np.array_equal(one, same)
    assert not np.array_equal(one, other[: len(one)])


@pytest.mark.parametrize(("order", "guide"), [(8, 0.84), (20, 0.53)])
def test_a_filter_on_the_target_alone_takes_ripple_away_and_on_rows_alike_does_not(
    order: int, guide: float
) -> None:
    left = amplitude_left(order)
    assert left.theory == pytest.approx(guide, abs=0.01)
    assert left.target_only == pytest.approx(left.theory, abs=0.01)
    assert left.rows_alike == pytest.approx(1.0, abs=0.02)
