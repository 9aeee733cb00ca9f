"""A joint of MuJoCo that its own friction heats, and whose friction follows its temperature."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mujoco_plugins import Loaded, instances, rotor
from numpy.typing import NDArray

from flexspline.effects import effect
from flexspline.exporting import export, plugin_of
from flexspline.logs.log import Log
from flexspline.model import Model, Part

pytestmark = pytest.mark.usefixtures("elsewhere")

Array = NDArray[np.float64]

STEP = 5e-4
START, ROOM, RESISTANCE, TIME_CONSTANT = 24.0, 21.0, 1.4, 12.0
COLDEST, WARMEST = 20.0, 60.0
HEATED = {
    "joint": "j",
    "temperature": START,
    "ambient": ROOM,
    "thermal_resistance": RESISTANCE,
    "thermal_time_constant": TIME_CONSTANT,
    "implicit": "IMPLICIT",
}
ARM = f"""
<mujoco>
  <option timestep="{STEP}" gravity="0 0 0"/>
  {instances("flexspline.NAME", j=HEATED)}
  <worldbody>
    {rotor("j", 0.2)}
  </worldbody>
  <actuator><motor joint="j"/></actuator>
</mujoco>"""
WARMER = 4  # place in plugin_state


def model_of(names: list[str], sizes: list[float], **ranges: list[float]) -> Model:
    validity = {"output_velocity": [-4.0, 4.0], **(ranges or {"temperature": [COLDEST, WARMEST]})}
    part = Part(
        "motor_torque", tuple(map(effect, names)), np.array(sizes), None, {"validity": validity}
    )
    return Model({"drive": part}, {"gear_ratio": 100.0, "output_spline": "circular"})


GREASE = model_of(
    ["coulomb_friction", "viscous_friction", "temperature_dependent_friction"],
    [0.4, 3.0, -0.06, 5e-4],
)


@pytest.fixture(scope="module")
def grease(loaded: Loaded) -> str:
    """The plugin of `GREASE`."""
    return loaded(GREASE)


def scene_of(mujoco: Any, name: str, implicit: str = "false") -> tuple[Any, Any]:
    scene = mujoco.MjModel.from_xml_string(ARM.replace("NAME", name).replace("IMPLICIT", implicit))
    return scene, mujoco.MjData(scene)


@pytest.mark.parametrize("implicit", ["false", "true"])
def test_friction_at_the_joints_own_temperature_is_the_cores_over_a_hundred_thousand_steps(
    implicit: str, mujoco: Any, grease: str
) -> None:
    scene, data = scene_of(mujoco, grease, implicit)
    t = STEP * np.arange(100_000)
    rows = np.empty((len(t), 3))
    temperatures = np.empty(len(t))
    for k, data.ctrl[0] in enumerate(8.0 * np.sin(2 * np.pi * 0.4 * t)):
        temperatures[k] = START + data.plugin_state[WARMER]
        mujoco.mj_step(scene, data)
        rows[k] = data.plugin_state[0], data.qfrc_passive[0], data.qpos[0]
    velocity, force, _ = rows.T
    expected, now = np.empty(len(t)), START
    for k, loss in enumerate(-force * velocity):
        expected[k] = now
        end = ROOM + RESISTANCE * loss
        now = end + (now - end) * np.exp(-STEP / TIME_CONSTANT)
    np.testing.assert_allclose(temperatures, expected, rtol=0.0, atol=1e-10)  # sums of rounding
    assert temperatures.min() > COLDEST and temperatures.max() < WARMEST
    assert np.ptp(temperatures) > 8.0
    log = Log.from_arrays(time=t, output_velocity=velocity, temperature=temperatures)
    plugin = plugin_of(GREASE)
    said = -plugin.torque * plugin.model.predict(log).predicted
    np.testing.assert_allclose(force, said, rtol=0.0, atol=1e-12)
    log = Log.from_arrays(time=t, output_velocity=velocity, temperature=np.full(len(t), START))
    cold = -plugin.torque * plugin.model.predict(log).predicted
    assert np.abs(force - cold).max() > 0.3


def test_at_a_constant_speed_it_warms_along_an_exponential(mujoco: Any, loaded: Loaded) -> None:
    name = loaded(model_of(["viscous_friction"], [2.5]))
    scene, data = scene_of(mujoco, name)
    speed = 1.5
    for k in range(1, 40_001):
        data.qvel[0] = speed
        mujoco.mj_step(scene, data)
        if k % 8000 == 0:
            end = ROOM + RESISTANCE * 2.5 * speed**2
            expected = end + (START - end) * np.exp(-k * STEP / TIME_CONSTANT)
            assert START + data.plugin_state[WARMER] == pytest.approx(expected, rel=1e-12)
    data.qvel[0] = 0.0
    warm = START + data.plugin_state[WARMER]
    mujoco.mj_step(scene, data, nstep=24_000)  # a time constant
    cooled = ROOM + (warm - ROOM) * np.exp(-1.0)
    assert START + data.plugin_state[WARMER] == pytest.approx(cooled, rel=1e-12)


@pytest.mark.parametrize(("start", "held"), [(5.0, COLDEST), (90.0, WARMEST)])
def test_friction_goes_no_further_than_the_temperatures_of_the_fit(
    start: float, held: float, mujoco: Any, grease: str
) -> None:
    """Beyond them this model's friction would grow again, or fall below zero."""
    text = ARM.replace("NAME", grease).replace("IMPLICIT", "false")
    scene = mujoco.MjModel.from_xml_string(text.replace(f'"{START}"', f'"{start}"'))
    data = mujoco.MjData(scene)
    data.qvel[0] = 1.0
    mujoco.mj_forward(scene, data)
    log = Log.from_arrays(time=[0.0], output_velocity=[1.0], temperature=[held])
    assert data.qfrc_passive[0] == -plugin_of(GREASE).model.predict(log).predicted[0]


