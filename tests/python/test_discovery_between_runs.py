"""Runs with other payloads: no channel tells what differs, and one size does not suit all."""

from __future__ import annotations

import numpy as np
import pytest

import flexspline
from flexspline.discovery.result import BY_RUN
from flexspline.discovery.unexplained import _of_each_run
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


@pytest.mark.parametrize("own", [[0, 1, 0, 0], [1, 0, 0, 0], [0, 0, 0, 1], [1, 1, 0, 0]])
def test_what_sizes_of_each_run_explain_is_that_of_least_squares(own: list[int]) -> None:
    generator, mask = np.random.default_rng(0), np.array(own, dtype=bool)
    columns = generator.normal(size=(3, 50, 4))
    target = generator.normal(size=(3, 50)) + columns[..., 1] * np.arange(3)[:, None]
    both = np.concatenate([columns, target[..., None]], axis=2)
    flat, stacked = both.reshape(-1, 5), np.zeros((150, 3 * mask.sum()))
    for run in range(3):
        at = slice(run * mask.sum(), (run + 1) * mask.sum())
        stacked[50 * run : 50 * (run + 1), at] = columns[run][:, mask]
    left = [
        np.linalg.lstsq(x, flat[:, 4])[1][0]
        for x in (flat[:, :4], np.column_stack([flat[:, :4][:, ~mask], stacked]))
    ]
    products = np.swapaxes(both, 1, 2) @ both
    assert _of_each_run(products, mask) == pytest.approx(left[0] - left[1], rel=1e-9)
