"""Derived channels: gain and phase on sines, exactness on polynomials, gaps, edges, rates."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from flexspline.errors import InputError
from flexspline.logs import Log
from flexspline.logs.derive import (
    decimate,
    default_bandwidth,
    differentiate,
    lowpass,
    lowpass_log,
    resample,
)
from flexspline.logs.local_fit import LocalFit
from flexspline.logs.quantisation import quantum, white_noise

Array = NDArray[np.float64]

PASSED = {0.25: 0.9978, 0.5: 0.9696, 1.0: 0.7071, 2.0: 0.0712}
"""Gain (1 + s) exp(-s) by frequency over bandwidth."""


def uneven_time(rows: int) -> Array:
    """Steps of 10 or 12 ms, as a UR10e has them."""
    return np.cumsum(np.random.default_rng(1).choice([0.01, 0.012], rows, p=[0.66, 0.34]))


def gain_and_phase(time: Array, out: Array, frequency: float, order: int) -> complex:
    """Complex gain against the true derivative of sin(2πft), from the middle of the run."""
    w = 2 * np.pi * frequency
    middle = slice(len(time) // 4, 3 * len(time) // 4)
    waves = np.exp(1j * w * time[middle])
    fit = np.linalg.lstsq(np.column_stack((waves.real, waves.imag)), out[middle], rcond=None)[0]
    return complex(fit[0] - 1j * fit[1]) / (-1j * (1j * w) ** order)


@pytest.mark.parametrize("time", [np.arange(6000) / 1000, uneven_time(6000)], ids=["even", "not"])
@pytest.mark.parametrize("order", [0, 1, 2])
@pytest.mark.parametrize("share", PASSED)
def test_gain_is_the_stated_one_and_there_is_no_phase(
    time: Array, order: int, share: float
) -> None:
    bandwidth = 0.1 / float(np.median(np.diff(time)))
    frequency = share * bandwidth
    out = LocalFit(bandwidth, order).apply(time, np.sin(2 * np.pi * frequency * time))
    gain = gain_and_phase(time, out, frequency, order)
    # The cut of the window at 4.5 σ and the discrete sums change the gain by 2 % at most.
    assert abs(gain) == pytest.approx(PASSED[share], rel=0.02, abs=0.005)
    assert abs(gain.imag) < 1e-3


@pytest.mark.parametrize("time", [np.arange(2000) / 1000, uneven_time(2000)], ids=["even", "not"])
def test_constant_acceleration_comes_out_exact_up_to_the_edges(time: Array) -> None:
    log = Log.from_arrays(time=time, output_position=1 + 2 * time - 0.5 * time**2)
    log = differentiate(log, bandwidth=8.0)
    assert np.abs(log["output_velocity"] - (2 - time)).max() < 1e-8
    assert np.abs(log["output_acceleration"] + 1).max() < 1e-6


def test_wide_windows_on_uneven_steps_agree_with_narrow_work() -> None:
    time = uneven_time(6000)
    wave = np.sin(2 * np.pi * 0.2 * time)
    wide = LocalFit(1.0, 1).apply(time, wave)
    inside = slice(300, -300)
    true = 2 * np.pi * 0.2 * np.cos(2 * np.pi * 0.2 * time)
    s = 1.07796 * 0.2**2
    assert np.abs(wide - (1 + s) * np.exp(-s) * true)[inside].max() < 2e-4 * np.abs(true).max()


def test_no_filter_reaches_over_a_gap() -> None:
    time = np.concatenate((np.arange(1000), np.arange(1500, 2500))) / 1000
    position = np.where(time < 1.2, 0.0, 5.0)
    log = differentiate(Log.from_arrays(time=time, output_position=position), bandwidth=20.0)
    assert np.abs(log["output_velocity"]).max() < 1e-9
    assert "2 runs" in log.history[-1]


def test_runs_too_short_for_a_derivative_are_nan_and_counted() -> None:
    time = np.concatenate((np.arange(100), [200.0], np.arange(300, 400))) / 1000
    log = differentiate(Log.from_arrays(time=time, output_position=time), bandwidth=20.0)
    assert np.flatnonzero(np.isnan(log["output_velocity"])).tolist() == [100]
    assert "1 row NaN" in log.history[-1]


def test_the_history_states_bandwidth_and_edges() -> None:
    time = np.arange(1000) / 1000
    log = differentiate(Log.from_arrays(time=time, output_position=time), bandwidth=20.0)
    assert "-3 dB at 20 Hz" in log.history[-1]
    assert "0.0526 s" in log.history[-1]


def test_the_default_bandwidth_falls_with_the_quantum() -> None:
    time = np.arange(20_000) / 1000
    position = np.sin(time)
    fine = default_bandwidth(time, position)
    coarse = default_bandwidth(time, np.round(position / 0.001) * 0.001)
    assert fine == pytest.approx(100.0)
    assert coarse < 0.5 * fine


def test_a_bandwidth_above_a_quarter_of_the_rate_is_refused() -> None:
    time = np.arange(100) / 100
    log = Log.from_arrays(time=time, output_position=time)
    with pytest.raises(InputError, match="up to 25 Hz"):
        differentiate(log, bandwidth=30.0)


@pytest.mark.parametrize(
    ("channel", "remedy"), [("time", "sort_time"), ("output_position", "drop_invalid")]
)
def test_what_a_filter_would_spread_is_refused_with_its_row(channel: str, remedy: str) -> None:
    columns = {"time": np.arange(100) / 100, "output_position": np.zeros(100)}
    columns[channel][50] = columns["time"][49] if channel == "time" else np.nan
    with pytest.raises(InputError, match=f"row 50.*{remedy}"):
        differentiate(Log.from_arrays(**columns), bandwidth=5.0)


def test_one_low_pass_is_the_same_operator_on_target_and_rows() -> None:
    rng = np.random.default_rng(2)
    time = np.arange(3000) / 1000
    rows, coefficients = rng.standard_normal((3000, 4)), np.array([1.0, -2.0, 0.5, 3.0])
    filtered = lowpass(rows, time, 5.0)
    target = lowpass(rows @ coefficients, time, 5.0)
    assert np.abs(filtered.values @ coefficients - target.values).max() < 1e-12
    assert filtered.half_length == pytest.approx(1.0516 / 5.0, rel=1e-3)
    assert np.flatnonzero(target.valid)[[0, -1]].tolist() == [211, 2788]


def test_a_level_passes_the_low_pass_unchanged() -> None:
    time = np.arange(1000) / 1000
    assert np.abs(lowpass(np.full(1000, 7.0), time, 5.0).values - 7.0).max() < 1e-12


def test_the_low_pass_refuses_nan() -> None:
    with pytest.raises(InputError, match="row 3"):
        lowpass(np.array([0, 0, 0, np.nan] + [0.0] * 96), np.arange(100) / 100, 5.0)


def test_lowpass_log_leaves_time_and_commands_alone() -> None:
    time = np.arange(1000) / 1000
    log = Log.from_arrays(time=time, sensor_torque=np.sin(600 * time), enabled=time > 0.5)
    smooth = lowpass_log(log, 5.0)
    assert np.array_equal(smooth["enabled"], log["enabled"])
    assert np.abs(smooth["sensor_torque"][300:700]).max() < 1e-3
    assert "sensor_torque low-passed" in smooth.history[-1]


def test_resampling_keeps_slow_motion_and_leaves_gaps_open() -> None:
    time = np.concatenate((np.arange(0, 3000), np.arange(5000, 8000))) / 1000
    log = Log.from_arrays(time=time, output_position=np.sin(time))
    slow = resample(log, 100.0)
    inside = (np.abs(slow["time"] - 1.5) < 1.2) | (np.abs(slow["time"] - 6.5) < 1.2)
    assert np.abs(slow["output_position"] - np.sin(slow["time"]))[inside].max() < 1e-4
    assert not np.any((slow["time"] > 3.0) & (slow["time"] < 5.0))
    assert "1 gap kept" in slow.history[-1]


@pytest.mark.parametrize("make", [lambda log: resample(log, 100.0), lambda log: decimate(log, 10)])
def test_a_slower_rate_does_not_alias(make: object) -> None:
    time = np.arange(10_000) / 1000
    log = Log.from_arrays(time=time, sensor_torque=np.sin(2 * np.pi * 95 * time))
    slow = make(log)  # type: ignore[operator]
    assert slow.rate == pytest.approx(100.0)
    assert np.abs(slow["sensor_torque"][20:-20]).max() < 0.01


def test_decimation_keeps_rows_of_the_log() -> None:
    log = Log.from_arrays(time=np.arange(1000) / 1000, output_position=np.arange(1000) / 1000)
    assert np.array_equal(decimate(log, 5)["time"], log["time"][::5])


def test_the_quantum_is_found_and_constant_speed_is_none() -> None:
    rng = np.random.default_rng(3)
    time = np.arange(20_000) / 1000
    triangle = np.abs((0.37 * time + 0.003 * rng.standard_normal()) % 2 - 1)
    assert quantum(np.round(np.sin(time) / 0.00153) * 0.00153) == pytest.approx(0.00153)
    assert quantum(triangle + 1e-6 * rng.standard_normal(20_000)) == 0.0


@pytest.mark.parametrize("bits", [17, 19, 22])
@pytest.mark.parametrize("stroke", [None, 1.0, 7.3])
def test_the_quantum_of_a_motion_at_one_speed_is_the_encoders_and_not_its_travel(
    bits: int, stroke: float | None
) -> None:
    time, step = np.arange(8_000) / 200, 2 * np.pi / 2**bits
    motion = 0.5 * (time if stroke is None else np.abs((time + stroke) % (2 * stroke) - stroke))
    assert quantum(step * np.round(motion / step)) == pytest.approx(step, rel=1e-3)
    assert quantum(motion) == 0.0
    assert quantum(motion + 1e-5 * np.random.default_rng(5).standard_normal(8_000)) == 0.0


@pytest.mark.parametrize("counts", [0.1, 1 / 3, 0.6, 0.97, 1.03])
def test_a_coarse_encoder_at_one_speed_shows_its_quantum(counts: float) -> None:
    """From 0.02 counts beside whole ones on; printed with 6 digits behind the point as well."""
    step = 2 * np.pi / 4096
    angle = step * np.round(counts * np.arange(8_000.0))
    assert quantum(angle) == pytest.approx(step)
    assert quantum(np.round(angle, 6)) == pytest.approx(step, rel=1e-3)


def test_channels_that_hold_their_level_show_their_quantum() -> None:
    time = np.arange(20_000) / 1000
    assert quantum(np.round(25.0 + time / 10.0, 1)) == pytest.approx(0.1)
    assert quantum(5.0 * np.floor(time / 2.0)) == pytest.approx(5.0)


def test_white_noise_is_told_from_motion() -> None:
    rng = np.random.default_rng(4)
    time = np.arange(50_000) / 1000
    noisy = np.sin(time) + 0.003 * rng.standard_normal(50_000)
    # The median of 50 000 values with a memory of five has an error of about 1 %.
    assert white_noise(noisy) == pytest.approx(0.003, rel=0.04)
