"""What joints have in common: mean and spread of each parameter, and what a joint's own log adds.

The estimate of joint u has errors of known covariance V_u, and joints differ:

    β_u = μ + b_u + e_u,     b_u ~ N(0, Σ),   e_u ~ N(0, V_u)

Mean and spread are those of each parameter by itself, by restricted maximum likelihood (REML): its
margin, β_uk ~ N(μ_k, σ_k² + v_uk), is what a table says of it, holds whatever the correlations are,
and can be judged with few joints:

    −2 ℓ(σ²) = Σ ln d_u + ln Σ 1/d_u + Σ (β_u − μ)²/d_u,   d_u = σ² + v_u
    μ = Σ (β_u/d_u) / Σ 1/d_u

The error of μ is that of [HartungKnapp2001] and no smaller than 1/√(Σ 1/d_u), with U − 1 degrees of
freedom; the interval of σ is where −2 ℓ rises by the 95 % point of χ² with one.

Variances v are estimates as well, of ν degrees of freedom. One that is too small by chance would
have too much weight, and many would make joints differ that are alike; v ν/(ν − 2), the variance of
Student's t, takes its place.

Correlations of b are those of pairs of parameters, each maximising the likelihood of its pair with
means and spreads as they are (composite likelihood [Varin2011]), times (1 − ρ²): of few
joints they are shrunk towards zero. Σ is the nearest matrix with these that is a covariance.

The value of a joint given fleet and log is the mean of b_u given β_u (BLUP [Robinson1991]): a long
log keeps its own value, a short one is shrunk towards the fleet's mean by as much as it does not
know. With γ = F β what the log determines (`estimates.py`), and C its covariance,

    β̃_u = μ + K (γ_u − F μ),     K = Σ Fᵀ (F Σ Fᵀ + C)⁻¹
    cov = (I − K F) Σ + (I − K F) cov(μ) (I − K F)ᵀ

The spread of few joints may come out as zero, and all would be one value without an error. Here it
is where ℓ(σ²) + ln σ² is largest, which never is zero, and tends to the other with many joints
([MorrisTang2011]: the shrinkage then is that of its posterior mean).

A joint stands out in a parameter where its value is improbable given the others: mean and spread
are those without it, the difference over its predictive error is Student's t with the degrees of
freedom that both variances leave ([Satterthwaite1946]), and the share of false ones among those
told is held at 5 % over all joints and parameters [BenjaminiHochberg1995]. Those told are taken out
and the others tested again, since several hide each other (of ten joints and more it begins without
those that are far from the median); the population is that of the others.

Between runs of one joint parameters differ as well (temperature, mounting). Their variance ω² is
that of each parameter within joints, by REML; where no joint has two runs, nobody knows it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, minimize_scalar
from scipy.stats import chi2
from scipy.stats import t as student

from flexspline.fleet.estimates import Scored

__all__ = ["FALSE_SHARE", "LEAST_UNITS", "Margin", "Population", "Shrunken", "margin_of",
           "population_of", "run_to_run"]  # fmt: skip

Array = NDArray[np.float64]

FALSE_SHARE = 0.05
"""Of the joints said to stand out, in the long run: half of it finds fewer, twice of it more."""
LEAST_UNITS = 3
"""Joints from which a spread has two degrees of freedom; its interval then says how little that
is."""
LEVEL = 0.95
LEAST = 1e-100  # a variance: its inverse and the squares of that are numbers
ROUNDS = 200
STANDS = 1e-9
AT_ONCE = 256  # joints that are left out, each with all others in a row
TOGETHER = 2000  # joints: one of 1500 moves p by 0.002 at most, and by less the more there are
MANY = 10  # joints, of which the median deviation is a scale
FAR = 3.5  # standard deviations: where the first round begins, not where it ends
PATIENCE = 10  # rounds of taking out those that stand out


@dataclass(frozen=True)
class Margin:
    """Mean and spread of one parameter over U joints.

    `mean_error`: with U − 1 degrees of freedom. `spread`: standard deviation between joints, and
    the interval of it. `shrinking`: the spread by which values are shrunk towards the mean.
    `units`: U.
    """

    mean: float
    mean_error: float
    mean_interval: tuple[float, float]
    spread: float
    spread_interval: tuple[float, float]
    shrinking: float
    units: int


@dataclass(frozen=True, eq=False)
class Shrunken:
    """Values of a joint given its log and the fleet, (P,), and their covariance."""

    values: Array
    covariance: Array

    @property
    def errors(self) -> Array:
        """Standard errors, (P,)."""
        return np.asarray(np.sqrt(np.maximum(np.diag(self.covariance), 0.0)))


@dataclass(frozen=True, eq=False)
class Population:
    """What joints have in common.

    Parameters
    ----------
    margins : of each parameter, P of them; NaN in one that fewer than three joints determine.
    correlation : (P, P), of the joints' true values.
    outlying : (U, P), where a joint stands out.
    p : (U, P), of the test for that; NaN where a joint does not determine the parameter.
    expected : (U, P), the mean of the others; `expected_error` : of a joint's value around it.
    """

    margins: tuple[Margin, ...]
    correlation: Array
    outlying: NDArray[np.bool_]
    p: Array
    expected: Array
    expected_error: Array

    @property
    def mean(self) -> Array:
        """(P,)"""
        return np.array([margin.mean for margin in self.margins])

    @property
    def spread(self) -> Array:
        """(P,)"""
        return np.array([margin.spread for margin in self.margins])

    @property
    def covariance(self) -> Array:
        """(P, P), Σ by which values are shrunk towards the mean."""
        shrinking = np.array([margin.shrinking for margin in self.margins])
        return np.asarray(self.correlation * np.outer(shrinking, shrinking))

    def shrunken(self, scored: Scored, stands_out: bool = False) -> Shrunken:
        """Return the values of a joint given its log and the fleet.

        A joint that stands out is none of this population: its own values are kept. So are those of
        a parameter that fewer than three joints determine.
        """
        known = np.isfinite(self.mean) & np.isfinite(self.spread)
        if stands_out or not known.all():
            errors = np.where(scored.determined, np.diag(scored.covariance), np.nan)
            covariance = scored.covariance.copy()
            np.fill_diagonal(covariance, errors)
            return Shrunken(scored.values.copy(), covariance)
        reading, sigma = scored.reading, self.covariance
        through = reading @ sigma
        gain = np.linalg.lstsq(through @ reading.T + scored.core, through, rcond=1e-13)[0].T
        left = np.eye(len(sigma)) - gain @ reading
        values = self.mean + gain @ (reading @ (scored.values - self.mean))
        error = np.array([margin.mean_error for margin in self.margins])
        of_mean = self.correlation * np.outer(error, error)
        covariance = left @ sigma @ left.T + gain @ scored.core @ gain.T + left @ of_mean @ left.T
        return Shrunken(values, covariance)


def population_of(units: Sequence[Scored]) -> Population:
    """Return what joints have in common, at least three of them."""
    values = np.array([unit.values for unit in units])
    errors = np.array([unit.errors for unit in units])
    freedom = np.array([unit.degrees_of_freedom for unit in units])
    told = np.isfinite(errors)
    each, squared = range(values.shape[1]), errors**2 * _loose(freedom)
    outlying = np.column_stack([_far(values[:, k], squared[:, k], told[:, k]) for k in each])
    for _ in range(PATIENCE):
        regular = told & ~outlying
        tested = [
            _left_out(
                values[:, k],
                errors[:, k] ** 2,
                squared[:, k],
                freedom[:, k],
                told[:, k],
                regular[:, k],
            )
            for k in each
        ]
        p, mean, spread = (np.column_stack([one[i] for one in tested]) for i in range(3))
        found = _discovered(p)
        if (found == outlying).all():
            break
        outlying = found
    regular = told & ~outlying
    margins = tuple(margin_of(values[regular[:, k], k], squared[regular[:, k], k]) for k in each)
    correlation = _correlation(units, regular, margins)
    return Population(margins, correlation, outlying, p, mean, spread)


def margin_of(values: Array, variances: Array) -> Margin:
    """Return mean and spread of one parameter: values (U,) and their variances (U,)."""
    count = len(values)
    if count < LEAST_UNITS:
        nothing = (np.nan, np.nan)
        return Margin(np.nan, np.nan, nothing, np.nan, nothing, np.nan, count)
    squared = float(_reml(values[None], variances[None], np.ones((1, count), dtype=bool))[0])
    weights = 1.0 / _positive(squared + variances)
    mean = float(weights @ values / weights.sum())
    scatter = float(weights @ (values - mean) ** 2) / (count - 1)
    error = float(np.sqrt(max(scatter, 1.0) / weights.sum()))
    half = float(student.ppf(0.5 + 0.5 * LEVEL, count - 1)) * error
    ends = _profile(values, variances, squared)
    shrinking = _shrinking(values, variances)
    interval = (mean - half, mean + half)
    return Margin(mean, error, interval, float(np.sqrt(squared)), ends, shrinking, count)


def run_to_run(joints: Sequence[Sequence[Scored]]) -> Array:
    """Return the variance of each parameter between runs of one joint, (P,); NaN where unknown.

    Parameters
    ----------
    joints : the runs of each joint, each by itself.
    """
    width = len(joints[0][0].values)
    made = np.full(width, np.nan)
    for k in range(width):
        groups = []
        for runs in joints:
            told = [run for run in runs if run.determined[k]]
            if len(told) > 1:
                groups.append((np.array([run.values[k] for run in told]),
                               np.array([run.errors[k] ** 2 for run in told])))  # fmt: skip
        if groups:
            made[k] = _within(groups)
    return made


def _within(groups: Sequence[tuple[Array, Array]]) -> float:
    """ω² by REML over groups of (values, variances)."""

    def cost(squared: float) -> float:
        total = 0.0
        for values, variances in groups:
            weights = 1.0 / _positive(squared + variances)
            mean = weights @ values / weights.sum()
            total += float(weights @ (values - mean) ** 2 - np.log(weights).sum())
            total += float(np.log(weights.sum()))
        return total

    most = max(float(np.ptp(values)) ** 2 for values, _ in groups)
    return _least(cost, most)


def _least(cost: Callable[[float], float], most: float) -> float:
    """The variance from zero to a few times `most` at which a cost is least."""
    if not most > 0.0:
        return 0.0
    found = minimize_scalar(
        lambda logarithm: cost(float(np.exp(logarithm))),
        bounds=(np.log(most) - 30.0, np.log(most) + 3.0),
        method="bounded",
    )
    squared = float(np.exp(found.x))
    return squared if cost(squared) < cost(0.0) else 0.0


def _reml(values: Array, variances: Array, chosen: NDArray[np.bool_]) -> Array:
    """σ² of each row, (R,), of the values (R, U) that are chosen.

    σ² ← Σ w² ((β − μ)² + 1/Σw − v) / Σ w², zero at least [Viechtbauer2005].
    """
    counts = chosen.sum(axis=1)
    mean = np.sum(np.where(chosen, values, 0.0), axis=1) / counts
    scatter = np.sum(np.where(chosen, (values - mean[:, None]) ** 2, 0.0), axis=1) / (counts - 1)
    squared = np.maximum(scatter - np.sum(np.where(chosen, variances, 0.0), axis=1) / counts, 0.0)
    squared = np.maximum(squared, 0.01 * scatter)
    for _ in range(ROUNDS):
        weights = np.where(chosen, 1.0 / _positive(squared[:, None] + variances), 0.0)
        total = weights.sum(axis=1)
        mean = np.sum(weights * np.where(chosen, values, 0.0), axis=1) / total
        off = np.where(chosen, (values - mean[:, None]) ** 2 - variances, 0.0)
        squares = weights**2
        new = np.sum(squares * (off + 1.0 / total[:, None]), axis=1) / squares.sum(axis=1)
        new = np.maximum(new, 0.0)
        moved = np.abs(new - squared) > STANDS * np.maximum(scatter, np.finfo(float).tiny)
        squared = new
        if not moved.any():
            break
    return np.asarray(squared)


def _loose(freedom: Array) -> Array:
    """ν/(ν − 2), two at most: by how much a value is further off than a variance of ν says."""
    return np.asarray(np.where(freedom > 4.0, freedom / np.maximum(freedom - 2.0, 2.0), 2.0))


def _positive(variances: Array) -> Array:
    return np.maximum(variances, LEAST)


def _information(weights: Array) -> Array:
    """tr(P²), P = W − w wᵀ / Σ w, of each row (R, U): half of it is the information of σ²."""
    total = weights.sum(axis=1)
    squares, cubes = np.sum(weights**2, axis=1), np.sum(weights**3, axis=1)
    return _positive(squares - 2.0 * cubes / total + (squares / total) ** 2)


def _cost(squared: float, values: Array, variances: Array) -> float:
    """−2 ℓ(σ²)."""
    weights = 1.0 / _positive(squared + variances)
    mean = weights @ values / weights.sum()
    rest = weights @ (values - mean) ** 2
    return float(rest - np.log(weights).sum() + np.log(weights.sum()))


def _shrinking(values: Array, variances: Array) -> float:
    """The spread at which ℓ(σ²) + ln σ² is largest."""
    scale = float(np.var(values)) + float(np.mean(variances))
    if not scale > 0.0:
        return 0.0
    found = minimize_scalar(
        lambda logarithm: _cost(np.exp(logarithm), values, variances) - 2.0 * logarithm,
        bounds=(np.log(scale) - 20.0, np.log(scale) + 5.0),
        method="bounded",
    )
    return float(np.exp(0.5 * found.x))


def _profile(values: Array, variances: Array, best: float) -> tuple[float, float]:
    """Ends of the interval of the spread σ."""
    limit = _cost(best, values, variances) + float(chi2.ppf(LEVEL, 1))
    scale = max(best, float(np.mean(variances)), float(np.var(values)))
    if not scale > 0.0:
        return 0.0, 0.0

    def beyond(squared: float) -> float:
        return _cost(squared, values, variances) - limit

    high = max(best, 1e-6 * scale)
    while beyond(high) < 0.0 and high < 1e12 * scale:
        high *= 2.0
    upper = float(brentq(beyond, best, high, xtol=1e-12 * scale, rtol=1e-8))
    least = 1e-12 * scale if (variances <= 0.0).any() else 0.0
    if best <= 0.0 or beyond(least) <= 0.0:
        return 0.0, float(np.sqrt(upper))
    lower = float(brentq(beyond, least, best, xtol=1e-12 * scale, rtol=1e-8))
    return float(np.sqrt(lower)), float(np.sqrt(upper))


def _left_out(
    values: Array, own: Array, variances: Array, freedom: Array, told: NDArray[np.bool_],
    regular: NDArray[np.bool_],
) -> tuple[Array, Array, Array]:  # fmt: skip
    """Of each joint given the others that are regular: p, their mean, its predictive error; (U,).

    `own`: variance of each as it was estimated; `variances`: as the others' weights take it. NaN
    where the joint does not determine the parameter or too few others do.
    """
    p, mean, error = (np.full(len(values), np.nan) for _ in range(3))
    step = AT_ONCE if regular.sum() <= TOGETHER else len(values)
    for first in range(0, len(values), step):
        rows = np.arange(first, min(first + step, len(values)))
        asked = told[rows] & (regular.sum() - regular[rows] >= LEAST_UNITS - 1)
        rows = rows[asked]
        if not len(rows):
            continue
        middle, spread, loose = _of_others(values, variances, regular, rows)
        total = _positive(spread + own[rows])
        known = 2.0 * total**2 / _positive(loose + 2.0 * own[rows] ** 2 / freedom[rows])
        mean[rows], error[rows] = middle, np.sqrt(total)
        off = np.abs(values[rows] - middle) / error[rows]
        p[rows] = 2.0 * student.sf(off, np.clip(known, 1.0, 1e6))
    return p, mean, error


def _of_others(
    values: Array, variances: Array, regular: NDArray[np.bool_], rows: NDArray[np.intp]
) -> tuple[Array, Array, Array]:
    """Of the regular joints but each of `rows` (R,): mean, σ² and the mean's variance, σ²'s own.

    Among very many one more or less does not change σ²: they are taken together once.
    """
    if regular.sum() > TOGETHER:
        some = np.flatnonzero(regular)
        kept = (values[None, some], variances[None, some], np.ones((1, len(some)), dtype=bool))
        squared = float(_reml(*kept)[0])
        weights = np.where(regular, 1.0 / _positive(squared + variances), 0.0)
        own = weights[rows]
        total = weights.sum() - own
        middle = (weights @ np.where(regular, values, 0.0) - own * values[rows]) / total
        loose = 2.0 / _information(weights[None, some])
        return middle, squared + 1.0 / total, np.broadcast_to(loose, middle.shape)
    chosen = np.repeat(regular[None, :], len(rows), axis=0)
    chosen[np.arange(len(rows)), rows] = False
    each = _reml(values[None], variances[None], chosen)
    weights = np.where(chosen, 1.0 / _positive(each[:, None] + variances), 0.0)
    total = weights.sum(axis=1)
    middle = np.sum(weights * np.where(chosen, values, 0.0), axis=1) / total
    return middle, each + 1.0 / total, 2.0 / _information(weights)


def _far(values: Array, variances: Array, told: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Joints (U,) that are far from the median of many, by a spread that these do not move.

    It is the s² at which half of the joints are within ⅔ of √(s² + v), as of normal values.
    """
    if told.sum() < MANY:
        return np.zeros(len(values), dtype=bool)
    off = (values - np.median(values[told])) ** 2
    noise = _positive(np.where(told, variances, np.inf))

    def beyond(squared: float) -> float:
        return float(np.median(off[told] / (squared + noise[told]))) - float(chi2.ppf(0.5, 1))

    most = float(np.max(off[told])) / float(chi2.ppf(0.5, 1)) + np.finfo(float).tiny
    squared = 0.0 if beyond(0.0) <= 0.0 else float(brentq(beyond, 0.0, 2.0 * most))
    return np.asarray(told & (off > FAR**2 * (squared + noise)))


