"""What the noise of a load cell gives effects beside a free scale of the load is not theirs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from driven_joint import strokes, waves
from numpy.typing import NDArray

import flexspline
from flexspline.discovery.evidence import dictionary_of
from flexspline.discovery.search import search_context_of
from flexspline.effects import effect
from flexspline.logs.log import Log
from flexspline.regression.candidate_model import candidate_model_of, refitted
from flexspline.regression.gram import Whitening

Array = NDArray[np.float64]
LOAD = "reference_torque"
NM_PER_A = 8.0  # at the output


def loaded(noise: float, gain: float) -> Log:
    """A torque sensor of so much more gain beside a load cell of so much noise [Nm], in strokes.

    The load is a payload's gravity, a spring's torque and an inertia; rows at 250 Hz, 17 bit.
    """
    angle = strokes()
    time, step = np.arange(len(angle)) / 5000.0, 2.0 * np.pi / 2**17
    turned = np.gradient(np.gradient(angle, time), time)
    load = (12.0 * np.sin(angle) + 6.0 * angle + 0.3 * turned)[::20]
    rng, rows = np.random.default_rng(0), len(load)
    return Log.from_arrays(
        time=time[::20], output_position=np.round(angle[::20] / step) * step,
        reference_torque=np.round((load + rng.normal(0.0, noise, rows)) / 0.02) * 0.02,
        sensor_torque=(1.0 + gain) * load + 0.2 + rng.normal(0.0, 0.05, rows),
        facts={"gear_ratio": 100.0},
    )  # fmt: skip


def test_a_gain_is_named_alone_behind_a_noisy_load_cell() -> None:
    """Gravity had its place, which knows the load better than a cell with 0.2 Nm of noise does."""
    log = loaded(0.2, 0.03).rows(slice(0, 6000))
    found = flexspline.discover(["offset"], log, target="sensor_torque", known_load=LOAD)
    assert found.names == ("gain_error",)
    gain = found.fit["gain_error.gain"]
    assert abs(gain.value - 0.03) < 3.0 * gain.standard_error < 0.005


def told_by_motion(
    motion: Array, noise: float, seed: int, gain: float = 0.0, more: float = 0.0
) -> Log:
    """A load that gravity and inertia tell but for `more` [Nm] at 7 rad/s, over a motion at 5 kHz.

    Every channel but the torques is exact; rows at 500 Hz.
    """
    angle = motion[::10]
    time, speed = 0.002 * np.arange(len(angle)), np.gradient(angle, 0.002)
    turned, rng = np.gradient(speed, 0.002), np.random.default_rng(seed)
    load = 12.0 * np.sin(angle) + 0.3 * turned + more * np.sin(7.0 * time)
    cell = load + rng.normal(0.0, noise, len(angle))
    seen = (1.0 + gain) * load + rng.normal(0.0, 0.05, len(angle))
    return Log.from_arrays(
        time=time, output_position=angle, output_velocity=speed, output_acceleration=turned,
        reference_torque=cell, sensor_torque=seen, motor_torque=seen / 100.0,
        motor_current=seen / NM_PER_A,
        facts={"gear_ratio": 100.0, "torque_constant": NM_PER_A / 100.0},
    )  # fmt: skip


@pytest.mark.parametrize(
    ("target", "scale"),
    [("sensor_torque", "gain_error"), ("motor_torque", "torque_constant_error"),
     ("motor_current", "torque_constant_error")],
)  # fmt: skip
@pytest.mark.parametrize("noise", [0.1, 0.4])
def test_what_the_noise_gives_is_foretold(noise: float, target: str, scale: str) -> None:
    """Gravity and inertia tell the load; nothing is missing, and they gain beside a free scale."""
    log = told_by_motion(strokes(), noise, seed=4)
    base = [effect("offset"), effect(scale)]
    wanted = [effect("gravity"), effect("inertia")]
    problem = search_context_of(
        base, [log], target, known_load=LOAD, lowpass_hz=None, threads=1, scatter=noise
    ).problem
    unit = NM_PER_A if target == "motor_current" else 1.0
    white = Whitening(np.ones(1), (0.05**2 + noise**2) / unit**2, problem.decimation)
    work, _ = refitted(problem, candidate_model_of(base, len(base), {}), white)
    made = dictionary_of(problem, work, wanted, white)
    columns = np.concatenate([made.at[one] for one in wanted])
    told = 0.5 * made.by_noise(columns, made.model)  # a name has to gain twice that
    assert told > 1000.0
    assert made.table.gain(columns, made.model) == pytest.approx(told, rel=0.1)
    quiet = dictionary_of(replace(problem, scatter=0.0), work, wanted, white)
    assert quiet.by_noise(columns, quiet.model) == 0.0


def test_a_scale_that_the_noise_of_the_load_moves_has_an_error_that_says_so() -> None:
    """By −0.02 of 0.03 here; some were off by 3.6 of the errors of the target's noise."""
    effects, off = ["offset", "gain_error", "gravity", "inertia"], []
    for seed in range(4):
        log = told_by_motion(waves(), 0.4, seed, gain=0.03, more=0.4)
        gain = flexspline.fit(effects, log, "sensor_torque", known_load=LOAD)["gain_error.gain"]
        off.append((gain.value - 0.03) / gain.standard_error)
    assert max(map(abs, off)) < 2.0
