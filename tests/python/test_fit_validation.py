"""Held-out residuals against brute force, and scores against their definitions by hand."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from fit_logs import FRICTION, HELD, fitted, friction, log_with, motion, rows_of, run_of, simulated

import flexspline
from flexspline.least_squares.estimate import Given, estimate
from flexspline.least_squares.problem import problem_of
from flexspline.least_squares.validation import bands, cross_validate, score, scores_of


def log_of(seed: int, samples: int = 1600):
    return run_of(seed, samples)


def refitted(train: list[tuple[np.ndarray, np.ndarray]], rows, y):
    """Residuals of rows (n, P) and y under the least squares of the others."""
    best = np.linalg.lstsq(
        np.concatenate([t[0] for t in train]), np.concatenate([t[1] for t in train]), rcond=None
    )[0]
    return y - rows @ best


# Cross-validation


def test_four_runs_are_left_out_one_by_one_as_refits_without_them_would():
    logs = [log_of(seed, 800 + 100 * seed) for seed in range(4)]
    fit = fitted(friction(), logs)
    assert (fit.validated_by, fit.folds) == ("runs", 4)
    tables = [(rows_of(friction(), log), log["sensor_torque"]) for log in logs]
    for k in range(4):
        brute = refitted(tables[:k] + tables[k + 1 :], *tables[k])
        assert fit.runs[k].held_out == pytest.approx(brute, abs=1e-9)
    everything = np.concatenate([run.held_out for run in fit.runs])
    assert fit.cv_rmse == pytest.approx(np.sqrt(np.mean(everything**2)))


@pytest.mark.parametrize("runs", [1, 2, 3])
def test_fewer_runs_are_cut_into_contiguous_blocks(runs):
    logs = [log_of(seed) for seed in range(runs)]
    fit = fitted(friction(), logs)
    assert fit.validated_by == "blocks"
    count = max(2, round(8 / runs))
    assert fit.folds == count * runs
    tables = []
    for log in logs:
        rows, y = rows_of(friction(), log), log["sensor_torque"]
        edges = np.linspace(0, len(log), count + 1).astype(int)
        tables += [(rows[a:b], y[a:b]) for a, b in pairwise(edges)]
    brute = np.concatenate(
        [refitted(tables[:k] + tables[k + 1 :], *tables[k]) for k in range(len(tables))]
    )
    ours = np.concatenate([run.held_out for run in fit.runs])
    assert ours == pytest.approx(brute, abs=1e-9)


def test_shapes_are_refitted_to_first_order():
    logs = [log_of(seed) for seed in range(4)]
    fit = fitted(friction(), logs, fixed={})
    for k in range(4):
        other = fitted(friction(), logs[:k] + logs[k + 1 :], fixed={})
        brute = other.predict(logs[k]).residual
        moved = brute - fit.runs[k].residual
        gap = fit.runs[k].held_out - brute
        # Second order in the change of the shape: small beside the change itself.
        assert np.sqrt(np.mean(gap**2)) < 0.2 * np.sqrt(np.mean(moved**2))


def test_a_prior_stays_in_every_fold():
    log = log_of(3)
    fit = fitted(friction(), log, priors={"inertia": (0.5, 1e-7)})
    pinned = fitted(friction(), log, fixed={**HELD, "inertia": 0.5})
    assert fit.runs[0].held_out == pytest.approx(pinned.runs[0].held_out, abs=1e-5)


def test_a_fold_that_alone_excites_a_parameter_does_not_break_the_validation():
    channels = motion(0, 1600)
    channels["output_acceleration"] = channels["output_acceleration"].copy()
    channels["output_acceleration"][400:] = 0.0
    noise = 0.01 * np.random.default_rng(0).normal(size=1600)
    log = simulated(friction(), FRICTION, channels, noise)
    fit = fitted(friction(), log)
    assert np.isfinite(fit.runs[0].held_out).all()
    assert fit.cv_rmse >= fit.rmse


# Scores


def test_the_definitions_hold_on_four_numbers():
    y = np.array([1.0, 2.0, 3.0, 6.0])
    residual = np.array([1.0, -1.0, 2.0, 0.0])
    held_out = np.array([2.0, -2.0, 2.0, 2.0])
    made = score("all", "all rows", y, residual, held_out)
    assert made.rows == 4
    assert made.rmse == pytest.approx(np.sqrt(6 / 4))
    assert made.cv_rmse == pytest.approx(2.0)
    assert made.bias == pytest.approx(0.5)
    assert made.variance == pytest.approx(6 / 4 - 0.25)
    assert made.r_squared == pytest.approx(1 - 6 / 14)


def test_of_a_constant_target_there_is_no_share_explained():
    flat = np.full(3, 2.0)
    assert np.isnan(score("all", "", flat, np.ones(3), np.ones(3)).r_squared)


def triangle_log():
    """Forward at 1 rad/s for 10 s, standing for 2 s, back at 2 rad/s for 5 s; 100 Hz."""
    velocity = np.repeat([1.0, 0.0, -2.0], [1000, 200, 500])
    time = np.arange(1700) * 0.01
    position = np.concatenate([[0.0], np.cumsum(velocity[:-1]) * 0.01])
    temperature = np.linspace(20.0, 40.0, 1700)
    return log_with(
        {"time": time, "output_position": position, "output_velocity": velocity},
        np.arange(1700.0),
        temperature=temperature,
    )


def test_rows_are_told_by_direction_speed_temperature_and_nearness_to_a_reversal():
    log = triangle_log()
    problem = problem_of([log], [], "sensor_torque", known_load=None, lowpass_hz=None, threads=1)
    residual = np.where(log["output_velocity"] > 0, 1.0, np.where(log["output_velocity"], 2.0, 3.0))
    found = {(s.group, s.label): s for s in scores_of(problem, [residual], [2 * residual])}
    assert found["direction", "forward"].rows == 1000
    assert found["direction", "forward"].rmse == 1.0
    assert found["direction", "backward"].rows == 500
    assert found["direction", "backward"].cv_rmse == 4.0
    assert found["direction", "standstill"].rows == 200
    assert found["direction", "standstill"].bias == 3.0
    near = next(s for (group, label), s in found.items() if "within" in label)
    # 0.1 s on either side of the last row forward (999) and of the first row back (1200).
    assert near.rows == pytest.approx(2 * 21, abs=2)
    assert found["reversals", "elsewhere"].rows == 1700 - near.rows
    parts = [s for (group, _), s in found.items() if group == "temperature"]
    assert len(parts) == 3 and sum(s.rows for s in parts) == 1700
    assert found["all", "all rows"].rows == 1700


def test_directions_are_scored_where_only_a_position_is_recorded():
    channels = motion(3, 2000)
    del channels["output_velocity"], channels["output_acceleration"]
    log = log_with(channels, np.random.default_rng(1).normal(size=2000))
    fit = flexspline.fit(["offset"], log, "sensor_torque", checks=False)
    rows = {s.label: s.rows for s in fit.scores if s.group == "direction"}
    assert rows["forward"] > 500 and rows["backward"] > 500
    assert sum(rows.values()) == fit.scores[0].rows


def test_each_run_has_its_score():
    logs = [log_of(0), log_of(1)]
    found = {s.label: s for s in fitted(friction(), logs).scores if s.group == "run"}
    assert set(found) == {"run 0", "run 1"} and found["run 0"].rows == 1600


def test_speed_bands_hold_about_as_many_rows_each_and_leave_no_moving_row_out():
    fit = fitted(friction(), log_of(2, 4000))
    parts = [s for s in fit.scores if s.group == "speed"]
    moving = sum(s.rows for s in fit.scores if s.label in ("forward", "backward"))
    assert len(parts) == 5 and sum(s.rows for s in parts) == moving
    assert max(s.rows for s in parts) < 1.1 * min(s.rows for s in parts)


def test_a_prior_that_disagrees_with_the_runs_is_weighed_the_same_in_every_fold():
    log = log_of(5)
    posed = problem_of(
        [log], friction(), "sensor_torque", known_load=None, lowpass_hz=None, threads=1
    )
    given = Given(HELD, {}, {"inertia": (0.03, 2e-3)}, False)
    made = estimate(posed, friction(), given, lambda: None)
    found = cross_validate(made)
    rows, y = rows_of(friction(), log), log["sensor_torque"]
    known = (made.linear.prior_rows, made.linear.prior_rows @ [0.0, 0.0, 0.0, 0.03])
    edges = list(pairwise(np.linspace(0, len(log), 9).astype(int)))
    tables = [(rows[a:b], y[a:b]) for a, b in edges]
    for k, (a, b) in enumerate(edges):
        brute = refitted([*tables[:k], *tables[k + 1 :], known], *tables[k])
        assert found.residuals[0][a:b] == pytest.approx(brute, abs=1e-9)


def test_the_edge_of_a_band_that_is_nothing_beside_the_span_reads_zero() -> None:
    values = np.concatenate([[1.45e-7], np.linspace(0.5, 30.0, 99)])
    labels = [label for _, label, _ in bands("load", values, 2, "Nm")]
    assert labels[0].startswith("0 to ") and labels[-1].endswith(" to 30 Nm")
    narrow = [label for _, label, _ in bands("load", 1e-7 * values, 2, "Nm")]
    assert narrow[0].startswith("0 to ") and narrow[-1].endswith(" to 3e-06 Nm")
