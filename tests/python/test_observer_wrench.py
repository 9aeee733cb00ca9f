"""The wrench at the end effector: its value, its uncertainty, and what no joint feels."""

from __future__ import annotations

import numpy as np
import pytest

from flexspline.errors import InputError
from flexspline.observer import wrench_at_end_effector

TRUE = np.array([5.0, -2.0, 3.0, 0.4, 0.1, -0.6])


def jacobians(joints, count, seed=0):
    return np.random.default_rng(seed).standard_normal((count, 6, joints))


def test_seven_joints_find_the_wrench_and_its_covariance():
    rng = np.random.default_rng(1)
    count = 4000
    jacobian = np.broadcast_to(jacobians(7, 1), (count, 6, 7))
    spread = np.diag([0.1, 0.2, 0.1, 0.3, 0.05, 0.1, 0.2]) ** 2
    noise = rng.multivariate_normal(np.zeros(7), spread, size=count)
    found = wrench_at_end_effector(np.einsum("kij,i->kj", jacobian, TRUE) + noise, jacobian, spread)
    error = found.values - TRUE
    left = np.einsum("ki,kij,kj->k", error, np.linalg.inv(found.covariance), error)
    # χ² with 6 degrees of freedom: mean 6 ± √(12 / 4000), four standard errors.
    assert left.mean() == pytest.approx(6.0, abs=4.0 * np.sqrt(12.0 / count))
    assert np.all(found.rank == 6) and found.unknown == ()


def test_the_torques_of_six_joints_are_inverted_exactly_whatever_the_length():
    jacobian = jacobians(6, 20)
    torque = np.einsum("kij,i->kj", jacobian, TRUE)
    for length in (0.01, 1.0, 100.0):
        found = wrench_at_end_effector(torque, jacobian, np.eye(6), length=length)
        assert found.values == pytest.approx(np.broadcast_to(TRUE, (20, 6)), rel=1e-9)


def test_a_planar_arm_names_what_its_joints_do_not_feel():
    jacobian = np.zeros((3, 6, 3))
    jacobian[:, [0, 1, 5], :] = jacobians(3, 3)[:, :3]
    torque = np.einsum("kij,i->kj", jacobian, TRUE)
    found = wrench_at_end_effector(torque, jacobian, np.eye(3))
    assert found.unknown == ("force_z", "moment_x", "moment_y")
    assert found.values[:, [0, 1, 5]] == pytest.approx(np.broadcast_to(TRUE[[0, 1, 5]], (3, 3)))
    assert np.isnan(found.deviation[:, 2]).all() and np.all(found.rank == 3)
    assert "not observable: force_z, moment_x, moment_y" in str(found)


def test_four_joints_in_space_invent_no_component():
    found = wrench_at_end_effector(np.ones((5, 4)), jacobians(4, 5), np.eye(4))
    assert np.isnan(found.values).all() and np.all(found.rank == 4)


def test_a_singular_pose_loses_only_what_it_loses():
    jacobian = np.array([np.eye(6), np.eye(6)])
    jacobian[1, :, 2] = 0.0
    found = wrench_at_end_effector(np.ones((2, 6)), jacobian, np.eye(6))
    assert np.isfinite(found.values[0]).all()
    assert np.isnan(found.values[1]).tolist() == [False, False, True, False, False, False]
    assert found.unobservable[1, 2, 2] == pytest.approx(1.0)


def test_wrong_shapes_values_and_covariances_are_refused():
    jacobian = jacobians(6, 2)
    with pytest.raises(InputError, match="do not agree"):
        wrench_at_end_effector(np.ones((3, 6)), jacobian, np.eye(6))
    with pytest.raises(InputError, match="covariance of shape"):
        wrench_at_end_effector(np.ones((2, 6)), jacobian, np.eye(5))
    with pytest.raises(InputError, match="not symmetric positive definite"):
        wrench_at_end_effector(np.ones((2, 6)), jacobian, -np.eye(6))
    with pytest.raises(InputError, match="not finite at row 1"):
        wrench_at_end_effector(np.array([[1.0] * 6, [np.nan] * 6]), jacobian, np.eye(6))
    with pytest.raises(InputError, match="length"):
        wrench_at_end_effector(np.ones((2, 6)), jacobian, np.eye(6), length=0.0)
