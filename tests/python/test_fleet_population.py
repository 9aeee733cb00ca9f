"""Mean and spread of joints, their values given the fleet, and who stands out."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from flexspline.fleet.estimates import Scored
from flexspline.fleet.population import margin_of, population_of, run_to_run

Array = NDArray[np.float64]
MEAN, SPREAD = np.array([1.0, 2.0, 3.0]), np.array([0.2, 0.1, 0.0])
BETWEEN = np.array([[1.0, 0.6, 0.0], [0.6, 1.0, 0.0], [0.0, 0.0, 1.0]])
NOISE = np.array([[1.0, -0.5, 0.2], [-0.5, 1.0, 0.0], [0.2, 0.0, 1.0]])
FREEDOM = 20  # of an error


def scored(values: Array, covariance: Array, basis: Array | None = None) -> Scored:
    """An estimate that knows all, or the directions of a basis alone."""
    width = len(values)
    told = np.eye(width) if basis is None else basis
    hidden = 1.0 - np.einsum("pr,pr->p", told, told) > 1e-6
    core = told.T @ covariance @ told
    return Scored(
        values, told @ core @ told.T, told, told.T, core,
        np.full(width, float(FREEDOM)), ~hidden, 100, 1.0, np.eye(width), 30,
    )  # fmt: skip


def joints(
    count: int, rng: np.random.Generator, spread: Array = SPREAD
) -> tuple[Array, list[Scored]]:
    """True values (U, P) and estimates: some of short logs, errors as known as 20 blocks tell."""
    root = np.linalg.cholesky(BETWEEN) * 1.0
    truths = MEAN + (spread[:, None] * (root @ rng.standard_normal((3, count)))).T
    made = []
    for truth in truths:
        covariance = rng.choice([0.05, 0.1, 0.3]) ** 2 * NOISE
        seen = covariance * rng.chisquare(FREEDOM) / FREEDOM
        made.append(scored(rng.multivariate_normal(truth, covariance), seen))
    return truths, made


def test_equal_errors_give_the_values_of_the_textbook() -> None:
    """All variances v: μ is the mean, σ² + v the sample's variance, each value drawn by v/s²."""
    values = np.array([1.0, 2.0, 4.0, 5.0, 8.0])
    margin = margin_of(values, np.full(5, 0.5))
    assert margin.mean == pytest.approx(4.0)
    assert margin.spread**2 == pytest.approx(np.var(values, ddof=1) - 0.5, rel=1e-6)
    assert margin.mean_error == pytest.approx(np.sqrt(np.var(values, ddof=1) / 5), rel=1e-6)
    low, high = margin.spread_interval
    assert low < margin.spread < high < 8.0


def test_exact_values_have_the_sample_s_spread_and_are_kept() -> None:
    values = np.array([1.0, 2.0, 4.0])
    margin = margin_of(values, np.zeros(3))
    assert margin.spread == pytest.approx(np.std(values, ddof=1), rel=1e-4)
    units = [scored(np.array([v]), np.zeros((1, 1))) for v in values]
    made = population_of(units)
    drawn = [made.shrunken(unit).values[0] for unit in units]
    np.testing.assert_allclose(drawn, values, rtol=1e-6)


def test_two_joints_are_no_population() -> None:
    margin = margin_of(np.array([1.0, 2.0]), np.ones(2))
    assert np.isnan(margin.mean) and np.isnan(margin.spread) and margin.units == 2


@pytest.mark.parametrize("count", [8, 30])
def test_mean_spread_and_values_are_covered_and_drawn_values_are_nearer(count: int) -> None:
    """Of 120 fleets 94 % shows as 88 at least (three standard errors)."""
    means, spreads, inside, squares = [], [], [], []
    for seed in range(120):
        truths, units = joints(count, np.random.default_rng([count, seed]))
        made = population_of(units)
        ends = np.array([m.mean_interval for m in made.margins])
        means.append((ends[:, 0] <= MEAN) & (ends[:, 1] >= MEAN))
        ends = np.array([m.spread_interval for m in made.margins])
        spreads.append((ends[:, 0] <= SPREAD) & (ends[:, 1] >= SPREAD))
        for u, (truth, unit) in enumerate(zip(truths, units, strict=True)):
            drawn = made.shrunken(unit, bool(made.outlying[u].any()))
            inside.append(np.abs(drawn.values - truth) < 1.96 * drawn.errors)
            squares.append([(v - truth) ** 2 for v in (drawn.values, unit.values, made.mean)])
    assert np.all(np.mean(means, axis=0) > 0.88), np.mean(means, axis=0)
    assert np.all(np.mean(spreads, axis=0) > 0.88), np.mean(spreads, axis=0)
    assert np.all(np.mean(inside, axis=0) > 0.88), np.mean(inside, axis=0)
    drawn, separate, pooled = np.sqrt(np.mean(squares, axis=0))
    assert np.all(drawn[:2] < 0.85 * separate[:2])  # some know themselves, others do not
    assert np.all(drawn[:2] < pooled[:2])
    assert drawn[2] < 0.4 * separate[2]  # all joints are alike in it


