"""Quantum, noise floor and bandwidth of a channel, and the smoother that they ask for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from driven_joint import driven, strokes
from fit_logs import motion
from numpy.typing import NDArray

from flexspline.logs.channel_noise import HIGHEST, PASSED, ChannelNoise, channel_noise
from flexspline.logs.local_fit import LocalFit, response
from flexspline.logs.log import Log

Array = NDArray[np.float64]

RATE, SAMPLES = 200.0, 12_000  # 60 s
CORNER, STEEP = 4.0, 16  # Hz; the signal's spectrum is S0 / (1 + (f / CORNER)^STEEP)
POSITION = "output_position"
STEP = 1.25  # within which a bandwidth is known: densities are medians over frequencies / × 1.25
FREQUENCIES = np.fft.rfftfreq(SAMPLES, 1.0 / RATE)
DENSITY = 1.0 / (1.0 + (FREQUENCIES / CORNER) ** STEEP)


def signal(seed: int, derivative: int = 0) -> tuple[Array, Array]:
    """Time (N,), and a periodic random signal of RMS 1 (or its derivative) of that spectrum."""
    generator = np.random.default_rng([seed, 5])
    lines = np.sqrt(DENSITY) * (generator.normal(size=(len(DENSITY), 2)) @ [1.0, 1.0j])
    lines[0] = 0.0
    scale = np.std(np.fft.irfft(lines, SAMPLES))
    made = np.fft.irfft(lines * (2j * np.pi * FREQUENCIES) ** derivative, SAMPLES)
    return np.arange(SAMPLES) / RATE, made / scale


def crossing(noise: float) -> float:
    """Hz at which the signal's density equals that of white noise of this RMS."""
    signal_level = 1.0 / (DENSITY.sum() * FREQUENCIES[1])
    return float(CORNER * (signal_level / (2.0 * noise**2 / RATE) - 1.0) ** (1.0 / STEEP))


def log_of(time: Array, values: Array) -> Log:
    return Log.from_arrays(time=time, output_position=values)


def noise_of(*logs: Log) -> ChannelNoise:
    made = channel_noise(logs, POSITION)
    assert made is not None
    return made


def white(seed: int, size: float, samples: int = SAMPLES) -> Array:
    return np.random.default_rng([seed, 6]).normal(0.0, size, samples)


@pytest.mark.parametrize("size", [1e-4, 1e-2, 3.0])
def test_white_noise_alone_is_a_floor_without_a_signal(size: float) -> None:
    made = noise_of(log_of(np.arange(SAMPLES) / RATE, white(1, size)))
    assert made.noise == pytest.approx(size, rel=0.05)
    assert made.bandwidth < 1.0 and made.noisy
    assert made.quantum == 0.0 and made.rate == pytest.approx(RATE)


@pytest.mark.parametrize("size", [1e-4, 1e-3, 1e-2])
def test_floor_and_bandwidth_of_a_signal_in_white_noise(size: float) -> None:
    time, values = signal(2)
    made = noise_of(log_of(time, values + white(2, size)))
    assert made.noise == pytest.approx(size, rel=0.05)
    assert crossing(size) / STEP < made.bandwidth < crossing(size) * STEP
    assert made.spread == pytest.approx(1.0, rel=0.01) and made.noisy


@pytest.mark.parametrize("bits", [8, 12])
def test_a_quantum_makes_the_noise_that_it_should(bits: int) -> None:
    step = 8.0 / 2**bits
    time, values = signal(3)
    made = noise_of(log_of(time, step * np.round(values / step)))
    assert made.quantum == pytest.approx(step, rel=1e-6)
    assert made.noise == pytest.approx(step / np.sqrt(12.0), rel=0.05)
    floor = step / np.sqrt(12.0)
    assert crossing(floor) / STEP < made.bandwidth < crossing(floor) * STEP


