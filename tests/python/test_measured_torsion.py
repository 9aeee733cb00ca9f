"""Torsion of the two measured joints with an encoder on either side (no torque channel).

Known of them (data README): ratios 7.296 and 7.328, half a millisecond between the encoders,
±2 mrad of hysteresis at the output between the directions. All figures here are on rows that the
fit never saw, counted at the motor; a seventh of that is seen at the output.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import measured
import numpy as np
import pytest
from cli_calls import call

import flexspline
from flexspline.least_squares.result import Fit
from flexspline.logs.checks.consistency import measured_gear
from flexspline.logs.log import Log
from flexspline.logs.repairs import repaired
from flexspline.logs.writing import write_log

JOINTS = (1, 2)
HYSTERESIS = ["offset", "torsional_hysteresis"]

pytestmark = pytest.mark.usefixtures("data_folder")


@cache
def aligned(joint: int) -> Log:
    """The run with the encoder delay taken out and the ratio that was measured."""
    log = measured.two_encoder(joint)
    gear = measured_gear(log)
    assert gear is not None
    shifted = repaired(log, f"shift=output_position:{gear.delay}")
    return shifted.with_facts({"gear_ratio": gear.ratio})


@cache
def fitted(joint: int, *effects: str) -> Fit:
    return flexspline.fit(effects, aligned(joint), "torsion")


def half_gap(fit: Fit) -> float:
    """Half the difference of the residual between the directions, in motion, rad at the output."""
    (run,) = fit.runs
    velocity = np.gradient(run.log["output_position"], run.log["time"])
    fast = (np.abs(velocity) > 0.1 * np.abs(velocity).max()) & run.counts
    down, up = (np.median(run.residual[fast & (s * velocity > 0)]) for s in (-1, 1))
    return float(down - up) / 2 / run.log.facts["gear_ratio"]


@pytest.mark.parametrize("joint", JOINTS)
def test_two_mrad_between_the_directions_are_hysteresis(joint: int) -> None:
    assert half_gap(fitted(joint, "offset")) == pytest.approx(2e-3, abs=0.3e-3)
    fit = fitted(joint, *HYSTERESIS)
    assert abs(half_gap(fit)) < 0.15e-3
    (loop,) = [d for d in fit.derived if d.name.endswith("at the output")]
    assert loop.value == pytest.approx(2.1e-3, abs=0.2e-3)
    assert loop.standard_error < 0.1e-3


@pytest.mark.parametrize("joint", JOINTS)
def test_hysteresis_explains_five_sixths_of_the_torsion_on_rows_never_seen(joint: int) -> None:
    bare, fit = fitted(joint, "offset"), fitted(joint, *HYSTERESIS)
    assert 0.016 < bare.cv_rmse < 0.0175
    assert fit.cv_rmse < 0.0070
    assert 1 - (fit.cv_rmse / bare.cv_rmse) ** 2 > 0.83


@pytest.mark.parametrize("joint", JOINTS)
def test_the_gear_s_error_is_found_at_the_motor_s_orders(joint: int) -> None:
    fit = fitted(joint, *HYSTERESIS, "kinematic_error")
    (kinematic,) = [e for e in fit.part.effects if e.name == "kinematic_error"]
    motor = {order for order, pair in kinematic.harmonics if pair == "motor_on_stator"}
    assert {2, 4, 9} <= motor
    assert fit.cv_rmse < 0.0055


@pytest.mark.parametrize("joint", JOINTS)
def test_what_remains_is_worst_at_standstill_where_no_torque_was_measured(joint: int) -> None:
    """Two thirds of a milliradian at the output remain, and the loop's inside is not explained."""
    fit = fitted(joint, *HYSTERESIS, "kinematic_error")
    ratio = aligned(joint).facts["gear_ratio"]
    assert 0.6e-3 < fit.cv_rmse / ratio < 0.75e-3
    at = {score.label: score for score in fit.scores}
    assert at["standstill"].cv_rmse > 1.5 * fit.cv_rmse


def test_the_command_line_fits_the_same(tmp_path: Path) -> None:
    write_log(measured.two_encoder(1), tmp_path / "run.csv")
    gear = measured_gear(measured.two_encoder(1))
    assert gear is not None
    result = call(
        *("fit", tmp_path / "run.csv", "--target", "torsion"),
        *("--effects", ",".join(HYSTERESIS), "--gear-ratio", gear.ratio),
        *("--repair", f"shift=output_position:{gear.delay}", "--out", tmp_path / "out"),
    )
    assert result.exit_code == 0, result.output
    model = flexspline.Model.load(tmp_path / "out" / "model.json")
    part = model.part("torsion")
    assert part.effects[1].reads == ("motor_position",)
    expected = fitted(1, *HYSTERESIS).part
    assert part.coefficients == pytest.approx(expected.coefficients, rel=1e-6)
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "half the loop of the hysteresis" in page and "[Nm]" not in page
