"""Parameters of a fit by name, their covariance, likelihood, AIC and BIC, and the summary."""

from __future__ import annotations

import pickle
import re
from functools import cache

import numpy as np
import pytest
import report_fits
from fit_logs import FRICTION, HELD, fitted, friction, log_with, motion, rows_of, run_of, simulated
from output_error_logs import EFFECTS, law, runs
from scipy.linalg import toeplitz
from scipy.signal import lfilter
from scipy.stats import binom, multivariate_normal

import flexspline
from flexspline import FitOptions, InputError, MotionOptions
from flexspline.formatting import apart, plus_minus
from flexspline.least_squares.result import Fit
from flexspline.logs.log import Log
from flexspline.output_error.fitting import with_servo_torque
from flexspline.report.text import parameter_lines

FITS = {
    "plain": report_fits.plain_fit,
    "confounded": report_fits.confounded_fit,
    "constrained": report_fits.constrained_fit,
    "useless": report_fits.useless_fit,
}


def log_of(seed: int, samples: int = 700, phi: float = 0.9, shift: float = 0.0) -> Log:
    return run_of(seed, samples, phi, shift)


@cache
def of_the_motion() -> Fit:
    options = MotionOptions(starts=1)
    known = {"gravity.cosine": 0.0}
    given = [with_servo_torque(log, law(), "motor_torque") for log in runs()[:2]]
    return flexspline.fit_motion(EFFECTS, given, "motor_torque", fixed=known, options=options)


# By name


@pytest.mark.parametrize("name", FITS)
def test_the_mapping_holds_the_parameters_of_the_fit_in_their_order(name):
    fit = FITS[name]()
    assert list(fit.params) == [p.name for p in fit.parameters] == list(fit.to_frame().index)
    assert all(fit.params[p.name] is p for p in fit.parameters)
    assert len(fit.params) == len(fit.parameters)


@pytest.mark.parametrize("name", FITS)
def test_each_name_that_the_fit_prints_is_one_of_the_mapping(name):
    fit = FITS[name]()
    printed = [line.name for line in parameter_lines(fit) if not line.name.startswith("order ")]
    assert printed and all(one in fit.params for one in printed)


def test_a_name_that_may_be_two_or_none_is_refused_in_words():
    params = report_fits.plain_fit().params
    with pytest.raises(InputError, match="did you mean 'viscous_friction"):
        params["viscous_frictoin"]
    assert "viscous_frictoin" not in params and "temperature_drift" not in params
    assert params.get("temperature_drift") is None and 3 not in params


def test_bounds_are_those_that_were_given_and_shapes_have_those_of_the_catalogue():
    fit = fitted(
        friction(),
        log_of(1),
        fixed={},
        bounds={"inertia": (0.0, None), "direction_width": (0.01, 0.2)},
    )
    assert fit.params["inertia"].bounds == (0.0, None)
    assert fit.params["direction_width"].bounds == (0.01, 0.2)
    assert fit.params["offset"].bounds is None
    width = report_fits.plain_fit().params["direction_width"]
    (info,) = flexspline.effect("coulomb_friction").info.shapes
    assert width.bounds == (info.lower, info.upper)


@pytest.mark.parametrize("name", FITS)
def test_an_interval_at_95_percent_is_the_fits_own_and_a_higher_level_is_wider(name):
    for p in FITS[name]().parameters:
        if np.isfinite(p.stderr):
            assert p.ci() == p.interval
            ends = np.array([p.ci(level) for level in (0.5, 0.9, 0.99)])
            assert (np.diff(ends[:, 0]) < 0).all() and (np.diff(ends[:, 1]) > 0).all()


def test_what_is_fixed_at_a_bound_or_not_determined_has_no_error_of_its_own():
    fit = report_fits.constrained_fit()
    held = [fit.params[name] for name in ("direction_width", "viscous_friction")]
    assert [p.fixed for p in held] == [True, False]
    hidden = [p for p in report_fits.confounded_fit().parameters if not p.determined]
    assert len(hidden) == 3
    for p in [*held, *hidden]:
        assert np.isnan([p.stderr, *p.ci()]).all()
    assert not re.search(r"\d", str(hidden[0]))


