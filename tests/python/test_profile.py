"""Profiles and regions of parameters: against squares by hand, open ends, parts, coverage."""

from __future__ import annotations

import warnings
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from figure_layout import figure_faults
from fit_logs import (
    FRICTION,
    HELD,
    WIDTH,
    autoregressive,
    chosen,
    friction,
    motion,
    rows_of,
    simulated,
)
from matplotlib.figure import Figure
from scipy.stats import binom, chi2
from scipy.stats import f as fisher
from scipy.stats import t as student

import flexspline
from flexspline import FitOptions, InputError, effect
from flexspline.fitting import fit_near
from flexspline.formatting import short
from flexspline.least_squares.problem import problem_of
from flexspline.logs.log import Log

VELOCITY = "stribeck_friction.stribeck_velocity"
NAMES = ["offset", "coulomb_friction", "viscous_friction", "stribeck_friction"]


def with_stribeck(velocity: float) -> list[flexspline.Effect]:
    width = {"direction_width": WIDTH}
    return chosen(
        "offset",
        effect("coulomb_friction", **width),
        "viscous_friction",
        effect("stribeck_friction", stribeck_velocity=velocity, **width),
    )


def log_of(seed: int, *, velocity=0.1, level=0.4, speed=0.8, innovation=0.015, rows=1500) -> Log:
    noise = autoregressive(np.random.default_rng(seed), rows, 0.9, innovation)
    coefficients = [0.1, 0.3, 0.15, level]
    channels = motion(seed, rows, speed=speed)
    return simulated(with_stribeck(velocity), coefficients, channels, noise, f"run {seed}")


def weak(seed: int) -> Log:
    """Friction that fades at 0.3 rad/s, in runs that leave room for other explanations."""
    return log_of(seed, velocity=0.3, level=0.25, speed=1.0, innovation=0.02)


def fitted(log: Log, effects=NAMES, **more) -> flexspline.Fit:
    return flexspline.fit(effects, log, "sensor_torque", checks=False, **{"fixed": HELD, **more})


@cache
def plain() -> flexspline.Fit:
    return fitted(log_of(1))


@cache
def straight() -> flexspline.Fit:
    """Without a shape to fit: squares are a parabola."""
    noise = autoregressive(np.random.default_rng(3), 1500)
    log = simulated(friction(), FRICTION, motion(3, 1500), noise)
    return fitted(log, friction())


def squares(log: Log, velocity: float) -> float:
    """Of what the best coefficients leave with this velocity, by hand."""
    rows, y = rows_of(with_stribeck(velocity), log), log["sensor_torque"]
    return float(np.sum((y - rows @ np.linalg.lstsq(rows, y, rcond=None)[0]) ** 2))


def statistic(fit: flexspline.Fit, log: Log, velocity: float) -> float:
    """D by hand, with the slope of the prediction by a difference."""
    best = fit[VELOCITY].value
    rows = rows_of(with_stribeck(best), log)
    ends = [rows_of(with_stribeck(best * (1 + s)), log) for s in (-1e-4, 1e-4)]
    slope = (ends[1] - ends[0]) @ fit.part.coefficients / (2e-4 * best)
    tangent = np.column_stack([rows, slope])
    white = np.linalg.inv(tangent.T @ tangent)[-1, -1]
    more = squares(log, velocity) - squares(log, best)
    return more * white / fit[VELOCITY].standard_error ** 2


def test_the_profile_is_what_the_squares_by_hand_are():
    made = plain().profile("stribeck_velocity")
    by_hand = [statistic(plain(), log_of(1), v) for v in made.values]
    assert made.statistic == pytest.approx(by_hand, rel=2e-3, abs=2e-3)
    assert made.values[made.statistic.argmin()] == plain()[VELOCITY].value


def test_at_its_ends_the_profile_is_at_the_limit_and_is_not_symmetric():
    made, best = plain().profile(VELOCITY, points=0), plain()[VELOCITY]
    freedom = best.degrees_of_freedom
    assert made.limit == pytest.approx(student.ppf(0.975, freedom) ** 2)
    assert made.closed and made.parts == (made.interval,)
    for end in made.interval:
        assert statistic(plain(), log_of(1), end) == pytest.approx(made.limit, rel=0.01)
    below, above = best.value - made.interval[0], made.interval[1] - best.value
    assert abs(below - above) > 0.02 * best.standard_error
    assert made.wald == pytest.approx(best.interval)