def test_time_that_jitters_and_gaps_change_neither_floor_nor_bandwidth() -> None:
    time, values = signal(4)
    noise = white(4, 1e-3)
    plain = noise_of(log_of(time, values + noise))
    jitter = np.random.default_rng(4).uniform(-0.1, 0.1, SAMPLES) / RATE
    moved = values + jitter * signal(4, 1)[1] + 0.5 * jitter**2 * signal(4, 2)[1]
    uneven = noise_of(log_of(time + jitter, moved + noise))
    kept = np.ones(SAMPLES, dtype=bool)
    for first, last in ((1000, 1500), (6000, 6003), (9000, 9700)):
        kept[first:last] = False
    broken = noise_of(log_of(time[kept], (values + noise)[kept]))
    for other in (uneven, broken):
        assert other.noise == pytest.approx(plain.noise, rel=0.1)
        assert plain.bandwidth / STEP < other.bandwidth < plain.bandwidth * STEP


def test_a_jump_behind_a_gap_is_no_noise() -> None:
    time, values = signal(5)
    late = time + np.where(np.arange(SAMPLES) < SAMPLES // 2, 0.0, 3.0)
    jumped = values + np.where(np.arange(SAMPLES) < SAMPLES // 2, 0.0, 50.0)
    made = noise_of(log_of(late, jumped + white(5, 1e-3)))
    assert made.noise == pytest.approx(1e-3, rel=0.05)


@pytest.mark.parametrize("digits", [None, 9])
def test_a_channel_without_noise_is_not_noisy(digits: int | None) -> None:
    channels = motion(6, 8000, RATE)
    values = channels[POSITION]
    made = noise_of(log_of(channels["time"], values if digits is None else values.round(digits)))
    assert not made.noisy
    assert noise_of(log_of(channels["time"], values + white(6, 1e-4, 8000))).noisy


def test_the_noise_of_several_runs_is_that_of_their_rows_together() -> None:
    logs = [log_of(signal(k)[0], signal(k)[1] + white(k, s)) for k, s in ((7, 1e-3), (8, 3e-3))]
    assert noise_of(*logs).noise == pytest.approx(np.sqrt(5.0) * 1e-3, rel=0.05)


def test_a_run_too_short_to_tell_says_nothing() -> None:
    assert channel_noise([log_of(np.arange(40) / RATE, white(9, 1.0, 40))], POSITION) is None


@pytest.mark.parametrize("derivative", [0, 1, 2])
def test_noise_within_a_band_is_what_an_ideal_low_pass_lets_through(derivative: int) -> None:
    noise = white(10, 0.01)
    made = noise_of(log_of(np.arange(SAMPLES) / RATE, noise))
    passed = (2j * np.pi * FREQUENCIES) ** derivative * (FREQUENCIES <= 20.0)
    let = np.fft.irfft(np.fft.rfft(noise) * passed, SAMPLES)
    assert made.within(20.0, derivative) == pytest.approx(np.std(let), rel=0.08)


def errors(seed: int, size: float, derivative: int, bandwidths: Array) -> Array:
    """RMS by which smoothers of these bandwidths miss a derivative of the signal, ends left out."""
    time, values = signal(seed)
    _, truth = signal(seed, derivative)
    recorded = values + white(seed, size)
    inside = slice(400, -400)
    made = (LocalFit(b, derivative).apply(time, recorded) - truth for b in bandwidths)
    return np.array([np.sqrt(np.mean(missed[inside] ** 2)) for missed in made])


@pytest.mark.parametrize("size", [1e-3, 1e-2, 1e-1])
@pytest.mark.parametrize("derivative", [0, 1, 2])
def test_the_smoother_is_nearly_the_best_of_all_bandwidths(size: float, derivative: int) -> None:
    time, values = signal(11)
    chosen = noise_of(log_of(time, values + white(11, size))).smoother(derivative)
    tried = np.geomspace(1.0, HIGHEST * RATE, 40)
    every = errors(11, size, derivative, tried)
    assert errors(11, size, derivative, np.array([chosen]))[0] < 1.05 * every.min()
    assert every.max() > 2.0 * every.min()  # so that the choice matters


@pytest.mark.parametrize("size", [1e-3, 1e-2, 1e-1])
def test_the_smoother_falls_with_the_order_of_the_derivative(size: float) -> None:
    time, values = signal(12)
    made = noise_of(log_of(time, values + white(12, size)))
    widths = [made.smoother(k) for k in range(3)]
    assert widths[0] >= widths[1] >= widths[2] and widths[0] > widths[2]


@pytest.mark.parametrize("line", [20.0, 50.0, 70.0])
def test_one_outlying_frequency_sets_no_bandwidth(line: float) -> None:
    time, values = signal(13)
    noise = white(13, 1e-3)
    plain = noise_of(log_of(time, values + noise))
    hum = noise_of(log_of(time, values + noise + 0.05 * np.sin(2.0 * np.pi * line * time)))
    assert hum.bandwidth == pytest.approx(plain.bandwidth, rel=0.1)
    assert hum.noise == pytest.approx(plain.noise, rel=0.1)
    assert hum.smoother(1) == pytest.approx(plain.smoother(1), rel=0.1)


def test_a_bump_of_the_density_beyond_the_bandwidth_is_no_signal() -> None:
    made = noise_of(log_of(signal(14)[0], signal(14)[1] + white(14, 1e-2)))
    beyond = made.frequencies > 2.0 * made.bandwidth
    bumped = replace(made, density=np.where(beyond, 100.0 * made.density, made.density))
    assert bumped.smoother(2) == made.smoother(2)


@pytest.mark.parametrize("order", [1, 2])
def test_what_a_smoother_passes_of_noise_is_what_its_response_says(order: int) -> None:
    """I_k, c_k and m_k of the module's docstring, at a bandwidth of 1 Hz."""
    frequency, step = np.linspace(0.0, 20.0, 200_001, retstep=True)
    gain = response(frequency, 1.0)
    passed = step * np.sum(frequency ** (2 * order) * gain**2)
    freedom = passed**2 / (step * np.sum(frequency ** (4 * order) * gain**4))
    most = np.max((2.0 * np.pi * frequency) ** order * gain)
    assert PASSED[order] == pytest.approx((passed, freedom, most), rel=1e-4)


@pytest.mark.parametrize("bits", [14, 16])
def test_an_encoder_that_rests_and_moves_evenly_is_no_quieter_than_its_quantum(bits: int) -> None:
    log = driven(strokes(), 0.0, inertia=0.6, bits=bits)
    made = channel_noise([log], "output_position")
    assert made is not None
    assert made.noise == pytest.approx(2.0 * np.pi / 2**bits / np.sqrt(12.0), rel=0.01)


def of_a_torque(time: Array, *runs: Array) -> ChannelNoise:
    logs = [Log.from_arrays(time=time, sensor_torque=values) for values in runs]
    made = channel_noise(logs, "sensor_torque")
    assert made is not None
    return made


@pytest.mark.parametrize("noise", [0.002, 0.02])
@pytest.mark.parametrize("hertz", [0.1, 0.37, 0.9])
def test_a_channel_that_steps_has_the_noise_between_its_steps(hertz: float, noise: float) -> None:
    time, values = signal(1)
    values = values + 2.0 * np.sign(np.sin(2.0 * np.pi * hertz * time + 0.1))
    values += np.random.default_rng(2).normal(0.0, noise, SAMPLES)
    made = of_a_torque(time, values, values[::-1].copy())
    assert made.noise == pytest.approx(noise, rel=0.1)
    assert not made.noisy  # nothing is smoothed that steps


def test_spikes_are_no_steps_and_the_noise_that_they_are() -> None:
    time, values = signal(1)
    generator = np.random.default_rng(2)
    spikes = np.where(generator.random(SAMPLES) < 0.002, 2.0, 0.0)
    made = of_a_torque(time, values + spikes)
    assert made.noise == pytest.approx(2.0 * np.sqrt(0.002), rel=0.3)


@pytest.mark.parametrize("bits", [8, 11])
def test_a_slow_channel_steps_by_its_quantum_and_has_the_noise_of_it(bits: int) -> None:
    time, values = signal(1)
    step = 2.0 / 2**bits
    slow = np.interp(np.linspace(0.0, 0.05, SAMPLES), np.linspace(0.0, 1.0, SAMPLES), values)
    made = of_a_torque(time, step * np.round(slow / step))
    assert made.noise >= step / np.sqrt(12.0) * (1.0 - 1e-9)