@pytest.mark.parametrize("level", [0.0, 1.0, 95.0, float("nan")])
def test_a_level_that_is_no_share_is_refused(level):
    with pytest.raises(InputError, match="not between 0 and 1"):
        report_fits.plain_fit().params["offset"].ci(level)


def test_intervals_of_a_fit_of_the_motion_keep_their_logarithm():
    fit = of_the_motion()
    for p in fit.parameters:
        if np.isfinite(p.stderr):
            assert p.ci() == pytest.approx(p.interval, rel=1e-9)
    assert any(p.logarithmic for p in fit.parameters)
    assert fit.params["gravity.sine"].bounds is None and "inertia" in str(fit.params)


# Covariance


@pytest.mark.parametrize("name", FITS)
def test_covariance_and_correlation_go_by_name_and_are_nan_where_there_is_no_error(name):
    fit = FITS[name]()
    errors = np.array([p.stderr for p in fit.parameters])
    covariance, correlation = fit.covariance_frame(), fit.correlation_frame()
    assert list(covariance.index) == list(covariance.columns) == list(fit.params)
    assert np.sqrt(np.diag(covariance)) == pytest.approx(errors, rel=1e-9, nan_ok=True)
    unknown = np.isnan(errors)
    assert (np.isnan(covariance) == (unknown[:, None] | unknown)).all(axis=None)
    known = correlation.loc[~unknown, ~unknown].to_numpy()
    assert np.diag(known) == pytest.approx(1.0) and known == pytest.approx(known.T)
    assert (np.abs(known) <= 1.0 + 1e-9).all()


def test_the_covariance_of_two_parameters_is_that_of_their_scatter():
    draws = [fitted(friction(), log_of(seed)) for seed in range(80)]
    names = ["coulomb_friction.level", "viscous_friction.viscosity"]
    scatter = np.corrcoef([[fit.params[name].value for fit in draws] for name in names])[0, 1]
    told = np.mean([fit.correlation_frame().loc[names[0], names[1]] for fit in draws])
    assert abs(scatter - told) < 4 * (1 - told**2) / np.sqrt(80)


def test_offsets_taken_out_of_many_runs_have_their_error_and_no_made_up_covariance():
    logs = [log_of(seed, 300) for seed in range(16)]
    frame = fitted(friction(), logs, options=FitOptions(offset_per_run=True)).covariance_frame()
    assert frame.loc["offset.run 3", "offset.run 3"] > 0.0
    assert np.isnan(frame.loc["offset.run 3", "inertia.inertia"])


# Likelihood


def twice_by_hand(fit: Fit, blocks: list[tuple[np.ndarray, np.ndarray]], prior=None) -> float:
    """−2 ln L at its maximum, by the whole covariance of each block of rows and target."""
    noise = fit.uncertainty.noise
    width = blocks[0][0].shape[1]
    known, pull = (np.zeros((width, width)), np.zeros(width)) if prior is None else prior
    whitened, logarithms = [], 0.0
    for rows, y in blocks:
        # e = A⁻¹ w from far before the first row: its autocovariance by the impulse response
        pulse = lfilter([1.0], noise.denominator, np.eye(1, 20_000)[0])
        covariance = toeplitz([pulse[: len(pulse) - k] @ pulse[k:] for k in range(len(y))])
        lower = np.linalg.cholesky(covariance)
        whitened.append(np.linalg.solve(lower, np.column_stack([rows, y])))
        logarithms += 2.0 * np.log(np.diag(lower)).sum()
    both = np.concatenate(whitened)
    rows, y = both[:, :-1], both[:, -1]
    best = np.linalg.solve(rows.T @ rows + known, rows.T @ y + pull)
    left = float(np.sum((y - rows @ best) ** 2))
    return len(y) * (np.log(2.0 * np.pi * left / len(y)) + 1.0) + logarithms


