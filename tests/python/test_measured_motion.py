"""Contact-free motion of three UR10e joints: silent where it resembles what thresholds have seen.

Base model of the current fitted to the first third of a run, thresholds by the margin that parts
left out need within the first two thirds, the last third held out. Standstill (|q̇| < 0.02 rad/s) is
left out: friction that sticks is undetermined, and no threshold can know it.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from measured import ur10e

import flexspline
from flexspline import _core
from flexspline.collision import Residual, calibrate_detector, left_out_margin

BASE = ["offset", "coulomb_friction", "viscous_friction", "inertia"]
STOPS = {1: 60.4, 2: 61.6, 4: 63.9}
"""s: where each run is broken off from full speed within 0.15 s, which happens nowhere else."""


@pytest.fixture(scope="module", params=STOPS)
def moving(request, data_folder):
    """Joint, detector, residual of the last third."""
    joint = request.param
    log = ur10e(joint)
    time = log["time"] - log["time"][0]
    effects = BASE if joint == 1 else [*BASE, "gravity"]
    model = flexspline.fit(
        effects, [log.rows(slice(0, len(log) // 3))], target="motor_current"
    ).model
    left = model.predict(log).residual
    slow = _core.observe_momentum(time, np.zeros_like(time), left, gain=10.0, exact=True)
    known = np.where(np.abs(log["output_velocity"]) < 0.02, np.nan, slow)
    edges = np.linspace(0, len(log), 7).astype(int)
    seen = [
        Residual(time[a:b], known[a:b], log["output_velocity"][a:b], f"rows {a} to {b}", "A")
        for a, b in pairwise(edges[:5])
    ]
    detector = calibrate_detector(
        seen,
        false_alarms_per_hour=None,
        apart=0.5,
        symmetric=True,
        margin=left_out_margin(seen, symmetric=True),
    )
    rows = slice(edges[4], None)
    held_out = Residual(time[rows], known[rows], log["output_velocity"][rows], "held out", "A")
    return joint, detector, held_out


def test_held_out_motion_raises_no_alarm_before_the_run_is_broken_off(moving):
    joint, detector, held_out = moving
    contact = detector.detect(held_out)[:, 0]
    before = held_out.time < STOPS[joint]
    assert np.ptp(held_out.time[before]) > 18.0 and not contact[before].any()


def test_breaking_off_from_full_speed_is_taken_for_a_contact_in_joints_2_and_4(moving):
    joint, detector, held_out = moving
    contact = detector.detect(held_out)[:, 0]
    assert contact[held_out.time >= STOPS[joint]].any() == (joint in (2, 4))
