"""Comparisons on logs that nobody here made: numbers as the data's own README knows them."""

from __future__ import annotations

from pathlib import Path

import measured
import numpy as np
import pytest

import flexspline
from flexspline.comparison.result import Comparison

BASE = ["offset", "coulomb_friction", "viscous_friction", "inertia", "gravity"]


def _ur10e(joint: int) -> Comparison:
    log = measured.ur10e(joint)
    fit = flexspline.fit(BASE, log, "motor_current", lowpass=5.0)
    return flexspline.compare(fit.model, log, lowpass=5.0)


def test_the_gap_of_ur10e_joint_2_follows_its_load(data_folder: Path, tmp_path: Path) -> None:
    made = _ur10e(2)
    assert made.unit == "A"
    # 0.266 before and 0.103 after a load-dependent term, both known from outside
    assert made.rmse == pytest.approx(0.266, abs=0.01)
    assert 0.08 < made.noise_floor < 0.13
    assert made.follows[0].name == "load"
    # in this log the load is a function of the angle: nobody can tell the two apart
    assert "output angle" in made.follows[0].also
    made.report(tmp_path / "report.html")
    assert "<svg" in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_ur10e_joint_4_is_near_its_floor_but_at_reversals(data_folder: Path) -> None:
    made = _ur10e(4)
    assert made.rmse == pytest.approx(0.022, abs=0.002)
    assert made.noise_floor > 0.85 * made.rmse
    assert all("reversal" in f.name for f in made.follows[:1])


def test_the_gap_of_the_kinova_current_turns_with_the_motor(data_folder: Path) -> None:
    logs = [measured.kinova(speed) for speed in measured.KINOVA_SPEEDS]
    logs = [log.rows(log["time"] > 1.0, note="the start transient is left out") for log in logs]
    fit = flexspline.fit(
        ["offset", "viscous_friction", "stribeck_friction"], logs, "motor_current", checks=False
    )
    made = flexspline.compare(fit.model, logs)
    assert made.follows[0].name == "position_order"
    orders = [round(peak.per_output_turn) for peak in made.orders[:3]]
    assert sorted(orders) == [700, 1200, 1400]
    # amplitudes of the README at the output, by 7.6 Nm/A: 0.14, 0.13 and 0.10 Nm
    sizes = {round(peak.per_output_turn): 7.6 * peak.amplitude for peak in made.orders}
    assert sizes[1200] == pytest.approx(0.14, abs=0.03)
    assert sizes[1400] == pytest.approx(0.13, abs=0.03)


def test_the_weight_of_kuka_joint_2_leaves_no_order_of_its_bands(data_folder: Path) -> None:
    log, *others = (measured.iiwa(2, speed) for speed in ("p2", "p1", "p3"))
    fit = flexspline.fit(BASE[:3], others, "sensor_torque", checks=False)
    made = flexspline.compare(fit.model, log)
    assert made.follows[0].name == "position"
    # what is left of 34 Nm; with one mean per band of 0.1 rad 3.1 Nm and orders 63, 126, 188 ...
    assert made.noise_floor < 1.0
    bands = 20.0 * np.pi * np.arange(1, 9)  # bands of 0.1 rad and their harmonics
    orders = np.array([peak.per_output_turn for peak in made.orders])
    assert np.abs(orders[:, None] - bands).min(initial=np.inf) > 2.0
