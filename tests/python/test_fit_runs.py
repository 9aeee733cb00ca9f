"""Several runs, gaps, blocks, threads; low pass of target and rows; pushes and outliers."""

from __future__ import annotations

import dataclasses
import sys

import numpy as np
import pytest
from fit_logs import (
    FRICTION,
    WIDTH,
    chosen,
    fitted,
    friction,
    log_with,
    motion,
    rows_of,
    run_of,
    simulated,
)

from flexspline import FitOptions, effect
from flexspline.least_squares.estimate import huber_weights
from flexspline.least_squares.linear import fit_linear
from flexspline.least_squares.options import coefficient_names, constraints_of
from flexspline.least_squares.problem import problem_of
from flexspline.logs.derive import lowpass_log


def log_of(seed: int, samples: int = 2000, shift: float = 0.0):
    return run_of(seed, samples, shift=shift)


def posed(logs, effects, **options):
    options = {"known_load": None, "lowpass_hz": None, "threads": 1, **options}
    return problem_of(logs, effects, "sensor_torque", **options)


def solved(problem, effects, **options):
    nothing = constraints_of(coefficient_names(effects), {}, {}, {})
    return fit_linear(problem, effects, nothing, **options)


# Runs


def test_runs_of_unequal_length_are_one_least_squares_problem():
    logs = [log_of(1, 900), log_of(2, 2100), log_of(3, 1500)]
    rows = np.concatenate([rows_of(friction(), log) for log in logs])
    y = np.concatenate([log["sensor_torque"] for log in logs])
    best = np.linalg.lstsq(rows, y, rcond=None)[0]
    assert fitted(friction(), logs).part.coefficients == pytest.approx(best, rel=1e-10)


def test_the_order_of_the_runs_does_not_matter():
    logs = [log_of(seed, 1000 + 200 * seed) for seed in range(4)]
    forth, back = fitted(friction(), logs), fitted(friction(), logs[::-1])
    assert back.part.coefficients == pytest.approx(forth.part.coefficients, rel=1e-12)
    errors = [[p.standard_error for p in fit.parameters[:4]] for fit in (forth, back)]
    assert errors[0] == pytest.approx(errors[1], rel=1e-6)
    assert back.cv_rmse == pytest.approx(forth.cv_rmse, rel=1e-9)


def test_an_offset_for_each_run_is_found_and_the_model_keeps_their_mean():
    shifts = [0.0, 0.3, -0.2]
    logs = [log_of(seed, 2000, shift) for seed, shift in enumerate(shifts)]
    fit = fitted(friction(), logs, options=FitOptions(offset_per_run=True))
    for seed, shift in enumerate(shifts):
        offset = fit[f"offset.run {seed}"]
        assert abs(offset.value - (-0.12 + shift)) < 4 * offset.standard_error < 0.1
        assert offset.unit == "Nm"
    mean = np.mean([fit[f"offset.run {seed}"].value for seed in range(3)])
    assert fit.part.coefficients[0] == pytest.approx(mean)
    rows = np.concatenate([rows_of(friction(), log)[:, 1:] for log in logs])
    own = np.kron(np.eye(3), np.ones((2000, 1)))
    y = np.concatenate([log["sensor_torque"] for log in logs])
    best = np.linalg.lstsq(np.hstack([rows, own]), y, rcond=None)[0]
    values = [p.value for p in fit.parameters if p.kind == "coefficient"]
    assert values == pytest.approx(best, rel=1e-9)
    assert fitted(friction(), logs).rmse > 2 * fit.rmse


def test_runs_of_one_name_have_offsets_of_different_names():
    logs = [log_of(0), log_of(1)]
    logs = [log.with_facts({"name": "run"}) for log in logs]
    fit = fitted(friction(), logs, options=FitOptions(offset_per_run=True))
    names = [p.name for p in fit.parameters]
    assert "offset.run (1)" in names and "offset.run (2)" in names


def test_a_gap_in_time_only_separates_the_noise_on_its_two_sides():
    log = log_of(3, 3000)
    keep = np.ones(3000, dtype=bool)
    keep[1000:1400] = False
    gappy = log.rows(keep, note="400 rows lost")
    parts = [log.rows(slice(0, 1000), note="first"), log.rows(slice(1400, 3000), note="second")]
    one, two = fitted(friction(), gappy), fitted(friction(), parts)
    assert one.part.coefficients == pytest.approx(two.part.coefficients, rel=1e-12)
    for name in ("offset", "level", "viscosity", "inertia"):
        assert one[name].standard_error == pytest.approx(two[name].standard_error, rel=1e-9)


