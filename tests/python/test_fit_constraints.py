"""What is fixed, bounded or known beforehand, of coefficients and of shapes."""

from __future__ import annotations

import numpy as np
import pytest
from fit_logs import (
    FRICTION,
    HELD,
    WIDTH,
    autoregressive,
    fitted,
    friction,
    log_with,
    motion,
    rows_of,
    simulated,
)
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from flexspline import effect
from flexspline.effects import CATALOGUE
from flexspline.formatting import plus_minus

SIGMA = 0.05


def log_of(seed: int = 0, samples: int = 2000):
    noise = SIGMA * np.random.default_rng(seed).normal(size=samples)
    return simulated(friction(), FRICTION, motion(seed, samples), noise)


# Fixed and bounded coefficients


def test_a_fixed_coefficient_keeps_its_value_and_the_others_fit_the_rest():
    log = log_of()
    fit = fitted(friction(), log, fixed={**HELD, "inertia": 0.05, "offset": 0.0})
    rows = rows_of(friction(), log)
    rest = np.linalg.lstsq(rows[:, 1:3], log["sensor_torque"] - 0.05 * rows[:, 3], rcond=None)[0]
    assert fit.part.coefficients == pytest.approx([0.0, *rest, 0.05], rel=1e-10)
    assert fit["inertia"].state == "fixed" and np.isnan(fit["inertia"].standard_error)
    assert fit["inertia"].interval == (0.05, 0.05)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(
    lower=st.lists(st.floats(-1.0, 0.3), min_size=4, max_size=4),
    width=st.lists(st.floats(0.01, 1.0), min_size=4, max_size=4),
    seed=st.integers(0, 5),
)
def test_bounds_give_the_constrained_optimum(lower, width, seed):
    log = log_of(seed, 400)
    upper = np.add(lower, width)
    names = ("offset", "level", "viscosity", "inertia")
    limits = {name: (lower[k], upper[k]) for k, name in enumerate(names)}
    fit = fitted(friction(), log, bounds=limits)
    rows, y = rows_of(friction(), log), log["sensor_torque"]
    values = fit.part.coefficients
    assert ((np.array(lower) <= values) & (values <= upper)).all()
    best = lsq_linear(rows, y, (lower, upper), method="bvls", tol=1e-14, max_iter=100)
    assert np.sum((y - rows @ values) ** 2) <= 2 * best.cost * (1 + 1e-9)
    # Karush, Kuhn, Tucker: flat inside, downhill only through the bound outside.
    slope = rows.T @ (rows @ values - y)
    size = np.linalg.norm(rows, axis=0) * np.linalg.norm(y)
    for k, name in enumerate(names):
        state = fit[name].state
        if state in ("fitted", "not determined"):
            assert abs(slope[k]) <= 1e-8 * size[k]
        elif state == "at lower bound":
            assert values[k] == lower[k] and slope[k] >= -1e-8 * size[k]
        else:
            assert state == "at upper bound"
            assert values[k] == upper[k] and slope[k] <= 1e-8 * size[k]


def test_a_parameter_that_ends_on_a_bound_is_said_to_and_has_no_error():
    fit = fitted(friction(), log_of(), bounds={"viscous_friction": (0.3, None)})
    assert fit["viscosity"].state == "at lower bound" and fit["viscosity"].value == 0.3
    assert np.isnan(fit["viscosity"].standard_error)
    assert any("viscous_friction.viscosity ended on its lower bound" in w for w in fit.warnings)
    assert "lower bound" in str(fit)
    free = fitted(friction(), log_of(), bounds={"viscous_friction": (0.0, None)})
    assert free["viscosity"].state == "fitted"
    assert free.part.coefficients == pytest.approx(
        fitted(friction(), log_of()).part.coefficients, rel=1e-12
    )


def test_a_bound_at_exactly_the_value_leaves_the_optimum_where_it_is():
    value = fitted(friction(), log_of())["level"].value
    fit = fitted(friction(), log_of(), bounds={"level": (None, value)})
    assert fit["level"].value == pytest.approx(value, rel=1e-12)


def test_bounds_beside_a_dependency_stay_optimal():
    effects = [
        "offset",
        effect("coulomb_friction_per_direction", direction_width=WIDTH),
        "viscous_friction",
        "inertia",
    ]
    log = log_of()
    free, bound = fitted(effects, log), fitted(effects, log, bounds={"offset": (0.05, 0.06)})
    assert 0.05 <= bound["offset"].value <= 0.06
    assert bound.rmse == pytest.approx(free.rmse, rel=1e-12)


