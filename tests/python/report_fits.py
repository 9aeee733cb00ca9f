"""Simulated fits that the tests of reports and plots share. Seeds are fixed."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from scipy.signal import lfilter

import flexspline
from flexspline.least_squares.result import Fit
from flexspline.logs import Log

MEMORY = 0.9  # of the noise, from one sample to the next


def run(number: int, rows: int = 6000, *, name: str | None = None, **facts: Any) -> Log:
    """Two sines of velocity over five turns, friction, ripple, drift and AR(1) noise; 1 kHz."""
    rng = np.random.default_rng(number)
    time = np.arange(rows) * 1e-3
    turns = 2 * np.pi * time
    velocity = 8.0 * np.sin(0.31 * turns + number) + 5.0 * np.sin(0.83 * turns)
    position = np.cumsum(velocity) * 1e-3
    temperature = 25.0 + 12.0 * (1.0 - np.exp(-time / 3.0)) + number
    noise = lfilter([1.0], [1.0, -MEMORY], rng.normal(size=rows)) * 0.02
    torque = -0.12 + 0.3 * np.tanh(velocity / 0.2) + 0.015 * velocity + 0.01 * (temperature - 25.0)
    torque += 0.1 * np.cos(2 * position - 0.5) + 0.08 * np.cos(202 * position + 1.0) + noise
    return Log.from_arrays(
        time=time,
        output_position=position,
        output_velocity=velocity,
        temperature=temperature,
        sensor_torque=torque,
        facts={
            "name": name or f"run {number}",
            "gear_ratio": 100,
            "output_spline": "circular",
            **facts,
        },
    )


@cache
def plain_fit() -> Fit:
    """Five runs, every coefficient determined, two ripple effects of which one order is idle."""
    return flexspline.fit(
        [
            "offset",
            "coulomb_friction",
            "viscous_friction",
            "temperature_drift",
            "output_ripple",
            "wave_generator_ripple",
        ],
        [run(k) for k in range(5)],
        "sensor_torque",
        orders={"output_ripple": [2, 5], "wave_generator_ripple": [2]},
        checks=False,
    )


@cache
def confounded_fit() -> Fit:
    """Turlapati's two sigmoids beside an offset."""
    return flexspline.fit(
        ["offset", "coulomb_friction_per_direction", "viscous_friction"],
        [run(k) for k in range(4)],
        "sensor_torque",
        checks=False,
    )


@cache
def constrained_fit() -> Fit:
    """One run; a parameter fixed, one at its bound, one with a prior."""
    return flexspline.fit(
        ["offset", "coulomb_friction", "viscous_friction", "temperature_drift"],
        run(7),
        "sensor_torque",
        fixed={"temperature_drift.quadratic": 0.0, "direction_width": 0.2},
        bounds={"viscous_friction": (0.02, None)},
        priors={"coulomb_friction.level": (0.3, 0.05)},
        checks=False,
    )


@cache
def useless_fit() -> Fit:
    """A temperature drift of noise: no better than a constant, and a short log."""
    rng = np.random.default_rng(3)
    time = np.arange(400) * 1e-2
    log = Log.from_arrays(
        time=time,
        temperature=25.0 + np.sin(time),
        sensor_torque=lfilter([1.0], [1.0, -MEMORY], rng.normal(size=400)),
        facts={"name": "noise"},
    )
    return flexspline.fit(["offset", "temperature_drift"], log, "sensor_torque", checks=False)
