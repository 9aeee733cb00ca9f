"""What a drive or a gear cannot do is not fitted: laws of sizes and signs. Two seconds together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flexspline
from flexspline.discovery.physics import (
    driving_spring,
    falling_power,
    held_powers,
    impossible,
    one_signed,
    spring_bounds,
)
from flexspline.least_squares.problem import Problem, problem_of
from flexspline.logs.log import Log
from flexspline.regression.candidate_model import CandidateModel, candidate_model_of

VARYING = "position_dependent_friction"
HYSTERESIS = "torque_hysteresis"
BENDING = "nonlinear_viscous_friction"


@pytest.mark.parametrize(
    ("name", "target"),
    [("presliding_friction", "motor_torque"), ("torsional_hysteresis", "torsion")],
)
def test_the_spring_that_drives_most_is_held_first_and_the_rest_are_bounded(
    name: str, target: str
) -> None:
    effects = [flexspline.effect("offset"), flexspline.effect(name)]
    values = np.array([0.1, 0.3, -0.2, -0.5, 0.2])
    made = replace(candidate_model_of(effects, 1, {}), coefficients=values)
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
    said = impossible(candidate_model_of(effects, 1, {}), VARYING, problem)
    assert ("no run changes direction" in said) is refused


@pytest.mark.parametrize(
    ("levels", "refused"), [((1.0, 0.0, 0.0, 0.0), True), ((0.1, 0.1, 0.1, 1.0), False)]
)
def test_friction_builds_up_over_a_small_angle(levels: tuple[float, ...], refused: bool) -> None:
    """Of springs that slip at 0.3 rad and less: it is the mean by their levels that is small."""
    time = np.arange(0.0, 20.0, 0.01)
    log = Log.from_arrays(time=time, output_position=np.sin(time), motor_torque=np.cos(time),
                          facts={"gear_ratio": 1.0})  # fmt: skip
    springs = flexspline.effect("presliding_friction", presliding_width=0.3)
    effects = [flexspline.effect("offset"), springs]
    problem = problem_of([log], effects, "motor_torque", known_load=None, lowpass_hz=None,
                         threads=1)  # fmt: skip
    made = replace(candidate_model_of(effects, 1, {}), coefficients=np.array([0.0, *levels]))
    assert ("build up" in impossible(made, springs.name, problem)) is refused


def swinging(**channels: np.ndarray) -> Log:
    time = np.arange(0.0, 20.0, 0.01)
    return Log.from_arrays(time=time, output_position=np.sin(time), output_velocity=np.cos(time),
                           facts={"gear_ratio": 1.0},
                           **{name: values[: len(time)] for name, values in channels.items()}
                           )  # fmt: skip


def bending(target: str, *values: float) -> tuple[CandidateModel, Problem]:
    """A level, a viscous and two bending coefficients beside a run that swings."""
    log = swinging(**{target: np.sin(np.arange(2000.0))})
    effects = [flexspline.effect(n) for n in ("coulomb_friction", "viscous_friction", BENDING)]
    problem = problem_of([log], effects, target, known_load=None, lowpass_hz=None, threads=1)
    return replace(candidate_model_of(effects, 2, {}), coefficients=np.array(values)), problem


@pytest.mark.parametrize("target", ["motor_torque", "sensor_torque"])
@pytest.mark.parametrize(
    ("coulomb", "level", "refused"),
    [(1.0, 0.3, False), (1.0, -0.3, True), (-1.0, -0.3, False), (-1.0, 0.3, True)],
)
def test_stribecks_friction_adds_to_coulombs(
    target: str, coulomb: float, level: float, refused: bool
) -> None:
    """A drive's has one sign besides; a sensor sees both from the same side."""
    log = swinging(**{target: np.sin(np.arange(2000.0))})
    own = flexspline.effect("stribeck_friction", stribeck_velocity=0.3)
    effects = [flexspline.effect("coulomb_friction"), own]
    problem = problem_of([log], effects, target, known_load=None, lowpass_hz=None, threads=1)
    made = replace(candidate_model_of(effects, 1, {}), coefficients=np.array([coulomb, level]))
    said = impossible(made, own.name, problem)
    drives = target == "motor_torque" and level < 0.0 and not refused
    assert ("lessen friction" in said, "drive the joint" in said) == (refused, drives)
    assert bool(said) is (refused or drives)


