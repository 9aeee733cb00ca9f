"""MuJoCo's passive DC motors beside a joint: what they take of a model, and how near it is."""

from __future__ import annotations

import importlib.metadata
import json
import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli_calls import call
from numpy.typing import NDArray
from test_export_joint import VALIDITY, losses_of, model_of

from flexspline import simulate
from flexspline.effects import CATALOGUE, effect
from flexspline.errors import InputError
from flexspline.exporting import export, joint_of
from flexspline.logs.log import Log
from flexspline.model import Model, Part
from flexspline.prepared import Preparation, prepared

Array = NDArray[np.float64]

RIPPLES = ("output_ripple", "cogging", "wave_generator_ripple")
SPRUNG = (effect("coulomb_friction"), effect("presliding_friction", presliding_width=0.02))
SPRUNG_NUMBERS = [0.3, 0.2, 0.0, 0.1, 0.05]


def one_of(effects: tuple[Any, ...], numbers: list[float], **facts: Any) -> Model:
    part = Part("motor_torque", effects, np.array(numbers), None, {"validity": VALIDITY})
    return Model({"drive": part}, {"gear_ratio": 100.0, **facts})


def text_of(model: Model, folder: Path, dcmotor: bool | None = True) -> str:
    path = export(model, folder / "joint.xml", format="mujoco", dcmotor=dcmotor)
    return path.read_text(encoding="utf-8")


def motors_in(text: str) -> list[dict[str, str]]:
    return [one.attrib for one in ET.fromstring(text).iter("dcmotor")]


@pytest.fixture(scope="module")
def load() -> Callable[..., tuple[Any, Any, Any]]:
    mujoco = pytest.importorskip("mujoco", minversion="4", reason="run pip install 'mujoco>=4'")

    def made(text: str, **options: float) -> tuple[Any, Any, Any]:
        scene = mujoco.MjModel.from_xml_string(text)
        for name, value in options.items():
            setattr(scene.opt, name, value)
        return mujoco, scene, mujoco.MjData(scene)

    return made


@pytest.mark.parametrize("spline", ["circular", "flex", "unknown"])
@pytest.mark.parametrize("pair", [None, *CATALOGUE["wave_generator_ripple"].pairs])
def test_each_order_of_a_ripple_is_the_cores_at_every_angle(
    load: Any, pair: str | None, spline: str, tmp_path: Path
) -> None:
    random = np.random.default_rng(4)
    if pair is None:
        ripples = tuple(effect(name, orders=[2, 7]) for name in RIPPLES[:2])
    else:
        ripples = (effect("wave_generator_ripple", orders=[(2, pair), (4, pair)]),)
    numbers = random.normal(0.0, 0.3, sum(len(one.terms) for one in ripples))
    model = one_of(ripples, [*numbers], output_spline=spline)
    text = text_of(model, tmp_path)
    mujoco, scene, data = load(text)
    assert losses_of(text) == {} and len(motors_in(text)) == 2 * len(ripples) and scene.nu == 0
    angles = np.concatenate([np.linspace(-1.5, 2.0, 201), [0.0]])
    said = model.predict(Log.from_arrays(time=np.arange(202.0), output_position=angles)).predicted
    made = np.empty(202)
    for row, angle in enumerate(angles):
        data.qpos[0] = angle
        mujoco.mj_forward(scene, data)
        made[row] = data.qfrc_actuator[0]
    assert np.ptp(said) > 0.3
    np.testing.assert_allclose(made, -said, rtol=0.0, atol=1e-12)


def test_a_motor_whose_angle_no_gear_ratio_tells_keeps_its_ripple(tmp_path: Path) -> None:
    part = Part(
        "motor_torque",
        (effect("cogging", orders=[2]),),
        np.array([0.1, 0.0]),
        None,
        {"validity": VALIDITY, "channels": ["output_position", "motor_position"]},
    )
    text = text_of(Model({"drive": part}), tmp_path)
    assert "cogging" in losses_of(text) and not motors_in(text)
    assert "a dcmotor turns with the joint: no gear_ratio" in text


def test_stribecks_friction_in_steady_motion_is_the_cores(load: Any, tmp_path: Path) -> None:
    """Beside frictionloss, which is not in it: each level counts once."""
    effects = (
        effect("inertia"),
        effect("coulomb_friction"),
        effect("stribeck_friction", stribeck_velocity=0.3),
    )
    model = one_of(effects, [0.05, 0.4, 0.25])
    text = text_of(model, tmp_path)
    assert losses_of(text) == {} and re.search(r"stribeck_friction +dcmotor lugre", text)
    mujoco, scene, data = load(text)
    assert scene.dof_frictionloss[0] == 0.4
    speeds = np.array([-1.2, -0.4, -0.15, -0.05, 0.05, 0.1, 0.3, 0.7, 1.5])
    log = Log.from_arrays(time=np.arange(9.0), output_velocity=speeds, output_acceleration=speeds)
    said = model.components(log)
    for speed, expected in zip(speeds, said["stribeck_friction"], strict=True):
        mujoco.mj_resetData(scene, data)
        for _ in range(20):  # 0.05 rad/s for 40 ms: two hundred times the path
            data.qvel[0] = speed
            mujoco.mj_step(scene, data)
        data.qvel[0] = speed
        mujoco.mj_forward(scene, data)
        assert data.qfrc_actuator[0] == pytest.approx(-expected, rel=1e-8)
        assert np.sign(expected) == np.sign(speed)