def test_a_higher_level_is_wider():
    narrow, wide = (plain().profile(VELOCITY, level).interval for level in (0.68, 0.99))
    assert wide[0] < narrow[0] < narrow[1] < wide[1]


@pytest.mark.parametrize("name", ["offset", "coulomb_friction.level", "inertia"])
def test_where_squares_are_a_parabola_the_profile_is_walds(name):
    made = straight().profile(name)
    own = straight()[name]
    assert made.interval == pytest.approx(own.interval, abs=2e-3 * own.stderr)
    away = (made.values - made.value) / own.stderr
    assert made.statistic == pytest.approx(away**2, rel=1e-3, abs=1e-6)


def test_where_squares_are_a_parabola_the_region_is_walds_ellipse():
    names = ["coulomb_friction.level", "viscous_friction.viscosity"]
    made = straight().contour(*names, points=12)
    covariance = straight().covariance_frame().loc[names, names].to_numpy()
    away = made.points - made.values
    distance = np.einsum("ki,ij,kj->k", away, np.linalg.inv(covariance), away)
    freedom = min(straight()[name].degrees_of_freedom for name in names)
    assert made.closed and distance == pytest.approx(2 * fisher.ppf(0.95, 2, freedom), rel=5e-3)
    assert "both together" in str(made)


def test_a_prior_is_part_of_the_squares():
    noise = autoregressive(np.random.default_rng(3), 1500)
    log = simulated(friction(), FRICTION, motion(3, 1500), noise)
    fit = fitted(log, friction(), priors={"viscous_friction": (0.15, 0.01)})
    made, own = fit.profile("viscous_friction", points=5), fit["viscous_friction"]
    scale = made.statistic[0] / (made.values[0] - own.value) ** 2
    parabola = scale * (made.values - own.value) ** 2
    assert made.statistic == pytest.approx(parabola, rel=1e-6, abs=1e-9)
    assert made.interval == pytest.approx(own.interval, abs=2e-3 * own.stderr)


def test_a_region_holds_the_estimate_and_its_edge_is_at_the_limit():
    made = plain().contour(VELOCITY, "stribeck_friction.level", points=8)
    assert made.closed and len(made.to_frame()) == 8
    low, high = made.points.min(axis=0), made.points.max(axis=0)
    assert (low < made.values).all() and (made.values < high).all()
    alone = plain().profile(VELOCITY, points=0).interval
    assert low[0] < alone[0] and alone[1] < high[0]  # both together need more room


@pytest.mark.parametrize(("noise", "open_sides"), [(0.05, ["above"]), (0.1, ["below", "above"])])
def test_what_the_runs_leave_open_has_no_end_and_says_so(noise, open_sides):
    """The joint is hardly ever slow, and its noise is large."""
    fast = log_of(2, speed=8.0, velocity=0.05, level=0.3, innovation=noise, rows=1000)
    fit = fitted(fast, bounds={"stribeck_velocity": (0.02, 1.0)})
    made = fit.profile(VELOCITY)
    assert [side for side, end in zip(("below", "above"), made.interval, strict=True)
            if end is None] == open_sides  # fmt: skip
    assert not made.closed and "without an end rad/s" not in str(made)
    for side, bound in (("below", "0.02"), ("above", "1")):
        said = f"It has no end {side}: these runs allow everything to the bound {bound} rad/s."
        assert (said in str(made)) == (side in open_sides)
    region = fit.contour(VELOCITY, "stribeck_friction.level", points=8)
    assert not region.closed and np.isnan(region.points).any()
    assert "It does not close" in str(region)
    assert figure_faults(made.plot()) == figure_faults(region.plot()) == []


def test_another_valley_that_explains_as_much_is_part_of_the_interval():
    log = weak(1)
    fit = fitted(log)
    made = fit.profile(VELOCITY)
    assert len(made.parts) == 2 and str(made).count(" or ") == 1
    assert "and do not tell which of 2 parts is right." in str(made)
    (low, between), (again, high) = made.parts
    assert made.interval == (low, high)
    both = " or ".join(f"{short(a, 4)} to {short(b, 4)} rad/s" for a, b in made.parts)
    assert f"by its profile {both} (95 %)" in str(made) and both in repr(made)
    inside = np.sqrt(again * high)
    assert statistic(fit, log, inside) < made.limit < statistic(fit, log, np.sqrt(between * again))


def test_outliers_that_are_weighed_down_stay_so():
    fit = fitted(log_of(1), options=FitOptions(robust="huber"))
    made = fit.profile(VELOCITY, points=0)
    assert made.closed and made.interval[0] < fit[VELOCITY].value < made.interval[1]


