"""What closes most of the gap is named first, though sharp effects are most of the evidence."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, lfilter

import flexspline
from flexspline.logs.log import Log

sys.path.insert(0, str(Path(__file__).parents[1] / "bench"))

from elsewhere.parts import dahl

Array = NDArray[np.float64]

RATE, SECONDS, RATIO = 250.0, 72.0, 100.0
SPEEDS = (0.05, 0.15, 0.3, 0.6, 1.0, 1.5)  # rad/s
REACH, ACCELERATION, FILTER = 2.5, 3.0, 40.0  # rad, rad/s², Hz
LATE = 0.002  # s
SLIDING, VISCOUS, GRAVITY, INERTIA, DRAG = 8.0, 6.0, 12.0, 1.2, 3.0


def motion(rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Time, s, angle, rad, and speed, rad/s: there and back at one speed after the other."""
    time = np.arange(0.0, SECONDS, 1.0 / RATE)
    part = SECONDS / len(SPEEDS)
    speeds = rng.permutation(SPEEDS)[np.minimum((time / part).astype(int), len(SPEEDS) - 1)]
    half = np.minimum(0.5 * part, 2.0 * REACH / speeds)
    asked, speed = np.where(time % (2.0 * half) < half, speeds, -speeds), np.zeros(len(time))
    most = ACCELERATION / RATE
    for row in range(1, len(time)):
        speed[row] = speed[row - 1] + np.clip(asked[row] - speed[row - 1], -most, most)
    speed = np.convolve(speed, np.full(7, 1.0 / 7.0), "same")
    angle = np.cumsum(speed) / RATE
    return time, angle - 0.5 * (angle.max() + angle.min()), speed


def run(seed: int) -> Log:
    """A joint with a cable that drags over part of its angle, its torque recorded late."""
    rng = np.random.default_rng(seed)
    time, q, v = motion(rng)
    load = 10.0 * np.sin(0.37 * time)
    within = 1.0 / ((1.0 + np.exp((0.5 - q) / 0.03)) * (1.0 + np.exp((q - 1.3) / 0.03)))
    torque = (
        load
        + INERTIA * np.gradient(v, time)
        + GRAVITY * np.sin(q + 0.2)
        + (SLIDING + DRAG * within) * dahl(q, 0.002, 1, 0.0)
        + VISCOUS * v
    )
    position = np.round(rng.normal(q, 1e-5) * 2**18 / (2 * np.pi)) * 2 * np.pi / 2**18
    b, a = butter(2, FILTER / (0.5 * RATE))
    return Log.from_arrays(
        facts={"name": f"run{seed}", "gear_ratio": RATIO},
        time=time,
        output_position=position,
        output_velocity=lfilter(b, a, np.gradient(position, time)),
        motor_torque=rng.normal(np.interp(time - LATE, time, torque), 0.15) / RATIO,
        reference_torque=np.round(rng.normal(load, 0.05), 2),
    )


def test_gravity_that_is_nearly_all_of_the_gap_is_named_beside_sharp_effects_and_a_drag() -> None:
    """Presliding has most of the evidence, of which gravity was no more than "its form misses".

    With more rows nothing was named, at 8 Nm; with these it was a ripple, at 29 %.
    """
    base = [flexspline.Effect(n) for n in ("offset", "coulomb_friction", "viscous_friction")]
    made = flexspline.discover(
        base, [run(80), run(81)], target="motor_torque", known_load="reference_torque"
    )
    assert made.found[0].effect == "gravity"
    assert {*made.names} <= {"gravity", "inertia", "presliding_friction"}
    assert made.final_rmse < 0.3 * made.base_rmse
