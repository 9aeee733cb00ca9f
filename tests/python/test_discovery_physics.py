"""What a drive or a gear cannot do is not fitted: laws of sizes and signs. Two seconds together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flexspline
from flexspline.discovery.gram import Whitening
from flexspline.discovery.model import (
    Working,
    driving_spring,
    impossible,
    refitted,
    spring_bounds,
    varying,
    working,
)
from flexspline.fit.problem import Problem, problem_of
from flexspline.logs.log import Log

LEVEL, NOISE = 0.8, 0.05
BASE = ("offset", "coulomb_friction")
VARYING = "position_dependent_friction"


def strokes(span: float, seed: int = 3) -> Log:
    """Strokes over an angle [rad] against friction whose level varies as 0.3 cos(q)."""
    time = np.arange(0.0, 40.0, 0.01)
    angle = 0.5 * span * np.sin(1.1 * time)
    velocity = 0.55 * span * np.cos(1.1 * time)
    noise = NOISE * np.random.default_rng([seed, 1]).normal(size=len(time))
    friction = (LEVEL + 0.3 * np.cos(angle)) * np.tanh(velocity / 0.005)
    return Log.from_arrays(time=time, output_position=angle, output_velocity=velocity,
                           motor_torque=friction + noise, facts={"gear_ratio": 1.0})  # fmt: skip


def named(span: float) -> tuple[Problem, Working, float]:
    effects = [flexspline.effect(name) for name in (*BASE, VARYING)]
    problem = problem_of([strokes(span)], effects, "motor_torque", known_load=None,
                         lowpass_hz=None, threads=1)  # fmt: skip
    begun = working(effects, len(BASE), {"direction_width": 0.005})
    made, squares = refitted(problem, begun, Whitening(np.ones(1), NOISE**2, 1))
    return problem, made, squares


def amplitude(made: Working, angle: np.ndarray) -> np.ndarray:
    """What varies of the friction at an angle."""
    waves = [f(k * angle) for k in (1, 2, 3) for f in (np.cos, np.sin)]
    return np.asarray(np.stack(waves, axis=1) @ made.coefficients[2:])


def test_what_varies_over_a_small_angle_is_no_larger_at_others_than_the_friction_itself() -> None:
    problem, made, squares = named(0.8)
    (size,) = set(varying(made, problem).values())
    assert size == pytest.approx(LEVEL + 0.3, rel=0.05)
    assert np.abs(amplitude(made, np.linspace(0.0, 6.3, 500))).max() < size
    free, left = refitted(problem, replace(made, base=3), Whitening(np.ones(1), NOISE**2, 1))
    assert np.abs(amplitude(free, np.linspace(0.0, 6.3, 500))).max() > 10.0 * size
    assert squares - left < 10.0  # χ²: six numbers pay little for it


def test_what_varies_over_a_whole_turn_is_as_the_runs_show_it() -> None:
    _, made, _ = named(6.3)
    assert made.coefficients[2] == pytest.approx(0.3, abs=0.01)
    assert np.abs(made.coefficients[3:]).max() < 0.01


def test_what_a_user_puts_into_the_base_is_not_drawn_anywhere() -> None:
    problem, made, _ = named(0.8)
    assert varying(replace(made, base=3), problem) == {}


@pytest.mark.parametrize(
    ("name", "target"),
    [("presliding_friction", "motor_torque"), ("torsional_hysteresis", "torsion")],
)
def test_the_spring_that_drives_most_is_held_first_and_the_rest_are_bounded(
    name: str, target: str
) -> None:
    effects = [flexspline.effect("offset"), flexspline.effect(name)]
    values = np.array([0.1, 0.3, -0.2, -0.5, 0.2])
    made = replace(working(effects, 1, {}), coefficients=values)
    assert driving_spring(made, target) == f"{name}.quarter"
    held = made.holding(f"{name}.quarter", 0.0)
    assert driving_spring(held, target) == f"{name}.half"
    assert driving_spring(held.holding(f"{name}.half", 0.0), target) == ""
    bounds = spring_bounds(made, target)
    assert set(bounds.values()) == {(0.0, None)}
    assert len(bounds) == 4


@pytest.mark.parametrize(
    ("width", "low", "refused"), [(0.005, 0.1, False), (0.5, 0.1, True), (0.5, -1.0, False)]
)
def test_friction_that_bends_with_speed_is_no_change_of_a_direction_that_no_run_changes(
    width: float, low: float, refused: bool
) -> None:
    time = np.arange(0.0, 20.0, 0.01)
    velocity = 0.5 * (low + 1.0) + 0.5 * (1.0 - low) * np.sin(time)
    log = Log.from_arrays(time=time, output_position=np.cumsum(velocity) * 0.01,
                          output_velocity=velocity, motor_torque=np.sin(3.0 * time),
                          facts={"gear_ratio": 1.0})  # fmt: skip
    effects = [flexspline.effect("offset"), flexspline.effect(VARYING, direction_width=width)]
    problem = problem_of([log], effects, "motor_torque", known_load=None, lowpass_hz=None,
                         threads=1)  # fmt: skip
    said = impossible(working(effects, 1, {}), VARYING, problem)
    assert ("no run changes direction" in said) is refused