def test_the_likelihood_is_that_of_the_whole_covariance_over_runs_and_gaps():
    logs = [log_of(1, 500), log_of(2, 300), log_of(3, 400)]
    keep = np.r_[0:150, 180:400]
    gap = {name: logs[2][name][keep] for name in logs[2].channels}
    logs[2] = Log.from_arrays(facts={"name": "gap"}, **gap)
    fit = fitted(friction(), logs)
    assert fit.uncertainty.noise.order >= 1
    blocks = [(rows_of(friction(), log), log["sensor_torque"]) for log in logs]
    last = blocks.pop()
    blocks += [(last[0][:150], last[1][:150]), (last[0][150:], last[1][150:])]
    found = fit.likelihood
    assert -2.0 * found.log_likelihood == pytest.approx(twice_by_hand(fit, blocks), rel=1e-9)
    assert found.rows == 500 + 300 + 370
    assert found.parameters == pytest.approx(4 + fit.uncertainty.noise.order + 1)
    assert fit.aic == pytest.approx(-2.0 * found.log_likelihood + 2.0 * found.parameters)
    penalty = found.parameters * np.log(found.rows)
    assert fit.bic == pytest.approx(-2.0 * found.log_likelihood + penalty)


def test_aic_is_minus_twice_the_log_density_of_scipy_and_two_for_each_parameter():
    log = log_of(1, 500)
    fit = fitted(friction(), log)
    noise, rows, y = fit.uncertainty.noise, rows_of(friction(), log), log["sensor_torque"]
    pulse = lfilter([1.0], noise.denominator, np.eye(1, 20_000)[0])
    shape = toeplitz([pulse[: len(pulse) - k] @ pulse[k:] for k in range(len(y))])
    inverse = np.linalg.inv(shape)
    best = np.linalg.solve(rows.T @ inverse @ rows, rows.T @ inverse @ y)
    left = y - rows @ best
    variance = float(left @ inverse @ left) / len(y)
    density = multivariate_normal(rows @ best, variance * shape).logpdf(y)
    parameters = 4 + noise.order + 1  # coefficients, those of the noise, and its variance
    assert fit.aic == pytest.approx(-2.0 * density + 2.0 * parameters, rel=1e-6)
    assert fit.bic == pytest.approx(-2.0 * density + parameters * np.log(500), rel=1e-6)


def test_the_likelihood_counts_a_prior_as_part_of_a_parameter():
    log, error = log_of(5), 0.002
    fit = fitted(friction(), log, priors={"coulomb_friction": (0.301, error)})
    noise = fit.uncertainty.noise
    known, pull = np.zeros((4, 4)), np.zeros(4)
    known[1, 1] = noise.innovation_variance / error**2
    pull[1] = 0.301 * known[1, 1]
    by_hand = twice_by_hand(fit, [(rows_of(friction(), log), log["sensor_torque"])], (known, pull))
    assert -2.0 * fit.likelihood.log_likelihood == pytest.approx(by_hand, rel=1e-9)
    assert 3.0 < fit.likelihood.parameters - noise.order - 1 < 4.0


def test_the_likelihood_has_an_offset_of_each_run_that_is_taken_out():
    logs = [log_of(seed, 200, shift=0.1 * seed) for seed in range(16)]
    fit = fitted(friction(), logs, options=FitOptions(offset_per_run=True))
    assert fit.solved.tangent.problem.centred
    blocks = []
    for k, log in enumerate(logs):
        own = np.zeros((len(log), 16))
        own[:, k] = 1.0
        blocks.append((np.hstack([rows_of(friction(), log)[:, 1:], own]), log["sensor_torque"]))
    found = fit.likelihood
    assert -2.0 * found.log_likelihood == pytest.approx(twice_by_hand(fit, blocks), rel=1e-9)
    assert found.parameters == pytest.approx(3 + 16 + fit.uncertainty.noise.order + 1)


def test_a_direction_that_no_row_tells_is_no_parameter():
    """Offset and Coulomb friction are the sum and the difference of friction per direction."""
    whole = fitted(friction(), log_of(1))
    twice = fitted([*friction(), "coulomb_friction_per_direction"], log_of(1))
    assert len(twice.parameters) == len(whole.parameters) + 2 and twice.confounded
    assert twice.likelihood.parameters == pytest.approx(whole.likelihood.parameters)
    assert twice.aic == pytest.approx(whole.aic, rel=1e-9)


