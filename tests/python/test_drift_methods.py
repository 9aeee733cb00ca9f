"""The drift models of the first paper and of its references beside one another."""

from __future__ import annotations

import numpy as np
import pytest
from calibration_logs import QUIET, drift_run, load_run

from flexspline.baselines import compare_drift_methods
from flexspline.errors import InputError

EVERY = slice(0, None, 10)  # a row each second: a kernel takes its time
TRAINING = [log.rows(EVERY, note="thinned") for log in (load_run(QUIET), drift_run(QUIET))]
FRESH = drift_run(QUIET, seed=9).rows(EVERY, note="thinned")


def test_the_paper_s_polynomial_leaves_less_than_a_line_and_a_line_less_than_nothing() -> None:
    left = compare_drift_methods(TRAINING, FRESH)["RMSE [Nm]"]
    curve, line = left["polynomial of degree 2"], left["linear, with the calibration"]
    assert curve < 0.9 * line < 0.9 * left["none"]
    # noise of 0.4 mV is 25 mNm; the polynomial is the truth of this bench
    assert curve == pytest.approx(0.4e-3 * 62.738, rel=0.15)
    assert left["kernel regression"] < 1.5 * curve


def test_a_kernel_gives_no_answer_outside_of_its_temperatures() -> None:
    beyond = FRESH.with_columns({"temperature": FRESH["temperature"] + 10.0}, note="warmer")
    scores = compare_drift_methods(TRAINING, beyond)
    outside = np.mean(beyond["temperature"] > max(run["temperature"].max() for run in TRAINING))
    assert scores.loc["kernel regression", "no answer [%]"] == pytest.approx(100 * outside, abs=1.0)
    assert scores.loc["polynomial of degree 2", "no answer [%]"] == 0.0


def test_a_run_without_a_truth_is_refused() -> None:
    log = drift_run(QUIET)
    bare = type(log)({"time": log["time"], "sensor_voltage": log["sensor_voltage"]}, log.facts)
    with pytest.raises(InputError, match="need the channel temperature"):
        compare_drift_methods(TRAINING, bare)