def held(rest: Array) -> float:
    """Root mean square [mrad]."""
    return float(1e3 * np.sqrt(np.mean(rest**2)))


def driven(load: Any, text: str, torque: Array, period: float) -> Array:
    """The angle in MuJoCo where a torque acts on the joint, from standstill."""
    mujoco, scene, data = load(text, timestep=period)
    angle = np.empty(len(torque))
    for row, now in enumerate(torque):
        angle[row] = data.qpos[0]
        data.qfrc_applied[0] = now
        mujoco.mj_step(scene, data)
    return angle


def motion_of(model: Model, torque: Array, period: float) -> Array:
    """The same in the core's forward simulation, with true sticking."""
    still = np.zeros(len(torque))
    log = Log.from_arrays(
        time=period * np.arange(len(torque)),
        output_position=still,
        output_velocity=still,
        motor_torque=torque / 100.0,
    )
    return np.asarray(simulate(model, log.with_facts({"gear_ratio": 100.0})).log["output_position"])


@pytest.mark.parametrize("period", [0.002, 0.0005])
@pytest.mark.parametrize(
    ("numbers", "fades", "size"),
    [
        ([0.05, 0.3, 0.2, 0.1], 0.1, 0.9),
        ([1.0, 5.0, 3.0, 8.0], 0.05, 15.0),
        ([0.3, 1.0, 2.0, 1.0], 0.05, 4.0),
    ],
)
def test_a_joint_with_stribecks_friction_moves_as_the_core_says(
    load: Any, numbers: list[float], fades: float, size: float, period: float, tmp_path: Path
) -> None:
    sharp = {"direction_width": 1e-3}
    effects = (
        effect("inertia"),
        effect("coulomb_friction", **sharp),
        effect("stribeck_friction", stribeck_velocity=fades, **sharp),
        effect("viscous_friction"),
    )
    model = one_of(effects, numbers)
    time = np.arange(0.0, 10.0, period)
    slow = np.sin(2 * np.pi * 0.2 * time) * np.sin(2 * np.pi * 0.031 * time + 0.3)
    torque = size * (slow + 0.3 * np.sin(2 * np.pi * 1.3 * time))
    truth = motion_of(model, torque, period)
    with_motor = held(driven(load, text_of(model, tmp_path), torque, period) - truth)
    without = held(driven(load, text_of(model, tmp_path, False), torque, period) - truth)
    assert np.ptp(truth) > 1.0 and without > 45.0
    assert with_motor < 12.0 and with_motor < 0.1 * without


def test_springs_are_bristles_that_are_off_as_the_table_says(load: Any, tmp_path: Path) -> None:
    model = one_of(SPRUNG, SPRUNG_NUMBERS)
    text = text_of(model, tmp_path)
    assert len(motors_in(text)) == 3 and losses_of(text).keys() == {"presliding_friction"}
    assert re.search(r"presliding_friction +dcmotor lugre", text)
    assert "gives way gradually" in text
    mujoco, scene, data = load(text, timestep=1e-3)
    time = 1e-3 * np.arange(6000)
    angle = 0.25 * np.sin(2 * np.pi * 0.4 * time) + 0.01 * np.sin(2 * np.pi * 2.1 * time)
    log = Log.from_arrays(
        time=time, output_position=angle, output_velocity=np.gradient(angle, time)
    )
    made = np.empty(len(time))
    for row in range(len(time)):
        data.qvel[0] = 0.0
        mujoco.mj_forward(scene, data)
        made[row] = data.qfrc_actuator[0]
        data.qvel[0] = np.append(np.diff(angle), 0.0)[row] / 1e-3
        mujoco.mj_step(scene, data)
    springs = model.components(log)["presliding_friction"]
    off = springs + made
    (loss,) = joint_of(model, "mujoco", runs=log, dcmotor=True).lost
    assert loss.rms == pytest.approx(np.sqrt(np.mean(off**2)), rel=1e-6)
    assert loss.torque is not None and loss.rms < 0.5 * loss.torque
    slipped = np.abs(springs[2000:]) > 0.349  # of a level of 0.35
    assert slipped.any() and np.abs(off[2000:]).max() < 1.05 * loss.torque
    assert loss.torque == pytest.approx(float(losses_of(text)["presliding_friction"]), rel=1e-2)


def test_a_run_with_a_gap_starts_its_bristles_anew() -> None:
    model = one_of(SPRUNG, SPRUNG_NUMBERS)
    time = 1e-2 * np.arange(400)
    angle = 0.3 * np.sin(time * 2.0)
    log = Log.from_arrays(time=time, output_position=angle, output_velocity=np.cos(time * 2.0))
    late = log.with_columns({"time": np.where(time > 1.995, time + 50.0, time)}, note="late")
    halves = [log.rows(slice(0, 200)), log.rows(slice(200, None))]
    (gap,) = joint_of(model, "mujoco", runs=late, dcmotor=True).lost
    (apart,) = joint_of(model, "mujoco", runs=halves, dcmotor=True).lost
    assert gap.rms == pytest.approx(apart.rms, rel=1e-12)


