"""Channels that are a function of each other are found, on rows that no function was fitted to."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from flexspline.logs.checks.dependence import _thinned, dependences

Array = NDArray[np.float64]
Columns = dict[str, Array]

ROWS = 4000
ANGLE = "output_position"


def moving(seed: int, swing: float = 1.0) -> Columns:
    """Two sines that do not come round together."""
    draw = np.random.default_rng([seed, 13])
    time = np.arange(ROWS) / 100.0
    rates = 2.0 * np.pi * np.array([0.3, 0.71]) * draw.uniform(0.8, 1.2)
    phases = draw.uniform(0.0, 2.0 * np.pi, 2)
    parts = swing * np.array([1.0, 0.5])[:, None]
    x = rates[:, None] * time + phases[:, None]
    return {
        "time": time,
        ANGLE: (parts * np.sin(x)).sum(axis=0),
        "output_velocity": (parts * rates[:, None] * np.cos(x)).sum(axis=0),
        "output_acceleration": -(parts * rates[:, None] ** 2 * np.sin(x)).sum(axis=0),
        "load": 5.0 * np.sin(0.21 * time + draw.uniform(0.0, 6.0)) + draw.normal(0.0, 0.1, ROWS),
        "temperature": 25.0 + np.sin(0.5 * time + draw.uniform(0.0, 6.0)),
    }


def pairs(runs: list[Columns]) -> list[tuple[str, str]]:
    return [(one.channel, one.of) for one in dependences(runs)]


@pytest.mark.parametrize("count", [1, 2, 5])
@pytest.mark.parametrize("seed", range(4))
def test_channels_that_go_their_own_ways_are_no_function(seed: int, count: int) -> None:
    assert pairs([moving(10 * seed + number) for number in range(count)]) == []


@pytest.mark.parametrize("count", [1, 5])
@pytest.mark.parametrize("swing", [0.5, 3.0])
@pytest.mark.parametrize("noise", [0.004, 0.1])
def test_a_weight_on_a_lever_makes_one_load_of_each_angle(
    count: int, swing: float, noise: float
) -> None:
    """Also over more than one turn, where a load of gravity comes round."""
    runs = [moving(number, swing) for number in range(count)]
    draw = np.random.default_rng(3)
    for run in runs:
        load = np.sin(run[ANGLE] + 0.4)
        run["load"] = 7.0 * (load + noise * np.std(load) * draw.normal(size=ROWS))
    (found,) = dependences(runs, {"load": "reference_torque"})
    assert (found.channel, found.of) == ("load", ANGLE)
    assert noise / 1.2 < found.left < 1.2 * noise + 0.02
    assert "reference_torque is nearly a function of output_position" in found.sentence
    assert "payload" in found.sentence


def test_payloads_tell_a_load_from_the_angle() -> None:
    runs = [moving(number) for number in range(4)]
    for run, payload in zip(runs, (0.0, 1.5, 3.0, 5.0), strict=True):
        run["load"] = (1.0 + payload) * np.sin(run[ANGLE] + 0.4)
    assert pairs(runs) == []


def test_one_sine_makes_the_acceleration_a_function_of_the_angle() -> None:
    runs = [moving(number) for number in range(2)]
    for run in runs:
        run[ANGLE] = np.sin(2.0 * run["time"])
        run["output_acceleration"] = -4.0 * run[ANGLE]
        run["output_velocity"] = 2.0 * np.cos(2.0 * run["time"])
    assert pairs(runs) == [("output_acceleration", ANGLE)]


def test_a_warm_up_follows_the_clock_and_two_that_differ_do_not() -> None:
    runs = [moving(number) for number in range(5)]
    for run in runs:
        run["temperature"] = 22.0 + 0.4 * run["time"] + 0.004 * run["time"] ** 2
    assert pairs(runs) == [("temperature", "time")]
    for number, run in enumerate(runs):
        run["temperature"] = 22.0 + 0.2 * (number - 2) * run["time"]
    assert pairs(runs) == []


def test_a_channel_that_does_not_change_or_is_not_finite_is_no_function() -> None:
    run = moving(1)
    run["load"] = np.full(ROWS, 3.0)
    assert pairs([run]) == []
    run["load"] = 2.0 * run[ANGLE]
    run["load"][::7] = np.nan
    assert pairs([run]) == [("load", ANGLE)]


def test_readings_are_swapped_where_each_effect_reads_one_of_the_two() -> None:
    run = moving(1)
    run["load"] = 2.0 * run[ANGLE]
    (found,) = dependences([run])
    velocity = "output_velocity"
    assert found.swapped((velocity, "load"), (ANGLE, velocity))
    assert found.swapped((ANGLE,), ("load",))
    assert not found.swapped((ANGLE,), (ANGLE, velocity))
    assert not found.swapped((ANGLE, "load"), (ANGLE,))
    assert not found.swapped(("temperature",), ("load",))


def test_a_run_of_a_few_thousand_rows_is_used_whole_and_a_longer_one_evenly() -> None:
    for rows in (100, ROWS, 2 * ROWS - 1):
        assert len(_thinned({"a": np.arange(float(rows))})["a"]) == rows
    long = _thinned({"a": np.arange(5.0 * ROWS)})["a"]
    assert len(long) == ROWS and set(np.diff(long)) == {5.0}