def _discovered(p: Array) -> NDArray[np.bool_]:
    """Which of the tests (U, P) are told, at most `FALSE_SHARE` of them false ones."""
    known = np.isfinite(p)
    ranked = np.sort(p[known])
    below = np.flatnonzero(ranked <= FALSE_SHARE * np.arange(1, len(ranked) + 1) / len(ranked))
    limit = ranked[below[-1]] if len(below) else -1.0
    return np.asarray(known & (np.where(known, p, 1.0) <= limit))


def _correlation(
    units: Sequence[Scored], regular: NDArray[np.bool_], margins: Sequence[Margin]
) -> Array:
    width = len(margins)
    made = np.eye(width)
    for j, k in combinations(range(width), 2):
        pair = [u for u in range(len(units)) if regular[u, j] and regular[u, k]]
        if len(pair) > LEAST_UNITS and margins[j].spread > 0.0 and margins[k].spread > 0.0:
            made[j, k] = made[k, j] = _of_pair([units[u] for u in pair], (j, k), margins)
    powers, axes = np.linalg.eigh(made)
    if powers[0] < 1e-6:
        near = (axes * np.maximum(powers, 1e-6)) @ axes.T
        size = np.sqrt(np.diag(near))
        made = near / np.outer(size, size)
    return made


def _of_pair(units: Sequence[Scored], pair: tuple[int, int], margins: Sequence[Margin]) -> float:
    """ρ of two parameters."""
    one, other = (margins[k] for k in pair)
    off = np.array([unit.values[list(pair)] for unit in units]) - [one.mean, other.mean]
    noise = np.array([unit.covariance[np.ix_(pair, pair)] for unit in units])
    a = one.spread**2 + noise[:, 0, 0]
    b = other.spread**2 + noise[:, 1, 1]

    def cost(rho: float) -> float:
        c = rho * one.spread * other.spread + noise[:, 0, 1]
        determinant = np.maximum(a * b - c**2, 1e-12 * a * b)
        square = b * off[:, 0] ** 2 - 2.0 * c * off[:, 0] * off[:, 1] + a * off[:, 1] ** 2
        prior = -2.0 * np.log1p(-(rho**2))
        return float(np.sum(np.log(determinant) + square / determinant) + prior)

    return float(minimize_scalar(cost, bounds=(-0.99, 0.99), method="bounded").x)
