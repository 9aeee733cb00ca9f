"""The noise that evidence is measured by: what lasts as long as a run is none."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, Literal, cast

import numpy as np
import pytest
from hidden_logs import LOAD, friction_of, log_of, noise, rich_run
from scipy.signal import lfilter

import flexspline
from flexspline.discovery.search import search_context_of
from flexspline.least_squares.noise_model import NoiseModel
from flexspline.logs.log import Log
from flexspline.regression.candidate_model import (
    _rough_whitening,
    candidate_model_of,
    restricted_whitening,
)
from flexspline.regression.gram import Whitening

ROWS = 2000
SLOW = ("offset", "time_drift", "temperature_drift", "gain_error", "gravity")
MODEL = ("coulomb_friction", "viscous_friction", "inertia", *SLOW)


def wandering(seed: int, memory: float) -> Log:
    """A run whose torque wanders: each row adds to so much of the one before."""
    channels = rich_run(seed, ROWS)
    steps = np.random.default_rng(seed).normal(0.0, 0.03, ROWS)
    walk = lfilter([1.0], [1.0, -memory], steps)
    torque = channels[LOAD] + friction_of(channels) + noise(seed, ROWS) + walk
    return log_of(channels, sensor_torque=torque)


def noise_beside_the_model(memory: float) -> Whitening:
    effects = [flexspline.effect(name) for name in MODEL]
    logs = [wandering(seed, memory) for seed in range(1, 6)]
    made = search_context_of(
        effects, logs, "sensor_torque", known_load=LOAD, lowpass_hz=None, threads=1
    )
    return restricted_whitening(made.problem, candidate_model_of(effects, len(effects), {}))


def memory(made: Whitening) -> float:
    """Rows for one piece of news."""
    known = np.zeros((made.order, made.order))
    return NoiseModel(-made.denominator[1:], made.variance, known, ROWS, 0, 1).memory


def test_what_lasts_as_long_as_a_run_is_no_noise() -> None:
    assert memory(noise_beside_the_model(1.0)) < ROWS


def test_memory_that_is_short_is_found() -> None:
    """(1 + φ) / (1 − φ) of a noise of first order is 99 rows."""
    assert 0.5 * 99.0 < memory(noise_beside_the_model(0.98)) < 2.0 * 99.0


def test_a_first_guess_of_the_noise_has_its_memory_and_its_innovations() -> None:
    rows = lfilter([1.0], [1.0, -0.9], np.random.default_rng(4).normal(0.0, 0.03, 20_000))
    run = cast(Any, SimpleNamespace(stretches=[(0, 12_000), (12_000, 20_000)]))
    made = _rough_whitening([rows], [run], 1)
    assert made.variance == pytest.approx(0.03**2, rel=0.05)
    assert made.denominator[1] == pytest.approx(-0.9, abs=0.03)


def test_stretches_too_short_for_the_filter_to_start_are_left_out() -> None:
    run = cast(Any, SimpleNamespace(stretches=[(0, 100), (100, 105), (105, 105), (105, 300)]))
    white = Whitening(np.array([1.0, -0.5, 0.1]), 1.0, 1)
    assert [(rows[0], rows[-1]) for rows in white.taken(run)] == [(0, 99), (105, 299)]


@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("every", [1, 3])
@pytest.mark.parametrize("terms", [1, 2, 6, 17])
def test_columns_are_filtered_as_numpy_filters_each_of_them(
    order: Literal["C", "F"], every: int, terms: int
) -> None:
    random = np.random.default_rng(terms)
    columns = np.array(random.normal(size=(201, 3)), order=order)
    filter_ = Whitening(np.append(1.0, random.normal(size=terms - 1)), 1.0, every)
    made, rows = filter_.stretches([((20, 221), columns)], 3)
    np.testing.assert_array_equal(rows, np.arange(20, 221, every)[terms - 1 :])
    for column, own in zip(columns[::every].T, made.T, strict=True):
        whole = np.convolve(column, filter_.denominator, "valid")
        np.testing.assert_allclose(own, whole, rtol=1e-12, atol=1e-12)
