"""What body and intrinsic torque leave of the sensors: turlapati_intrinsic_dynamics (1), (2)."""

from __future__ import annotations

import numpy as np
import pytest
from two_link import motion, two_link

from flexspline.effects import effect
from flexspline.errors import InputError
from flexspline.observer import observe, subtract, wrench_at_end_effector
from flexspline.part import Part

TIME, ANGLE, SPEED, RATE = motion(2.0, 200.0)
PUSH = np.array([1.5, -0.7])  # Nm


def rigid():
    mass, coriolis, gravity = two_link(ANGLE, SPEED)
    return np.einsum("kij,kj->ki", mass, RATE) + np.einsum("kij,kj->ki", coriolis, SPEED) + gravity


def own_part():
    effects = (effect("viscous_friction"), effect("inertia"))
    return Part("sensor_torque", effects, np.array([0.8, 0.05]))


def found(**more):
    torque = rigid() + PUSH
    torque[:, 1] += 0.8 * SPEED[:, 1] + 0.05 * RATE[:, 1]
    given = {"dynamics": two_link, "noise": 0.02, "intrinsic": [None, own_part()], **more}
    return subtract(TIME, ANGLE, SPEED, RATE, torque, **given)


def test_what_is_left_is_the_push_and_the_part_keeps_its_inertia():
    left = found()
    # Rounding of sums of torques of some 50 Nm.
    assert left.external == pytest.approx(np.broadcast_to(PUSH, left.external.shape), abs=1e-12)
    assert left.intrinsic[:, 0] == pytest.approx(0.0)


def test_sensors_and_parts_add_up_in_the_wrench_s_uncertainty():
    left = found(noise=[0.03, 0.02], intrinsic_error=[0.04, 0.0])
    assert left.deviation == pytest.approx([0.05, 0.02])
    jacobian = np.zeros((len(TIME), 6, 2))
    jacobian[:, 0, 0], jacobian[:, 1, 1] = 0.5, 0.25  # m
    wrench = wrench_at_end_effector(left.external, jacobian, left.covariance)
    assert wrench.values[0, :2] == pytest.approx(PUSH / [0.5, 0.25])
    assert wrench.deviation[0, :2] == pytest.approx([0.05 / 0.5, 0.02 / 0.25])


def test_a_row_that_is_not_finite_costs_itself_alone():
    angle = ANGLE.copy()
    angle[7, 0] = np.nan
    torque = rigid() + PUSH
    left = subtract(TIME, angle, SPEED, RATE, torque, dynamics=two_link, noise=0.1)
    assert np.flatnonzero(np.isnan(left.external).any(axis=1)).tolist() == [7]


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"noise": 0.0}, "makes no covariance"),
        ({"noise": [0.1, 0.1, 0.1]}, "3 of noise for 2 joints"),
        ({"noise": -1.0}, "zero or more"),
        ({"intrinsic": [own_part()]}, "1 parts for 2 joints"),
        ({"dynamics": lambda q, v: two_link(q, -v)}, "violate Ṁ"),
    ],
)
def test_what_cannot_be_subtracted_is_one_sentence(more, said):
    with pytest.raises(InputError, match=said):
        found(**more)


def test_ripple_of_the_wave_generator_is_not_predicted_without_its_gear():
    """A part holds no gear: with a ratio of 1 the ripple would have another order."""
    part = Part("sensor_torque", (effect("wave_generator_ripple", orders=[2]),), np.ones(2))
    with pytest.raises(InputError, match="takes the gear"):
        observe(TIME, ANGLE[:, 0], SPEED[:, 0], SPEED[:, 0], gain=10.0, dynamics=0.1, friction=part)
