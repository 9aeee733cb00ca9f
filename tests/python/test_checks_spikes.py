"""Single rows that leap out of a channel are found, told and dropped; nothing else is one.

What is no spike: noise of any colour, steps, corners, stick-slip, coarse numbers, ripple near half
the rate, impacts that the recorder sees, a channel that is switched.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from checks_logs import sound_log
from scipy.signal import lfilter

from flexspline import FitOptions
from flexspline.logs import Log
from flexspline.logs.checks import check
from flexspline.logs.repairs import repaired
from flexspline.logs.spikes import ALONE, SPIKED, TOLD, spikes

Array = np.ndarray
RATE = 1000.0
ROWS = 200_000
TIME = np.arange(ROWS) / RATE
SPEED = np.cos(2 * np.pi * 0.3 * TIME)
ANGLE = np.sin(2 * np.pi * 0.3 * TIME)
NEAR_HALF = np.sin(2 * np.pi * 449.7 * TIME)


def impacts(rng: np.random.Generator, rows: float) -> Array:
    """Impacts that die away with a time constant of so many rows, and little noise."""
    hit = np.zeros(ROWS)
    hit[rng.integers(100, ROWS - 100, 60)] = 5.0
    return lfilter([1.0], [1.0, -np.exp(-1.0 / rows)], hit) + 0.001 * rng.standard_normal(ROWS)


SOUND: dict[str, Callable[[np.random.Generator], Array]] = {
    "white noise": lambda rng: rng.standard_normal(ROWS),
    "noise of Laplace": lambda rng: rng.laplace(size=ROWS),
    "even noise": lambda rng: rng.random(ROWS),
    "slow noise": lambda rng: lfilter([1.0], [1.0, -0.95], rng.standard_normal(ROWS)),
    "fast noise": lambda rng: lfilter([1.0], [1.0, 0.9], rng.standard_normal(ROWS)),
    "noise that grows with speed": lambda rng: SPEED**4 * rng.standard_normal(ROWS),
    "reversals": lambda _: np.sign(SPEED),
    "noisy reversals": lambda rng: np.sign(SPEED) + 0.01 * rng.standard_normal(ROWS),
    "reversals within a row": lambda _: np.tanh(SPEED / 0.001),
    "a square wave": lambda _: np.sign(np.sin(2 * np.pi * 37.3 * TIME)),
    "stick-slip": lambda rng: TIME * 7.0 % 1.0 + 0.001 * rng.standard_normal(ROWS),
    "coarse numbers": lambda _: np.round(3.0 * ANGLE),
    "coarse noisy numbers": lambda rng: np.round(3.0 * ANGLE + 0.3 * rng.standard_normal(ROWS)),
    "a last bit that flickers": lambda rng: (
        np.round(rng.standard_normal(ROWS) / 3.0) * (rng.random(ROWS) < 0.01)
    ),
    "ripple near half the rate": lambda _: NEAR_HALF * np.exp(-((TIME % 1.0 - 0.5) ** 2) / 0.001),
    "bursts of such ripple": lambda rng: (
        NEAR_HALF * (TIME % 1.0 < 0.02) + 0.001 * rng.standard_normal(ROWS)
    ),
    "values held for two rows": lambda rng: np.repeat(rng.standard_normal(ROWS // 2), 2),
    "a switched channel": lambda rng: (
        np.cumsum(rng.random(ROWS) < 0.01) % 2 + 0.001 * rng.standard_normal(ROWS)
    ),
    "impacts of half a row": lambda rng: impacts(rng, 0.5),
    "impacts of two rows": lambda rng: impacts(rng, 2.0),
    "nothing": lambda _: np.zeros(ROWS),
}


@pytest.mark.parametrize("sound", SOUND)
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_no_row_of_a_sound_channel_stands_alone(sound: str, seed: int) -> None:
    """0 of 600 000 rows each."""
    values = SOUND[sound](np.random.default_rng(seed))
    assert spikes(TIME, values).size == 0
    assert spikes(TIME, np.round(values, 3)).size == 0


def test_heavy_tails_make_rows_stand_alone_as_rarely_as_stated() -> None:
    rng = np.random.default_rng(4)
    count = sum(spikes(TIME, rng.standard_t(4, ROWS)).size for _ in range(20))
    assert count <= 4 * 2 * 4  # 2 in a million rows are stated, and Poisson's scatter


@pytest.mark.parametrize("seed", range(0, 50, 5))
def test_a_spike_in_any_channel_of_a_sound_log_is_found_and_dropped(seed: int) -> None:
    log = sound_log(seed).rows(slice(0, 6000))
    assert not check(log).named("spikes")
    rng = np.random.default_rng(seed)
    for channel in (name for name in SPIKED if name in log):
        values = log[channel].copy()
        far = 2.0 * ALONE * np.max(np.abs(np.diff(values)))
        rows = np.sort(rng.choice(np.arange(20, len(log) - 20, 40), 5, replace=False))
        rows = np.concatenate([rows, rows[:1] + 1])  # two rows on end, and four single ones
        values[rows] += far * rng.choice([-1.0, 1.0])
        spoilt = log.with_columns({channel: values}, note="spoilt")
        (finding,) = check(spoilt).named("spikes")
        assert (finding.channel, finding.size) == (channel, 6)
        assert finding.rows == (min(rows), max(rows) + 1) and f"row {min(rows)}" in finding.sentence
        asked = f"drop_spikes={channel}"
        assert asked in finding.remedy and "--robust" in finding.remedy
        assert 'FitOptions(robust="huber")' in finding.remedy
        assert FitOptions(robust="huber").robust == "huber"
        left = repaired(spoilt, asked)
        assert np.array_equal(left["time"], np.delete(log["time"], rows))
        assert np.array_equal(repaired(spoilt, "drop_spikes")["time"], left["time"])
        assert not check(left).named("spikes")


def test_what_lasts_three_rows_is_seen_by_the_recorder_and_is_no_spike() -> None:
    noise = np.random.default_rng(5).standard_normal(ROWS)
    for count, found in ((1, 1), (2, 2), (3, 0)):
        values = noise.copy()
        values[1_000 : 1_000 + count] = 10.0 * ALONE
        assert spikes(TIME, values).size == found


def test_a_spike_below_the_noise_is_none() -> None:
    noise = np.random.default_rng(6).standard_normal(ROWS)
    noise[1_000] = 0.5 * TOLD
    assert spikes(TIME, noise).size == 0


def test_a_thermometer_that_starts_anew_is_a_spike() -> None:
    """It reads 85 °C, as some do, which a joint can have; of four levels there is no lattice."""
    values = np.round(25.0 + 0.1 * ANGLE, 1)
    values[[5_000, 90_000]] = 85.0
    assert list(spikes(TIME, values)) == [5_000, 90_000]


def test_empty_rows_and_gaps_make_no_spike() -> None:
    values = np.random.default_rng(7).standard_normal(ROWS)
    values[500:600] = np.nan
    values[700] = 1e4
    assert list(spikes(TIME, values)) == [700]
    time = TIME + 10.0 * (np.arange(ROWS) >= 695)
    assert spikes(time, values).size == 0
    assert spikes(TIME[:20], values[:20]).size == 0


def test_a_log_of_a_few_rows_and_one_of_nan_are_checked() -> None:
    for values in (np.full(100, np.nan), np.arange(3.0)):
        time = np.arange(len(values)) / RATE
        assert not check(Log({"time": time, "motor_torque": values})).named("spikes")