def test_what_has_no_profile_says_why():
    fit = fitted(log_of(1), bounds={"viscous_friction": (0.5, None)})
    for name, sentence in (
        ("direction_width", "direction_width is fixed"),
        ("viscous_friction", "viscous_friction.viscosity is at lower bound"),
        ("no_such", "no parameter 'no_such'"),
    ):
        with pytest.raises(InputError, match=sentence):
            fit.profile(name)
    twice = fitted(log_of(1), [*NAMES, "coulomb_friction_per_direction"])
    with pytest.raises(InputError, match="level is not determined"):
        twice.profile("coulomb_friction.level")
    with pytest.raises(InputError, match="needs a second parameter"):
        plain().contour("offset", "offset.offset")
    with pytest.raises(InputError, match="4 at least"):
        plain().contour("offset", VELOCITY, points=3)
    with pytest.raises(InputError, match="not between 0 and 1"):
        plain().profile(VELOCITY, 95)


def test_runs_whose_noise_leaves_no_degrees_of_freedom_are_told_so():
    """As short runs in noise of a long memory may: there the fit has no interval."""
    nothing = {"interval": (np.nan, np.nan), "degrees_of_freedom": -9.9}
    fit = replace(plain(), parameters=tuple(replace(p, **nothing) for p in plain().parameters))
    with pytest.raises(InputError, match="no degrees of freedom; record longer runs"):
        fit.profile(VELOCITY)
    assert "nan" not in fit.summary() and "nan" not in str(fit.params)


def test_a_fit_by_generalised_least_squares_has_none():
    effects, options = friction(), {"known_load": None, "lowpass_hz": None, "threads": 1}
    noise = autoregressive(np.random.default_rng(0), 3000, 0.98)
    log = simulated(effects, FRICTION, motion(0, 3000), noise)
    problem = problem_of([log], effects, "sensor_torque", **options)
    made = fit_near(problem, effects, HELD, {}, None, general=True)
    assert made.generalised
    with pytest.raises(InputError, match="generalised least squares has no profiles"):
        made.profile("inertia")


def test_a_region_says_by_how_few_degrees_of_freedom_it_is_so_wide() -> None:
    """Of 2.8 degrees of freedom 4.6 standard errors: a region wider than two Wald intervals."""
    region = replace(plain().contour(VELOCITY, "stribeck_friction.level", points=6), freedom=2.8)
    assert "by F with 2.8 degrees of freedom, so that it reaches 4.6 standard errors" in str(region)
    assert "degrees of freedom" not in str(replace(region, freedom=1e4))
    assert "by F" in region.plot().axes[0].get_legend().get_texts()[0].get_text()


def test_figures_have_units_and_the_limit():
    profile = plain().profile(VELOCITY)
    region = plain().contour(VELOCITY, "stribeck_friction.level", points=6)
    for made, label in ((profile, "[rad/s]"), (region, "[rad/s]")):
        figure = made.plot()
        assert isinstance(figure, Figure)
        assert label in figure.axes[0].get_xlabel() and "[" in figure.axes[0].get_ylabel()
    assert list(profile.to_frame().columns) == ["value", "statistic"]


def test_the_95_percent_profile_covers_the_truth_as_often_as_that():
    """More draws, beside Wald's interval: tests/bench/profile_coverage.py."""
    draws = 40
    inside, at_truth = 0, []
    for seed in range(draws):
        log = log_of(100 + seed)
        fit = fitted(log)
        made = fit.profile(VELOCITY, points=0)
        inside += any((a or 0.0) <= 0.1 <= (b or np.inf) for a, b in made.parts)
        at_truth.append(statistic(fit, log, 0.1))
    assert binom.ppf(0.001, draws, 0.95) <= inside
    # D, which the profile is (see above), is χ² with one degree of freedom at the truth: errors
    # two thirds as long, or half as long again, fail
    low, high = chi2.interval(0.99, draws)
    assert low <= sum(at_truth) <= high


def test_a_profile_of_a_coefficient_of_thousands_warns_of_no_overflow():
    """Coordinates far from an estimate are thousands, whose exponential no double holds."""
    log = log_of(0)
    large = log.with_columns({"sensor_torque": 1e6 * log["sensor_torque"]}, note="in µNm")
    fit = flexspline.fit(NAMES[:3], large, "sensor_torque", fixed={"direction_width": WIDTH})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        low, high = fit.profile("offset").interval
    assert low < fit["offset"].value < high