def test_few_fleets_of_like_joints_have_one_that_stands_out() -> None:
    """At a false discovery rate of 5 % one such fleet in twenty has a false one."""
    false = [
        bool(population_of(joints(12, np.random.default_rng([5, seed]))[1]).outlying.any())
        for seed in range(150)
    ]
    assert np.mean(false) < 0.09, np.mean(false)


def test_joints_that_are_off_are_found_though_they_hide_each_other() -> None:
    found, false, spreads = 0, 0, []
    for seed in range(30):
        rng = np.random.default_rng([6, seed])
        _, units = joints(30, rng)
        sizes = [unit.errors[0] for unit in units]
        off = np.argsort(sizes)[:3]  # of long logs: these are told
        for u in off:
            units[u] = scored(units[u].values + np.array([1.4, 0.0, 0.0]), units[u].covariance)
        made = population_of(units)
        found += int(made.outlying[off, 0].sum())
        false += int(made.outlying.sum()) - int(made.outlying[off, 0].sum())
        spreads.append(made.margins[0].spread)
        kept = made.shrunken(units[off[0]], stands_out=True)
        assert np.array_equal(kept.values, units[off[0]].values)
    assert 0.15 < np.median(spreads) < 0.25  # 0.46 with them
    assert found > 0.85 * 90 and false < 0.08 * (found + false), (found, false)


def test_correlations_are_found_and_of_few_joints_drawn_to_zero() -> None:
    many = population_of(joints(150, np.random.default_rng(7))[1]).correlation[0, 1]
    assert 0.35 < many < 0.85
    few = [
        population_of(joints(4, np.random.default_rng([8, k]))[1]).correlation[0, 1]
        for k in range(40)
    ]
    assert abs(float(np.mean(few))) < 0.4


def test_a_joint_that_does_not_tell_a_parameter_has_the_fleet_s() -> None:
    """What it tells of others, and how these are correlated, still counts."""
    rng = np.random.default_rng(9)
    spread = np.array([0.2, 0.1, 0.1])
    _, units = joints(80, rng, spread)
    blind = scored(
        np.array([1.4, 0.0, 3.0]), 1e-4 * np.eye(3), np.array([[1.0, 0, 0], [0, 0, 1.0]]).T
    )
    made = population_of([*units, blind])
    assert blind.determined.tolist() == [True, False, True]
    assert np.isnan(made.p[-1, 1]) and np.isfinite(made.p[-1, 0])
    drawn = made.shrunken(blind)
    rho = made.correlation[0, 1]
    wanted = made.mean[1] + rho * made.margins[1].shrinking / made.margins[0].shrinking * (
        1.4 - made.mean[0]
    )
    assert drawn.values[1] == pytest.approx(wanted, abs=0.02)
    left = made.margins[1].shrinking * np.sqrt(1.0 - rho**2)  # less what correlation tells
    assert drawn.errors[1] == pytest.approx(left, rel=0.05)
    assert drawn.values[0] == pytest.approx(1.4, abs=0.01)  # its own error


def test_a_joint_that_tells_nothing_is_known_by_the_spread_and_by_the_error_of_the_mean() -> None:
    units = [scored(np.array([v]), 1e-8 * np.eye(1)) for v in (1.0, 2.0, 4.0, 5.0)]
    made = population_of(units)
    blind = scored(np.array([9.0]), np.eye(1), np.empty((1, 0)))
    drawn, (margin,) = made.shrunken(blind), made.margins
    assert drawn.values == pytest.approx([margin.mean])
    assert drawn.errors == pytest.approx([np.hypot(margin.shrinking, margin.mean_error)])


def test_what_differs_from_run_to_run_is_told_from_noise() -> None:
    rng = np.random.default_rng(10)
    omega, noise = 0.3, 0.1
    groups = []
    for _ in range(25):
        base = rng.normal(5.0, 1.0)
        runs = [
            scored(np.array([base + rng.normal(0, omega) + rng.normal(0, noise)]),
                   np.array([[noise**2]]))
            for _ in range(4)
        ]  # fmt: skip
        groups.append(runs)
    told = np.sqrt(run_to_run(groups)[0])  # by 75 degrees of freedom: to 9 %, three times that
    assert told == pytest.approx(omega, rel=0.27)
    still = [[scored(np.array([rng.normal(5.0, noise)]), np.array([[noise**2]])) for _ in range(4)]
             for _ in range(25)]  # fmt: skip
    assert np.sqrt(run_to_run(still)[0]) < 0.07
    assert np.isnan(run_to_run([[runs[0]] for runs in groups])[0])
