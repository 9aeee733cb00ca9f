"""The causal differentiator, as Python runs it over a log."""

from __future__ import annotations

import numpy as np
import pytest

from flexspline.errors import InputError
from flexspline.logs import Log, differentiate_causal

RATE = 1000.0
BANDWIDTH = 20.0


def swinging(seconds: float = 8.0, hertz: float = 0.2) -> Log:
    t = np.arange(0.0, seconds, 1 / RATE)
    return Log.from_arrays(time=t, output_position=np.sin(2 * np.pi * hertz * t))


def test_a_slow_swing_comes_out_late_by_the_delay_that_the_history_states() -> None:
    log = differentiate_causal(swinging(), bandwidth=BANDWIDTH)
    delay = 1 / (2 * np.pi * BANDWIDTH)
    assert f"late by {1e3 * delay:.3g} and {2e3 * delay:.3g} ms" in log.history[-1]
    w = 2 * np.pi * 0.2
    settled = log["time"] > 1.0
    late = log["time"][settled]
    velocity = w * np.cos(w * (late - delay))
    acceleration = -(w**2) * np.sin(w * (late - 2 * delay))
    bound = 3 * (w * delay) ** 2  # the delay is first order in w·delay, the rest second
    assert np.abs(log["output_velocity"][settled] - velocity).max() < bound * w
    assert np.abs(log["output_acceleration"][settled] - acceleration).max() < 3 * bound * w**2


def test_a_wrapped_angle_gives_the_same_velocity() -> None:
    log = swinging()
    turned = Log.from_arrays(time=log["time"], output_position=5.0 * log["time"])
    wrapped = Log.from_arrays(
        time=log["time"], output_position=np.mod(5.0 * log["time"], 2 * np.pi)
    )
    made = [
        differentiate_causal(x, bandwidth=BANDWIDTH)["output_velocity"] for x in (turned, wrapped)
    ]
    # a phase is rounded to 2⁻⁵² turns; over one step of 1 ms that is 1.4e-12 rad/s
    np.testing.assert_allclose(made[0], made[1], rtol=0, atol=1e-10)


def test_each_run_behind_a_gap_starts_at_rest() -> None:
    t = np.concatenate([np.arange(0.0, 1.0, 1 / RATE), np.arange(3.0, 4.0, 1 / RATE)])
    log = differentiate_causal(
        Log.from_arrays(time=t, output_position=2.0 * t), bandwidth=BANDWIDTH
    )
    assert log["output_velocity"][999] == pytest.approx(2.0, rel=1e-6)
    assert log["output_velocity"][1000] == 0.0


def test_a_bandwidth_beyond_a_quarter_of_the_rate_is_refused() -> None:
    with pytest.raises(InputError, match="400 Hz does not suit a rate of 1000 Hz; choose one up"):
        differentiate_causal(swinging(), bandwidth=400.0)
