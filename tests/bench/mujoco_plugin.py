"""What a joint's plugins cost a MuJoCo step: microseconds per joint, by the effects that they run.

    python tests/bench/mujoco_plugin.py [--steps 2000]

The least of 200 runs of a pendulum that a motor drives to and fro, with the plugin and without. The
gear that twists is between this motor's hinge and the pendulum's. Needs `mujoco` and a compiler.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1] / "python"))

import mujoco
import numpy as np

from flexspline.effects import CATALOGUE, effect
from flexspline.effects.causes import LAG
from flexspline.exporting import mujoco_plugin
from flexspline.model import Model, Part

RUNS = 200
PENDULUM = """
<mujoco>
  <option timestep="0.0002"/>
  {extension}
  <worldbody>
    <body>
      <joint name="j" type="hinge" axis="0 1 0" armature="0.05"/>
      <geom type="sphere" size="0.01" pos="0 0 -0.1" mass="0.5"/>
    </body>
  </worldbody>
  <actuator><position joint="j" kp="5" kv="0.1"/></actuator>
</mujoco>"""
GEAR = """
<mujoco>
  <option timestep="0.0002"/>
  {extension}
  <worldbody>
    <body>
      <inertial pos="0 0 0" mass="0.001" diaginertia="1e-9 1e-9 1e-9"/>
      <joint name="m" type="hinge" axis="0 1 0" armature="0.05"/>
    </body>
    <body>
      <joint name="j" type="hinge" axis="0 1 0"/>
      <geom type="sphere" size="0.01" pos="0 0 -0.1" mass="0.5"/>
    </body>
  </worldbody>
  <actuator><position joint="m" kp="5" kv="0.1"/></actuator>
</mujoco>"""
BETWEEN = """<extension><plugin plugin="flexspline.{name}_torsion">
    <instance name="j"><config key="joint" value="j"/><config key="motor" value="m"/></instance>
    </plugin></extension>"""
INSTANCE = """<extension><plugin plugin="flexspline.{name}">
    <instance name="j"><config key="joint" value="j"/>
    <config key="implicit" value="{implicit}"/>{more}</instance></plugin></extension>"""
HEATING = """<config key="thermal_resistance" value="1"/>
    <config key="thermal_time_constant" value="60"/>"""
MODELS = {
    "coulomb": ["coulomb_friction"],
    "friction": ["coulomb_friction", "viscous_friction", "stribeck_friction"],
    "memory": ["presliding_friction"],
    "usual": [
        "coulomb_friction",
        "viscous_friction",
        "stribeck_friction",
        "load_dependent_friction",
        "presliding_friction",
        "cogging",
    ],
    "everything": [n for n, info in CATALOGUE.items() if "M" in info.targets and n != LAG],
}

HEATED = {"heated": ["coulomb_friction", "viscous_friction", "temperature_dependent_friction"]}
SIZES = {  # of effects whose sum has to grow with the load
    "mesh_compliance": [1e-2],
    "wave_generator_compliance": [0.3],
    "torsional_hysteresis": [5e-3, 1e-3, 5e-4, 2e-4],
    "backlash": [1.5e-2],
}
GEARS = {
    "compliance": ["mesh_compliance"],
    "hysteresis": ["mesh_compliance", "torsional_hysteresis"],
    "backlash": ["mesh_compliance", "backlash"],
    "whole gear": [*SIZES],
}


def gear_of(names: list[str]) -> Model:
    sizes = np.concatenate([SIZES[name] for name in names])
    ranges = {"known_load": [-20.0, 20.0], "motor_torque": [-0.3, 0.3]}
    part = Part(
        "torsion", tuple(map(effect, names)), sizes, "reference_torque", {"validity": ranges}
    )
    return Model({"torsion": part}, {"gear_ratio": 100.0, "output_spline": "circular"})


def model_of(names: list[str]) -> Model:
    effects = tuple(effect(n, orders=[2]) if CATALOGUE[n].pairs else effect(n) for n in names)
    sizes = np.full(sum(len(e.terms) for e in effects), 0.01)
    facts = {"gear_ratio": 100.0, "output_spline": "circular"}
    return Model({"drive": Part("motor_torque", effects, sizes)}, facts)


def costs(texts: list[str], steps: int) -> list[float]:
    """The least time of a step of each scene [us], which take turns on a busy machine."""
    models: list[Any] = [mujoco.MjModel.from_xml_string(text) for text in texts]
    least = [np.inf] * len(models)
    for _ in range(RUNS):
        for place, model in enumerate(models):
            data = mujoco.MjData(model)
            start = time.thread_time()
            for goal in (0.5, -0.5):
                data.ctrl[:] = goal
                mujoco.mj_step(model, data, nstep=steps // 2)
            least[place] = min(least[place], time.thread_time() - start)
    return [1e6 * one / steps for one in least]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=2000)
    steps = parser.parse_args().steps
    texts, gears = [PENDULUM.format(extension="")], [GEAR.format(extension="")]
    with tempfile.TemporaryDirectory() as folder:
        for name, effects in (MODELS | HEATED).items():
            mujoco.mj_loadPluginLibrary(str(mujoco_plugin(model_of(effects), Path(folder) / name)))
            more = HEATING if name in HEATED else ""
            for implicit in ("false", "true"):
                instance = INSTANCE.format(name=name, implicit=implicit, more=more)
                texts.append(PENDULUM.format(extension=instance))
        for number, effects in enumerate(GEARS.values()):
            library = mujoco_plugin(gear_of(effects), Path(folder) / f"gear{number}")
            mujoco.mj_loadPluginLibrary(str(library))
            gears.append(GEAR.format(extension=BETWEEN.format(name=f"gear{number}")))
        bare, *others = costs(texts, steps)
        apart, *twisted = costs(gears, steps)
    print(f"{bare:.3f} us a step without; more for a joint and step:")
    more_than = np.reshape(others, (-1, 2)) - bare
    for name, (explicit, implicit_too) in zip(MODELS | HEATED, more_than, strict=True):
        print(f"{name:<12} {explicit:6.3f} us, {implicit_too:6.3f} us where implicit")
    print(f"{apart:.3f} us a step of two hinges without; more for a gear between them:")
    for name, cost in zip(GEARS, twisted, strict=True):
        print(f"{name:<12} {cost - apart:6.3f} us")


if __name__ == "__main__":
    main()
