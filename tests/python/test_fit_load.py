"""Friction that grows with the load: known, or made by the model's own inertia and gravity."""

from __future__ import annotations

import numpy as np
import pytest
from fit_logs import WIDTH, autoregressive, chosen, fitted, log_with, motion, rows_of, simulated

from flexspline import InputError, effect
from flexspline.least_squares.linear import PLAIN, Settling
from flexspline.signals import target_of

LOADED = [
    "offset",
    effect("coulomb_friction", direction_width=WIDTH),
    effect("load_dependent_friction", direction_width=WIDTH),
    "inertia",
    "gravity",
]
TRUTH = np.array([-0.12, 0.3, 0.08, 0.4, 3.0, -0.5])


def test_the_rows_hold_the_load_of_inertia_and_gravity():
    channels = motion(0)
    rows = rows_of(LOADED, log_with(channels), None, TRUTH)
    load = 0.4 * channels["output_acceleration"] + rows[:, 4:] @ TRUTH[4:]
    direction = np.tanh(channels["output_velocity"] / WIDTH)
    assert rows[:, 2] == pytest.approx(np.abs(load) * direction, rel=1e-9, abs=1e-9)


def test_without_noise_the_fixed_point_is_the_truth():
    log = simulated(LOADED, TRUTH, motion(1))
    fit = fitted(LOADED, log)
    assert fit.part.coefficients == pytest.approx(TRUTH, rel=1e-6)


def test_load_dependent_friction_is_recovered_within_its_error_from_the_models_own_load():
    away = []
    for seed in range(12):
        noise = autoregressive(np.random.default_rng([seed, 5]), 2000)
        fit = fitted(LOADED, simulated(LOADED, TRUTH, motion(seed), noise))
        errors = [p.standard_error for p in fit.parameters if p.kind == "coefficient"]
        away.append((fit.part.coefficients - TRUTH) / errors)
    # 72 standardised deviations: mean square 1 ± √(2/72), four sigma.
    assert np.mean(np.square(away)) < 1.0 + 4 * np.sqrt(2 / 72)
    assert np.abs(away).max() < 4.5


def test_load_dependent_friction_is_recovered_from_a_known_load():
    channels = motion(3)
    load = 5.0 * np.sin(0.7 * channels["time"]) + 2.0
    direction = np.tanh(channels["output_velocity"] / WIDTH)
    noise = 0.02 * np.random.default_rng(1).normal(size=2000)
    torque = load + 0.1 + (0.3 + 0.08 * np.abs(load)) * direction + noise
    log = log_with(channels, torque, reference_torque=load)
    fit = fitted(chosen(*LOADED[:3]), log, known_load="reference_torque")
    for name, truth in (("offset", 0.1), ("level", 0.3), ("factor", 0.08)):
        assert abs(fit[name].value - truth) < 4 * fit[name].standard_error


def test_a_gain_error_is_recovered_from_a_known_load():
    channels = motion(3)
    load = 5.0 * np.sin(0.7 * channels["time"]) + 2.0
    noise = 0.02 * np.random.default_rng(1).normal(size=2000)
    log = log_with(channels, 1.03 * load + 0.1 + noise, reference_torque=load)
    fit = fitted(["offset", "gain_error"], log, known_load="reference_torque", fixed={})
    assert abs(fit["gain"].value - 0.03) < 4 * fit["gain"].standard_error < 0.003


def test_the_prediction_on_other_motion_uses_the_load_of_that_motion():
    log, fresh = simulated(LOADED, TRUTH, motion(1)), simulated(LOADED, TRUTH, motion(8, speed=3.0))
    fit = fitted(LOADED, log)
    assert np.abs(fit.predict(fresh).residual).max() < 1e-6


def test_load_dependent_friction_without_any_load_is_refused():
    log = simulated(LOADED, TRUTH, motion(1))
    with pytest.raises(InputError, match=r"load_dependent_friction.*known_load"):
        fitted(LOADED[:3], log)


def test_a_gain_error_without_a_known_load_is_refused_even_beside_inertia():
    log = simulated(LOADED, TRUTH, motion(1))
    with pytest.raises(InputError, match=r"gain_error.*needs a known load"):
        fitted(["offset", "gain_error", "inertia"], log, fixed={})


@pytest.mark.parametrize("slopes", [(-1.4, 0.3), (-3.0, -0.9, 0.8), (0.95, -1.1)])
def test_loads_that_come_back_and_forth_settle(slopes):
    """Rounds x ← b + A x, which by themselves end nowhere or crawl."""
    turn = np.linalg.qr(np.random.default_rng(7).normal(size=(len(slopes),) * 2))[0]
    matrix, offset = turn @ np.diag(slopes) @ turn.T, np.arange(1.0, len(slopes) + 1.0)
    settling, load = Settling(), np.zeros(len(slopes))
    for _ in range(PLAIN + 2 * len(slopes)):
        load = settling.next(load, offset + matrix @ load)
    assert load == pytest.approx(np.linalg.solve(np.eye(len(slopes)) - matrix, offset), rel=1e-6)


def run():
    return simulated(LOADED, TRUTH, motion(1))


@pytest.mark.parametrize("target", ["sensor_torque", "motor_torque", "motor_current", "torsion"])
@pytest.mark.parametrize("load", ["motor_current", "motor_torque", "output_velocity"])
def test_a_known_load_that_is_no_torque_at_the_output_is_refused(target: str, load: str) -> None:
    says = "is the target itself" if load == target else "is no torque at the output"
    with pytest.raises(InputError, match=f"the known load {load} {says}.*reference_torque"):
        target_of(run(), target, load)
