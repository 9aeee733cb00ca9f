"""Laws of the errors under autocorrelated noise, and whether 95 % intervals cover the truth.

Coverage: 1000 logs, so a true 95 % shows as 95 ± 0.69 % (binomial); the promise of 93–97 % is
±2.9 of that per parameter. The full table comes from tests/bench/coverage.py.
"""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import toeplitz
from scipy.signal import lfilter

from flexspline.errors import InputError
from flexspline.least_squares import noise_model as noise_models
from flexspline.least_squares.noise_model import (
    Chunk,
    Chunks,
    NoiseModel,
    _collect,
    _contradicted,
    _expected_products,
    _iterate,
    _solve,
    lagged_products,
    noise_model,
)
from flexspline.least_squares.uncertainty import (
    Prior,
    Uncertainty,
    _Sums,
    parameter_uncertainty,
)

_study = Path(__file__).parents[1] / "bench" / "coverage.py"
_spec = importlib.util.spec_from_file_location("coverage_study", _study)
assert _spec is not None and _spec.loader is not None
coverage = importlib.util.module_from_spec(_spec)
sys.modules["coverage_study"] = coverage
_spec.loader.exec_module(coverage)

LOGS = 1000


@pytest.mark.parametrize(
    "case",
    [
        coverage.Case("AR(1), one run", coverage.AR1, terms=7),
        coverage.Case("AR(1), four runs", coverage.AR1, terms=10, runs=4),
        coverage.Case("AR(2), one run", coverage.AR2_SWINGING, terms=10),
        coverage.Case("AR(2), four runs", coverage.AR2_SLOW, terms=7, runs=4),
    ],
    ids=lambda case: case.name,
)
def test_of_1000_logs_93_to_97_percent_of_the_intervals_cover_every_parameter(case):
    result = coverage.study(case, LOGS, seed=2024)
    assert (result.ours >= 0.93).all() and (result.ours <= 0.97).all(), result.ours
    assert (result.naive < 0.90).all(), result.naive
    if case.noise != coverage.AR2_SWINGING:
        assert (result.naive < 0.65).all(), result.naive
    assert result.too_short == 0.0


@pytest.mark.parametrize("samples", [150, 200])
def test_in_runs_too_short_for_their_noise_the_intervals_are_wide_and_the_result_says_so(samples):
    result = coverage.study(coverage.Case("short", coverage.AR1, samples=samples), 60, seed=3)
    assert result.ours.min() > 0.93
    assert result.too_short > 0.95


def test_the_length_that_is_asked_for_is_beyond_what_failed_and_not_far_beyond_what_held():
    """Intervals covered 93–97 % with 15 pieces of news beyond one per parameter, more with 6."""
    rows, residual = problem()
    made = solve(rows, residual)
    news = made.shortest_length / made.noise.memory - made.noise.parameters
    assert 15.0 < news < 30.0


def test_white_noise_is_not_spoilt():
    result = coverage.study(coverage.Case("white", coverage.WHITE, terms=7), 200, seed=4)
    four_sigma = 4 * np.sqrt(0.95 * 0.05 / 200)
    assert (np.abs(result.ours - 0.95) < four_sigma).all()


