"""Logs of a simulated calibration rig with more physics than the model that is fitted to them.

    V = (τ + bend(τ) + memory(τ) + ripple) / k + b(T_body) + noise
    T_body follows the thermometer's T by a first-order lag; noise is AR(1)

with k of zhang_disturbance_elimination (25) and b of (24). The model knows k and b alone; bend
(a cubic), memory (play elements in series: hysteresis), ripple and noise are what its figures
have to show or survive.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from flexspline.logs.log import Log
from flexspline.rigs import play

Array = NDArray[np.float64]

SENSITIVITY = 62.738  # Nm/V, (25)
FULL_SCALE = 70.0  # Nm
DRIFT = (-21.39e-3, -0.8704e-3, 0.0102e-3)  # V, V/K, V/K², (24)
RATE = 10.0  # Hz


@dataclass(frozen=True)
class Bench:
    """What the rig is made of. Nm but where stated; zero for a rig without it.

    `bend`: deviation of the cubic at full scale. `memory`: half-width of the hysteresis.
    `ripple`: amplitude. `noise`, V, and `persistence` of the bridge; `reference_noise`.
    `lag`: s, of the body behind the thermometer. `gradient`: Nm/K. `thermometer`: K.
    """

    bend: float = 0.3
    memory: float = 0.2
    ripple: float = 0.05
    noise: float = 0.4e-3
    persistence: float = 0.9
    reference_noise: float = 0.01
    lag: float = 0.0
    gradient: float = 0.0
    thermometer: float = 0.02


QUIET = Bench(bend=0.0, memory=0.0, ripple=0.0)


def drift(temperature: Array) -> Array:
    """b(T) of (24), V."""
    return np.asarray(np.polynomial.polynomial.polyval(temperature, DRIFT))


def bend(torque: Array, size: float) -> Array:
    """A cubic that is zero at zero and at full scale and largest, `size`, at 0.577 of it."""
    u = torque / FULL_SCALE
    return np.asarray(size * 1.5 * np.sqrt(3.0) * (u - u**3))


def memory(torque: Array, size: float) -> Array:
    """Hysteresis that is ±size in mid-range: half of what a play of a third of the range lacks."""
    slip = FULL_SCALE / 6.0
    return np.asarray(size * (torque - play(torque, slip)) / slip)


def stairs(levels: Array, dwell: float, move: float, rate: float = RATE) -> Array:
    """Plateaus of `dwell` s with ramps of `move` s between them."""
    hold, go = round(dwell * rate), round(move * rate)
    parts = [np.full(hold, levels[0])]
    for before, after in pairwise(levels):
        parts += [np.linspace(before, after, go + 2)[1:-1], np.full(hold, after)]
    return np.concatenate(parts)


def cycles(count: int = 2, step: float = 5.0, one_way: bool = False) -> Array:
    """Levels of loading and unloading, zhang's 5 Nm steps."""
    up = np.arange(0.0, FULL_SCALE + step / 2, step)
    if one_way:
        return up
    once = np.concatenate([up, up[-2::-1]])
    return np.concatenate([once, *[once[1:]] * (count - 1)])


def thermal_steps(low: float = 20.0, high: float = 45.0, cooling: bool = False) -> Array:
    """zhang's 5 °C steps, and back."""
    up = np.arange(low, high + 0.1, 5.0)
    return np.concatenate([up, up[-2::-1]]) if cooling else up


def recorded(
    name: str, torque: Array, temperature: Array, bench: Bench, seed: int, rate: float = RATE
) -> Log:
    """What the instruments make of torque and temperature."""
    rng = np.random.default_rng(seed)
    time = np.arange(len(torque)) / rate
    body = lagged(time, temperature, bench.lag)
    wave = bench.ripple * np.sin(2.0 * np.pi * 0.731 * time)
    shown = torque + bend(torque, bench.bend) + memory(torque, bench.memory) + wave
    shown = shown - bench.gradient * (temperature - body)
    innovations = rng.normal(0.0, bench.noise * np.sqrt(1.0 - bench.persistence**2), len(time))
    noise = lfilter([1.0], [1.0, -bench.persistence], innovations)
    return Log.from_arrays(
        facts={"name": name, "joint": "bench"},
        time=time,
        sensor_voltage=shown / SENSITIVITY + drift(body) + noise,
        reference_torque=torque + rng.normal(0.0, bench.reference_noise, len(time)),
        temperature=temperature + rng.normal(0.0, bench.thermometer, len(time)),
    )


def lagged(time: Array, temperature: Array, lag: float) -> Array:
    """First order, exact for a temperature that holds between samples."""
    if lag == 0.0:
        return temperature
    gain = -np.expm1(-(time[1] - time[0]) / lag)
    start = [(1.0 - gain) * temperature[0]]
    return np.asarray(lfilter([gain], [1.0, gain - 1.0], temperature, zi=start)[0])


def load_run(
    bench: Bench = Bench(),
    *,
    seed: int = 1,
    count: int = 2,
    one_way: bool = False,
    temperature: float = 25.0,
    ramp: bool = False,
) -> Log:
    """Loading and unloading in steps, or in ramps, at about one temperature."""
    levels = cycles(count, one_way=one_way)
    if ramp:
        ends = [0.0, *[FULL_SCALE, 0.0] * count][: 2 if one_way else None]
        torque = stairs(np.array(ends), 2.0, 100.0)
    else:
        torque = stairs(levels, 6.0, 1.5)
    warmth = temperature + np.linspace(0.0, 0.3, len(torque))
    return recorded("load", torque, warmth, bench, seed)


def drift_run(
    bench: Bench = Bench(),
    *,
    seed: int = 2,
    cooling: bool = False,
    dwell: float = 60.0,
    move: float = 60.0,
    name: str = "drift",
) -> Log:
    """No load; the temperature goes up in steps of 5 °C, and down again."""
    warmth = stairs(thermal_steps(cooling=cooling), dwell, move)
    return recorded(name, np.zeros(len(warmth)), warmth, bench, seed)


def without(log: Log, *channels: str) -> Log:
    """The log without some channels."""
    kept = {name: log[name] for name in log.channels if name not in channels}
    return replace(log, columns=kept)