@pytest.mark.parametrize(
    ("viscosity", "quadratic", "refused"),
    [(0.2, 0.1, False), (0.5, -0.2, False), (-0.05, 0.2, False), (-0.8, 0.9, True)],
)
def test_friction_that_falls_from_rest_is_no_bend_of_viscous_friction(
    viscosity: float, quadratic: float, refused: bool
) -> None:
    """Beside a level of 1 Nm, at up to 1 rad/s: by 0.18 Nm, where a tenth is a matter of form."""
    made, problem = bending("motor_torque", 1.0, viscosity, quadratic, 0.0)
    assert ("fall as the speed rises" in impossible(made, BENDING, problem)) is refused


@pytest.mark.parametrize(
    ("level", "quadratic", "cubic", "power"),
    [(1.0, -2.0, 1.0, "quadratic"), (1.0, 2.0, -2.5, "cubic"), (-1.0, 2.0, -1.0, "quadratic"),
     (1.0, -0.2, 0.1, "")],
)  # fmt: skip
def test_the_power_by_which_friction_would_fall_is_held_and_the_last_one_is_not(
    level: float, quadratic: float, cubic: float, power: str
) -> None:
    made, problem = bending("sensor_torque", level, 0.1 * level, quadratic, cubic)
    found = falling_power(made, problem)
    assert found == (f"{BENDING}.{power}" if power else "")
    assert held_powers(made) == {}
    if power:
        held = made.holding(found, 0.0)
        assert falling_power(held, problem) == "" and held_powers(held) == {found: 0.0}


@pytest.mark.parametrize(
    ("heights", "scatter", "said"),
    [((0.3, 0.0, 0.0, 0.0), 0.1, ""), ((-0.3, 0.0, 0.0, 0.0), 0.1, "run ahead"),
     ((0.3, 0.0, 0.0, 0.0), 3.0, "noise of the load"), ((0.3, 0.0, 0.0, 0.0), 0.5, ""),
     ((0.0, 0.0, 0.0, 0.3), 0.5, "noise of the load"),
     ((0.1, -0.2, 0.0, 0.3), 1.2, "noise of the load")],
)  # fmt: skip
def test_a_sensors_loop_lags_and_is_wider_than_its_load_scatters(
    heights: tuple[float, ...], scatter: float, said: str
) -> None:
    """A narrower one follows the noise, which is in what the load leaves, too.

    How wide it is, springs of 8, 4, 2 and 1 Nm say by their heights.
    """
    load = 10.0 * np.sin(0.3 * np.arange(2000.0))
    log = swinging(sensor_torque=1.01 * load, reference_torque=load)
    effects = [flexspline.effect("offset"), flexspline.effect(HYSTERESIS, load_width=8.0)]
    problem = problem_of([log], effects, "sensor_torque", known_load="reference_torque",
                         lowpass_hz=None, threads=1, scatter=scatter)  # fmt: skip
    made = replace(candidate_model_of(effects, 1, {}), coefficients=np.array([0.0, *heights]))
    why = impossible(made, HYSTERESIS, problem)
    assert said in why and bool(said) is bool(why)


@pytest.mark.parametrize(
    ("name", "target", "signs"),
    [
        ("presliding_friction", "motor_torque", 1),
        ("presliding_friction", "sensor_torque", 2),
        ("torsional_hysteresis", "torsion", 1),
        ("coulomb_friction", "motor_torque", 1),
        ("coulomb_friction", "sensor_torque", 0),
        ("offset", "motor_torque", 0),
    ],
)
def test_a_loop_costs_energy_and_only_friction_may_be_seen_from_the_other_side(
    name: str, target: str, signs: int
) -> None:
    assert one_signed(name, target) == signs
