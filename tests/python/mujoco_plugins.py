"""What tests of MuJoCo's plugins share: libraries under names of their own, and scenes."""

from __future__ import annotations

import itertools
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest

from flexspline.exporting import mujoco_plugin
from flexspline.model import Model

Loaded = Callable[[Model], str]
NUMBERS = itertools.count()  # a process knows one plugin of a name


def loader(mujoco: Any, folder: Path) -> Loaded:
    """Return what compiles and loads the plugin of a model, each under a name of its own."""
    if shutil.which("c++") is None:
        pytest.skip("c++ is missing; install Debian's g++")

    def load(model: Model) -> str:
        name = f"joint_{next(NUMBERS)}"
        mujoco.mj_loadPluginLibrary(str(mujoco_plugin(model, folder / name)))
        return name

    return load


def instances(plugin: str, **settings: Mapping[str, object]) -> str:
    """The instances of a plugin that a scene has, by name, each with its settings."""
    written = "".join(
        f'<instance name="{name}">'
        + "".join(f'<config key="{key}" value="{value}"/>' for key, value in own.items())
        + "</instance>"
        for name, own in settings.items()
    )
    return f'<extension><plugin plugin="{plugin}">{written}</plugin></extension>'


def rotor(name: str, armature: float) -> str:
    """A body that weighs nothing, on a hinge with an armature: a motor's side of a gear."""
    return f"""<body>
      <inertial pos="0 0 0" mass="0.001" diaginertia="1e-9 1e-9 1e-9"/>
      <joint name="{name}" type="hinge" axis="0 1 0" armature="{armature}"/>
    </body>"""