def test_a_model_of_filtered_runs_has_its_bristles_on_the_filtered_angle() -> None:
    plain = one_of(SPRUNG, SPRUNG_NUMBERS)
    time = 1e-2 * np.arange(2000)
    angle = 0.3 * np.sin(time) + 0.02 * np.sin(40.0 * time)
    log = Log.from_arrays(time=time, output_position=angle, output_velocity=np.cos(time))
    part = plain.part().preparing([Preparation("output_position", "output_position", 2.0)])
    filtered = Model({"drive": part}, plain.facts)
    by_hand = prepared(log, filtered.part().preparations)
    assert np.ptp(by_hand["output_position"] - angle) > 0.01
    (loss,) = joint_of(filtered, "mujoco", runs=log, dcmotor=True).lost
    (expected,) = joint_of(plain, "mujoco", runs=by_hand, dcmotor=True).lost
    assert loss.rms == pytest.approx(expected.rms, rel=1e-9)


def test_what_no_bristle_is_stays_lost(tmp_path: Path) -> None:
    text = text_of(one_of((effect("stribeck_friction"),), [-0.2]), tmp_path)
    assert not motors_in(text) and "stribeck_friction" in losses_of(text)
    text = text_of(one_of(SPRUNG, [0.3, 0.2, -0.1, 0.0, 0.0]), tmp_path)
    (motor,) = motors_in(text)
    assert motor["name"] == "joint presliding_friction wide"
    assert motor["lugre"] == "10.0 0.0 0.2 0.2 1.0"
    assert float(losses_of(text)["presliding_friction"]) > 0.1


def test_a_joint_without_such_effects_is_the_same_file(tmp_path: Path) -> None:
    plain = text_of(model_of(), tmp_path, False)
    assert text_of(model_of(), tmp_path, True) == plain and "dcmotor" not in plain


def test_a_mujoco_decides_by_its_version_and_is_not_imported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = one_of(SPRUNG, SPRUNG_NUMBERS)
    asked = {False: text_of(model, tmp_path, False), True: text_of(model, tmp_path, True)}
    for version, has in {"4.0.0": True, "12.1": True, "3.17.0": False, "dev": False}.items():
        monkeypatch.setattr("importlib.metadata.version", lambda name, version=version: version)
        assert text_of(model, tmp_path, None) == asked[has]

    def missing(name: str) -> str:
        raise importlib.metadata.PackageNotFoundError(name)

    monkeypatch.setattr("importlib.metadata.version", missing)
    assert text_of(model, tmp_path, None) == asked[False]
    assert "dcmotors of MuJoCo 4 would take presliding_friction:\n" in asked[False]
    # of a level of 0.35: as much just behind a reversal, where the joint's own has turned over
    assert losses_of(asked[False])["presliding_friction"] == "0.7"
    monkeypatch.undo()
    model.save(tmp_path / "model.json")
    script = (
        "import sys; from flexspline import Model; from flexspline.exporting import export;"
        "export(Model.load('model.json'), 'joint.xml', 'mujoco');"
        "sys.exit('mujoco' in sys.modules)"
    )
    assert not subprocess.run([sys.executable, "-c", script], cwd=tmp_path).returncode


def test_the_command_forces_and_forbids_dcmotors(tmp_path: Path) -> None:
    one_of(SPRUNG, SPRUNG_NUMBERS).save(tmp_path / "model.json")
    out = tmp_path / "joint.xml"
    command = ("export", "--model", tmp_path / "model.json", "--out", out, "--format")
    for option, count in (("--dcmotor", 3), ("--no-dcmotor", 0)):
        done = call(*command, "mujoco", option, "--json")
        assert done.exit_code == 0 and json.loads(done.stdout)["dcmotors"] == count
        assert len(motors_in(out.read_text())) == count
    out.unlink()
    for form in ("urdf", "header"):
        for option in ("--dcmotor", "--no-dcmotor"):
            done = call(*command, form, option)
            assert done.exit_code == 2 and f"{option} is for --format mujoco" in done.stderr
            assert done.stderr.count("\n") == 1 and not out.exists()
    with pytest.raises(InputError, match="dcmotor is for the format mujoco, and urdf has none"):
        export(one_of(SPRUNG, SPRUNG_NUMBERS), out, "urdf", dcmotor=True)


@pytest.mark.parametrize("name", ['a"b<c>&d', "--> <joint/>", "tab\tand\x00zero", "關節"])
def test_no_name_reaches_out_of_its_place(name: str, load: Any, tmp_path: Path) -> None:
    text = text_of(one_of(SPRUNG, SPRUNG_NUMBERS, joint=name), tmp_path)
    (joint,) = ET.fromstring(text).iter("joint")
    assert {motor["joint"] for motor in motors_in(text)} == {joint.attrib["name"]}
    _, scene, _ = load(text)
    assert scene.nu == 0 and scene.na == 3