# Priors


def exact_posterior(log, name_at: int, mean: float, error: float, variance: float):
    rows = rows_of(friction(), log)
    precision = rows.T @ rows / variance
    precision[name_at, name_at] += 1 / error**2
    right = rows.T @ log["sensor_torque"] / variance
    right[name_at] += mean / error**2
    return np.linalg.solve(precision, right), np.sqrt(np.diag(np.linalg.inv(precision)))


@pytest.mark.parametrize("error", [1e-4, 1e-3, 1e-2])
def test_a_prior_in_white_noise_gives_the_gaussian_posterior(error):
    log = log_of(3)
    fit = fitted(friction(), log, priors={"inertia": (0.022, error)})
    # The noise model is estimated: its long-run variance stands for σ², its error is 3 %.
    noise = fit.uncertainty.noise
    mean, spread = exact_posterior(log, 3, 0.022, error, noise.long_run_variance)
    known = [fit[name].standard_error for name in ("offset", "level", "viscosity", "inertia")]
    assert fit.part.coefficients == pytest.approx(mean, rel=1e-3)
    assert known == pytest.approx(spread, rel=0.1)
    truly, _ = exact_posterior(log, 3, 0.022, error, SIGMA**2)
    assert np.abs(fit.part.coefficients - truly).max() < 0.2 * spread.max()


@pytest.mark.parametrize("error", [1e-6, 1e-3, 0.02])
def test_a_prior_that_the_data_contradict_is_warned_of_with_what_they_say_alone(error):
    log = log_of(3)
    alone = fitted(friction(), log)["inertia"]
    away = alone.value + 20.0 * np.hypot(error, alone.standard_error)
    (said,) = fitted(friction(), log, priors={"inertia": (away, error)}).warnings
    assert said.startswith("the prior of inertia, ") and "contradicts the data" in said
    assert plus_minus(alone.value, alone.standard_error) in said
    apart = float(said.split(": ")[1].split(" standard errors")[0])
    assert apart == pytest.approx(20.0, rel=0.05)


@pytest.mark.parametrize("away", [-2.5, 0.0, 2.5])
def test_a_prior_within_three_standard_errors_of_the_data_is_not_warned_of(away):
    log = log_of(3)
    alone = fitted(friction(), log)["inertia"]
    value = alone.value + away * np.hypot(0.01, alone.standard_error)
    assert not fitted(friction(), log, priors={"inertia": (value, 0.01)}).warnings


def test_a_loose_prior_changes_nothing_and_a_tight_one_pins():
    log = log_of(1)
    plain = fitted(friction(), log)
    loose = fitted(friction(), log, priors={"inertia": (0.5, 1e4)})
    assert loose.part.coefficients == pytest.approx(plain.part.coefficients, rel=1e-6)
    assert loose["inertia"].standard_error == pytest.approx(
        plain["inertia"].standard_error, rel=1e-6
    )
    tight = fitted(friction(), log, priors={"inertia": (0.5, 1e-9)})
    pinned = fitted(friction(), log, fixed={**HELD, "inertia": 0.5})
    assert tight["inertia"].value == pytest.approx(0.5, abs=1e-8)
    assert tight["inertia"].standard_error == pytest.approx(1e-9, rel=1e-3)
    assert tight.part.coefficients == pytest.approx(pinned.part.coefficients, rel=1e-6)


def test_the_posterior_is_as_wide_as_both_say_where_rows_are_low_passed():
    generator = np.random.default_rng(8)
    noise = autoregressive(generator, 20_000, 0.98, 0.01)
    log = simulated(friction(), FRICTION, motion(2, 20_000), noise)
    own = fitted(friction(), log, lowpass=2.0)["inertia"]
    error = own.standard_error
    fit = fitted(friction(), log, lowpass=2.0, priors={"inertia": (own.value + error, error)})
    # Two witnesses of the same weight: halfway between, error / √2.
    assert fit["inertia"].value == pytest.approx(own.value + 0.5 * error, abs=0.15 * error)
    assert fit["inertia"].standard_error == pytest.approx(error / np.sqrt(2), rel=0.15)


def test_a_prior_and_a_bound_on_different_parameters_work_together():
    log = log_of(2)
    options = {"bounds": {"offset": (0.0, 1.0)}, "priors": {"inertia": (0.05, 1e-3)}}
    fit = fitted(friction(), log, **options)
    assert fit["offset"].state == "at lower bound"
    assert fit["inertia"].standard_error < 1e-3
    assert 0.02 < fit["inertia"].value < 0.05