def test_a_reset_cools_and_a_copy_is_as_warm(mujoco: Any, grease: str) -> None:
    scene, data = scene_of(mujoco, grease, "true")
    data.ctrl[0] = 9.0
    mujoco.mj_step(scene, data, nstep=4000)
    assert data.plugin_state[WARMER] > 1.0
    kept = mujoco.mjtState.mjSTATE_INTEGRATION
    state = np.empty(mujoco.mj_stateSize(scene, kept))
    mujoco.mj_getState(scene, data, state, kept)
    other = mujoco.MjData(scene)
    mujoco.mj_setState(scene, other, state, kept)
    for one in (data, other):
        mujoco.mj_step(scene, one, nstep=1000)
    assert other.plugin_state.tobytes() == data.plugin_state.tobytes()
    mujoco.mj_resetData(scene, data)
    assert not data.plugin_state.any()


def test_without_a_resistance_the_temperature_stays(mujoco: Any, grease: str) -> None:
    bare = re.sub(r'<config key="(ambient|thermal_\w+)" value="[^"]*"/>', "", ARM)
    scene = mujoco.MjModel.from_xml_string(bare.replace("NAME", grease).replace("IMPLICIT", "true"))
    data = mujoco.MjData(scene)
    data.ctrl[0] = 9.0
    mujoco.mj_step(scene, data, nstep=4000)
    assert data.qvel[0] > 1.0 and data.plugin_state[WARMER] == 0.0


WRONG = {
    "a resistance below zero": (
        "1.4",
        "-1.4",
        "thermal_resistance of joint 'j' is no number of K",
    ),
    "a resistance in words": ("1.4", "good", "thermal_resistance of joint 'j' is no number of K"),
    "no time": ("12.0", "0", "thermal_time_constant of joint 'j' is no number of s above zero"),
    "NaN": ("12.0", "nan", "thermal_time_constant of joint 'j' is no number of s above zero"),
    "a room in words": ("21.0", "warm", "ambient of joint 'j' is no number of deg C"),
    "one of both": (
        f'<config key="thermal_resistance" value="{RESISTANCE}"/>',
        "",
        "has one of thermal_resistance and thermal_time_constant; give both, or none",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_the_mjcf_has_wrong_is_said(case: str, mujoco: Any, grease: str) -> None:
    old, new, sentence = WRONG[case]
    text = ARM.replace("NAME", grease).replace("IMPLICIT", "true")
    old, new = (old, new) if old.startswith("<") else (f'value="{old}"', f'value="{new}"')
    assert text.count(old) == 1
    with pytest.raises(ValueError, match=re.escape(sentence)):
        mujoco.MjModel.from_xml_string(text.replace(old, new))


def test_a_room_alone_is_refused(mujoco: Any, grease: str) -> None:
    bare = re.sub(r'<config key="thermal_\w+" value="[^"]*"/>', "", ARM)
    with pytest.raises(ValueError, match="ambient of joint 'j' needs a thermal_resistance and a"):
        mujoco.MjModel.from_xml_string(bare.replace("NAME", grease).replace("IMPLICIT", "true"))


def test_the_mjcf_to_copy_from_says_how_a_joint_heats_itself(tmp_path: Path) -> None:
    said = {
        name: (export(model, tmp_path / name, "mujoco-plugin") / f"{name}.xml").read_text()
        for name, model in {"warm": GREASE, "plain": model_of(["coulomb_friction"], [1.0])}.items()
    }
    assert "thermal_resistance" in said["warm"] and "thermal" not in said["plain"]
