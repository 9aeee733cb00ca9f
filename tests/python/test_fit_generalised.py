"""In slow noise a right model is fitted as the noise sees it, and a wrong one as before."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from fit_logs import WIDTH, autoregressive
from hidden_logs import LOAD, friction_of, log_of, rich_run

import flexspline
from flexspline.effects import Effect
from flexspline.fitting import fit_near
from flexspline.least_squares.estimate import Estimate, Given, estimate, newton
from flexspline.least_squares.problem import Problem, problem_of
from flexspline.least_squares.result import Fit
from flexspline.least_squares.shapes import filtered as filtered_rows
from flexspline.logs.log import Log

NAMES = ("offset", "coulomb_friction", "viscous_friction", "inertia")
RIPPLE = "wave_generator_ripple"  # some 10 Hz: far above what such noise is large at
TARGET, ROWS, DRAWS, PHI = "sensor_torque", 1500, 60, 0.97
SIZE = 0.005  # Nm, innovations
SLOW = 0.3  # rad/s, of the Stribeck friction
AT = {"direction_width": WIDTH, "stribeck_velocity": SLOW}
Array = np.ndarray


def logs(seed: int, phi: float = PHI, missing: float = 0.0, size: float = SIZE) -> list[Log]:
    """Two runs; `missing`: Nm of what the model lacks, a wave in the speed."""
    made = []
    for run in (1, 2):
        c = rich_run(run, ROWS, speed=1.0)
        lacks = missing * np.sin(3.0 * c["output_velocity"])
        noise = autoregressive(np.random.default_rng([seed, run]), ROWS, phi, size)
        made.append(log_of(c, sensor_torque=c[LOAD] + friction_of(c) + lacks + noise))
    return made


def fitted(runs: list[Log], *, general: bool, held: bool = True) -> Fit:
    fixed = {"direction_width": WIDTH} if held else {}
    effects = [*map(flexspline.effect, NAMES), flexspline.effect(RIPPLE, orders=[2])]
    effects = [e.with_shapes(direction_width=WIDTH) if e.shapes else e for e in effects]
    problem = problem_of(runs, effects, TARGET, known_load=LOAD, lowpass_hz=None, threads=1)
    return fit_near(problem, effects, fixed, {}, None, general=general)


def filtered(made: Fit) -> bool:
    return bool(made.part.record["noise"]["filtered"])


@cache
def draws(general: bool) -> tuple[Array, Array, Array]:
    """Values (DRAWS, P), errors, and whether each 95 % interval holds the truth."""
    truth = values(fitted(logs(0, 0.0, size=1e-5 * SIZE), general=False))
    found = [fitted(logs(seed), general=general) for seed in range(1, DRAWS + 1)]
    inside = [[p.interval[0] <= t <= p.interval[1] for p, t in zip(free(f), truth, strict=True)]
              for f in found]  # fmt: skip
    errors = [[p.standard_error for p in free(f)] for f in found]
    return np.array([values(f) for f in found]), np.array(errors), np.array(inside)


def free(made: Fit) -> list[flexspline.Parameter]:
    return [p for p in made.parameters if p.state == "fitted"]


def values(made: Fit) -> Array:
    return np.array([p.value for p in free(made)])


def test_in_slow_noise_the_estimates_scatter_less() -> None:
    plain, general = (draws(general)[0].std(axis=0) for general in (False, True))
    names = [p.name.split(".")[0] for p in free(fitted(logs(1), general=True))]
    share = general / plain
    assert share[[name == RIPPLE for name in names]].max() < 0.5
    assert share.max() < 1.15  # what is slow itself is known as well either way


def test_its_errors_are_what_the_estimates_scatter_by() -> None:
    found, errors, inside = draws(True)
    scatter = found.std(axis=0)
    assert np.median(errors, axis=0) == pytest.approx(scatter, rel=0.35)  # 60 draws know 9 %
    assert 0.88 <= inside.mean() <= 0.99


def test_a_model_that_lacks_something_stays_with_the_plain_fit() -> None:
    for seed in range(1, 6):
        runs = logs(seed, missing=0.2)
        general, plain = (fitted(runs, general=general) for general in (True, False))
        assert not filtered(general)
        assert values(general) == pytest.approx(values(plain), rel=1e-12)


def test_a_right_model_is_seldom_held_for_wrong() -> None:
    taken = [filtered(fitted(logs(seed), general=True)) for seed in range(1, 41)]
    assert np.mean(taken) >= 0.85


def test_rows_that_were_left_out_are_foretold_by_the_other_runs_alone() -> None:
    """The residual of a fold is that of the fit to the others, filtered by the same noise."""
    runs = [log for seed in (1, 2) for log in logs(seed)]
    made = fitted(runs, general=True)
    assert filtered(made)
    assert made.validated_by == "runs"
    plain = fitted(runs, general=False)
    assert made.cv_rmse == pytest.approx(plain.cv_rmse, rel=0.02)


def posed(runs: list[Log], names: tuple[str, ...]) -> tuple[Problem, list[Effect]]:
    effects = [flexspline.effect(name) for name in names]
    problem = problem_of(runs, effects, TARGET, known_load=LOAD, lowpass_hz=None, threads=1)
    return problem, effects


def squares(made: Estimate) -> float:
    """What the filtered rows leave."""
    assert made.denominator is not None
    return sum(
        float(c.residual @ c.residual) for c in filtered_rows(made.tangent, made.denominator)()
    )


def test_no_shape_near_by_leaves_less_of_the_filtered_rows() -> None:
    problem, effects = posed(logs(3), NAMES)
    plain = estimate(problem, effects, Given({}, {}, {}, False), lambda: None)
    start = replace(plain, denominator=np.array([1.0, -PHI]))
    best = newton(start)
    assert best is not None and squares(best) < squares(start)
    (shape,) = best.free_shapes
    at = shape.value(best.linear.effects)
    assert at != shape.value(plain.linear.effects)
    for factor in (0.99, 1.01):
        effects_beside = shape.set(best.linear.effects, factor * at)
        linear = replace(best.linear, effects=effects_beside)
        tangent = replace(best.tangent, effects=effects_beside)
        held = replace(best, linear=linear, tangent=tangent, free_shapes=())
        held = replace(held, tangent=replace(tangent, shapes=()), basis=np.eye(len(best.fitted)))
        beside = newton(held)
        assert beside is not None and squares(beside) > squares(best)


def test_a_shape_that_the_rows_hardly_tell_does_not_run_away() -> None:
    """Steps of Gauss and Newton alone went from 0.32 to 0.04 rad/s, and on."""
    found = []
    for seed in range(1, 9):
        runs = []
        for log in logs(seed):
            v = log["output_velocity"]
            slow = 0.05 * np.tanh(v / WIDTH) * np.exp(-((v / SLOW) ** 2))
            runs.append(log.with_columns({"sensor_torque": log["sensor_torque"] + slow}, note="s"))
        problem, effects = posed(runs, (*NAMES, "stribeck_friction"))
        effects = [e.with_shapes(**{n: AT[n] for n in e.shapes if n in AT}) for e in effects]
        plain = estimate(problem, effects, Given({}, {}, {}, False), lambda: None, near=True)
        start = replace(plain, denominator=np.array([1.0, -PHI]))
        best = newton(start)
        if best is not None:
            assert squares(best) <= squares(start)
            (speed,) = (s for s in best.free_shapes if s.name.endswith("stribeck_velocity"))
            found.append(speed.value(best.linear.effects))
            again = newton(best)  # it stands: from there on no step leads anywhere
            assert again is not None
            assert speed.value(again.linear.effects) == pytest.approx(found[-1], rel=1e-3)
    assert len(found) >= 3
    assert 0.5 * SLOW < np.median(found) < 2.0 * SLOW


@pytest.mark.parametrize("rows", [9, 10, 12, 34])
def test_runs_too_short_for_their_noise_keep_the_plain_fit(rows: int) -> None:
    for seed in range(1, 6):
        whole = logs(seed)[0]
        runs = [
            whole.rows(slice(first, first + rows), note="cut") for first in range(0, 1000, rows)
        ]
        runs = runs[:1] if rows == 34 else runs
        problem, effects = posed(runs, ("offset", "viscous_friction"))
        assert fit_near(problem, effects, {}, {}, None, general=True).parameters


def test_naive_errors_are_those_of_the_rows_as_they_are() -> None:
    made = fitted(logs(1), general=True)
    assert filtered(made)
    plain = {p.name: p for p in fitted(logs(1), general=False).parameters}
    for p in free(made):
        assert p.naive_error == pytest.approx(plain[p.name].naive_error, rel=0.05)
    assert made["coulomb_friction"].effective_samples < 1000  # of 3000 rows of slow noise
    level = made["coulomb_friction"]  # Student's t of few degrees of freedom: A is estimated, too
    assert level.interval[1] - level.value > 2.0 * level.standard_error