# Shapes


def stribeck(width: float = WIDTH, speed: float = 0.1, level: float = 0.4):
    effects = [
        *friction(width),
        effect("stribeck_friction", direction_width=width, stribeck_velocity=speed),
    ]
    return effects, np.array([*FRICTION, level])


def plain(names):
    return [effect(name) for name in names]


STRIBECK = ("offset", "coulomb_friction", "viscous_friction", "inertia", "stribeck_friction")


@pytest.mark.parametrize("start", [0.0002, 0.005, 0.4])
def test_the_direction_width_is_found_from_far_away(start):
    noise = 0.01 * np.random.default_rng(0).normal(size=4000)
    log = simulated(friction(), FRICTION, motion(0, 4000), noise)
    fit = fitted(friction(start), log, fixed={})
    width = fit["direction_width"]
    assert width.state == "fitted"
    assert abs(width.value - WIDTH) < 4 * width.standard_error < 0.4 * WIDTH


@pytest.mark.parametrize("start", [0.002, 0.05, 8.0])
def test_the_stribeck_speed_is_found_from_far_away(start):
    effects, truth = stribeck(0.02, 0.3)
    noise = 0.01 * np.random.default_rng(1).normal(size=6000)
    log = simulated(effects, truth, motion(1, 6000), noise)
    begun = [*friction(), effect("stribeck_friction", stribeck_velocity=start)]
    fit = fitted(begun, log, fixed={"direction_width": 0.02})
    speed = fit["stribeck_velocity"]
    assert abs(speed.value - 0.3) < 4 * speed.standard_error < 0.3


@pytest.mark.parametrize(("width", "speed"), [(0.01, 0.2), (0.03, 1.0), (0.05, 0.4)])
def test_stribeck_speed_and_direction_width_are_found_together(width, speed):
    effects, truth = stribeck(width, speed)
    noise = 0.005 * np.random.default_rng(2).normal(size=8000)
    log = simulated(effects, truth, motion(2, 8000), noise)
    fit = fitted(plain(STRIBECK), log, fixed={})
    found = {name: fit[name] for name in ("direction_width", "stribeck_velocity")}
    assert abs(found["direction_width"].value - width) < 4 * found["direction_width"].standard_error
    assert abs(found["stribeck_velocity"].value - speed) < (
        4 * found["stribeck_velocity"].standard_error
    )
    # As good as the truth itself in the residual.
    at_truth = fitted(
        plain(STRIBECK), log, fixed={"direction_width": width, "stribeck_velocity": speed}
    )
    assert fit.rmse <= at_truth.rmse


def test_a_fixed_shape_is_not_searched():
    fit = fitted(friction(), log_of(), fixed={"direction_width": 0.2})
    assert fit["direction_width"].value == 0.2 and fit["direction_width"].state == "fixed"


def test_a_shape_keeps_within_its_bounds_even_if_it_starts_outside():
    for limits in ((0.1, 0.3), (None, 0.01)):
        fit = fitted(friction(), log_of(), fixed={}, bounds={"direction_width": limits})
        low, high = limits[0] or CATALOGUE["coulomb_friction"].shapes[0].lower, limits[1]
        assert low * (1 - 1e-9) <= fit["direction_width"].value <= high * (1 + 1e-9)
        assert "bound" in fit["direction_width"].state
        assert any("direction_width ended on its" in w for w in fit.warnings)


def test_a_shape_that_changes_nothing_keeps_its_value_and_is_not_determined():
    channels = motion(0)
    channels["output_velocity"] = 5.0 + np.sin(channels["time"])
    noise = 0.01 * np.random.default_rng(1).normal(size=2000)
    log = simulated(friction()[:3], FRICTION[:3], channels, noise)
    fit = fitted(["coulomb_friction", "viscous_friction"], log, fixed={})
    width = fit["direction_width"]
    assert width.value == pytest.approx(CATALOGUE["coulomb_friction"].shapes[0].default)
    assert width.state == "not determined" and not width.determined
    assert any("direction_width changes nothing" in w for w in fit.warnings)


def test_a_fit_without_any_noise_finds_the_truth():
    fit = fitted(friction(0.005), log_with(motion(0), clean_torque()), fixed={})
    assert fit.part.coefficients == pytest.approx(FRICTION, rel=1e-5)
    assert fit["direction_width"].value == pytest.approx(WIDTH, rel=1e-4)


def clean_torque():
    return rows_of(friction(), log_with(motion(0))) @ FRICTION