def test_an_effect_that_is_not_there_wins_by_aic_as_seldom_as_chance_allows():
    """Twice the gain in ln L is χ² with one degree of freedom, above 2 in 15.7 % of all cases."""
    won, apart, draws = 0, [], 120
    for seed in range(draws):
        log = log_of(seed, 600, phi=0.95)
        channels = {name: log[name] for name in log.channels}
        warm = 25.0 + 3.0 * np.sin(0.7 * log["time"])
        odd = log_with(channels, temperature=warm)
        held = {**HELD, "temperature_drift.quadratic": 0.0}
        small = fitted(friction(), odd)
        large = fitted([*friction(), "temperature_drift"], odd, fixed=held)
        same = small.uncertainty.noise.order == large.uncertainty.noise.order
        won += large.aic < small.aic if same else 0
        apart += [large.aic - small.aic] if same else []
    assert len(apart) > draws / 2
    low, high = binom.interval(0.999, draws, 0.157)
    assert low <= won <= high + 0.03 * draws  # φ is estimated too
    # 2 − χ² has the mean 1 and the variance 2; φ is that of each fit's own residual, 0.2 of it
    assert abs(np.mean(apart) - 1.0) <= 3.3 * np.sqrt(2.0 / len(apart)) + 0.2


def test_an_effect_that_is_there_wins_by_aic_and_bic():
    small, large = fitted(friction()[:2], log_of(1)), fitted(friction(), log_of(1))
    assert large.aic < small.aic - 10 and large.bic < small.bic - 10


def test_rows_without_noise_are_infinitely_likely():
    exact = simulated(friction(), FRICTION, motion(1), 0.0)
    assert fitted(friction(), exact).aic < -1e4


def test_what_has_no_likelihood_says_why():
    robust = fitted(friction(), log_of(1), options=FitOptions(robust="huber"))
    with pytest.raises(InputError, match="robust weights are no Gaussian noise"):
        _ = robust.aic
    with pytest.raises(InputError, match="fit of the motion"):
        _ = of_the_motion().bic
    assert "No AIC or BIC: robust weights" in robust.summary()
    assert "least squares of the simulated motion" in of_the_motion().summary()


@pytest.mark.parametrize("lowpass", [None, 10.0])
def test_a_fit_that_was_pickled_has_the_likelihood_that_it_had(lowpass):
    fit = fitted(friction(), log_of(1, 1500), lowpass=lowpass)
    again = pickle.loads(pickle.dumps(fit))
    assert again.aic == fit.aic
    assert (fit.likelihood.rows < 700) == (lowpass is not None)


# As text


@pytest.mark.parametrize("name", FITS)
def test_table_and_summary_have_the_numbers_that_the_fit_prints(name):
    fit = FITS[name]()
    table, summary = str(fit.params), fit.summary()
    assert repr(summary) == summary and "\n" in summary  # in a cell, as it reads
    for line in parameter_lines(fit):
        if line.name not in fit.params:
            continue
        (row,) = [r for r in table.splitlines() if r.startswith(f"{line.name}  ")]
        (other,) = [r for r in summary.splitlines() if r.startswith(f"{line.name}  ")]
        assert line.value in row
        if fit.params[line.name].determined:
            assert [cell for cell in apart(line.value) if cell not in other.split()] == []
    held_out = re.search(r"held-out rows: (\S+ \S+) RMSE", str(fit))
    assert held_out and f"RMSE held out          {held_out[1]}" in summary
    assert max(map(len, [*table.splitlines(), *summary.splitlines()])) <= 160  # with long names
    assert "below" not in table or "known: " in table


@pytest.mark.parametrize("name", FITS)
def test_a_notebook_shows_every_parameter(name):
    fit = FITS[name]()
    page = fit.params._repr_html_()
    assert page.count("<tr>") == len(fit.parameters) + 1 and "script" not in page


@pytest.mark.parametrize(
    ("value", "error", "cells"),
    [
        (0.30246, 0.0022, ("0.3025", "0.0022")),
        (12345.6, 230.0, ("1.235·10⁴", "0.023·10⁴")),
        (0.5, float("nan"), ("0.5", "–")),
    ],
)
def test_value_and_error_that_were_rounded_together_come_apart(value, error, cells):
    assert apart(plus_minus(value, error)) == cells
