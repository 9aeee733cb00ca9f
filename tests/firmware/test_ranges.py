"""The exported header says of a sample what `predict` says of a row: whether it extrapolates."""

from __future__ import annotations

from pathlib import Path

import device
import numpy as np
import pytest
from every_effect import LOAD, motion

from flexspline.effects import effect
from flexspline.exporting import export
from flexspline.model import Model, Part, rows_outside

EFFECTS = (
    effect("gravity"),
    effect("viscous_friction"),
    effect("load_dependent_friction"),
    effect("temperature_drift"),
)
RANGES = {
    "output_position": [-0.5, 2.0],
    "output_velocity": [-4.0, 3.0],
    "known_load": [-18.0, 18.0],
    "temperature": [24.0, 37.0],
    "motor_torque": [0.0, 0.1],  # which no effect reads
}


def model(**ranges: list[float]) -> Model:
    terms = sum(len(each.terms) for each in EFFECTS)
    part = Part("sensor_torque", EFFECTS, np.full(terms, 0.1), LOAD, {"validity": ranges})
    return Model({"sensor": part}, {"gear_ratio": 100.0})


@pytest.mark.parametrize("scalar", ["double", "float"])
def test_a_device_knows_where_its_model_extrapolates(tmp_path: Path, scalar: str) -> None:
    log = motion(5)
    rows = device.radian_rows(log, LOAD)
    for names in (tuple(RANGES), ("output_position",)):
        made = model(**{name: RANGES[name] for name in names})
        program = device.compiled(made, tmp_path, device.compilers()[0], name="ranges")
        flags, _ = device.stream(program, scalar, "radians", rows)
        found = rows_outside(made.part(), log)
        assert "motor_torque" not in found and len(found) == len(set(names) - {"motor_torque"})
        expected = np.any(list(found.values()), axis=0)
        assert 0.02 < expected.mean() < 0.98
        different = np.count_nonzero((flags == 1.0) != expected)
        assert set(flags) == {0.0, 1.0}
        assert different == 0 if scalar == "double" else different <= 3  # a float at the very edge


def test_a_range_of_a_whole_turn_leaves_no_angle_out(tmp_path: Path) -> None:
    made = model(output_position=[0.0, 6.2], output_velocity=[-100.0, 100.0])
    program = device.compiled(made, tmp_path, device.compilers()[0], name="ranges")
    flags, _ = device.stream(program, "float", "radians", device.radian_rows(motion(5), LOAD))
    assert not flags.any() and rows_outside(made.part(), motion(5)) == {}


def test_a_header_without_ranges_of_what_it_reads_has_no_flags(tmp_path: Path) -> None:
    text = export(model(motor_torque=[0.0, 1.0]), tmp_path / "joint.hpp").read_text()
    assert "flags" not in text and "validity" in text
