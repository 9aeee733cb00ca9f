"""A load cell with its own clock is put on the time of the joint."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from flexspline.errors import InputError
from flexspline.logs import Log, merge

OFFSET, DRIFT = -3.2, 40.0
ALIGN = ("sensor_torque", "reference_torque")


def torque(time: NDArray[np.float64], seed: int) -> NDArray[np.float64]:
    """Twelve sines between 0.1 and 3 Hz: a torque that does not repeat itself."""
    random = np.random.default_rng(seed)
    orders, phases = random.uniform(0.1, 3, 12), random.uniform(0, 2 * np.pi, 12)
    waves = [np.sin(2 * np.pi * f * time + p) for f, p in zip(orders, phases, strict=True)]
    return np.sum(waves, axis=0)  # type: ignore[no-any-return]


def joint(seed: int, noise: float = 0.3) -> Log:
    time = 100 + np.arange(60_000) / 1000
    spoilt = noise * np.random.default_rng(seed + 100).normal(size=len(time))
    return Log.from_arrays(time=time, sensor_torque=3 * torque(time, seed) + 1 + spoilt)


def load_cell(seed: int, noise: float = 0.3, offset: float = OFFSET, sign: int = 1) -> Log:
    """160 Hz, from 5 s after the joint's first row to 55 s after it, by a clock of its own."""
    true = 105 + np.arange(0, 50, 1 / 160)
    stamps = true + offset + 1e-6 * DRIFT * (true - 100)
    spoilt = noise * np.random.default_rng(seed + 200).normal(size=len(true))
    return Log.from_arrays(time=stamps, reference_torque=sign * 3 * torque(true, seed) - 2 + spoilt)


@pytest.mark.parametrize("seed", range(6))
def test_offset_and_drift_are_found_within_their_errors(seed: int) -> None:
    _, clock = merge(joint(seed), load_cell(seed), align=ALIGN)
    # Noise of 0.3 Nm at 160 Hz against a slope of RMS about 3·√6·2π·1.6 Nm/s over 8000 samples
    # allows 0.3 / (74 · √8000) = 0.05 ms at best; twelve sines known in 16 windows, 0.5 ms.
    assert clock.offset_error < 5e-4
    assert clock.drift_error < 5e-4 / 25 * 1e6  # lever arm of the drift: half of 50 s
    # Student's t of 14 degrees of freedom exceeds 4.1 once in 1000
    assert abs(clock.offset - OFFSET) < 4.1 * clock.offset_error
    assert abs(clock.drift - DRIFT) < 4.1 * clock.drift_error


def test_without_noise_the_clock_is_found_to_the_interpolation_error() -> None:
    merged, clock = merge(joint(1, 0), load_cell(1, 0), align=ALIGN)
    # the sensor's sampling by 160 Hz, interpolated, is good to a fiftieth of its 6 ms, and the
    # lever arm is 25 s
    assert clock.offset == pytest.approx(OFFSET, abs=1e-4)
    assert clock.drift == pytest.approx(DRIFT, abs=4)
    # h²/8 · max|τ''| = (1/160)²/8 · 3·12·(2π·3)²: 62 mNm, and the clock's 0.1 ms · 280 Nm/s
    expected = merged["sensor_torque"] - 3
    np.testing.assert_allclose(merged["reference_torque"], expected, atol=0.062 + 0.028)


def test_offsets_as_long_as_the_run_itself_are_found() -> None:
    _, clock = merge(joint(2), load_cell(2, offset=1e5), align=ALIGN)
    assert abs(clock.offset - 1e5) < 4.1 * clock.offset_error


def test_a_given_clock_is_kept_and_rows_without_a_value_are_dropped_and_counted() -> None:
    merged, clock = merge(joint(3), load_cell(3), offset=OFFSET, drift=DRIFT)
    assert (clock.offset, clock.drift, clock.offset_error) == (OFFSET, DRIFT, 0)
    assert len(merged) in (49_993, 49_994)  # 50 s less one step of the load cell
    assert f"dropped: {60_000 - len(merged)}" in merged.history[-1]
    assert "offset -3.2 (given) s, drift 40 (given) ppm" in merged.history[-1]


def test_a_given_offset_is_kept_while_the_drift_is_found() -> None:
    _, clock = merge(joint(4), load_cell(4), offset=OFFSET, align=ALIGN)
    assert clock.offset == OFFSET and clock.offset_error == 0
    assert abs(clock.drift - DRIFT) < 4.1 * clock.drift_error


def test_a_gap_of_the_load_cell_stays_a_gap() -> None:
    cell = load_cell(5)
    cell = cell.rows((cell["time"] < 120) | (cell["time"] > 125))
    merged, _ = merge(joint(5), cell, offset=OFFSET, drift=DRIFT)
    assert np.max(np.diff(merged["time"])) == pytest.approx(5, abs=2 / 160)


def test_channels_that_see_different_things_are_refused() -> None:
    with pytest.raises(InputError, match=r"'sensor_torque' of log 'log' .* hardly correlate"):
        merge(joint(6), load_cell(7), align=ALIGN)


@pytest.mark.parametrize("seed", range(20))
def test_slow_channels_that_only_look_alike_are_refused(seed: int) -> None:
    random = np.random.default_rng(seed)
    time = np.arange(6000) / 100
    walks = np.cumsum(random.normal(size=(2, 6000)), axis=1)
    log = Log.from_arrays(time=time, sensor_torque=walks[0])
    other = Log.from_arrays(time=time + 3, reference_torque=walks[1])
    with pytest.raises(InputError, match=r"hardly|opposite signs|match as well"):
        merge(log, other, align=ALIGN)


def test_opposite_signs_are_named() -> None:
    with pytest.raises(InputError, match=r"opposite signs .*flip_sign"):
        merge(joint(6), load_cell(6, sign=-1), align=ALIGN)


def test_a_motion_that_repeats_itself_needs_the_offset() -> None:
    time = np.arange(6000) / 100
    log = Log.from_arrays(time=time, sensor_torque=np.sin(2 * np.pi * time / 4))
    other = Log.from_arrays(time=time + 1, reference_torque=np.sin(2 * np.pi * time / 4))
    with pytest.raises(InputError, match=r"match as well 4 s apart.*give the offset"):
        merge(log, other, align=ALIGN)


@pytest.mark.parametrize(
    ("how", "sentence"),
    [
        ({}, "give offset, or align"),
        ({"offset": 1e6}, "do not overlap"),
        ({"offset": 1e6, "align": ALIGN}, "overlap by 0 rows only"),
        ({"offset": 0, "channels": ["duty"]}, "no channel 'duty'"),
        ({"offset": 0, "align": ("duty", "reference_torque")}, "no channel 'duty'"),
    ],
)
def test_an_impossible_merge_is_refused(how: dict[str, object], sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        merge(joint(0), load_cell(0), **how)  # type: ignore[arg-type]


def test_a_channel_that_is_there_already_is_not_overwritten() -> None:
    log = joint(0)
    with pytest.raises(InputError, match="has 'sensor_torque' already"):
        merge(log, log, channels=["sensor_torque"], offset=0)
    with pytest.raises(InputError, match="has no channel that"):
        merge(log, log, offset=0)


def test_a_constant_channel_gives_no_clock() -> None:
    log = joint(0)
    still = log.with_columns({"sensor_torque": np.ones(len(log))}, note="still")
    with pytest.raises(InputError, match="constant or too short"):
        merge(still, load_cell(0), align=ALIGN)
