"""Dynamics from a URDF by Pinocchio: the same as by hand, and a sentence where it is absent."""

from __future__ import annotations

import os
import sys

import numpy as np
import pytest
from two_link import motion, two_link, urdf

from flexspline.errors import InputError
from flexspline.observer import dynamics_from_urdf, observe, require_dynamics


@pytest.fixture
def arm(tmp_path):
    if os.environ.get("CI") != "true" or sys.version_info[:2] != (3, 11):
        pytest.importorskip("pinocchio", reason="Pinocchio is not installed: pip install pin")
    path = tmp_path / "arm.urdf"
    path.write_text(urdf())
    return path


def test_a_urdf_gives_the_mass_coriolis_and_gravity_worked_out_by_hand(arm):
    _, angle, speed, _ = motion(3.0, 100.0)
    for made, by_hand in zip(
        dynamics_from_urdf(arm)(angle, speed), two_link(angle, speed), strict=True
    ):
        # A product of a dozen numbers of order ten.
        assert made == pytest.approx(by_hand, abs=1e-12)


def test_pinocchios_coriolis_matrix_passes_the_check_and_the_observer_agrees(arm):
    time, angle, speed, _ = motion(3.0, 100.0)
    require_dynamics(dynamics_from_urdf(arm), angle, speed)
    made, by_hand = (
        observe(time, angle, speed, 0.0 * angle, gain=20.0, dynamics=dynamics)
        for dynamics in (dynamics_from_urdf(arm), two_link)
    )
    assert made.external == pytest.approx(by_hand.external, abs=1e-9)


def test_an_arm_with_other_joints_than_the_log_is_refused(arm):
    with pytest.raises(InputError, match="has 2 joints that move, the log 3"):
        dynamics_from_urdf(arm)(np.zeros((4, 3)), np.zeros((4, 3)))


def test_a_file_that_is_missing_or_no_urdf_is_refused(arm):
    with pytest.raises(InputError, match="no such file"):
        dynamics_from_urdf(arm.with_name("other.urdf"))
    arm.write_text("no robot")
    with pytest.raises(InputError, match="cannot be read as a URDF"):
        dynamics_from_urdf(arm)


def test_an_absent_pinocchio_is_one_sentence_with_the_command(monkeypatch):
    monkeypatch.setitem(sys.modules, "pinocchio", None)
    with pytest.raises(InputError, match=r"pip install 'flexspline\[pinocchio\]'"):
        dynamics_from_urdf("arm.urdf")
