"""A model as a MuJoCo engine plugin: it brakes as the core does, in every joint and mjData."""

from __future__ import annotations

import copy
import os
import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli_calls import call
from mujoco_plugins import Loaded, instances
from numpy.typing import NDArray
from test_own_header import compiled as fit_with_header

from flexspline import InputError
from flexspline.effects import CATALOGUE, effect
from flexspline.effects.causes import LAG
from flexspline.exporting import export, mujoco_plugin, plugin_of
from flexspline.logs.log import Log
from flexspline.model import Model, Part
from flexspline.programs import include_folder

pytestmark = pytest.mark.usefixtures("elsewhere")

Array = NDArray[np.float64]

FACTS = {"gear_ratio": 100.0, "output_spline": "circular", "joint": "elbow"}
VALIDITY = {
    "output_position": [-1.5, 2.0],
    "output_velocity": [-2.0, 1.5],
    "output_acceleration": [-4.0, 5.0],
    "temperature": [20.0, 35.0],
}
OF_DRIVES = [name for name, info in CATALOGUE.items() if "M" in info.targets and name != LAG]
STEP = 4e-4
ARM = f"""
<mujoco>
  <option timestep="{STEP}"/>
  {instances("flexspline.NAME", left={"joint": "a"}, right={"joint": "b", "temperature": 31})}
  <worldbody>
    <body>
      <joint name="free" type="hinge" axis="0 0 1" damping="1"/>
      <geom type="sphere" size="0.01" pos="0.1 0 0" mass="1"/>
      <body>
        <joint name="a" type="hinge" axis="0 1 0" armature="0.05"/>
        <geom type="sphere" size="0.01" pos="0 0 -0.2" mass="0.5"/>
        <body pos="0 0 -0.2">
          <joint name="b" type="hinge" axis="0 1 0" armature="0.04"/>
          <geom type="sphere" size="0.01" pos="0 0 -0.1" mass="0.2"/>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator><motor joint="a"/><motor joint="b"/></actuator>
</mujoco>"""
TEMPERATURES = {"a": 27.5, "b": 31.0}


def model_of(names: list[str], target: str = "motor_torque", **facts: Any) -> Model:
    """A model with a coefficient of some size for every term."""
    made = [effect(n, orders=[2]) if CATALOGUE[n].pairs else effect(n) for n in names]
    terms = [f"{e.name}.{term.name}" for e in made for term in e.terms]
    sizes = [0.02 + 0.003 * (len(term) % 7) for term in terms]
    part = Part(target, tuple(made), np.array(sizes), None, {"validity": VALIDITY})
    side = "torsion" if target == "torsion" else "drive"
    return Model({"sensor" if target == "sensor_torque" else side: part}, {**FACTS, **facts})


@pytest.fixture(scope="module")
def whole(loaded: Loaded) -> tuple[Model, str]:
    """A model with every effect of a drive, and the name of its plugin."""
    model = model_of(OF_DRIVES)
    return model, loaded(model)


def arm(mujoco: Any, name: str, **replaced: str) -> tuple[Any, Any]:
    text = ARM.replace("NAME", name)
    for old, new in replaced.items():
        text = text.replace(f'{old}="', f'{old}="{new}" was="') if new else text
    model = mujoco.MjModel.from_xml_string(text)
    return model, mujoco.MjData(model)


def drive(steps: int) -> Array:
    """Torques of the two motors, (steps, 2): to and fro, with rests and reversals of all sizes."""
    t = STEP * np.arange(steps)
    first = 1.5 * np.sin(2 * np.pi * 0.5 * t) * np.sin(2 * np.pi * 0.07 * t)
    second = 0.8 * np.sin(2 * np.pi * 0.8 * t) * (np.sin(2 * np.pi * 0.11 * t) > 0.0)
    return np.column_stack([first + 0.3 * np.sin(2 * np.pi * 3.1 * t), second])


