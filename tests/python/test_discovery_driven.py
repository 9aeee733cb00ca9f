"""What `discover` says of the motion where a base and the model are driven forward."""

from __future__ import annotations

import numpy as np
from forward_runs import drive, run_of
from numpy.typing import NDArray

import flexspline
from flexspline import Discovery
from flexspline.report.discovery import driven_sentence

Array = NDArray[np.float64]

BASE = ["inertia", "gravity", "coulomb_friction"]


def discovered(torque: Array, time: Array) -> Discovery:
    """Viscous friction is missing in a pendulum that a torque drives."""
    model = drive([
        ("inertia", [0.5]), ("gravity", [8.0, 0.0]), ("coulomb_friction", [0.3]),
        ("viscous_friction", [0.4]),
    ])  # fmt: skip
    moved = flexspline.simulate(model, run_of(time, torque), steps_per_sample=8).log
    channels = {n: moved[n] for n in moved.channels if n.startswith("output_")}
    noise = np.random.default_rng(4).normal(0.0, 0.02, len(time))
    log = run_of(time, torque + noise, **channels)
    return flexspline.discover(BASE, log, target="motor_torque")


def test_a_name_that_is_right_lessens_what_a_forward_simulation_misses() -> None:
    time = np.arange(0.0, 80.0, 0.02)
    made = discovered(3.0 * np.sin(1.3 * time) + 2.0 * np.sin(2.9 * time), time)
    assert [one.effect for one in made.found] == ["viscous_friction"]
    assert made.motion is not None
    assert made.motion.final_rmse < 0.1 * made.motion.base_rmse
    assert "rad RMS." in driven_sentence(made)


def test_a_motion_that_the_least_difference_decides_is_not_shown() -> None:
    """Thrown over its top, the pendulum has another motion with every step size."""
    time = np.arange(0.0, 400.0, 0.02)
    made = discovered(8.5 * np.sin(2.5 * time), time)
    assert [one.effect for one in made.found] == ["viscous_friction"]
    assert made.motion is None
    assert driven_sentence(made) == ""
