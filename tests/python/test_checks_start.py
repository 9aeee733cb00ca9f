"""A start that differs from a steady run is a fault where speed, angle and load are the same."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from flexspline.logs import Log
from flexspline.logs.checks import check

Array = NDArray[np.float64]

RATE, LEVEL = 200.0, 0.03
TIME = np.arange(6000) / RATE
RAMP = 0.5
"""s, from rest to the steady speed."""


def stroke(rest: float, speed: float = LEVEL) -> dict[str, Array]:
    """A stroke at one speed from -0.5 rad on, behind a rest of so many seconds and a ramp."""
    rng = np.random.default_rng(3)
    velocity = speed * np.clip((TIME - rest) / RAMP, 0.0, 1.0)
    noise = 0.001 * rng.standard_normal((2, len(TIME)))
    angle = np.cumsum(velocity) / RATE - 0.5
    friction = 0.05 * np.minimum(velocity / (0.1 * speed), 1.0)
    return {
        "time": TIME,
        "output_position": angle,
        "output_velocity": velocity + noise[0],
        "motor_torque": friction + noise[1],
    }


def starts(columns: dict[str, Array]) -> list[str]:
    found = check(Log.from_arrays(facts={"gear_ratio": 100}, **columns))
    return [finding.channel for finding in found.named("start_transient")]


@pytest.mark.parametrize("rest", [0.0, 0.4, 2.0])
def test_a_stroke_that_starts_from_rest_has_no_fault(rest: float) -> None:
    assert starts(stroke(rest)) == []


def test_a_velocity_alone_shows_a_start_from_rest_where_it_begins_with_one() -> None:
    columns = stroke(1.0)
    alone = {name: columns[name] for name in ("time", "output_velocity")}
    assert starts(alone) == []
    assert starts({name: values[200:] for name, values in alone.items()}) == ["output_velocity"]


def test_a_velocity_that_settles_beyond_its_level_is_one() -> None:
    columns = stroke(0.4)
    ringing = 0.5 * LEVEL * np.exp(-((TIME - 1.3) ** 2) / 0.05)
    columns["output_velocity"] = columns["output_velocity"] + ringing
    columns["output_position"] = columns["output_position"] + np.cumsum(ringing) / RATE
    assert "output_velocity" in starts(columns)


@pytest.mark.parametrize("left_out", [(), ("reference_torque",), ("output_position",)])
def test_gravity_over_a_stroke_is_no_fault_of_its_start(left_out: tuple[str, ...]) -> None:
    """The angle explains it, or a load that is known."""
    columns = stroke(0.4)
    load = 60.0 * np.sin(columns["output_position"])
    columns |= {"reference_torque": load}
    columns["motor_torque"] = columns["motor_torque"] + load / 100.0
    assert starts({name: v for name, v in columns.items() if name not in left_out}) == []


def test_a_load_that_is_taken_away_is_no_fault() -> None:
    columns = stroke(0.0)
    load = np.where(TIME < 3.0, 20.0, 0.0)
    columns["motor_torque"] = columns["motor_torque"] + load / 100.0
    assert "motor_torque" in starts(columns)
    assert starts(columns | {"reference_torque": load}) == []


@pytest.mark.parametrize("gravity", [0.0, 0.3])
def test_lubricant_that_disperses_is_a_fault_with_its_length(gravity: float) -> None:
    """0.03 exp(-t / 1 s) sinks below 2.5 times the noise of 0.001 after 2.5 s."""
    columns = stroke(0.0, speed=1.0)
    columns["motor_torque"] = (
        columns["motor_torque"]
        + 0.03 * np.exp(-TIME)
        + gravity * np.sin(columns["output_position"])
    )
    found = check(Log.from_arrays(facts={"gear_ratio": 100}, **columns))
    (finding,) = found.named("start_transient")
    assert finding.channel == "motor_torque" and 1.5 <= finding.size <= 3.0
    assert "at the same speed, angle and load" in finding.sentence