def recorded(mujoco: Any, model: Any, data: Any, torques: Array) -> dict[str, dict[str, Array]]:
    """Run and return, by joint, what the plugin is to have read in each step, and its force."""
    dofs = np.array([model.joint(name).dofadr[0] for name in "ab"])
    rows = np.zeros((len(torques), 6, 2))
    for k, torque in enumerate(torques):
        last = [data.qacc[dofs], data.qfrc_actuator[dofs] + data.qfrc_passive[dofs]]
        rows[k, :4] = [data.qpos[dofs], data.qvel[dofs], *(last if k else [[0, 0], [0, 0]])]
        data.ctrl[:] = torque
        mujoco.mj_step(model, data)
        rows[k, 4:] = [data.qfrc_passive[dofs], data.plugin_state[model.plugin_stateadr]]
    motion = ("output_position", "output_velocity", "output_acceleration")
    names = (*motion, "load", "force", "velocity")
    return {
        joint: dict(zip(names, rows[:, :, place].T, strict=True))
        for place, joint in enumerate("ab")
    }


def said_by_the_core(model: Model, rows: dict[str, Array], temperature: float) -> Array:
    channels = {name: rows[name] for name in rows if name.startswith("output")}
    size = len(rows["force"])
    log = Log.from_arrays(
        time=STEP * np.arange(size),
        reference_torque=rows["load"],
        temperature=np.full(size, temperature),
        **channels,
    )
    plugin = plugin_of(model)
    return -plugin.torque * plugin.model.predict(log).predicted


def test_two_joints_brake_as_the_core_says_over_a_hundred_thousand_steps(
    mujoco: Any, whole: tuple[Model, str]
) -> None:
    model, name = whole
    runs = recorded(mujoco, *arm(mujoco, name), drive(100_000))
    for joint, rows in runs.items():
        expected = said_by_the_core(model, rows, TEMPERATURES[joint])
        assert np.isfinite(expected).all() and np.ptp(expected) > 0.5
        np.testing.assert_allclose(rows["force"], expected, rtol=0.0, atol=1e-12)
        reversals = np.count_nonzero(np.diff(np.sign(rows["output_velocity"])))
        assert reversals > 30 and np.ptp(rows["output_position"]) > 0.4
        assert np.ptp(rows["load"]) > 0.4
        np.testing.assert_array_equal(rows["velocity"], rows["output_velocity"])
    assert set(plugin_of(model).left) == {"inertia", "gravity"}


IMPLICIT = '<config key="implicit" value="true"/>'


def test_an_implicit_force_is_the_cores_at_the_end_of_each_step(
    mujoco: Any, whole: tuple[Model, str]
) -> None:
    model, name = whole
    text = ARM.replace("NAME", name).replace("</instance>", f"{IMPLICIT}</instance>")
    scene = mujoco.MjModel.from_xml_string(text)
    scene.opt.timestep = 5 * STEP
    runs = recorded(mujoco, scene, mujoco.MjData(scene), np.repeat(drive(4000), 5, axis=0))
    for joint, rows in runs.items():
        starts, rows["output_velocity"] = rows["output_velocity"], rows["velocity"]
        expected = said_by_the_core(model, rows, TEMPERATURES[joint])
        np.testing.assert_allclose(rows["force"], expected, rtol=0.0, atol=1e-12)
        armature = {"a": 0.05, "b": 0.04}[joint]
        last = np.concatenate([[0.0], rows["force"][:-1]])
        pull = armature * rows["output_acceleration"] - last
        ends = starts + (pull + rows["force"]) * scene.opt.timestep / armature
        assert np.abs(ends - rows["velocity"]).max() < 2e-10
        assert np.ptp(rows["output_position"]) > 0.4


def test_an_implicit_force_holds_a_load_at_any_timestep(mujoco: Any, loaded: Loaded) -> None:
    sharp = effect("coulomb_friction", direction_width=1e-3)
    name = loaded(Model({"drive": Part("motor_torque", (sharp,), np.array([0.3]))}, FACTS))
    slowest = {}
    for implicit in (IMPLICIT, ""):
        text = ARM.replace("NAME", name).replace("</instance>", f"{implicit}</instance>")
        scene = mujoco.MjModel.from_xml_string(text)
        scene.opt.timestep, scene.opt.gravity = 0.005, (0.0, 0.0, 0.0)
        data = mujoco.MjData(scene)
        data.ctrl[:] = 0.2, 0.0
        mujoco.mj_step(scene, data, nstep=400)
        speeds = []
        for _ in range(20):
            mujoco.mj_step(scene, data)
            speeds.append(abs(data.joint("a").qvel[0]))
        slowest[implicit] = max(speeds)
    creeps = 1e-3 * np.arctanh(0.2 / 0.3)
    assert slowest[IMPLICIT] == pytest.approx(creeps, rel=0.01)
    assert slowest[""] > 5.0 * creeps


