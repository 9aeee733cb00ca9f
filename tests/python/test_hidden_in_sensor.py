"""Each effect of a sensor torque is found in runs that hide it and not in runs that do not."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hidden_logs import (
    BASE,
    FINE,
    LOAD,
    RATE,
    RATIO,
    SEEDS,
    Array,
    Channels,
    Truth,
    by_position,
    by_temperature,
    closes_the_gap,
    fitted,
    floor_of,
    followed,
    friction_of,
    gains_nothing,
    log_of,
    noise,
    of_each_seed,
    presliding,
    rich_run,
    torque_hiding,
)
from scipy.signal import lsim
from torsion_logs import bouc_wen

from flexspline.effects import effect
from flexspline.least_squares.result import Fit
from flexspline.logs.log import Log


def resonating(c: Channels) -> Array:
    """An oscillator of 12 Hz, driven by order 2 of the wave generator."""
    natural, damping = 2 * np.pi * 12.0, 0.15
    drive = 0.1 * np.cos(2 * RATIO * c["fine_angle"] + 0.5)
    system = ([natural**2], [1, 2 * damping * natural, natural**2])
    time = np.arange(len(drive)) / (RATE * FINE)
    _, response, _ = lsim(system, drive, time)
    return np.asarray(response[::FINE])


def uneven(c: Channels) -> Array:
    return np.asarray(0.05 * (c["temperature"] - followed(c["time"], c["temperature"], 6.0)))


def creeping(c: Channels) -> Array:
    return np.asarray(0.2 * -np.expm1(-c["time"] / 40.0))


def warm_gain(c: Channels) -> Array:
    return np.asarray(0.002 * c[LOAD] * (c["temperature"] - 25.0))


def bent(c: Channels) -> Array:
    return np.asarray(0.1 * (np.cosh(0.15 * c[LOAD]) - 1) + 2e-4 * c[LOAD] ** 3)


def looped(c: Channels) -> Array:
    return -0.06 * bouc_wen(c[LOAD], c["time"], 2.0)


def leaking(c: Channels) -> Array:
    return 0.3 * c["motor_torque"]


def late(c: Channels) -> Array:
    return c["late_load"] - c[LOAD]


HIDDEN: dict[str, Truth] = {
    "presliding_friction": presliding,
    "temperature_dependent_friction": by_temperature,
    "position_dependent_friction": by_position,
    "speed_dependent_ripple": resonating,
    "thermal_gradient_drift": uneven,
    "time_drift": creeping,
    "gain_temperature_dependence": warm_gain,
    "sensor_nonlinearity": bent,
    "torque_hysteresis": looped,
    "motor_crosstalk": leaking,
    "sensor_lag": late,
}


@of_each_seed
def runs(name: str, seed: int) -> Log:
    """A run that hides an effect; "" hides none."""
    speed = 0.4 if name == "speed_dependent_ripple" else 2.0
    c, torque = torque_hiding(HIDDEN.get(name), seed, speed)
    return log_of(c, sensor_torque=torque)


def base_of(name: str) -> list[object]:
    """What is known without the effect; a ripple stands beside what speed makes of it."""
    more = [effect("wave_generator_ripple", orders=[(2, "motor_on_stator")])]
    return [*BASE, *(more if name == "speed_dependent_ripple" else [])]


@cache
def with_it(name: str) -> Fit:
    return fitted([*base_of(name), name], runs(name), "sensor_torque")


@pytest.mark.parametrize("name", HIDDEN)
def test_a_hidden_effect_closes_the_gap(name: str) -> None:
    base = fitted(base_of(name), runs(name), "sensor_torque")
    closes_the_gap(base, with_it(name), name, floor_of())


@pytest.mark.parametrize("name", HIDDEN)
def test_an_effect_that_is_not_there_gains_nothing(name: str) -> None:
    base = fitted(base_of(name), runs(""), "sensor_torque")
    made = fitted([*base_of(name), name], runs(""), "sensor_torque")
    gains_nothing(base, made, name)


def test_what_was_put_in_comes_out_within_its_error() -> None:
    truth = {"gain_temperature_dependence": 0.002, "motor_crosstalk": 0.3}
    truth["thermal_gradient_drift"] = 0.05
    for name, value in truth.items():
        found = next(p for p in with_it(name).parameters if p.name.startswith(f"{name}."))
        assert abs(found.value - value) < 4.0 * found.standard_error, name


def test_a_delay_is_told_from_a_lag() -> None:
    lagged = []
    for seed in SEEDS:
        c = rich_run(seed)
        slow = followed(c["time"], c[LOAD], 0.03)
        torque = slow + friction_of(c) + noise(seed, len(slow))
        lagged.append(log_of(c, sensor_torque=torque))
    by_lag = fitted([*BASE, "sensor_lag"], lagged, "sensor_torque")
    for made, ratio in ((by_lag, 1.0), (with_it("sensor_lag"), 0.5)):
        (smoothing,) = (d for d in made.derived if d.name.startswith("smoothing over lateness"))
        lateness = next(p for p in made.parameters if p.name == "sensor_lag.lateness")
        assert lateness.value == pytest.approx(0.03, rel=0.05)
        assert smoothing.value == pytest.approx(ratio, abs=0.15)


def test_the_resonance_is_found_at_its_frequency() -> None:
    (frequency,) = with_it("speed_dependent_ripple").derived
    assert frequency.unit == "Hz" and frequency.value == pytest.approx(12.0, rel=0.03)
