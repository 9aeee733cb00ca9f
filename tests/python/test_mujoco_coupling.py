"""A torsion between two hinges of MuJoCo: the core's spring, loop and backlash, and no energy."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli_calls import call
from mujoco_plugins import Loaded, instances, rotor
from numpy.typing import NDArray
from torsion_logs import truth

from flexspline import InputError
from flexspline.effects import effect
from flexspline.exporting import Coupling, coupling_of, export, plugins_of
from flexspline.logs.log import Log
from flexspline.model import Model, Part
from flexspline.programs import include_folder

pytestmark = pytest.mark.usefixtures("elsewhere")

Array = NDArray[np.float64]

FACTS = {"gear_ratio": 100.0, "output_spline": "circular", "joint": "elbow"}
RATIO = 101.0
RANGES = {"known_load": [-40.0, 35.0], "motor_torque": [-1.0, 1.0], "temperature": [20.0, 35.0]}
STEP = 4e-4
MOTOR, LINK = 0.5, 0.8  # kg m²
GEAR = {"joint": "link", "motor": "motor", "temperature": 31}
ARM = f"""
<mujoco>
  <option timestep="{STEP}" gravity="0 0 0"/>
  {instances("flexspline.NAME_torsion", gear=GEAR)}
  <worldbody>
    {rotor("motor", MOTOR)}
    <body>
      <inertial pos="0 0 0" mass="1" diaginertia="{LINK} {LINK} {LINK}"/>
      <joint name="link" type="hinge" axis="0 1 0"/>
    </body>
    <body>
      <joint name="slide" type="slide"/>
      <geom type="sphere" size="0.01" mass="1"/>
    </body>
  </worldbody>
  <actuator><motor joint="motor"/><motor joint="link"/></actuator>