@pytest.mark.parametrize("rows", [1, 17, 500, 10_000])
def test_the_length_of_the_blocks_does_not_matter(rows):
    effects = [*friction(), effect("output_ripple", orders=[1, 2, 3])]
    problem = posed([log_of(1), log_of(2, 700)], effects)
    usual = solved(problem, effects).coefficients
    other = solved(dataclasses.replace(problem, block_rows=rows), effects).coefficients
    assert other == pytest.approx(usual, rel=1e-12)


@pytest.mark.parametrize("lowpass", [None, 5.0])
def test_the_length_of_the_pieces_that_the_errors_are_read_in_does_not_matter(lowpass, monkeypatch):
    logs = [log_of(1), log_of(2, 700)]
    whole = fitted(friction(), logs, lowpass=lowpass)
    monkeypatch.setattr(sys.modules["flexspline.least_squares.problem"], "CHUNK", 333)
    pieces = fitted(friction(), logs, lowpass=lowpass)
    assert [p.standard_error for p in pieces.parameters[:4]] == pytest.approx(
        [p.standard_error for p in whole.parameters[:4]], rel=1e-6
    )
    assert pieces.cv_rmse == pytest.approx(whole.cv_rmse, rel=1e-9)


@pytest.mark.parametrize("exact", [False, True])
def test_two_threads_give_the_bits_of_one(exact):
    effects = [*friction(), effect("output_ripple", orders=[1, 2, 3])]
    one, two = (
        solved(posed([log_of(1, 20_000), log_of(2)], effects, threads=n), effects, exact=exact)
        for n in (1, 2)
    )
    assert np.array_equal(one.coefficients, two.coefficients)
    assert one.squares == two.squares


def test_exact_sums_agree_with_plain_ones():
    effects = friction()
    problem = posed([log_of(1)], effects)
    plain, exact = (solved(problem, effects, exact=flag) for flag in (False, True))
    assert plain.coefficients == pytest.approx(exact.coefficients, rel=1e-11)
    assert plain.squares == pytest.approx(exact.squares, rel=1e-10)
    assert exact.exact and not plain.exact


# Low pass


def ripple_log(order: int, speed: float = 0.5, samples: int = 20_000):
    """Constant speed, so that an order is a frequency: order · speed / 2π Hz."""
    time = np.arange(samples) * 0.01
    channels = {
        "time": time,
        "output_position": speed * time,
        "output_velocity": np.full(samples, speed),
        "output_acceleration": np.zeros(samples),
    }
    effects = chosen("offset", effect("output_ripple", orders=[order]))
    noise = 0.02 * np.random.default_rng(order).normal(size=samples)
    return effects, simulated(effects, [-0.1, 0.2, 0.1], channels, noise)


def passed(frequency: float, cutoff: float) -> float:
    """Gain of the low pass of the logs, (1 + s) exp(-s) with s = 1.078 (f / f_c)²."""
    s = 1.078 * (frequency / cutoff) ** 2
    return (1 + s) * np.exp(-s)


@pytest.mark.parametrize("order", [4, 8, 16])
def test_a_low_pass_on_target_and_rows_alike_leaves_the_ripple_unbiased(order):
    effects, log = ripple_log(order)
    fit = fitted(effects, log, lowpass=1.0, fixed={})
    for name, truth in ((f"cosine {order}", 0.2), (f"sine {order}", 0.1)):
        assert abs(fit[name].value - truth) < 4 * fit[name].standard_error < 0.02


@pytest.mark.parametrize("order", [4, 8, 16])
def test_a_low_pass_on_the_target_alone_takes_the_filters_gain_off_the_ripple(order):
    effects, log = ripple_log(order)
    smooth = lowpass_log(log, 1.0, ("sensor_torque",)).rows(slice(500, -500), note="ends cut")
    fit = fitted(effects, smooth, fixed={})
    gain = passed(order * 0.5 / (2 * np.pi), 1.0)
    amplitude = np.hypot(fit[f"cosine {order}"].value, fit[f"sine {order}"].value)
    assert amplitude / np.hypot(0.2, 0.1) == pytest.approx(gain, abs=0.01)
    if order >= 8:  # a bias that the errors do not tell
        assert gain < 0.95
        away = abs(fit[f"cosine {order}"].value - 0.2)
        assert away > 4 * fit[f"cosine {order}"].standard_error


