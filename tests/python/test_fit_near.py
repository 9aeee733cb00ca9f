"""A fit from shapes near by ends where the search for shapes does, and a bend is a derivative."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from hidden_logs import LOAD, friction_of, log_of, noise, rich_run
from scipy.signal import lfilter

import flexspline
from flexspline.effects import Effect
from flexspline.errors import InputError
from flexspline.fitting import fit_near, held_out_near
from flexspline.least_squares.estimate import Given, estimate
from flexspline.least_squares.options import shapes_of
from flexspline.least_squares.problem import Problem, problem_of
from flexspline.least_squares.shapes import bent
from flexspline.logs.log import Log

TARGET = "sensor_torque"
NAMES = ("offset", "coulomb_friction", "viscous_friction", "inertia", "stribeck_friction")


def logs() -> list[Log]:
    made = []
    for seed in (1, 2):
        c = rich_run(seed, 2000, speed=1.0)
        v = c["output_velocity"]
        slow = 0.2 * np.tanh(v / 0.02) * np.exp(-((v / 0.15) ** 2))
        made.append(log_of(c, sensor_torque=friction_of(c) + c[LOAD] + slow + noise(seed, 2000)))
    return made


def posed(effects: Sequence[Effect], runs: Sequence[Log]) -> Problem:
    return problem_of(runs, effects, TARGET, known_load=LOAD, lowpass_hz=None, threads=1)


def test_a_fit_from_shapes_near_by_is_that_of_the_whole_search() -> None:
    runs = logs()
    whole = flexspline.fit(NAMES, runs, TARGET, known_load=LOAD, checks=False)
    moved = [
        e.with_shapes(**{s.name: 1.2 * e.shapes[s.name] for s in e.fitted_shapes})
        for e in whole.part.effects
    ]
    near = fit_near(posed(moved, runs), moved, {}, {}, None)
    for one, other in zip(near.parameters, whole.parameters, strict=True):
        assert abs(one.value - other.value) < 0.01 * other.standard_error, one.name
        assert one.standard_error == pytest.approx(other.standard_error, rel=1e-3)


def test_rows_held_out_are_weighed_as_by_the_fit_that_they_are_compared_with() -> None:
    runs, generator = list[Log](), np.random.default_rng(5)
    for log in logs():
        slow = lfilter([0.1], [1.0, -0.97], generator.normal(0.0, 1.0, len(log)))
        runs.append(log.with_columns({TARGET: log[TARGET] + slow}, note="slow noise"))
    effects = tuple(flexspline.effect(name) for name in NAMES)
    problem = posed(effects, runs)
    general = fit_near(problem, effects, {}, {}, None, general=True)
    plain = fit_near(problem, effects, {}, {}, None)
    assert general.generalised and not plain.generalised
    for like, whole in ((general, general), (plain, plain), (None, plain)):
        left = held_out_near(problem, effects, {}, {}, like)
        for own, run in zip(left, whole.runs, strict=True):
            np.testing.assert_allclose(own, run.held_out, rtol=1e-9, atol=1e-12)
    apart = [
        one.held_out - other.held_out for one, other in zip(general.runs, plain.runs, strict=True)
    ]
    assert np.nanmax(np.abs(apart)) > 1e-3


def test_a_fit_from_shapes_near_by_of_fewer_rows_than_its_numbers_need_is_refused() -> None:
    effects = tuple(flexspline.effect(name) for name in NAMES)
    few = [log.rows(slice(0, 10)) for log in logs()]
    for near in (lambda problem: fit_near(problem, effects, {}, {}, None),
                 lambda problem: held_out_near(problem, effects, {}, {})):  # fmt: skip
        with pytest.raises(InputError, match=r"rows that count, but \d+ coefficients need"):
            near(posed(effects, few))


def test_the_pull_of_a_shape_is_how_the_squares_fall_along_it() -> None:
    effects = tuple(flexspline.effect(name) for name in NAMES)
    problem = posed(effects, logs())
    held = {"direction_width": 0.03, "stribeck_velocity": 0.2}
    made = estimate(problem, effects, Given(held, {}, {}, False), lambda: None)
    shapes = shapes_of(made.linear.effects)
    found = bent(problem, made.linear, made.constraints, shapes, None)
    for shape, pull in zip(shapes, found.pull, strict=True):
        squares = []
        for step in (-1e-3, 1e-3):
            name = shape.name.split(".")[-1]
            moved = Given({**held, name: held[name] * np.exp(step)}, {}, {}, False)
            squares.append(estimate(problem, effects, moved, lambda: None).linear.squares)
        assert pull == pytest.approx(-(squares[1] - squares[0]) / 4e-3, rel=1e-3)
