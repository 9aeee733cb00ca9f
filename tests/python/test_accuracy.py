"""Coefficients against a solve of the same rounded rows in 80 digits.

The promise: within 1e-8 relative up to a condition number of 1e8 of the scaled design, within
1e-6 up to 1e10. Rows are doubles, so their sums of products are exact as whole numbers; the
reference solves these in 80 digits. Residuals are as large as the explained part.
"""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
from fit_logs import WIDTH, chosen, friction, log_with, motion, rows_of

import flexspline
from flexspline import effect
from flexspline.least_squares.linear import fit_linear
from flexspline.least_squares.options import coefficient_names, constraints_of
from flexspline.least_squares.problem import problem_of

SAMPLES = 500


def whole_numbers(matrix: np.ndarray) -> tuple[np.ndarray, int]:
    """Doubles as integers times one power of two: (integers, exponent)."""
    mantissa, exponent = np.frexp(matrix)
    lowest = int(exponent[matrix != 0].min())
    digits = np.ldexp(mantissa, 53).astype(np.int64).astype(object)
    return digits * 2 ** np.maximum(exponent - lowest, 0).astype(object), lowest - 53


def reference(rows: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Least squares of rows (N, P) that are taken as exact, in 80 digits, rounded at the end."""
    (x, shift_x), (y, shift_y) = whole_numbers(rows), whole_numbers(target)
    with mpmath.workdps(80):
        gram = mpmath.matrix([[mpmath.mpf(v) for v in row] for row in x.T @ x])
        right = mpmath.matrix([mpmath.mpf(v) for v in x.T @ y])
        found = mpmath.lu_solve(gram, right) * mpmath.mpf(2) ** (shift_y - shift_x)
        return np.array([float(v) for v in found])


def condition(rows: np.ndarray) -> float:
    return float(np.linalg.cond(rows / np.linalg.norm(rows, axis=0)))


def swept(reach: float, seed: int = 1) -> dict[str, np.ndarray]:
    """A motion that keeps within ±reach rad."""
    time = np.arange(SAMPLES) * 0.01
    omega = 2 * np.pi * 0.9
    phase = 0.3 * seed
    return {
        "time": time,
        "output_position": reach * np.sin(omega * time + phase),
        "output_velocity": reach * omega * np.cos(omega * time + phase),
        "output_acceleration": -reach * omega**2 * np.sin(omega * time + phase),
    }


def nearly_one_speed(spread: float) -> dict[str, np.ndarray]:
    """Turning at 1 rad/s that varies by `spread`."""
    channels = motion(3, SAMPLES)
    wobble = np.sin(np.arange(SAMPLES) * 0.37)
    return {**channels, "output_velocity": 1.0 + spread * wobble}


def with_noise(effects, channels, seed: int = 5, name: str = "run", **more):
    """A log whose residual is as large as what the effects explain."""
    generator = np.random.default_rng(seed)
    rows = rows_of(effects, log_with(channels, **more))
    torque = rows @ generator.normal(size=rows.shape[1]) / np.sqrt(rows.shape[1])
    torque += np.sqrt(np.mean(torque**2)) * generator.normal(size=len(torque))
    return log_with(channels, torque, name, **more)


DENSE = {n: effect("output_ripple", orders=range(1, n + 1)) for n in range(2, 12)}
SPARSE = effect("output_ripple", orders=[1, 2, 4, 7])

LADDER = {
    "n=3 over 0.3 rad": (["offset", DENSE[3]], swept(0.3), 1e6, 1e7),
    "n=4 over 0.3 rad": (["offset", DENSE[4]], swept(0.3), 1e8, 1e9),
    "n=4 over 0.24 rad": (["offset", DENSE[4]], swept(0.24), 1e9, 1e10),
    "n=4 over 0.5 rad": (["offset", DENSE[4]], swept(0.5), 1e6, 1e8),
    "n=5 over 0.8 rad": (["offset", DENSE[5]], swept(0.8), 1e6, 1e8),
    "n=6 over 1.5 rad and friction": ([*friction(), DENSE[6]], swept(1.5), 1e3, 1e6),
    "n=10 over 1.5 rad": (["offset", DENSE[10]], swept(1.5), 1e7, 1e8),
    "n=11 over 1.4 rad": (["offset", DENSE[11]], swept(1.4), 1e8, 1e10),
    "sparse orders over 0.3 rad": (["offset", SPARSE], swept(0.3), 1e6, 1e9),
    "sparse orders and friction": ([*friction(), SPARSE], swept(1.0), 1e2, 1e6),
    "one speed to 1e-3": (["offset", "viscous_friction"], nearly_one_speed(1e-3), 1e3, 1e4),
    "one speed to 1e-5": (["offset", "viscous_friction"], nearly_one_speed(1e-5), 1e5, 1e6),
    "one speed to 1e-7": (["offset", "viscous_friction"], nearly_one_speed(1e-7), 1e7, 1e8),
    "one speed to 1e-9": (["offset", "viscous_friction"], nearly_one_speed(1e-9), 1e9, 1e10),
    "one speed and ripple": (
        ["offset", "viscous_friction", DENSE[4]],
        nearly_one_speed(1e-6),
        1e6,
        1e7,
    ),
}


def promised(kappa: float) -> float:
    assert kappa <= 1e10
    return 1e-8 if kappa <= 1e8 else 1e-6


@pytest.mark.parametrize("name", LADDER)
def test_coefficients_are_those_of_the_same_rows_in_high_precision(name):
    effects, channels, least, most = LADDER[name]
    log = with_noise(effects, channels)
    rows = rows_of(effects, log)
    kappa = condition(rows)
    assert least <= kappa <= most, f"{kappa:.2g}"
    truth = reference(rows, log["sensor_torque"])
    residual = log["sensor_torque"] - rows @ truth
    assert np.linalg.norm(residual) > 0.3 * np.linalg.norm(log["sensor_torque"])
    fit = flexspline.fit(
        effects,
        log,
        "sensor_torque",
        checks=False,
        fixed={"direction_width": WIDTH} if len(effects) > 4 else {},
    )
    error = np.abs(fit.part.coefficients - truth) / np.abs(truth)
    assert error.max() <= promised(kappa), f"κ = {kappa:.2g}: {error.max():.2g}"
    assert fit.exact or kappa < 1e3
    assert fit.condition == pytest.approx(kappa, rel=0.01)


@pytest.mark.parametrize("lowpass", [None, 8.0])
def test_several_runs_keep_the_accuracy_filtered_or_not(lowpass):
    effects = ["offset", DENSE[4]]
    logs = [with_noise(effects, swept(0.5, seed), seed, f"run {seed}") for seed in (1, 2, 3)]
    posed = problem_of(
        logs, chosen(*effects), "sensor_torque", known_load=None, lowpass_hz=lowpass, threads=1
    )
    parts = [
        (posed.rows(chosen(*effects), number, np.empty(0))[a:b], run.target[a:b])
        for number, run in enumerate(posed.runs)
        for a, b in run.stretches
    ]
    rows = np.concatenate([part[0] for part in parts])
    truth = reference(rows, np.concatenate([part[1] for part in parts]))
    fit = flexspline.fit(effects, logs, "sensor_torque", lowpass=lowpass, checks=False)
    assert 1e7 < condition(rows) < 1e9
    limit = promised(condition(rows))
    assert (np.abs(fit.part.coefficients - truth) <= limit * np.abs(truth)).all()


def test_held_coefficients_are_taken_off_the_target_without_losing_digits():
    effects = ["offset", DENSE[4]]
    log = with_noise(effects, swept(0.5))
    rows = rows_of(effects, log)
    held = {"sine 2": 0.25, "offset": -0.75}
    kept = [k for k in range(rows.shape[1]) if k not in (0, 4)]
    off = 0.25 * rows[:, 4] - 0.75 * rows[:, 0]
    truth = reference(rows[:, kept], log["sensor_torque"] - off)
    fit = flexspline.fit(effects, log, "sensor_torque", fixed=held, checks=False)
    values = fit.part.coefficients
    assert values[0] == -0.75 and values[4] == 0.25
    # The target is rounded once where the held part is taken off: κ ε of it comes back.
    assert (np.abs(values[kept] - truth) <= 1e-8 * np.abs(truth)).all()


def test_an_exact_dependency_beside_an_ill_conditioned_design_costs_no_digits():
    log = with_noise(["offset", DENSE[4]], swept(0.5))
    rows = rows_of(["offset", DENSE[4]], log)
    truth = rows @ reference(rows, log["sensor_torque"])
    fit = flexspline.fit(["offset", "gravity", DENSE[4]], log, "sensor_torque", checks=False)
    assert fit.exact and any(group.exact or len(group.names) > 2 for group in fit.confounded)
    assert np.abs(fit.runs[0].predicted - truth).max() < 1e-9 * np.ptp(truth)


def test_a_prior_does_not_cost_the_accuracy_of_what_it_does_not_touch():
    effects = ["offset", DENSE[4]]
    log = with_noise(effects, swept(0.5))
    plain = flexspline.fit(effects, log, "sensor_torque", checks=False)
    value = plain["offset"].value
    fit = flexspline.fit(
        effects, log, "sensor_torque", priors={"offset": (value, 1e9)}, checks=False
    )
    assert fit.part.coefficients == pytest.approx(plain.part.coefficients, rel=1e-8)


@pytest.mark.parametrize("name", ["n=4 over 0.3 rad", "one speed to 1e-9", "n=10 over 1.5 rad"])
def test_errors_of_an_ill_conditioned_fit_are_those_of_high_precision_too(name):
    effects, channels, _, _ = LADDER[name]
    log = with_noise(effects, channels)
    rows = rows_of(effects, log)
    digits, shift = whole_numbers(rows)
    with mpmath.workdps(80):
        gram = mpmath.matrix([[mpmath.mpf(v) for v in row] for row in digits.T @ digits])
        inverse = gram**-1 * mpmath.mpf(2) ** (-2 * shift)
        spread = np.array([float(mpmath.sqrt(inverse[k, k])) for k in range(len(gram))])
    fit = flexspline.fit(effects, log, "sensor_torque", checks=False)
    residual = fit.runs[0].residual
    sigma = np.sqrt(residual @ residual / (len(residual) - rows.shape[1]))
    naive = [p.naive_error for p in fit.parameters]
    # The basis of the errors is in doubles: κ ε = 1e-6 of the error.
    assert naive == pytest.approx(sigma * spread, rel=1e-5)


@pytest.mark.parametrize("orders", [[1, 2, 3, 4, 5, 6], [1, 2, 4, 7], [100, 200, 4200]])
def test_the_fast_structured_sums_equal_those_of_the_plain_rows(orders):
    effects = [*friction(), effect("output_ripple", orders=orders)]
    channels = motion(2, 4000)
    log = with_noise(effects, channels)
    posed = problem_of(
        [log], chosen(*effects), "sensor_torque", known_load=None, lowpass_hz=None, threads=1
    )
    nothing = constraints_of(coefficient_names(effects), {}, {}, {})
    made = fit_linear(posed, chosen(*effects), nothing)
    rows = rows_of(effects, log)
    assert condition(rows) < 100 and not made.exact
    assert posed.design(chosen(*effects)).structured == (orders == list(range(1, 7)))
    plain = np.linalg.lstsq(rows, log["sensor_torque"], rcond=None)[0]
    assert np.abs(made.coefficients - plain).max() <= 1e-12 * np.abs(plain).max()
    table = np.column_stack([rows, log["sensor_torque"]])
    sums = posed.sums(chosen(*effects), np.empty(0)).total()[0]
    size = np.sqrt(np.outer(np.diag(sums), np.diag(sums)))
    assert (np.abs(sums - table.T @ table) <= 1e-12 * size).all()


@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("turlapati", [False, True])
def test_both_directions_of_coulomb_friction_have_the_sums_of_their_rows(turlapati, weighted):
    pair = effect("coulomb_friction_per_direction", direction_width=WIDTH)
    ripple = effect("output_ripple", orders=range(1, 9))
    effects = ["viscous_friction", pair, ripple, "inertia", *(["offset"] if turlapati else [])]
    log = with_noise(effects, motion(3, 3001))
    posed = problem_of(
        [log], chosen(*effects), "sensor_torque", known_load=None, lowpass_hz=None, threads=2
    )
    weights = np.random.default_rng(4).uniform(0.2, 1.0, len(log)) if weighted else None
    assert posed.design(chosen(*effects)).structured
    sums = posed.sums(
        chosen(*effects), np.empty(0), weights=None if weights is None else [weights]
    ).total()[0]
    table = np.column_stack([rows_of(effects, log), log["sensor_torque"]])
    plain = table.T @ (table if weights is None else weights[:, None] * table)
    size = np.sqrt(np.outer(np.diag(plain), np.diag(plain)))
    assert (np.abs(sums - plain) <= 1e-12 * size).all()