def test_the_memory_of_each_instance_is_cleared_by_a_reset(
    mujoco: Any, whole: tuple[Model, str]
) -> None:
    model, data = arm(mujoco, whole[1])
    fresh = data.plugin_state.copy()
    assert not fresh.any() and len(fresh) == model.npluginstate > 6
    first = recorded(mujoco, model, data, drive(3000))
    assert data.plugin_state.any()
    mujoco.mj_resetData(model, data)
    assert data.plugin_state.tobytes() == fresh.tobytes()
    again = recorded(mujoco, model, data, drive(3000))
    for joint in "ab":
        np.testing.assert_array_equal(again[joint]["force"], first[joint]["force"])


@pytest.mark.parametrize("by", ["mj_copyData", "deepcopy", "mj_setState"])
def test_a_copy_goes_on_as_the_original_does(
    by: str, mujoco: Any, whole: tuple[Model, str]
) -> None:
    model, data = arm(mujoco, whole[1])
    torques = drive(6000)
    recorded(mujoco, model, data, torques[:3000])
    other = copy.deepcopy(data) if by == "deepcopy" else mujoco.MjData(model)
    if by == "mj_copyData" and hasattr(mujoco, by):
        mujoco.mj_copyData(other, model, data)
    elif by == "mj_copyData":  # MuJoCo 3 has it behind copy alone
        other = copy.copy(data)
    if by == "mj_setState":
        kept = mujoco.mjtState.mjSTATE_INTEGRATION
        state = np.empty(mujoco.mj_stateSize(model, kept))
        mujoco.mj_getState(model, data, state, kept)
        mujoco.mj_setState(model, other, state, kept)
    for torque in torques[3000:]:
        for one in (data, other):
            one.ctrl[:] = torque
            mujoco.mj_step(model, one)
        np.testing.assert_array_equal(other.qfrc_passive, data.qfrc_passive)
    np.testing.assert_array_equal(other.qpos, data.qpos)
    assert other.plugin_state.tobytes() == data.plugin_state.tobytes()


def test_looking_moves_no_memory(mujoco: Any, whole: tuple[Model, str]) -> None:
    model, data = arm(mujoco, whole[1])
    recorded(mujoco, model, data, drive(3000))
    state = data.plugin_state.tobytes()
    mujoco.mj_forward(model, data)
    forces = data.qfrc_passive.copy()
    for _ in range(3):
        mujoco.mj_forward(model, data)
        np.testing.assert_array_equal(data.qfrc_passive, forces)
    assert data.plugin_state.tobytes() == state


def test_a_runge_kutta_step_moves_the_memory_once(mujoco: Any, loaded: Loaded) -> None:
    """Springs that have started are in the middle, whatever the stages of the step were."""
    name = loaded(model_of(["presliding_friction"]))
    ends = []
    for integrator in (mujoco.mjtIntegrator.mjINT_EULER, mujoco.mjtIntegrator.mjINT_RK4):
        model, data = arm(mujoco, name)
        model.opt.integrator = integrator
        model.opt.timestep = STEP / 10
        for torque in np.repeat(drive(6000), 10, axis=0):
            data.ctrl[:] = torque
            mujoco.mj_step(model, data)
        ends.append([data.qpos.copy(), data.qfrc_passive.copy()])
    np.testing.assert_allclose(ends[0][0], ends[1][0], atol=1e-3)
    assert np.abs(ends[0][0]).max() > 0.1


def test_friction_opposes_the_motion_and_a_current_is_brought_to_the_output(
    mujoco: Any, loaded: Loaded
) -> None:
    part = Part("motor_current", (effect("viscous_friction"),), np.array([0.5]))
    name = loaded(Model({"drive": part}, {**FACTS, "torque_constant": 0.1}))
    model, data = arm(mujoco, name)
    data.qvel[:] = [0.0, 2.0, -1.0]
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.qfrc_passive[1:], [-0.5 * 10.1 * 2.0, 0.5 * 10.1], rtol=1e-15)


