"""Logs without noise, as a first simulation makes them, and runs that are there twice."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from fit_logs import FRICTION, friction, motion, simulated

import flexspline
from flexspline import InputError
from flexspline.least_squares.estimate import Given, estimate
from flexspline.least_squares.problem import problem_of
from flexspline.least_squares.shapes import GRID
from flexspline.logs.log import Log

MODELS = {
    "one effect, exact to the bit": (["viscous_friction"], [1.0]),
    "exact to the bit, beside an offset": (["offset", "viscous_friction"], [0.5, 0.25]),
    "friction": (friction(), FRICTION),
}


def runs(effects, values, count: int) -> list[Log]:
    made = [
        simulated(effects, np.array(values), motion(seed), name=f"r{seed}") for seed in range(count)
    ]
    return [made[k] for k in range(count)]


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("count", [1, 4])
def test_a_fit_of_what_is_exact_says_so(model: str, count: int) -> None:
    effects, values = MODELS[model]
    made = flexspline.fit(effects, runs(effects, values, count), "sensor_torque", checks=False)
    assert made.part.coefficients == pytest.approx(values, rel=1e-9)
    assert made.cv_rmse < 1e-9 and np.isfinite(made.effective_samples)
    assert "±" in str(made)
    flexspline.Model.from_json(made.model.to_json())


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("count", [1, 4])
def test_nothing_is_missing_in_what_is_exact(model: str, count: int) -> None:
    effects, values = MODELS[model]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        made = flexspline.discover(effects, runs(effects, values, count), target="sensor_torque")
    assert made.names == () and made.unexplained is None
    assert made.final_rmse < 1e-9
    assert "inf" not in str(made) and "nan" not in made.to_json()


@pytest.mark.parametrize("count", [1, 4])
def test_what_is_hidden_in_exact_runs_is_named_alone(count: int) -> None:
    effects = ["offset", "viscous_friction"]
    made = flexspline.discover(["offset"], runs(effects, [0.5, 0.25], count),
                               target="sensor_torque")  # fmt: skip
    assert made.names == ("viscous_friction",)
    assert made.final_rmse < 1e-6 * made.base_rmse
    bare = flexspline.discover([], runs(["viscous_friction"], [1.0], count),
                               target="sensor_torque")  # fmt: skip
    assert bare.names == ("viscous_friction",)


def noisy(seed: int, name: str) -> Log:
    noise = 0.02 * np.random.default_rng([seed, 2]).normal(size=2000)
    return simulated(friction(), FRICTION, motion(seed), noise, name)


@pytest.mark.parametrize("of", ["fit", "discover"])
def test_a_run_that_is_there_twice_is_refused(of: str) -> None:
    again = noisy(0, "a copy")
    logs = [noisy(0, "first"), noisy(1, "second"), again]
    with pytest.raises(InputError, match=r"run 3 of 3, 'a copy'.*'first'"):
        if of == "fit":
            flexspline.fit(friction(), logs, "sensor_torque")
        else:
            flexspline.discover(friction(), logs, target="sensor_torque")


def test_two_halves_of_a_file_and_a_run_that_differs_by_one_value_are_runs() -> None:
    log = noisy(0, "first")
    torque = log["sensor_torque"].copy()
    torque[1000] += 1e-9
    other = log.with_columns({"sensor_torque": torque}, note="another reading")
    halves = [log.rows(slice(0, 1000), note="one"), log.rows(slice(1000, 2000), note="two")]
    for logs in ([log, other], halves):
        assert len(flexspline.fit(friction(), logs, "sensor_torque", checks=False).runs) == 2


def test_who_waits_is_told_of_every_solve_of_a_search() -> None:
    logs, effects = runs(friction(), FRICTION, 1), friction()
    problem = problem_of(
        logs, effects, "sensor_torque", known_load=None, lowpass_hz=None, threads=1
    )
    told: list[int] = []
    estimate(problem, effects, Given({}, {}, {}, False), lambda: told.append(1))
    assert [shape.name for e in effects for shape in e.fitted_shapes] == ["direction_width"]
    assert len(told) > GRID  # the points of its scan, and what follows
