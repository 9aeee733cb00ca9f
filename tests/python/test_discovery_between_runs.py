"""Runs with other payloads: no channel tells what differs, and one size does not suit all."""

from __future__ import annotations

import numpy as np
import pytest

import flexspline
from flexspline.discovery.result import BY_RUN
from flexspline.logs.log import Log

BASE = ["offset", "coulomb_friction", "viscous_friction", "inertia", "gravity"]
QUANTUM = 2.0 * np.pi / 2**17
NOISE = 0.02  # Nm


def runs(weights: list[float], zeros: list[float]) -> list[Log]:
    """Swings of a joint, one for each weight, Nm, and each zero of its torque, Nm."""
    made, generator = [], np.random.default_rng(11)
    for number, (weight, zero) in enumerate(zip(weights, zeros, strict=True)):
        time = np.arange(0.0, 12.0, 1 / 250.0)
        angle = np.sin(2.0 * np.pi * (0.17 + 0.04 * number) * time)
        angle += 0.3 * np.sin(2.0 * np.pi * 0.53 * time + number)
        speed = np.gradient(angle, time)
        torque = zero + 1.2 * np.tanh(speed / 0.02) + 0.8 * speed + weight * np.sin(angle)
        torque += (0.05 + 0.002 * weight) * np.gradient(speed, time)
        made.append(
            Log.from_arrays(
                facts={"gear_ratio": 100.0, "name": f"run{number}"},
                time=time,
                output_position=QUANTUM * np.round(angle / QUANTUM),
                sensor_torque=torque + generator.normal(0.0, NOISE, len(time)),
            )
        )
    return made


@pytest.mark.parametrize(
    ("weights", "zeros", "differs"),
    [
        ([3.0, 4.0, 5.0, 6.0], [0.2] * 4, ("gravity",)),
        ([3.0] * 4, [0.2, 0.5, 0.1, 0.4], ("offset",)),
    ],
)
def test_what_differs_between_runs_is_said_and_is_no_noise(
    weights: list[float], zeros: list[float], differs: tuple[str, ...]
) -> None:
    made = flexspline.discover(BASE, runs(weights, zeros), target="sensor_torque")
    assert made.names == () and made.unexplained is not None
    assert made.unexplained.depends_on == ("run",) and made.unexplained.differs == differs
    assert made.unexplained.share_of_variance > 0.9
    assert made.floor.by == BY_RUN and NOISE < made.noise_floor < 0.3 * made.final_rmse
    told = " ".join(str(made).split())
    assert f"needs a size of {differs[0]} for each run" in told
    assert f"--per-run {differs[0]}" in told and "Nothing is missing" not in told
    made.to_json()


def test_runs_that_are_alike_differ_in_nothing() -> None:
    made = flexspline.discover(BASE, runs([3.0] * 4, [0.2] * 4), target="sensor_torque")
    assert made.names == () and made.unexplained is None and made.vibrations == ()