def test_an_effect_of_the_users_own_runs_by_its_header(
    mujoco: Any, loaded: Loaded, tmp_path: Path
) -> None:
    model = fit_with_header(tmp_path).model
    plugin = plugin_of(model)
    data: Any
    scene, data = arm(mujoco, loaded(model))
    data.qvel[:] = [0.0, 0.15, -0.3]
    mujoco.mj_forward(scene, data)
    log = Log.from_arrays(time=[0.0, 1.0], output_velocity=[0.15, -0.3])
    assert "hump" in {e.name for e in plugin.part.effects}
    np.testing.assert_allclose(
        data.qfrc_passive[1:], -plugin.model.predict(log).predicted, rtol=0, atol=1e-12
    )


def test_a_timestep_at_which_friction_chatters_is_told(
    mujoco: Any, loaded: Loaded, tmp_path: Path
) -> None:
    name = loaded(model_of(["coulomb_friction", "viscous_friction"]))
    warned = tmp_path / "MUJOCO_LOG.TXT"
    arm(mujoco, name)
    assert not warned.exists()
    text = ARM.replace("NAME", name).replace(f'timestep="{STEP}"', 'timestep="0.05"')
    mujoco.MjData(mujoco.MjModel.from_xml_string(text))
    found = re.search(
        r"joint 'a' will chatter .* 0\.05 s; give one below (\S+) s", warned.read_text()
    )
    assert found is not None and 0.001 < float(found[1]) < 0.05


WRONG = {
    "a joint that is not there": ('value="a"', 'value="wrist"', "has no joint 'wrist'; give the"),
    "a slide": ('"a" type="hinge"', '"a" type="slide"', "joint 'a' is no hinge"),
    "no joint": ('<config key="joint" value="a"/>', "", 'config with key="joint"'),
    "one joint twice": ('value="b"', 'value="a"', "two instances act on joint 'a'"),
    "words for a temperature": ('value="31"', 'value="warm"', "temperature of joint 'b' is no num"),
    "neither true nor false": (
        'value="a"/>',
        'value="a"/><config key="implicit" value="yes"/>',
        "implicit of joint 'a' is neither true nor false",
    ),
    "no armature": (
        'value="a"/></instance>',
        f'value="a"/>{IMPLICIT}</instance>',
        "an implicit force needs an armature of joint 'a' above zero",
    ),
    "no temperature": ('value="31"', 'value="nan"', "temperature of joint 'b' is no number"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_the_mjcf_has_wrong_is_said(case: str, mujoco: Any, whole: tuple[Model, str]) -> None:
    old, new, sentence = WRONG[case]
    text = ARM.replace("NAME", whole[1])
    assert old in text
    if case == "no armature":
        text = text.replace('armature="0.05"', "")
    with pytest.raises(ValueError, match=re.escape(sentence)) as raised:
        mujoco.MjModel.from_xml_string(text.replace(old, new, 1))
    assert f"flexspline.{whole[1]}: " in str(raised.value)


@pytest.mark.parametrize("name", ["coulomb_friction", "viscous_friction"])
def test_friction_that_a_sensor_sees_from_the_other_side_never_drives_a_joint(
    name: str, tmp_path: Path
) -> None:
    """iiwa joint 5 as recorded: -0.018 Nm of Coulomb friction."""
    model = model_of([name], "sensor_torque")
    part = replace(model.parts["sensor"], coefficients=np.array([-0.018]))
    turned = Model({"sensor": part}, model.facts)
    with pytest.raises(InputError, match=r"would drive the joint.*flip_sign=sensor_torque"):
        export(turned, tmp_path / "joint", "mujoco-plugin")
    assert not [*tmp_path.iterdir()]
    assert export(model, tmp_path / "joint", "mujoco-plugin").is_dir()


@pytest.mark.parametrize(("slope", "drives"), [(-0.1, False), (-0.3, True)])
def test_friction_that_falls_with_speed_may_leave_while_it_brakes(
    slope: float, drives: bool, tmp_path: Path
) -> None:
    """A plain model of a joint with Stribeck friction: 0.3 Nm at rest, less when it is fast."""
    model = model_of(["coulomb_friction", "viscous_friction"], "sensor_torque")
    part = replace(
        model.parts["sensor"],
        coefficients=np.array([0.3, slope]),
        record={"validity": {"output_velocity": [-1.5, 2.0]}},
    )
    falling = Model({"sensor": part}, model.facts)
    if drives:
        with pytest.raises(InputError, match=r"is -0.3 Nm at 2 rad/s, which would drive the joint"):
            export(falling, tmp_path / "joint", "mujoco-plugin")
    else:
        assert export(falling, tmp_path / "joint", "mujoco-plugin").is_dir()


def test_the_line_in_the_source_builds_it(mujoco: Any, tmp_path: Path) -> None:
    if shutil.which("c++") is None:
        pytest.skip("c++ is missing; install Debian's g++")
    folder = export(
        model_of(["coulomb_friction"], joint='"elbow" 7'), tmp_path / "by hand", "mujoco-plugin"
    )
    first, *lines, _ = re.findall(r"^//   (.*)$", (folder / "by_hand.cpp").read_text(), re.M)
    assert "get_include()" in first  # which leads nowhere in a checkout
    script = "\n".join([f"F='{include_folder()}'", *lines])
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])  # its python3
    done = subprocess.run(["bash", "-e", "-c", script], cwd=folder, capture_output=True, text=True,
                          env={**os.environ, "PATH": path})  # fmt: skip
    assert done.returncode == 0 and not done.stderr
    mujoco.mj_loadPluginLibrary(str(folder / "libby_hand.so"))
    scene = mujoco.MjModel.from_xml_path(str(folder / "by_hand.xml"))
    assert scene.nplugin == 1 and scene.joint(0).name == '"elbow" 7'
    assert scene.dof_armature[0] == 0.0


