"""What vibrates at one frequency, or rings, is no effect of the joint, and no noise unsaid."""

from __future__ import annotations

import json

import numpy as np
import pytest
from driven_joint import driven, strokes, waves
from numpy.typing import NDArray
from scipy.signal import bilinear, lfilter
from test_discovery_between_runs import BASE, runs

import flexspline
from flexspline.discovery.result import BY_MODE
from flexspline.logs.log import Log
from flexspline.orders.vibrations import excited

Array = NDArray[np.float64]

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


def behind_a_mode(given: Array, rate: float, mode: float, damping: float) -> Array:
    """What a mode [Hz] adds to an input (N,) that goes through it."""
    turning = 2.0 * np.pi * mode
    both = bilinear([turning**2], [1.0, 2.0 * damping * turning, turning**2], rate)
    return np.asarray(lfilter(*both, given) - given)


def swinging(mode: float, damping: float, *, load: bool) -> list[Log]:
    """A drive, or a sensor beside a load; 0.2 Nm of noise; behind the joint an arm that rings."""
    logs = []
    for number, angle in enumerate((strokes(), waves(), waves()[::-1].copy(), strokes(20.0))):
        log = driven(angle, 0.0, inertia=0.6, bits=17, seed=number)
        time = np.arange(len(angle)) / 5000.0
        given = 0.6 * np.gradient(np.gradient(angle, time), time)
        if load:
            given = lfilter([0.02], [1.0, -0.98], np.sign(np.sin(1.4 * time + number)) * 4.0)
        torque = 80.0 * log["motor_torque"] + 0.3 * behind_a_mode(given, 5e3, mode, damping)[::20]
        noise = np.random.default_rng(number).normal(0.0, 0.05, len(log))
        channels = {
            "sensor_torque": torque + given[::20], "reference_torque": given[::20] + noise
        } if load else {"motor_torque": torque / 80.0}  # fmt: skip
        logs.append(log.with_columns(channels, note="an arm that rings"))
    return logs


@pytest.mark.parametrize(
    ("mode", "damping", "load"),
    [(14.0, 0.05, False), (5.0, 0.1, False), (9.0, 0.03, True)],
)
def test_what_rings_is_a_mode_and_no_noise(mode: float, damping: float, load: bool) -> None:
    logs = swinging(mode, damping, load=load)
    target, known = ("sensor_torque", "reference_torque") if load else ("motor_torque", None)
    made = flexspline.discover(BASE, logs, target=target, known_load=known)
    assert made.names == () and made.unexplained is not None
    assert made.unexplained.rings == pytest.approx(mode, abs=0.3)
    assert made.unexplained.depends_on == (known or "output_acceleration",)
    assert made.floor.by == BY_MODE and 0.19 < made.noise_floor < 0.75 * made.final_rmse
    told = " ".join(str(made).split())
    assert f"lacks a mode at {made.unexplained.rings:.3g} Hz: RMSE" in told
    assert "Nothing" not in told.split(" Rows ")[0]
    assert json.loads(made.to_json())["unexplained"]["rings"] == made.unexplained.rings


def test_a_comparison_says_what_rings() -> None:
    logs = swinging(9.0, 0.02, load=False)
    model = flexspline.fit(BASE, logs, "motor_torque").model
    told = [note for note in flexspline.compare(model, logs).notes if " rings at 9 Hz " in note]
    assert len(told) == 1 and "output_acceleration" in told[0]
    still = [driven(waves(), 0.0, inertia=0.6, seed=seed) for seed in range(2)]
    assert not any("rings" in note for note in flexspline.compare(model, still).notes)


def test_what_is_missing_is_named_beside_a_mode() -> None:
    base = [name for name in BASE if name != "viscous_friction"]
    made = flexspline.discover(base, swinging(9.0, 0.02, load=False), target="motor_torque")
    assert made.names == ("viscous_friction",)
    assert made.unexplained is not None and made.unexplained.rings == pytest.approx(9.0, abs=0.3)


@pytest.mark.parametrize("cause", ["noise", "gain", "low pass", "delay"])
def test_what_follows_an_input_without_a_peak_is_no_mode(cause: str) -> None:
    generator = np.random.default_rng(3)
    given = lfilter([0.05], [1.0, -0.95], generator.normal(size=30_000))
    noise = 0.01 * generator.normal(size=30_000)
    behind = {
        "noise": 0.0 * given,
        "gain": 0.3 * given,
        "low pass": lfilter([0.1], [1.0, -0.9], given) - given,
        "delay": np.roll(given, 2) - given,
    }
    time = np.arange(30_000) / 250.0
    mode = excited([(time, given, behind[cause] + noise)], 60.0)
    assert mode is None or mode.share < 0.02
    ringing = behind_a_mode(given, 250.0, 9.0, 0.05) + noise
    mode = excited([(time, given, ringing)], 60.0)
    assert mode is not None and mode.frequency == pytest.approx(9.0, abs=0.3) and mode.share > 0.7


def test_pieces_that_are_shorter_than_a_segment_tell_no_mode() -> None:
    time = np.arange(0.0, 3.9, 0.004)
    assert excited([(time, np.sin(time), np.cos(time))], 60.0) is None
    assert excited([], 60.0) is None
