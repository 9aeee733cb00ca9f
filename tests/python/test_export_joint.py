"""A model as the joint of a simulator: what it says there, and what it leaves out."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli_calls import call

from flexspline.effects import CATALOGUE, effect
from flexspline.errors import FlexsplineWarning, InputError
from flexspline.exporting import export
from flexspline.logs.log import Log
from flexspline.model import Model, Part

VALIDITY = {
    "output_position": [-1.5, 2.0],
    "output_velocity": [-2.0, 1.5],
    "output_acceleration": [-4.0, 5.0],
    "temperature": [20.0, 35.0],
}
PLAIN = ("inertia", "viscous_friction", "nonlinear_viscous_friction", "coulomb_friction")
MOMENTS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
NUMBERS = [0.02, 0.30000000000000004, -0.02, 0.001, 0.4]


@pytest.fixture(autouse=True)
def an_older_mujoco(monkeypatch: pytest.MonkeyPatch) -> None:
    """One without passive DC motors, which would take some of what is lost here."""
    monkeypatch.setattr("flexspline.exporting.has_dcmotor", lambda: False)


def model_of(
    names: tuple[str, ...] = PLAIN,
    numbers: list[float] = NUMBERS,
    target: str = "motor_torque",
    record: dict[str, Any] | None = None,
    **facts: Any,
) -> Model:
    made = {"validity": VALIDITY} if record is None else record
    part = Part(target, tuple(map(effect, names)), np.array(numbers), None, made)
    return Model({"torsion" if target == "torsion" else "drive": part}, facts)


def text_of(model: Model, folder: Path, form: str = "mujoco") -> str:
    return export(model, folder / "joint.xml", format=form).read_text(encoding="utf-8")


def joint_of(text: str) -> dict[str, str]:
    found = ET.fromstring(text).find(".//joint")
    assert found is not None
    return found.attrib


def losses_of(text: str) -> dict[str, str]:
    """Effect and size of the table of what is lost."""
    table = text.split("over the ranges of the fit [Nm]:")[1].split("\n\n")[0]
    return dict(re.findall(r"^ +(\w+)  +([\d.e+-]+|\?)  ", table, re.M))


def in_mujoco(text: str) -> tuple[Any, Any, Any]:
    mujoco = pytest.importorskip("mujoco")
    loaded = mujoco.MjModel.from_xml_string(text)
    return mujoco, loaded, mujoco.MjData(loaded)


def test_mujoco_brakes_as_the_core_does(tmp_path: Path) -> None:
    model = model_of()
    mujoco, loaded, data = in_mujoco(text_of(model, tmp_path))
    speeds = np.linspace(-2.0, 1.5, 29)
    log = Log.from_arrays(
        time=np.arange(29.0), output_velocity=speeds, output_acceleration=np.zeros(29)
    )
    said = model.components(log)
    viscous = said["viscous_friction"] + said["nonlinear_viscous_friction"]
    for speed, expected, level in zip(speeds, viscous, said["coulomb_friction"], strict=True):
        data.qvel[0] = speed
        mujoco.mj_forward(loaded, data)
        assert data.qfrc_passive[0] == pytest.approx(-expected, rel=1e-12, abs=1e-12)
        if abs(speed) > 0.25:  # 0.011 s · 0.4 Nm / 0.02 kg·m², and damping beside it
            assert data.qfrc_constraint[0] == pytest.approx(-level, rel=1e-12)
        else:
            assert abs(data.qfrc_constraint[0]) <= abs(level)
    assert loaded.dof_armature[0] == 0.02 and loaded.jnt_stiffness[0] == 0.0


def test_a_line_of_the_joint_can_be_copied(tmp_path: Path) -> None:
    text = text_of(model_of(joint="elbow"), tmp_path)
    (line,) = [line for line in text.splitlines() if "<joint " in line]
    assert dict(ET.fromstring(line).attrib) == {
        "name": "elbow",
        "type": "hinge",
        "axis": "0 0 1",
        "armature": "0.02",
        "damping": "0.30000000000000004 -0.02 0.001",
        "frictionloss": "0.4",
        "stiffness": "0",
    }
    assert losses_of(text) == {} and "knows; for an older one" in text


def test_damping_is_one_number_where_the_model_is_linear(tmp_path: Path) -> None:
    text = text_of(model_of(("viscous_friction",), [0.25]), tmp_path)
    assert joint_of(text)["damping"] == "0.25"
    assert "older" not in text and "soft constraint" not in text


def test_a_current_is_brought_to_the_output(tmp_path: Path) -> None:
    names, values = ("viscous_friction", "offset"), [0.5, -0.2501]
    facts: dict[str, Any] = {
        "gear_ratio": 100.0,
        "output_spline": "circular",
        "torque_constant": 0.1,
    }
    text = text_of(model_of(names, values, "motor_current", **facts), tmp_path)
    assert float(joint_of(text)["damping"]) == pytest.approx(0.5 * 101 * 0.1, rel=1e-15)
    assert losses_of(text) == {"offset": "2.53"}
    with pytest.raises(InputError, match=r"lacks torque_constant.*--torque-constant"):
        text_of(model_of(names, values, "motor_current", gear_ratio=100.0), tmp_path)
    with pytest.raises(InputError, match="part for torsion is in rad"):
        text_of(model_of(("offset",), [0.1], "torsion"), tmp_path)


def test_what_is_lost_has_its_size_over_the_ranges(tmp_path: Path) -> None:
    names = ("stribeck_friction", "gravity", "offset", "output_ripple", "viscous_friction")
    ripple = effect("output_ripple", orders=[7])
    effects = tuple(ripple if name == "output_ripple" else effect(name) for name in names)
    part = Part(
        "sensor_torque",
        effects,
        np.array([0.3, 0.0, 2.0, -0.125, 0.03, 0.04, 0.1]),
        None,
        {"validity": VALIDITY},
    )
    text = text_of(Model({"sensor": part}), tmp_path)
    sizes = {name: float(size) for name, size in losses_of(text).items()}
    assert sizes["offset"] == 0.125
    assert sizes["gravity"] == pytest.approx(2.0, rel=0.01)
    assert sizes["output_ripple"] == pytest.approx(0.05, rel=0.01)  # the root of 0.03² + 0.04²
    log = Log.from_arrays(time=np.arange(9001.0), output_velocity=np.linspace(-2.0, 1.5, 9001))
    alone = Model({"drive": Part("motor_torque", effects[:1], np.array([0.3]))})
    peak = np.abs(alone.predict(log).predicted).max()
    assert sizes["stribeck_friction"] == pytest.approx(peak, rel=0.01)
    assert list(sizes) == sorted(sizes, key=lambda name: -sizes[name])


def test_directions_of_friction_have_their_mean(tmp_path: Path) -> None:
    text = text_of(model_of(("coulomb_friction_per_direction",), [0.5, -0.3]), tmp_path)
    assert float(joint_of(text)["frictionloss"]) == pytest.approx(0.4)
    assert losses_of(text) == {"coulomb_friction_per_direction": "0.1"}


def test_negative_friction_is_lost_and_not_written(tmp_path: Path) -> None:
    with pytest.warns(FlexsplineWarning, match="negative friction"):
        text = text_of(model_of(("coulomb_friction", "viscous_friction"), [-0.2, -0.5]), tmp_path)
    assert joint_of(text)["damping"] == joint_of(text)["frictionloss"] == "0.0"
    assert losses_of(text) == {"viscous_friction": "1", "coulomb_friction": "0.2"}
    in_mujoco(text)


def test_sizes_without_a_range_are_not_guessed(tmp_path: Path) -> None:
    names, values = ("viscous_friction", "gravity", "offset"), [0.1, 1.0, 0.0, 0.5]
    text = text_of(model_of(names, values, record={}), tmp_path)
    assert losses_of(text) == {"offset": "0.5", "gravity": "?"}
    assert "the model has no range of output_position" in text


def test_friction_by_load_is_sized_by_the_load_of_the_model(tmp_path: Path) -> None:
    names, values = ("inertia", "load_dependent_friction"), [0.5, 0.1]
    text = text_of(model_of(names, values), tmp_path)
    assert float(losses_of(text)["load_dependent_friction"]) == pytest.approx(0.25, rel=0.02)
    silent = {"validity": {"output_velocity": [-2.0, 1.5]}}
    assert losses_of(text_of(model_of(names, values, record=silent), tmp_path)) == {
        "load_dependent_friction": "?"
    }


def test_a_product_of_channels_is_sized_in_the_corner_of_its_ranges(tmp_path: Path) -> None:
    names, values = ("temperature_dependent_friction",), [0.1, 0.0]
    text = text_of(model_of(names, values), tmp_path)
    (size,) = losses_of(text).values()
    ends = Log.from_arrays(time=[0.0, 1.0], output_velocity=[-2.0, -2.0], temperature=[20.0, 35.0])
    corner = np.abs(model_of(names, values).predict(ends).predicted).max()
    assert float(size) == pytest.approx(corner, rel=0.03)


@pytest.mark.parametrize("name", [n for n, e in CATALOGUE.items() if "M" in e.targets])
def test_every_effect_of_a_drive_is_kept_or_lost(name: str, tmp_path: Path) -> None:
    ripple = bool(CATALOGUE[name].pairs)
    made = effect(name, orders=[2]) if ripple else effect(name)
    part = Part(
        "motor_torque", (made,), np.full(len(made.terms), 0.1), None, {"validity": VALIDITY}
    )
    text = text_of(Model({"drive": part}, {"gear_ratio": 50.0}), tmp_path)
    numbers = ("armature", "damping", "frictionloss")
    kept = any(float(n) for each in numbers for n in joint_of(text)[each].split())
    assert kept != (name in losses_of(text))
    in_mujoco(text)


@pytest.mark.parametrize(
    "name", ['a"b<c>&d', "--> <joint/>", "x--", "tab\tand\x00zero", "-", "關節"]
)
def test_no_name_reaches_out_of_its_place(name: str, tmp_path: Path) -> None:
    root = ET.fromstring(text_of(model_of(joint=name), tmp_path))
    (joint,) = root.iter("joint")
    assert joint.attrib["name"] == name.replace("\t", " ").replace(
        "\x00", "\N{REPLACEMENT CHARACTER}"
    )


def test_the_command_exports_a_joint(tmp_path: Path) -> None:
    model_of().save(tmp_path / "model.json")
    out = tmp_path / "joint.xml"
    done = call("export", "--model", tmp_path / "model.json", "--format", "mujoco", "--out", out)
    assert done.exit_code == 0 and joint_of(out.read_text())["frictionloss"] == "0.4"


def urdf_parts(text: str) -> dict[str, dict[str, str]]:
    """Attributes of the joint and of all in it."""
    (joint,) = ET.fromstring(text).iter("joint")
    return {"joint": joint.attrib, **{child.tag: child.attrib for child in joint}}


def test_a_urdf_has_damping_friction_and_limits(tmp_path: Path) -> None:
    names = ("inertia", "viscous_friction", "coulomb_friction")
    text = text_of(model_of(names, [0.02, 0.3, 0.4], joint="elbow"), tmp_path, "urdf")
    parts = urdf_parts(text)
    assert parts["joint"] == {"name": "elbow", "type": "revolute"}
    assert parts["dynamics"] == {"damping": "0.3", "friction": "0.4"}
    limit = {name: float(value) for name, value in parts["limit"].items()}
    assert limit.pop("effort") == pytest.approx(0.02 * 5.0 + 0.3 * 2.0 + 0.4, rel=0.05)
    assert limit == {"lower": -1.5, "upper": 2.0, "velocity": 2.0}
    assert losses_of(text) == {"inertia": "0.1"} and "give it to the link" in text


def test_a_known_load_is_in_the_effort(tmp_path: Path) -> None:
    record = {"validity": {**VALIDITY, "known_load": [-7.0, 3.0]}}
    part = Part("motor_torque", (effect("offset"),), np.array([0.5]), "reference_torque", record)
    parts = urdf_parts(text_of(Model({"drive": part}), tmp_path, "urdf"))
    assert float(parts["limit"]["effort"]) == 7.5


def test_nonlinear_damping_is_lost_to_a_urdf(tmp_path: Path) -> None:
    text = text_of(model_of(), tmp_path, "urdf")
    assert float(losses_of(text)["nonlinear_viscous_friction"]) == pytest.approx(
        0.02 * 4 - 0.001 * 8
    )
    assert urdf_parts(text)["dynamics"]["damping"] == "0.30000000000000004"


@pytest.mark.parametrize(
    ("ranges", "limited"),
    [
        ({}, False),
        ({"output_position": [-1.0, 1.0]}, False),
        ({"output_velocity": [-1.0, 1.0]}, True),
    ],
)
def test_a_urdf_without_ranges_turns_without_limits(
    ranges: dict[str, Any], limited: bool, tmp_path: Path
) -> None:
    model = model_of(("viscous_friction",), [0.25], record={"validity": ranges})
    text = text_of(model, tmp_path, "urdf")
    parts = urdf_parts(text)
    assert parts["joint"]["type"] == "continuous" and "The joint is continuous" in text
    assert parts.get("limit") == ({"effort": "0.25", "velocity": "1.0"} if limited else None)
    assert ("There are no limits" in text) != limited


def test_mujoco_reads_the_urdf(tmp_path: Path) -> None:
    text = text_of(model_of(joint='a"<-->'), tmp_path, "urdf")
    moments = " ".join(f'{name}="{int(name[1] == name[2])}"' for name in MOMENTS)
    inertial = f'<inertial><mass value="1"/><inertia {moments}/></inertial>'
    _, loaded, _ = in_mujoco(
        text.replace('"link"/>\n  <joint', f'"link">{inertial}</link>\n  <joint')
    )
    assert loaded.dof_damping[0] == 0.30000000000000004 and loaded.dof_frictionloss[0] == 0.4
    assert loaded.jnt_range[0].tolist() == [-1.5, 2.0] and loaded.joint(0).name == 'a"<-->'