def test_the_command_writes_a_folder_and_compiles_it(mujoco: Any, tmp_path: Path) -> None:
    model_of(["inertia", "coulomb_friction", "load_dependent_friction"]).save(tmp_path / "m.json")
    arguments = ("export", "--model", tmp_path / "m.json", "--format", "mujoco-plugin", "--out")
    done = call(*arguments, tmp_path / "wrist")
    assert done.exit_code == 0, done.output
    shared = {"mujoco-instance.hpp", "mujoco-joint.hpp"}
    sources = {"wrist.hpp", "wrist.cpp", "wrist.xml", *shared}
    assert {path.name for path in (tmp_path / "wrist").iterdir()} == sources
    if shutil.which("c++") is not None:
        done = call(*arguments, "wrist", "--compile")
        assert done.exit_code == 0, done.output
        assert (tmp_path / "wrist" / "libwrist.so").is_file()
    done = call(*arguments[:4], "header", "--out", tmp_path / "wrist.hpp", "--compile")
    assert done.exit_code == 2 and "--compile is for --format mujoco-plugin" in done.stderr
    done = call(*arguments, tmp_path / "m.json")
    assert done.exit_code == 2 and "is a file; give the name of a folder" in done.stderr


REFUSED: dict[str, tuple[Model, str]] = {
    "no friction": (
        model_of(["inertia", "gravity"]),
        r"no effect that a plugin could run: inertia, gravity; fit friction, or export with",
    ),
    "a torsion without loads": (
        model_of(["mesh_compliance"], "torsion"),
        "does not say up to which load it was fitted, and so not how stiff it gets; fit it again",
    ),
    "a sensor's errors": (
        model_of(["temperature_drift", "torque_hysteresis"], "sensor_torque"),
        "no effect that a plugin could run: temperature_drift, torque_hysteresis",
    ),
    "a current without a constant": (
        model_of(["coulomb_friction"], "motor_current"),
        "lacks torque_constant",
    ),
    "another part": (model_of(["coulomb_friction"]), "no part"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_model_that_no_plugin_runs_is_refused(case: str, tmp_path: Path) -> None:
    model, sentence = REFUSED[case]
    target = "torsion" if case == "another part" else None
    with pytest.raises(InputError, match=sentence):
        export(model, tmp_path / "joint", "mujoco-plugin", target)
    assert [*tmp_path.iterdir()] == []


def test_a_motor_encoder_needs_the_gear_ratio(tmp_path: Path) -> None:
    channels = {"channels": ["output_position", "motor_position"]}
    part = replace(model_of(["cogging"]).parts["drive"], record=channels)
    with pytest.raises(InputError, match="lacks it; fit it again with --gear-ratio"):
        export(Model({"drive": part}), tmp_path / "joint", "mujoco-plugin")
    folder = export(Model({"drive": part}, FACTS), tmp_path / "joint", "mujoco-plugin")
    assert "/*motor_encoder=*/false" in (folder / "joint.hpp").read_text()


def test_without_mujoco_or_a_compiler_nothing_is_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    model, folder = model_of(["coulomb_friction"]), tmp_path / "joint"
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"not installed; run pip install 'flexspline\[mujoco"):
        mujoco_plugin(model, folder)
    monkeypatch.undo()
    pytest.importorskip("mujoco")
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CXX", raising=False)
    with pytest.raises(InputError, match=r"c\+\+ is not on this machine; install Debian's g\+\+"):
        mujoco_plugin(model, folder)
    (tmp_path / "refuses").write_text("#!/bin/sh\necho error: no thanks >&2\nexit 1\n")
    (tmp_path / "refuses").chmod(0o755)
    monkeypatch.setenv("CXX", "refuses")
    with pytest.raises(InputError, match="compiling the plugin: exit code 1: error: no thanks"):
        mujoco_plugin(model, folder)
    assert [path.name for path in tmp_path.iterdir()] == ["refuses"]


@pytest.mark.parametrize(
    "name", ['a"b<c>&d', "--> <joint/>", 'x"; int y = 1; //', "tab\tand\x00zero", "\\\n*/", "關節"]
)
def test_no_name_reaches_out_of_its_place(name: str, tmp_path: Path) -> None:
    names = ["coulomb_friction", "inertia"]
    model = model_of(names, joint=name)
    folder = export(model, tmp_path / 'jo"int\n7', "mujoco-plugin")
    root = ET.fromstring((folder / "jo_int_7.xml").read_text(encoding="utf-8"))
    (joint,) = root.iter("joint")
    config = {one.attrib["key"]: one.attrib["value"] for one in root.iter("config")}
    assert config == {"joint": joint.attrib["name"], "implicit": "true"}
    source = (folder / "jo_int_7.cpp").read_text(encoding="utf-8")
    assert source.isascii() and all(letter.isprintable() or letter == "\n" for letter in source)
    usual = export(
        model_of(["coulomb_friction", "inertia"]), tmp_path / "jo_int_7", "mujoco-plugin"
    )
    assert source == (usual / "jo_int_7.cpp").read_text()


def test_sensor_errors_are_left_out_of_a_part_with_friction(tmp_path: Path) -> None:
    model = model_of(["coulomb_friction", "gain_error", "time_drift", "gravity"], "sensor_torque")
    plugin = plugin_of(model)
    assert [e.name for e in plugin.part.effects] == ["coulomb_friction"]
    assert plugin.left["gravity"] == "the mass of the bodies"
    folder = export(model, tmp_path / "joint", "mujoco-plugin")
    assert "Left out: time_drift; nothing" in (folder / "joint.cpp").read_text()


def test_own_headers_stay_as_they_are(tmp_path: Path) -> None:
    if shutil.which("c++") is None:
        pytest.skip("c++ is missing; install Debian's g++")
    model = fit_with_header(tmp_path).model
    with pytest.raises(InputError, match="is the name of the header of one of the model's own"):
        export(model, tmp_path / "hump", "mujoco-plugin")
    folder = export(model, tmp_path / "joint", "mujoco-plugin")
    assert (folder / "hump.hpp").is_file()
    (folder / "hump.hpp").write_text("mine")
    with pytest.raises(InputError, match=r"hump\.hpp: is not what .* was when it was compiled"):
        export(model, tmp_path / "joint", "mujoco-plugin")
    assert (folder / "hump.hpp").read_text() == "mine"
