"""The hand that pushes a UR10e at rest: contacts labelled by eye, thresholds from other logs.

The logs hold currents, no torques; the residual is the current without its slow trend, A. What is
contact-free with the arm at rest is short: before the first push and at the ends of the other runs,
without 1 s after a motion (the controllers' integrals die away) and 1 s before one.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from measured import ur10e

from flexspline.collision import (
    Residual,
    calibrate_detector,
    left_out_margin,
    standstill_residual,
)
from flexspline.errors import InputError

LABELS = json.loads((Path(__file__).parent / "contacts" / "ur10e_push_pose_1.json").read_text())
MOVING = 0.03  # rad/s, of the fastest joint; the push log stays below
AROUND = 1.0  # s, before and after a motion
RUNS = ("joint_1", "joint_2", "joint_4", "14harm50sec")


def at_rest(run):
    """Residual of all six joints; NaN near any motion."""
    logs = [ur10e(joint, run) for joint in range(1, 7)]
    time = logs[0]["time"] - logs[0]["time"][0]
    currents = np.stack([log["motor_current"] for log in logs], axis=1)
    fastest = np.max([np.abs(log["output_velocity"]) for log in logs], axis=0)
    found = standstill_residual(time, currents, np.zeros_like(currents), settle=0.2, name=run)
    moves = np.concatenate(([-np.inf], time[fastest >= MOVING], [np.inf]))
    after = np.searchsorted(moves, time)
    near = (time - moves[after - 1] < AROUND) | (moves[after] - time < AROUND)
    return Residual(time, np.where(near[:, None], np.nan, found.values), None, run, "A")


def part(residual, first, last, name):
    inside = (residual.time >= first) & (residual.time < last)
    values = np.where(inside[:, None], residual.values, np.nan)
    return Residual(residual.time, values, None, name, "A")


def calibrated(runs):
    return calibrate_detector(
        runs,
        false_alarms_per_hour=None,
        apart=0.25,
        symmetric=True,
        margin=left_out_margin(runs, symmetric=True),
    )


def onsets(detector, residual):
    """Times of the beginnings of contacts, one array for each joint."""
    rising = np.diff(detector.detect(residual).astype(int), axis=0, prepend=0) == 1
    return [residual.time[column] for column in rising.T]


@pytest.fixture(scope="module")
def pushed(data_folder):
    return at_rest("push_pose_1")


@pytest.fixture(scope="module")
def quiet(pushed):
    first = LABELS["contacts"][0]["start"] - LABELS["edge_uncertainty"]
    return [*(at_rest(run) for run in RUNS), part(pushed, 0.0, first, "before the first push")]


@pytest.fixture(scope="module")
def detector(quiet):
    return calibrated(quiet)


def test_every_labelled_joint_of_every_push_is_found_within_four_tenths_of_a_second(
    detector, pushed
):
    begun = onsets(detector, pushed)
    late = []
    for contact in LABELS["contacts"]:
        first = contact["start"] - LABELS["edge_uncertainty"]
        for joint in contact["joints"]:
            inside = (begun[joint - 1] >= first) & (begun[joint - 1] <= contact["end"])
            assert inside.any(), f"joint {joint} misses the push at {contact['start']} s"
            late.append(begun[joint - 1][inside][0] - contact["start"])
    print(
        f"found {len(late)} of {len(late)}; late by {np.median(late):.2f} s, worst {max(late):.2f}"
    )
    assert len(late) == 9 and max(late) < 0.4 and np.median(late) < 0.25


def test_no_alarm_begins_outside_of_the_pushes(detector, pushed):
    windows = [(c["start"] - LABELS["edge_uncertainty"], c["end"]) for c in LABELS["contacts"]]
    for joint, begun in enumerate(onsets(detector, pushed), start=1):
        for moment in begun:
            assert any(a <= moment <= b for a, b in windows), f"joint {joint} at {moment:.2f} s"


def test_the_end_of_the_push_log_that_no_threshold_has_seen_is_silent(detector, pushed):
    settled = LABELS["contacts"][-1]["end"] + LABELS["settling"]
    held_out = part(pushed, settled, np.inf, "after the last push")
    assert not detector.detect(held_out).any()
    assert np.isfinite(held_out.values[:, 0]).sum() > 250


def test_runs_left_out_alarm_at_most_once_in_all(quiet):
    alarms = {}
    for run in quiet:
        others = [other for other in quiet if other is not run]
        alarms[run.name] = sum(map(len, onsets(calibrated(others), run)))
    print(alarms)
    # One in joint 2, whose integral is still dying away 1 s after its own motion (0.39 A).
    assert sum(alarms.values()) <= 1


def test_the_contact_free_seconds_prove_little_and_the_result_says_so(quiet, detector):
    assert 9.0 < detector.hours * 3600.0 < 10.0
    assert detector.proven_rate == pytest.approx(3.0 / detector.hours, rel=0.01)
    assert detector.proven_rate > 1000.0
    assert "prove no more than 1.16e+03 false alarms per hour" in str(detector)
    with pytest.raises(InputError, match="too few to state a rate"):
        calibrate_detector(quiet, false_alarms_per_hour=60.0)


def test_the_papers_margin_of_1_18_is_too_small_for_logs_this_short(quiet):
    assert left_out_margin(quiet, symmetric=True) > 2.0
    alarms = 0
    for run in quiet:
        others = [other for other in quiet if other is not run]
        rule = calibrate_detector(others, false_alarms_per_hour=None, apart=0.25)
        alarms += sum(map(len, onsets(rule, run)))
    assert alarms > 1