def problem(samples: int = 600, terms: int = 5, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Rows (n, P) with memory and an offset, and the residual of AR(2) noise about them."""
    generator = np.random.default_rng(seed)
    rows = lfilter([1.0], [1.0, -0.98], generator.normal(size=(samples, terms)), axis=0)
    rows[:, 0] = 1.0
    noise = lfilter([1.0], [1.0, -1.2, 0.3], generator.normal(size=samples + 200))[200:]
    return rows, noise - rows @ np.linalg.lstsq(rows, noise, rcond=None)[0]


def cut(rows, residual, starts=(0,), length=None, weights=None) -> Chunks:
    """The problem as an iterator factory with chunks of `length` rows."""
    marks = np.zeros(len(residual), bool)
    marks[list(starts)] = True
    length = length or len(residual)

    def chunks() -> Iterator[Chunk]:
        for first in range(0, len(residual), length):
            part = slice(first, first + length)
            given = None if weights is None else weights[part]
            yield Chunk(rows[part], residual[part], marks[part], given)

    return chunks


def orthonormal(rows: np.ndarray) -> np.ndarray:
    return np.linalg.inv(np.linalg.qr(rows, mode="r"))


def solve(rows, residual, **options) -> Uncertainty:
    basis, chunks = orthonormal(rows), cut(rows, residual, **options)
    return parameter_uncertainty(chunks, basis, noise_model(chunks, basis))


def given_noise(phi: list[float], **changes) -> NoiseModel:
    values = {
        "coefficients": np.array(phi),
        "innovation_variance": 0.7,
        "coefficient_covariance": np.eye(len(phi)) * 1e-3,
        "samples": 60,
        "parameters": 3,
        "decimation": 1,
    }
    return NoiseModel(**{**values, **changes})


def stationary_covariance(phi: list[float], variance: float, count: int) -> np.ndarray:
    """Ω of AR noise from its infinite moving average, cut where it is below 1e-16."""
    impulse = np.zeros(3000)
    impulse[0] = 1.0
    response = lfilter([1.0], np.append(1.0, -np.array(phi)), impulse)
    return variance * toeplitz([response[: 3000 - lag] @ response[lag:] for lag in range(count)])


@pytest.mark.parametrize("phi", [[], [0.9], [1.6, -0.8], [-0.5, 0.2, 0.1]])
def test_the_covariance_is_the_sandwich_with_the_dense_noise_matrix_of_each_run(phi):
    rows, residual = problem(60, 3)
    noise, inverse = given_noise(phi), np.linalg.inv(rows.T @ rows)
    omega = stationary_covariance(phi, noise.innovation_variance, 60)
    omega[:25, 25:] = omega[25:, :25] = 0.0
    chunks = cut(rows, residual, starts=(0, 25), length=17)
    result = parameter_uncertainty(chunks, orthonormal(rows), noise)
    expected = inverse @ rows.T @ omega @ rows @ inverse
    # the filter rings out to 1e-4 in amplitude, 1e-8 in what is squared
    np.testing.assert_allclose(result.covariance, expected, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(noise.variance, omega[0, 0], rtol=1e-9)


def test_the_degrees_of_freedom_follow_from_the_derivative_of_the_errors():
    rows, residual = problem(60, 3)
    phi, spread = np.array([1.2, -0.3]), np.array([[2e-3, -1e-3], [-1e-3, 2e-3]])
    basis, chunks = orthonormal(rows), cut(rows, residual, starts=(0, 30))

    def log_variances(at):
        noise = given_noise(list(at), coefficient_covariance=spread)
        result = parameter_uncertainty(chunks, basis, noise)
        return 2 * np.log(result.standard_errors), result.degrees_of_freedom

    steps = 1e-5 * np.eye(2)
    slopes = [(log_variances(phi + h)[0] - log_variances(phi - h)[0]) / 2e-5 for h in steps]
    uncertain = np.einsum("kj,kl,lj->j", slopes, spread, slopes)
    expected = 2.0 / (uncertain + 2.0 / (60 - 3))
    np.testing.assert_allclose(log_variances(phi)[1], expected, rtol=1e-3)


def test_lagged_products_are_sums_over_time():
    z, order = np.random.default_rng(1).normal(size=(40, 3)), 4
    products = lagged_products(z, order)
    for i in range(order + 1):
        for j in range(order + 1):
            expected = z[order - i : 40 - i].T @ z[order - j : 40 - j]
            np.testing.assert_allclose(products[i, j], expected, atol=1e-12)


@pytest.mark.parametrize("length", [1, 7, 100, 599])
def test_the_size_of_the_chunks_changes_nothing(length):
    rows, residual = problem()
    whole = solve(rows, residual, starts=(0, 250))
    parts = solve(rows, residual, starts=(0, 250), length=length)
    np.testing.assert_allclose(parts.covariance, whole.covariance, rtol=1e-7, atol=1e-14)
    np.testing.assert_allclose(parts.degrees_of_freedom, whole.degrees_of_freedom, rtol=1e-5)


def test_the_order_of_the_runs_changes_nothing():
    rows, residual = problem()
    turned = np.r_[200:600, 0:200]
    there = solve(rows, residual, starts=(0, 200))
    back = solve(rows[turned], residual[turned], starts=(0, 400))
    np.testing.assert_allclose(back.covariance, there.covariance, rtol=1e-7, atol=1e-14)


def test_errors_scale_with_the_units_of_the_columns_and_the_target():
    rows, residual = problem()
    scale = np.array([1.0, 1e6, 1e-6, 1e3, 1e-9])
    plain, scaled = solve(rows, residual), solve(rows * scale, 5.0 * residual)
    np.testing.assert_allclose(
        scaled.standard_errors * scale, 5.0 * plain.standard_errors, rtol=1e-6
    )
    np.testing.assert_allclose(scaled.degrees_of_freedom, plain.degrees_of_freedom, rtol=1e-5)


def test_confounded_columns_keep_the_error_of_what_is_known():
    rows, residual = problem()
    doubled = np.column_stack([rows, rows[:, 1]])
    _, sizes, right = np.linalg.svd(doubled, full_matrices=False)
    basis = (right[:-1] / sizes[:-1, None]).T
    chunks = cut(doubled, residual)
    result = parameter_uncertainty(chunks, basis, noise_model(chunks, basis))
    together = result.errors_of(np.array([[0.0, 1.0, 0.0, 0.0, 0.0, 1.0]]))
    np.testing.assert_allclose(together, solve(rows, residual).standard_errors[1], rtol=1e-5)


def test_a_parameter_outside_the_basis_has_no_error():
    rows, residual = problem()
    basis = np.vstack([orthonormal(rows[:, :4]), np.zeros(4)])
    chunks = cut(rows, residual)
    result = parameter_uncertainty(chunks, basis, noise_model(chunks, basis))
    assert np.isnan(result.standard_errors).tolist() == [False] * 4 + [True]


def test_a_strong_prior_gives_its_own_error():
    rows, residual = problem()
    weight, error = 1e6, 0.01
    prior = Prior(weight * np.eye(5)[1:2], np.array([weight * error]))
    basis, chunks = orthonormal(rows), cut(rows, residual)
    result = parameter_uncertainty(chunks, basis, noise_model(chunks, basis), prior)
    np.testing.assert_allclose(result.standard_errors[1], error, rtol=1e-6)


def test_a_floor_keeps_noise_that_was_smoothed_from_being_inverted():
    """A low pass leaves next to nothing that is new; with a floor that is not the scale."""
    rows, residual = problem(20_000, 5)
    smooth = np.convolve(residual, np.hanning(16) / np.hanning(16).sum(), mode="same")
    basis, chunks = orthonormal(rows), cut(rows, smooth)
    plain = noise_model(chunks, basis)
    floored = noise_model(chunks, basis, floor=0.01)
    mean_square = np.mean(smooth**2)
    assert plain.innovation_variance < 1e-4 * mean_square
    assert 0.01 * mean_square < floored.innovation_variance < 0.1 * mean_square
    np.testing.assert_allclose(floored.variance, 1.01 * mean_square, rtol=0.05)


def test_the_noise_found_is_the_noise_made():
    rows, residual = problem(200_000, 5)
    noise = solve(rows, residual, starts=(0, 90_000), length=30_000).noise
    error = np.sqrt(np.diag(noise.coefficient_covariance))
    made = np.append([1.2, -0.3], np.zeros(noise.order - 2))
    assert (np.abs(noise.coefficients - made) < 4 * error).all()
    assert abs(noise.innovation_variance - 1.0) < 4 * np.sqrt(2 / 200_000)


def test_every_third_chunk_tells_nearly_the_same_noise():
    rows, residual = problem(60_000, 5)
    basis, chunks = orthonormal(rows), cut(rows, residual, length=2_000)
    part, whole = noise_model(chunks, basis, every=3, max_order=2), noise_model(chunks, basis)
    assert part.samples == 10 * (2_000 - 2)
    np.testing.assert_allclose(part.long_run_variance, whole.long_run_variance, rtol=0.3)


def test_thinning_out_is_the_same_as_handing_over_every_third_row_of_each_run():
    rows, residual = problem()
    basis, kept = orthonormal(rows), np.r_[0:250:3, 250:600:3]
    chunks = cut(rows, residual, starts=(0, 250), length=70)
    thin = parameter_uncertainty(chunks, basis, noise_model(chunks, basis, decimation=3))
    chunks = cut(rows[kept], residual[kept], starts=(0, 84))
    few = parameter_uncertainty(chunks, basis, noise_model(chunks, basis))
    np.testing.assert_allclose(thin.covariance, few.covariance, rtol=1e-7, atol=1e-14)
    assert (thin.rows, thin.length) == (len(kept), 3 * len(kept))


def test_a_chunk_of_which_thinning_out_leaves_no_row_changes_nothing():
    rows, residual = problem()
    basis = orthonormal(rows)
    whole, short = (cut(rows, residual, length=length) for length in (600, 2))
    noise = noise_model(whole, basis, decimation=3)
    state = np.full((noise.order, 2), 7.0)
    left, same = noise.filter(np.empty((0, 2)), state)
    assert noise.order > 0 and left.shape == (0, 2) and (same == state).all()
    one, other = (parameter_uncertainty(chunks, basis, noise) for chunks in (whole, short))
    np.testing.assert_allclose(other.covariance, one.covariance, rtol=1e-9)


def test_slow_noise_under_white_noise_is_found_by_higher_orders():
    generator = np.random.default_rng(6)
    slow = lfilter([1.0], [1.0, -0.98], generator.normal(size=40_000)) * np.sqrt(1 - 0.98**2)
    residual = slow + 2.0 * generator.normal(size=40_000)
    rows = np.ones((40_000, 1))
    noise = solve(rows, residual - residual.mean()).noise
    assert noise.order > 8
    true = (1 + 0.98) / (1 - 0.98) + 4.0  # long-run variances of the two
    np.testing.assert_allclose(noise.long_run_variance, true, rtol=0.3)


def test_a_random_walk_is_called_too_short_and_stays_finite():
    rows, _ = problem()
    walk = np.cumsum(np.random.default_rng(5).normal(size=600))
    residual = walk - rows[:, :1] @ np.linalg.lstsq(rows[:, :1], walk, rcond=None)[0]
    result = solve(rows[:, :1], residual)
    assert result.noise.largest_root < 1.0 and np.isfinite(result.standard_errors).all()
    assert not result.reliable
    assert "record longer logs" in result.statement


def test_effective_samples_of_an_offset_are_those_of_the_mean():
    rows, residual = problem(100_000, 1)
    result = solve(rows, residual)
    np.testing.assert_allclose(result.effective_samples_of[0], result.effective_samples, rtol=0.05)
    assert result.reliable and result.statement.startswith("Intervals hold")


@pytest.mark.parametrize("coefficient", [-0.5, 0.5])
def test_more_effective_samples_than_samples_are_explained(coefficient):
    """The mean of what swings about it is better known than that of independent samples."""
    white = np.random.default_rng(2).normal(size=2_000)
    swinging = lfilter([1.0], [1.0, -coefficient], white)
    made = solve(np.ones((2_000, 1)), swinging - np.mean(swinging))
    assert (made.effective_samples > made.length) == (coefficient < 0)
    assert ("what swings averages out more" in made.statement) == (coefficient < 0)


def test_huber_weights_keep_outliers_from_widening_the_errors():
    rows, clean = problem(4_000, 3)
    pushed = clean.copy()
    pushed[::100] += 40.0
    threshold = 1.345 * np.median(np.abs(clean)) / 0.6745
    weights = np.minimum(1.0, threshold / np.abs(pushed))
    robust = solve(rows, pushed, weights=weights).standard_errors
    plain = solve(rows, clean).standard_errors
    assert (robust < 1.3 * plain).all() and (robust > 0.8 * plain).all()


@pytest.mark.parametrize(("samples", "spoilt"), [(20, False), (600, True)])
def test_a_residual_that_cannot_be_used_is_refused_in_a_sentence(samples, spoilt):
    rows, residual = problem(samples)
    if spoilt:
        residual[3] = np.nan
    with pytest.raises(InputError, match="too few" if not spoilt else "not finite"):
        solve(rows, residual)


def test_a_confidence_of_95_is_refused():
    with pytest.raises(InputError, match=r"0\.95"):
        solve(*problem()).intervals(np.zeros(5), confidence=95)


def test_below_one_degree_of_freedom_there_is_no_interval() -> None:
    """Student's t of a tenth of a degree once made an offset of -0.7 Nm "±3·10²⁸ Nm"."""
    found = solve(*problem())
    few = replace(found, degrees_of_freedom=np.array([0.1, 0.99, 1.0, 3.0, np.inf]))
    ends = few.intervals(np.zeros(5))
    assert np.isnan(ends[:2]).all()
    reach = ends[2:, 1] / few.standard_errors[2:]
    assert reach == pytest.approx([12.706, 3.182, 1.960], abs=1e-3)


def test_the_spread_of_the_noise_is_widened_by_what_the_terms_hide_of_it() -> None:
    """1 / (1 - r): r is the factor by which an iteration takes a coefficient to its fixed point."""
    rng = np.random.default_rng(7)
    rows = np.column_stack([np.cos(np.pi * k * (np.arange(400) + 0.5) / 400) for k in range(5)])
    rows /= np.linalg.norm(rows, axis=0)
    left = lfilter([1.0], [1.0, -0.9], rng.normal(size=400))
    left -= rows @ (rows.T @ left)
    starts = np.arange(400) == 0
    made = noise_model(lambda: iter([Chunk(rows, left, starts)]), np.eye(5), max_order=1)
    products, _ = _collect(lambda: iter([Chunk(rows, left, starts)]), np.eye(5), 1, 1, 1, False)
    degrees = 399 - 5
    phi, expected = _iterate(products, degrees)
    one, two = (_solve(_expected_products(phi + step, products, degrees)[0])
                for step in (1e-3, -1e-3))  # fmt: skip
    rate = float((one - two)[0]) / 2e-3
    assert 0.05 < rate < 0.9
    known = made.innovation_variance / expected[1, 1]
    assert made.coefficient_covariance[0, 0] == pytest.approx(known / (1.0 - rate), rel=0.1)


def test_smooth_noise_beside_smooth_terms_leaves_every_parameter_its_degrees_of_freedom() -> None:
    """A rig's target and rows behind one low pass: coefficients of the noise are one in thousands.

    Steps in one of them alone once made a covariance with negative eigenvalues, and a negative
    number of degrees of freedom, of which no interval can be made.
    """
    rng = np.random.default_rng(11)
    window = np.hanning(24) / np.hanning(24).sum()
    made = np.apply_along_axis(np.convolve, 0, rng.normal(size=(6000, 5)), window, mode="valid")
    rows, noise = made[:, :4], made[:, 4]
    residual = noise - rows @ np.linalg.lstsq(rows, noise, rcond=None)[0]
    found = solve(rows, residual)
    spread = found.noise.coefficient_covariance
    assert found.noise.order >= 8
    assert np.linalg.eigvalsh(spread)[0] > 0.0
    assert (found.degrees_of_freedom > 10.0).all() and (found.degrees_of_freedom < 6000.0).all()
    assert np.isfinite(found.intervals(np.zeros(4))).all()


@pytest.mark.parametrize("phi", [(0.9,), (1.6, -0.8), (1.2, -0.3, 0.05), (0.5, 0.2, 0.1, 0.05)])
def test_what_the_filters_add_behind_a_stretch_is_what_they_add_over_zeros(
    phi: tuple[float, ...],
) -> None:
    generator, order = np.random.default_rng(3), len(phi)
    noise = NoiseModel(np.array(phi), 1.0, np.eye(order), 1000, 3, 1)
    rows = generator.standard_normal((200, 3))
    basis = np.linalg.qr(generator.standard_normal((5, 3)))[0]
    closed, run_on = _Sums(basis, noise), _Sums(basis, noise)
    for sums in (closed, run_on):
        sums.add(rows, rows[:, 0], np.ones(200))
    closed.close()
    run_on._filter(np.zeros((4000, 3)))
    for name in ("meat", "powers", "slopes"):
        expected = getattr(run_on, name)
        assert np.allclose(
            getattr(closed, name), expected, rtol=0.0, atol=1e-13 * abs(expected).max()
        )


def test_noise_as_slow_as_may_be_costs_a_stretch_no_more() -> None:
    """Its filter rings for 10⁸ rows; that took minutes for each end of a run."""
    noise = NoiseModel(np.array([1.0 - 1e-7]), 1.0, np.eye(1), 1000, 3, 1)
    sums = _Sums(np.eye(1), noise)
    sums.add(np.ones((1, 1)), np.ones(1), np.ones(1))
    sums.close()
    assert sums.powers[0] == pytest.approx(0.5e7, rel=1e-6)  # 1 / (1 - φ²)


def reversing(samples: int = 6000) -> tuple[np.ndarray, np.ndarray]:
    """Rows (n, 4) of a joint that turns over every 2 s at 200 Hz, friction a step of the speed.

    And what 8 Nm of friction that takes their level over 4 mrad leaves of the rows, with white
    noise of 0.15 Nm.
    """
    time = np.arange(samples) / 200.0
    pace = 0.2 + 0.6 * time / time[-1]
    speed = pace * np.clip(4.0 * np.sin(0.5 * np.pi * time), -1.0, 1.0)
    bristle = np.zeros(samples)
    for i in range(1, samples):
        way = speed[i] / 200.0
        bristle[i] = bristle[i - 1] + way / 0.004 * (1.0 - bristle[i - 1] * np.sign(way))
    rows = np.column_stack([np.ones(samples), np.tanh(speed / 0.03), speed, np.gradient(speed)])
    torque = 8.0 * bristle + 0.15 * np.random.default_rng(4).normal(size=samples)
    return rows, torque - rows @ np.linalg.lstsq(rows, torque, rcond=None)[0]


def slow_noise(generator: np.random.Generator, samples: int, size: float) -> np.ndarray:
    """AR(1) with a root of 0.9988, at 200 Hz a memory of 8 s."""
    made = lfilter([1.0], [1.0, -0.9988], generator.normal(size=samples + 10_000))[10_000:]
    return size * np.sqrt(1.0 - 0.9988**2) * made


def test_friction_that_takes_its_level_over_some_way_is_not_called_noise() -> None:
    rows, residual = reversing()
    result = solve(rows, residual)
    assert np.sqrt(result.noise.variance) < 1.5 * residual.std()
    assert result.standard_errors[1] < 0.4 and (result.degrees_of_freedom > 10.0).all()


def test_noise_as_slow_as_that_which_is_there_widens_the_errors_as_before(monkeypatch) -> None:
    rows, _ = reversing()
    inverse = np.linalg.pinv(rows)
    for seed in range(10):
        generator = np.random.default_rng(seed)
        noise = slow_noise(generator, len(rows), 1.0) + 0.1 * generator.normal(size=len(rows))
        chunks = cut(rows, noise - rows @ (inverse @ noise))
        found = noise_model(chunks, orthonormal(rows))
        with monkeypatch.context() as before:
            before.setattr(noise_models, "_contradicted", lambda *_: False)
            same = noise_model(chunks, orthonormal(rows))
        np.testing.assert_array_equal(found.coefficients, same.coefficients)
        assert found.largest_root > 0.99


def test_slow_noise_under_misfit_is_still_counted() -> None:
    rows, misfit = reversing()
    inverse, covered = np.linalg.pinv(rows), []
    for seed in range(20):
        noise = slow_noise(np.random.default_rng(seed), len(rows), 0.6)
        off = inverse @ noise
        result = solve(rows, misfit + noise - rows @ off)
        low, high = result.intervals(off).T
        covered.append((low < 0.0) & (high > 0.0))
    assert np.mean(covered) > 0.85


@pytest.mark.parametrize(
    ("times", "samples", "contradicted"),
    [(1.0, 10_000, False), (0.5, 10_000, False), (1.5, 100, False), (1.5, 1000, True)],
)
def test_white_noise_is_contradicted_where_chernoff_says_so(times, samples, contradicted) -> None:
    """n/2 (1 − 1/R − log R) + P/2 log R at s = (1 − 1/R)/2: −3 for 100 rows, −35 for 1000."""
    residual = np.eye(3) * samples
    assert _contradicted(times * residual, residual, samples, 3) is contradicted
