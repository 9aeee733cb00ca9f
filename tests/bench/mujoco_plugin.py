"""What a joint's plugin costs a MuJoCo step: microseconds per joint, by the effects that it runs.

    python tests/bench/mujoco_plugin.py [--steps 2000]

The least of 200 runs of a pendulum that a motor drives to and fro, with the plugin and without.
Needs `mujoco` and a compiler.
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
INSTANCE = """<extension><plugin plugin="flexspline.{name}">
    <instance name="j"><config key="joint" value="j"/>
    <config key="implicit" value="{implicit}"/></instance></plugin></extension>"""
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
    texts = [PENDULUM.format(extension="")]
    with tempfile.TemporaryDirectory() as folder:
        for name, effects in MODELS.items():
            mujoco.mj_loadPluginLibrary(str(mujoco_plugin(model_of(effects), Path(folder) / name)))
            for implicit in ("false", "true"):
                instance = INSTANCE.format(name=name, implicit=implicit)
                texts.append(PENDULUM.format(extension=instance))
        bare, *others = costs(texts, parser.parse_args().steps)
    print(f"{bare:.3f} us a step without; more for a joint and step:")
    more = np.reshape(others, (-1, 2)) - bare
    for name, (explicit, implicit) in zip(MODELS, more, strict=True):
        print(f"{name:<12} {explicit:6.3f} us, {implicit:6.3f} us where implicit")


if __name__ == "__main__":
    main()