</mujoco>"""
TEMPERATURE = 31.0

MESH = (effect("mesh_compliance", mesh_shape=0.02), [1e-2])
LOOP = (effect("torsional_hysteresis", load_width=8.0), [5e-3, 1e-3, 5e-4, 2e-4])
GAP = (effect("backlash", contact_torque=0.5), [1.5e-2])
WAVE = (effect("wave_generator_compliance"), [0.3])
WARM = (effect("temperature_dependent_stiffness", mesh_shape=0.02), [1e-5])
GEARS = {
    "compliance": (MESH, WAVE),
    "hysteresis": (MESH, LOOP),
    "backlash": (MESH, GAP),
    "all": (MESH, WAVE, LOOP, GAP, WARM),
}


def gear(*parts: Any, ranges: Any = RANGES, **facts: Any) -> Model:
    """A model with a torsion of these effects and coefficients."""
    effects = tuple(one for one, _ in parts)
    sizes = np.concatenate([np.array(of, dtype=float) for _, of in parts])
    part = Part("torsion", effects, sizes, "reference_torque", {"validity": ranges})
    return Model({"torsion": part}, {**FACTS, **facts})


@pytest.fixture(scope="module")
def names(loaded: Loaded) -> dict[str, str]:
    """The plugins of `GEARS`, each compiled once."""
    return {kind: loaded(gear(*parts)) for kind, parts in GEARS.items()}


def arm(mujoco: Any, name: str) -> tuple[Any, Any]:
    scene = mujoco.MjModel.from_xml_string(ARM.replace("NAME", name))
    return scene, mujoco.MjData(scene)


def torsion_of(coupling: Coupling, torque: Array) -> Array:
    """What the core says that the gear twists by, rad at the motor, along a path of torques."""
    log = Log.from_arrays(
        time=STEP * np.arange(len(torque)),
        reference_torque=torque,
        motor_torque=torque / RATIO,
        temperature=np.full(len(torque), TEMPERATURE),
        output_position=np.zeros(len(torque)),
        motor_position=np.zeros(len(torque)),
    )
    return coupling.model.predict(log).predicted


def prescribed(mujoco: Any, name: str, twists: Array) -> Array:
    """The torque on the link [Nm] where the hinges are put to these twists [rad at the output]."""
    scene, data = arm(mujoco, name)
    torques = np.empty(len(twists))
    for k, twist in enumerate(twists):
        data.qpos[:] = [0.3, 0.3 + twist, 0.0]
        data.qvel[:] = 0.0
        mujoco.mj_step(scene, data)
        torques[k] = data.qfrc_passive[1]
        assert data.qfrc_passive[0] == -torques[k]
    return torques


def there_and_back(sizes: list[float], each: int = 400) -> Array:
    """Straight from 0 to each size in turn, and back to 0."""
    ends = np.array([0.0, *sizes, 0.0])
    pieces = [np.linspace(a, b, each, endpoint=False) for a, b in pairwise(ends)]
    return np.concatenate([*pieces, [0.0]])


@pytest.mark.parametrize("kind", GEARS)
def test_a_coupling_has_the_cores_torque_over_a_hundred_thousand_steps(
    kind: str, mujoco: Any, names: dict[str, str]
) -> None:
    """Torques within 1e-12 Nm: torsions within that times the least compliance."""
    coupling = coupling_of(gear(*GEARS[kind]))
    scene, data = arm(mujoco, names[kind])
    t = STEP * np.arange(100_000)
    driving = 9.0 * np.sin(2 * np.pi * 0.5 * t) * np.sin(2 * np.pi * 0.07 * t)
    outside = 25.0 * np.sin(2 * np.pi * 0.31 * t) * np.sin(2 * np.pi * 0.11 * t) ** 3
    rows = np.empty((len(t), 3))
    for k, data.ctrl[:] in enumerate(np.column_stack([driving - outside, outside])):
        rows[k, :2] = data.qpos[:2]
        mujoco.mj_step(scene, data)
        rows[k, 2] = data.plugin_state[0]
        assert rows[k, 2] == data.qfrc_passive[1] == -data.qfrc_passive[0]
    twisted = RATIO * (rows[:, 1] - rows[:, 0])
    apart = torsion_of(coupling, rows[:, 2]) - twisted
    assert np.isfinite(apart).all() and np.ptp(rows[:, 2]) > 20.0
    assert np.abs(rows[:, 2]).max() < coupling.largest_load
    assert np.abs(apart).max() / coupling.least_compliance < 1e-12
    assert np.count_nonzero(np.diff(np.sign(np.diff(rows[:, 2])))) > 40


def test_a_slow_cycle_draws_the_cores_loop(mujoco: Any, names: dict[str, str]) -> None:
    coupling = coupling_of(gear(*GEARS["hysteresis"]))
    torques = there_and_back([30.0, -30.0, 30.0, -10.0, 20.0, -30.0, 30.0])
    twists = torsion_of(coupling, torques) / RATIO
    drawn = prescribed(mujoco, names["hysteresis"], twists)
    np.testing.assert_allclose(drawn, torques, rtol=0.0, atol=2e-12)
    cycle = slice(400, 1201)  # 30, −30, 30
    assert twists[400] == pytest.approx(twists[1200], abs=1e-15)
    lost = -np.trapezoid(drawn[cycle], twists[cycle])
    # Four plays of half-widths w: a turn of a loop takes 4 (c/w) w (30 − w) of each.
    widths, sizes = np.array([8.0, 4.0, 2.0, 1.0]), np.array(LOOP[1])
    assert lost == pytest.approx(4.0 * (sizes * (30.0 - widths)).sum() / RATIO, rel=1e-3)


def test_the_backlash_is_seen_with_its_width(mujoco: Any, names: dict[str, str]) -> None:
    twists = np.linspace(-4e-3, 4e-3, 4001)
    torques = prescribed(mujoco, names["backlash"], twists)
    assert (np.diff(torques) < 0.0).all()
    gap, contact = GAP[1][0], 3.0  # Nm, six times the contact torque
    ahead, behind = np.interp([-contact, contact], torques[::-1], twists[::-1])
    elastic = 2.0 * MESH[1][0] * np.arctan(0.02 * contact) / 0.02 / RATIO
    assert ahead - behind - elastic == pytest.approx(2.0 * gap / RATIO, rel=1e-4)
    inside = np.abs(twists) < 0.2 * gap / RATIO
    assert np.abs(torques[inside]).max() < 0.15


@pytest.mark.parametrize("kind", GEARS)
def test_no_closed_path_gives_energy(kind: str, mujoco: Any, names: dict[str, str]) -> None:
    dice = np.random.default_rng(5)
    twists = there_and_back([*(1.5e-3 * dice.standard_normal(300))], 100)
    torques = prescribed(mujoco, names[kind], twists)
    middle = 0.5 * (torques[1:] + torques[:-1])
    taken = np.concatenate([[0.0], np.cumsum(-middle * np.diff(twists))])  # by the gear, J
    assert taken.min() > -1e-3 * taken.max()
    assert taken[-1] > (0.3 * taken.max() if kind in ("hysteresis", "all") else -1e-3 * taken.max())


@pytest.mark.parametrize("kind", ["compliance", "hysteresis"])
def test_a_gear_that_rings_gains_nothing(kind: str, mujoco: Any, names: dict[str, str]) -> None:
    """At a tenth of the longest timestep: a plain spring keeps its swing, a loop damps it."""
    coupling = coupling_of(gear(*GEARS[kind]))
    scene, data = arm(mujoco, names[kind])
    scene.opt.timestep = 0.1 * coupling.longest_step(MOTOR, LINK)
    data.qpos[1] = 1e-3
    swings = []
    for _ in range(20):
        largest = 0.0
        for _ in range(2000):
            mujoco.mj_step(scene, data)
            largest = max(largest, abs(data.qpos[1] - data.qpos[0]))
        swings.append(largest)
    assert max(swings) < 1e-3 * 1.02  # the step's own wobble, (ω h)²/2
    if kind == "hysteresis":
        assert swings[-1] < 0.5 * swings[0]
    else:
        assert swings[-1] == pytest.approx(swings[0], rel=0.01)


def test_each_integrator_moves_the_loop_alike(mujoco: Any, names: dict[str, str]) -> None:
    """Whatever the stages of a step were."""
    twists, torques = [], []
    for name in ("mjINT_EULER", "mjINT_IMPLICITFAST", "mjINT_RK4"):
        scene, data = arm(mujoco, names["hysteresis"])
        scene.opt.integrator = getattr(mujoco.mjtIntegrator, name)
        scene.opt.timestep = STEP / 10
        for k in range(10_000):
            data.ctrl[:] = -20.0 * np.sin(2e-3 * k), 15.0 * np.sin(3e-3 * k)
            mujoco.mj_step(scene, data)
        twists.append(data.qpos[1] - data.qpos[0])
        torques.append(data.plugin_state[0])
    assert abs(torques[0]) > 2.0
    np.testing.assert_allclose(torques, torques[0], rtol=0.01)
    np.testing.assert_allclose(twists, twists[0], rtol=0.01)


def test_beyond_the_loads_of_the_fit_a_gear_is_straight(mujoco: Any, names: dict[str, str]) -> None:
    coupling = coupling_of(gear(*GEARS["compliance"]))
    edge = torsion_of(coupling, np.array([0.0, -coupling.largest_load]))[1] / RATIO
    torques = prescribed(mujoco, names["compliance"], edge + np.array([0.0, 1e-3, 0.1]))
    expected = -coupling.largest_load - coupling.stiffness * np.array([0.0, 1e-3, 0.1])
    np.testing.assert_allclose(torques, expected, rtol=1e-11)


def test_a_timestep_that_is_too_long_is_refused(mujoco: Any, names: dict[str, str]) -> None:
    longest = coupling_of(gear(*GEARS["compliance"])).longest_step(MOTOR, LINK)
    text = ARM.replace("NAME", names["compliance"])
    below = text.replace(f'timestep="{STEP}"', f'timestep="{0.99 * longest}"')
    scene = mujoco.MjModel.from_xml_string(below)
    data = mujoco.MjData(scene)
    data.qpos[1] = 3e-3  # past the end of the fit, where it is as stiff as it gets
    mujoco.mj_step(scene, data, nstep=3000)
    assert np.abs(data.qpos[1] - data.qpos[0]) < 0.2
    above = text.replace(f'timestep="{STEP}"', f'timestep="{1.01 * longest}"')
    with pytest.raises(ValueError, match=r"Nm/rad stiff, and a timestep of .* is too long") as said:
        mujoco.MjModel.from_xml_string(above)
    number = re.search(r"give one below (\S+) s", str(said.value))
    assert number is not None and float(number[1]) == pytest.approx(longest, rel=0.05)


def test_a_timestep_that_was_made_longer_is_told_once(
    mujoco: Any, names: dict[str, str], tmp_path: Path
) -> None:
    scene, data = arm(mujoco, names["compliance"])
    mujoco.mj_step(scene, data)
    assert not (tmp_path / "MUJOCO_LOG.TXT").exists()
    scene.opt.timestep = 0.1
    for _ in range(3):
        mujoco.mj_step(scene, data)
    assert (tmp_path / "MUJOCO_LOG.TXT").read_text().count("a timestep of 0.1 s is too long") == 1


def test_reset_copy_and_looking_keep_to_the_memory(mujoco: Any, names: dict[str, str]) -> None:
    scene, data = arm(mujoco, names["all"])
    assert not data.plugin_state.any()
    data.ctrl[:] = 8.0, -3.0
    mujoco.mj_step(scene, data, nstep=500)
    state = data.plugin_state.tobytes()
    mujoco.mj_forward(scene, data)
    forces = data.qfrc_passive.copy()
    mujoco.mj_forward(scene, data)
    np.testing.assert_array_equal(data.qfrc_passive, forces)
    assert data.plugin_state.tobytes() == state
    other = mujoco.MjData(scene)
    kept = mujoco.mjtState.mjSTATE_INTEGRATION
    whole = np.empty(mujoco.mj_stateSize(scene, kept))
    mujoco.mj_getState(scene, data, whole, kept)
    mujoco.mj_setState(scene, other, whole, kept)
    for one in (data, other):
        one.ctrl[:] = -5.0, 4.0
        mujoco.mj_step(scene, one, nstep=500)
    np.testing.assert_array_equal(other.qpos, data.qpos)
    mujoco.mj_resetData(scene, data)
    assert not data.plugin_state.any()


def test_an_angle_that_is_not_finite_is_told(
    mujoco: Any, names: dict[str, str], tmp_path: Path
) -> None:
    scene, data = arm(mujoco, names["all"])
    data.qpos[1] = np.nan
    mujoco.mj_forward(scene, data)
    assert np.isnan(data.qfrc_passive[:2]).all()


WRONG = {
    "no motor": ('<config key="motor" value="motor"/>', "", 'a config with key="motor"'),
    "a motor that is not there": (
        'value="motor"', 'value="m"', "has no joint 'm'; give the config \"motor\" the name of one",
    ),
    "no link": ('<config key="joint" value="link"/>', "", 'config with key="joint"'),
    "a slide": ('value="motor"', 'value="slide"', "joint 'slide' is no hinge"),
    "one hinge": ('value="motor"', 'value="link"', "joint 'link' is both link and motor; give"),
    "words": ('value="31"', 'value="warm"', "temperature of joint 'link' is no number of deg C"),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_what_the_mjcf_has_wrong_is_said(case: str, mujoco: Any, names: dict[str, str]) -> None:
    old, new, sentence = WRONG[case]
    text = ARM.replace("NAME", names["all"])
    assert old in text
    with pytest.raises(ValueError, match=re.escape(sentence)) as raised:
        mujoco.MjModel.from_xml_string(text.replace(old, new, 1))
    assert f"flexspline.{names['all']}_torsion: " in str(raised.value)


def test_two_gears_on_one_link_are_refused(mujoco: Any, names: dict[str, str]) -> None:
    text = ARM.replace("NAME", names["all"])
    (gear_of_link,) = re.findall(r"<instance.*?</instance>", text, re.S)
    twice = text.replace(gear_of_link, gear_of_link + gear_of_link.replace('"gear"', '"other"'))
    with pytest.raises(ValueError, match="two instances act on joint 'link'; take one away"):
        mujoco.MjModel.from_xml_string(twice)


REFUSED: dict[str, tuple[Model, str]] = {
    "zeros of encoders": (
        gear((effect("offset"), [0.1]), (effect("kinematic_error", orders=[2]), [1e-3, 0.0])),
        "no effect that yields to a load: offset, kinematic_error; fit a compliance",
    ),
    "a loop by the motor's angle": (
        gear((effect("torsional_hysteresis", path=1.0), LOOP[1])),
        "no effect that yields to a load: torsional_hysteresis",
    ),
    "no loads": (gear(MESH, ranges={}), "does not say up to which load it was fitted"),
    "no ratio": (
        Model({"torsion": gear(MESH).parts["torsion"]}, {}),
        "lacks the gear ratio.*--gear-ratio",
    ),
    "a loop that gives": (
        gear(MESH, (LOOP[0], [5e-3, -1e-3, 5e-4, 2e-4])),
        r"hysteresis.half of the torsion is -0.001 rad, by .*--bound torsional_hysteresis.half=0:",
    ),
    "a loop that sticks too well": (
        gear(MESH, (LOOP[0], [5e-3, 1e-3, 5e-4, 8e-3])),
        r"grows by -0.00\d+ rad at the motor per Nm at .*40 Nm .* up to 2.8 of 40 Nm alone",
    ),
    "backlash alone": (gear(GAP), r"by enough up to 2 of 40 Nm alone"),
    "a mesh that pushes": (gear((MESH[0], [-1e-2])), "by enough up to 0 of 40 Nm alone"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_a_torsion_that_is_no_coupling_is_refused(case: str, tmp_path: Path) -> None:
    model, sentence = REFUSED[case]
    with pytest.raises(InputError, match=sentence):
        export(model, tmp_path / "joint", "mujoco-plugin")
    assert not [*tmp_path.iterdir()]


def test_what_is_no_torsion_by_load_is_left_out_with_its_reason(tmp_path: Path) -> None:
    zeros = [(effect("offset"), [0.1]), (effect("kinematic_error", orders=[2]), [1e-3, 0.0])]
    model = gear(*zeros, MESH, (effect("torsional_hysteresis", path=1.0), LOOP[1]))
    left = coupling_of(model).left
    assert set(left) == {"offset", "kinematic_error", "torsional_hysteresis"}
    assert "may give more work than it takes" in left["torsional_hysteresis"]
    folder = export(model, tmp_path / "joint", "mujoco-plugin")
    for file in ("joint.cpp", "joint.xml"):
        assert "moves the link, and twists no more" in (folder / file).read_text()


def test_the_stiffness_is_the_largest_of_the_range() -> None:
    """Of the mesh at 40 Nm in the cold, with all of a loop sticking."""
    coupling = coupling_of(gear(*GEARS["all"]))
    sticking = sum(c / w for c, w in zip(LOOP[1], (8.0, 4.0, 2.0, 1.0), strict=True))
    mesh = (MESH[1][0] + WARM[1][0] * (20.0 - 25.0)) / (1.0 + (0.02 * 40.0) ** 2)
    wave = WAVE[1][0] * np.exp(-3.0 * 40.0 / RATIO) / RATIO
    assert coupling.largest_load == coupling.fitted_load == 40.0
    assert coupling.least_compliance == pytest.approx(mesh + wave - sticking, rel=2e-3)
    assert coupling.stiffness == RATIO / coupling.least_compliance


def test_a_model_is_asked_no_further_than_its_loop_leaves_the_mesh_something(
    tmp_path: Path,
) -> None:
    """The gear of Table III of the paper, which stiffens more than its loop does."""
    effects, values = truth(orders=False)
    model = gear(*zip(effects, np.split(values, [1, 2, 3]), strict=True))
    coupling = coupling_of(model)
    assert coupling.fitted_load == 40.0 and 35.0 < coupling.largest_load < 40.0
    up_to = there_and_back([coupling.largest_load, -coupling.largest_load] * 2, 4000)
    twisted = torsion_of(coupling, up_to)
    grows = -np.diff(twisted) / np.diff(up_to)
    assert coupling.least_compliance == pytest.approx(grows.min(), rel=0.02)
    text = (export(model, tmp_path / "joint", "mujoco-plugin") / "joint.xml").read_text()
    assert f"beyond {coupling.largest_load:.3g} Nm" in text and "The fit goes up to 40 Nm" in text


def test_the_command_says_how_long_a_timestep_may_be(tmp_path: Path) -> None:
    model = with_drive(gear(*GEARS["all"]))
    model.save(tmp_path / "m.json")
    arguments = ("export", "--model", tmp_path / "m.json", "--format", "mujoco-plugin")
    done = call(*arguments, "--out", tmp_path / "wrist")
    assert done.exit_code == 0, done.output
    (factor,) = re.findall(r"timestep has to be below (\S+) s / sqrt\(1/J_motor", done.stdout)
    longest = coupling_of(model).longest_step(MOTOR, LINK)
    lightness = 1.0 / MOTOR + 1.0 / LINK
    assert float(factor) / np.sqrt(lightness) == pytest.approx(longest, rel=0.05)
    done = call(*arguments, "--target", "motor_torque", "--out", tmp_path / "friction")
    assert done.exit_code == 0 and "timestep" not in done.stdout
    done = call(*arguments, "--json", "--out", tmp_path / "json")
    assert json.loads(done.stdout)["stiffness"] == coupling_of(model).stiffness


def test_the_plugins_compile_without_a_warning(mujoco: Any, tmp_path: Path) -> None:
    if shutil.which("c++") is None:
        pytest.skip("c++ is missing; install Debian's g++")
    folder = export(with_drive(gear(*GEARS["all"])), tmp_path / "joint", "mujoco-plugin")
    strict = ["-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Wconversion", "-Werror"]
    places = ["-I", include_folder(), "-isystem", Path(mujoco.__file__).parent / "include"]
    command = ["c++", "-std=c++20", "-fsyntax-only", *strict, *places, "joint.cpp"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def with_drive(model: Model) -> Model:
    """The same joint with friction and an inertia."""
    effects = (effect("inertia"), effect("coulomb_friction"))
    drive = Part("motor_torque", effects, np.array([0.4, 0.5]), None, {"validity": RANGES})
    return Model({**model.parts, "drive": drive}, model.facts)


def files(folder: Path) -> Iterator[str]:
    return (path.name for path in folder.iterdir())


def test_a_joint_with_both_parts_has_both_plugins(
    mujoco: Any, loaded: Loaded, tmp_path: Path
) -> None:
    model = with_drive(gear(*GEARS["all"]))
    name = loaded(model)
    text = (export(model, tmp_path / name, "mujoco-plugin") / f"{name}.xml").read_text()
    scene = mujoco.MjModel.from_xml_string(text)
    assert scene.nplugin == 2 and scene.joint("elbow_motor").dofadr[0] == 0
    assert scene.dof_armature[0] == pytest.approx(0.4)
    coupling = coupling_of(model)
    assert scene.opt.timestep == pytest.approx(0.1 * coupling.longest_step(0.4, 1.0), rel=0.05)
    data = mujoco.MjData(scene)
    data.qvel[:] = 1.0
    mujoco.mj_step(scene, data, nstep=20)
    speeds = data.qvel.copy()
    assert speeds[0] < 1.0 and speeds[1] < 1.0  # friction brakes both, the link by the gear
    mujoco.mj_step(scene, data, nstep=20_000)
    assert np.abs(data.qvel).max() < 0.02


def test_a_target_takes_its_part_alone(tmp_path: Path) -> None:
    model = with_drive(gear(MESH))
    torque = export(model, tmp_path / "friction", "mujoco-plugin", "motor_torque")
    twist = export(model, tmp_path / "twist", "mujoco-plugin", "torsion")
    assert "friction_torsion.hpp" not in files(torque) and "twist.hpp" not in files(twist)
    assert "twist_torsion.hpp" in files(twist)
    assert "JointPlugin" not in (twist / "twist.cpp").read_text()
    assert plugins_of(model, "motor_torque").coupling is None
    broken = with_drive(gear(GAP))
    with pytest.raises(InputError, match="or give the target motor_torque alone"):
        export(broken, tmp_path / "joint", "mujoco-plugin")
    assert export(broken, tmp_path / "joint", "mujoco-plugin", "motor_torque").is_dir()
