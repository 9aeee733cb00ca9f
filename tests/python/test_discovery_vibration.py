"""What vibrates at one frequency is no effect of the joint, and no noise without a word."""

from __future__ import annotations

import json

import numpy as np
import pytest
from test_discovery_between_runs import BASE, runs

import flexspline
from flexspline.logs.log import Log

FREQUENCY, SIZE = 17.3, 0.2  # Hz, Nm


def humming(log: Log, number: int) -> Log:
    line = SIZE * np.sin(2.0 * np.pi * FREQUENCY * log["time"] + 2.0 * number)
    return log.with_columns({"sensor_torque": log["sensor_torque"] + line}, note="a fan")


def test_a_vibration_that_no_speed_moves_is_said() -> None:
    logs = [humming(log, k) for k, log in enumerate(runs([3.0] * 4, [0.2] * 4))]
    made = flexspline.discover(BASE, logs, target="sensor_torque")
    (vibration,) = made.vibrations
    assert vibration.frequency == pytest.approx(FREQUENCY, abs=0.1)
    assert vibration.amplitude == pytest.approx(SIZE, rel=0.1)
    assert made.names == () and made.unexplained is None
    told = " ".join(str(made).split())
    assert "What is left vibrates, whatever the speed: 0." in told and "Nm at 17.3" in told
    (kept,) = json.loads(made.to_json())["vibrations"]
    assert kept["frequency"] == vibration.frequency