def test_rows_that_the_filter_sees_from_one_side_do_not_count():
    effects, log = ripple_log(4, samples=3000)
    fit = fitted(effects, log, lowpass=1.0, fixed={})
    counts = fit.runs[0].counts
    assert not counts[:100].any() and not counts[-100:].any()
    assert counts[110:-110].all()


# Outliers and pushes


def pushed(seed: int):
    """5 % of the rows far off: single outliers, and two pushes of an arm."""
    clean = simulated(
        friction(),
        FRICTION,
        motion(seed),
        0.02 * np.random.default_rng(seed).normal(size=2000),
    )
    generator = np.random.default_rng([seed, 1])
    torque = clean["sensor_torque"].copy()
    torque[generator.choice(2000, 40, replace=False)] += generator.uniform(3, 8, 40)
    torque[700:730] += 5.0
    torque[1500:1530] += 4.0
    return clean, log_with(motion(seed), torque)


def test_the_weights_are_those_of_huber_about_the_median_deviation():
    residual = np.array([-3.0, -1.0, -0.5, 0.5, 1.0, 100.0, 7.0])
    counted = np.array([True] * 6 + [False])
    # Median 0, absolute deviations 0.5 0.5 1 1 3 100: their median 1, scale 1.4826.
    limit = 1.345 * 1.4826
    (weights,) = huber_weights([residual], [counted])
    assert weights == pytest.approx([limit / 3, 1, 1, 1, 1, limit / 100, limit / 7])


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_pushes_move_a_robust_fit_by_less_than_its_errors_but_least_squares_by_far_more(seed):
    clean, spoilt = pushed(seed)
    truth = fitted(friction(), clean)
    robust = fitted(friction(), spoilt, options=FitOptions(robust="huber"))
    plain = fitted(friction(), spoilt)
    for name in ("level", "viscosity", "inertia"):
        moved = abs(robust[name].value - truth[name].value)
        assert moved < 2 * robust[name].standard_error
    gap = np.abs(robust.part.coefficients - FRICTION)
    assert gap[0] < 0.1 * np.abs(plain.part.coefficients - FRICTION)[0]
    assert gap[0] < 0.02


def test_a_robust_fit_of_clean_data_is_nearly_least_squares():
    clean, _ = pushed(4)
    plain = fitted(friction(), clean)
    robust = fitted(friction(), clean, options=FitOptions(robust="huber"))
    for name in ("offset", "level", "viscosity", "inertia"):
        assert abs(plain[name].value - robust[name].value) < plain[name].standard_error


def test_a_robust_fit_is_the_fixed_point_of_its_weights():
    _, spoilt = pushed(5)
    fit = fitted(friction(), spoilt, options=FitOptions(robust="huber"))
    residual = fit.runs[0].residual
    (weights,) = huber_weights([residual], [fit.runs[0].counts])
    rows = rows_of(friction(), spoilt)
    root = np.sqrt(weights)
    again = np.linalg.lstsq(rows * root[:, None], spoilt["sensor_torque"] * root, rcond=None)[0]
    assert fit.part.coefficients == pytest.approx(again, abs=1e-5)


def test_weights_low_pass_and_ill_condition_go_together():
    channels = motion(0)
    channels["output_position"] = 0.5 * np.sin(channels["time"])
    effects = chosen("offset", effect("output_ripple", orders=[1, 2, 3]))
    noise = 0.02 * np.random.default_rng(0).standard_t(2, size=2000)
    log = simulated(effects, [0.1, 0.2, 0.1, 0.05, 0.0, 0.0, 0.1], channels, noise)
    fit = fitted(effects, log, fixed={}, lowpass=10.0, options=FitOptions(robust="huber"))
    (run,) = posed([log], effects, lowpass_hz=10.0).runs
    rows = posed([log], effects, lowpass_hz=10.0).rows(effects, 0, np.empty(0))
    counts = fit.runs[0].counts
    (weights,) = huber_weights([fit.runs[0].residual], [counts])
    root = np.sqrt(weights[counts])
    again = np.linalg.lstsq(rows[counts] * root[:, None], run.target[counts] * root, rcond=None)[0]
    contributions = rows[counts] @ (fit.part.coefficients - again)
    assert fit.exact and np.abs(contributions).max() < 1e-4


def test_a_robust_fit_finds_the_direction_width_too():
    _, spoilt = pushed(6)
    fit = fitted(friction(), spoilt, options=FitOptions(robust="huber"), fixed={})
    width = fit["direction_width"]
    assert abs(width.value - WIDTH) < 4 * width.standard_error < WIDTH
