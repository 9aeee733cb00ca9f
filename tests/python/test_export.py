"""What `export` writes, and what it refuses."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import flexspline
from flexspline.effects import effect
from flexspline.errors import InputError
from flexspline.estimation.plan import part_limits
from flexspline.exporting import export, namespace_of
from flexspline.logs.log import Log
from flexspline.model import Model, Part

SENSOR = Part(
    "sensor_torque",
    (
        effect("offset"),
        effect("coulomb_friction", direction_width=0.02),
        effect("wave_generator_ripple", orders=[1, 2]),
        effect("gain_error"),
    ),
    np.array([0.1, 0.30000000000000004, 1e-5, -2.0, 3.0, 4.0, 0.01]),
    "reference_torque",
    {
        "lowpass": 5.0,
        "channels": ["output_position", "output_velocity", "known_load"],
        "validity": {"output_velocity": [-1.5, 1.25]},
        "parameters": [
            {
                "name": "coulomb_friction.level",
                "kind": "coefficient",
                "value": 0.3,
                "standard_error": 0.0021,
                "unit": "Nm",
                "state": "fitted",
                "determined": True,
            }
        ],
        "logs": [
            {
                "name": "run \\\n1",
                "sha256": "ab12",
                "rows": 5,
                "history": [
                    "read from a file",
                    "output_velocity derived from output_position: zero phase, -3 dB at 12 Hz",
                ],
            }
        ],
    },
)
DRIVE = Part("motor_current", (effect("viscous_friction"),), np.array([0.25]))
FACTS = {"gear_ratio": 100.0, "output_spline": "circular", "joint": "elbow"}
ONE = Model({"sensor": SENSOR}, FACTS)
BOTH = Model({"sensor": SENSOR, "drive": DRIVE}, FACTS)


def header(model: Model, folder: Path, target: str | None = None) -> str:
    return export(model, folder / "joint.hpp", target=target).read_text(encoding="utf-8")


def test_numbers_in_a_header_read_back_as_the_same_doubles(tmp_path: Path) -> None:
    numbers = [float(n) for n in re.findall(r"^ +S\((.+)\),  //", header(ONE, tmp_path), re.M)]
    limits = part_limits(SENSOR)
    assert numbers == [*SENSOR.coefficients.tolist(), *limits.values()]
    assert limits and f"S({limits['output_velocity']}),  // output_velocity, rad/s" in header(
        ONE, tmp_path
    )


def test_a_header_says_where_it_comes_from(tmp_path: Path) -> None:
    text = header(ONE, tmp_path)
    ONE.save(tmp_path / "model.json")
    digest = hashlib.sha256((tmp_path / "model.json").read_bytes()).hexdigest()
    assert f'model_sha256 =\n    "{digest}";' in text
    assert "SHA-256 ab12" in text
    assert f"flexspline {flexspline.__version__}" in text
    assert "joint elbow" in text


def test_a_header_names_channels_filters_and_ranges(tmp_path: Path) -> None:
    text = header(ONE, tmp_path)
    assert "Reads output_velocity [rad/s]" in text
    assert "Reads known_load [Nm]: reference_torque" in text
    assert "low-passed at 5 Hz" in text
    assert "zero phase, -3 dB at 12 Hz" in text
    assert "read from a file" not in text
    assert "output_velocity{  // rad/s\n    S(-1.5), S(1.25)};" in text


def test_a_header_has_errors_and_units_beside_its_values(tmp_path: Path) -> None:
    assert "level 0.3000 ± 0.0021 Nm" in header(ONE, tmp_path)
    assert "A·s/rad" in header(BOTH, tmp_path, "motor_current")


def test_no_name_of_a_run_reaches_out_of_its_comment(tmp_path: Path) -> None:
    head = header(ONE, tmp_path).split("#pragma once")[0].splitlines()
    assert all(line.startswith("//") and not line.endswith("\\") for line in head)


def test_an_encoder_on_the_motor_is_expected_where_the_logs_had_one(tmp_path: Path) -> None:
    assert "/*motor_encoder=*/false" in header(ONE, tmp_path)
    record = {"channels": ["motor_position"]}
    part = Part(SENSOR.target, SENSOR.effects, SENSOR.coefficients, None, record)
    text = header(Model({"sensor": part}, FACTS), tmp_path)
    assert "/*motor_encoder=*/true" in text
    assert "Reads motor_position [rad]" in text


@pytest.mark.parametrize(
    ("file", "name"),
    [
        ("joint.hpp", "joint"),
        ("left arm-2.hpp", "left_arm_2"),
        ("7.hpp", "joint_7"),
        ("__x__.hpp", "x"),
        ("float.h", "float_model"),
        ("flexspline.hpp", "flexspline_model"),
        ("關節.hpp", "model"),
    ],
)
def test_a_namespace_is_the_stem_made_an_identifier(file: str, name: str) -> None:
    assert namespace_of(Path("folder") / file) == name


def test_json_is_the_model_file(tmp_path: Path) -> None:
    export(BOTH, tmp_path / "out.json", format="json")
    BOTH.save(tmp_path / "saved.json")
    assert (tmp_path / "out.json").read_bytes() == (tmp_path / "saved.json").read_bytes()


def test_json_of_one_target_holds_that_part_alone(tmp_path: Path) -> None:
    loaded = Model.load(export(BOTH, tmp_path / "out.json", "json", "motor_current"))
    assert list(loaded.parts) == ["drive"]
    log = Log.from_arrays(time=[0.0, 1.0], output_velocity=[1.0, 2.0])
    assert loaded.predict(log).predicted.tolist() == [0.25, 0.5]


def test_a_model_of_several_parts_needs_a_target_for_a_header(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="say which target"):
        header(BOTH, tmp_path)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("model", "options", "sentence"),
    [
        (ONE, {"format": "headr"}, "no export format 'headr' .did you mean 'header'"),
        (ONE, {"format": "elf"}, "json or fmu or simulink or mujoco-plugin or mujoco or urdf"),
        (ONE, {"format": "binary", "scalar": "half"}, "give float or double"),
        (ONE, {"format": "header", "scalar": "half"}, "give float or double"),
        ("model.json", {}, r"model is a str; give what it holds, Model.load\('model.json'\)"),
        (SimpleNamespace(model=ONE), {}, "give the model that it holds, its .model"),
        (None, {}, "model is a NoneType; give a model"),
        (ONE, {"target": "torsion"}, "no part for the target torsion"),
        (ONE, {"target": "torsion", "format": "json"}, "no part for the target torsion"),
        (Model({"sensor": SENSOR}, {"gear_ratio": 2.0**31}), {}, "effective ratio"),
    ],
)
def test_what_cannot_be_exported_is_said_in_a_sentence(
    tmp_path: Path, model: Model, options: dict[str, str], sentence: str
) -> None:
    with pytest.raises(InputError, match=sentence):
        export(model, tmp_path / "joint.hpp", **options)
    assert not list(tmp_path.iterdir())


def test_a_coefficient_that_no_float_holds_is_named(tmp_path: Path) -> None:
    part = Part("sensor_torque", (effect("offset"),), np.array([1e39]))
    with pytest.raises(InputError, match=r"offset\.offset = .* does not fit"):
        header(Model({"sensor": part}, {}), tmp_path)


def test_a_file_in_the_place_of_a_folder_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    with pytest.raises(InputError, match=r"file.*cannot be written"):
        export(ONE, tmp_path / "file" / "joint.hpp")


def test_the_same_model_gives_the_same_header(tmp_path: Path) -> None:
    assert header(ONE, tmp_path) == header(ONE, tmp_path)


def test_an_effect_with_memory_shows_its_state_in_the_example(tmp_path: Path) -> None:
    part = Part("torsion", (effect("torsional_hysteresis"),), np.full(4, 1e-3), "reference_torque")
    text = header(Model({"torsion": part}, {"gear_ratio": 100.0}), tmp_path)
    assert "Model<float>::State state;" in text
    assert ".predict(at, state, torsion);" in text
    assert ".path = S(0.0)" in text
    assert "State state" not in header(ONE, tmp_path)
