"""What a fit says of a loop of the torsion that is none of a gear, or that no run went round."""

from __future__ import annotations

import numpy as np
import pytest
from torsion_logs import LOAD, own_rows, truth

import flexspline
from flexspline.least_squares.problem import Run

GIVES_BACK, WIDE = "it gives back", "is wider than half of the"


def said(times: float, width: float | None = None) -> str:
    """Warnings of a fit to a gear whose loop is so many times that of a sound one."""
    effects, values = truth(orders=False)
    log = own_rows(9, effects, values * np.r_[np.ones(len(values) - 4), np.full(4, times)])
    fixed = {} if width is None else {"torsional_hysteresis.load_width": width}
    fit = flexspline.fit(effects, log, "torsion", known_load=LOAD, fixed=fixed)
    return " ".join(fit.warnings)


def test_a_sound_gear_is_not_warned_of() -> None:
    found = said(1.0)
    assert GIVES_BACK not in found and WIDE not in found


def test_a_loop_that_gives_back_more_than_the_mesh_yields_is_warned_of() -> None:
    assert GIVES_BACK in said(5.0)


def test_a_loop_wider_than_half_the_load_s_turns_is_warned_of() -> None:
    assert "its load_width of 500 Nm is wider than half of the 83" in said(1.0, width=500.0)


def fitted_loop() -> flexspline.Fit:
    time = np.arange(0.0, 20.0, 0.01)
    log = flexspline.Log.from_arrays(
        time=time,
        output_position=0.3 * np.sin(time),
        output_velocity=0.3 * np.cos(time),
        sensor_torque=np.sin(time) + 0.01 * np.cos(9.0 * time),
    )
    effects = ["coulomb_friction", flexspline.effect("presliding_friction", presliding_width=0.01)]
    return flexspline.fit(effects, log, "sensor_torque", checks=False,
                          fixed={"presliding_width": 0.01, "direction_width": 0.01})  # fmt: skip


def test_rows_that_do_not_count_are_said_to_be_those_of_the_effect_that_remembers() -> None:
    (said,) = [text for text in fitted_loop().warnings if "depends on what came before" in text]
    assert "presliding_friction" in said and "coulomb" not in said


def test_runs_are_not_compared_array_by_array(monkeypatch: pytest.MonkeyPatch) -> None:
    """Since Python 3.13 runs that share their arrays cannot be compared: those have no truth."""
    monkeypatch.setattr(Run, "__eq__", lambda one, other: pytest.fail("two runs are compared"))
    assert fitted_loop().rmse > 0.0
