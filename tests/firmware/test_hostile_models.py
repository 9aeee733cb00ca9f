"""A model file is data: certifying one that holds code compiles none of it and runs none."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import device
import numpy as np
import pytest

import flexspline
from flexspline.effects import effect
from flexspline.errors import InputError
from flexspline.exporting import export, namespace_of
from flexspline.exporting.cpp_text import OF_THE_C_LIBRARY
from flexspline.logs.log import Log
from flexspline.model import Model, Part

HEADERS = "assert ctype errno fenv float inttypes limits locale math pthread sched setjmp"
HEADERS += " signal stdarg stddef stdint stdio stdlib string strings time unistd wchar wctype"


def model_that_runs(command: str) -> str:
    """A model.json whose validity declares a variable that runs a command before main."""
    part = Part("motor_torque", (effect("viscous_friction"),), np.array([0.5]))
    content = json.loads(Model({"drive": part}, {"gear_ratio": 100.0}).to_json())
    key = 'x{}; extern "C" int system(const char*); inline const int pwned = system("%s"); '
    key += "template <typename S> inline constexpr std::array<S, 2> output_velocity"
    content["drive"]["validity"] = {key % command: [0.0, 1.0]}
    return json.dumps(content)


def test_a_model_file_runs_no_command(tmp_path: Path) -> None:
    device.compilers()
    time = np.arange(100) * 1e-3
    log = Log.from_arrays(time=time, output_velocity=np.sin(time), motor_torque=np.sin(time))
    with pytest.raises(InputError, match="validity"):
        flexspline.certify(Model.from_json(model_that_runs(f"touch {tmp_path}/ran")), log, "host")
    assert not list(tmp_path.iterdir())


def test_every_name_of_the_c_library_is_a_file_name_whose_header_compiles(tmp_path: Path) -> None:
    part = Part("motor_torque", (effect("viscous_friction"),), np.array([0.5]))
    made = export(Model({"drive": part}, {"gear_ratio": 100.0}), tmp_path / "gamma.hpp")
    names = sorted({namespace_of(f"{name}.hpp") for name in OF_THE_C_LIBRARY} - {"gamma_model"})
    source = tmp_path / "all.cpp"
    includes = [f"#include <{name}.h>" for name in HEADERS.split()]
    others = [f"namespace {name} {{}}" for name in names]
    source.write_text("\n".join([*includes, f'#include "{made.name}"', *others, ""]))
    for compiler in device.compilers():
        command = [compiler, "-std=gnu++20", "-fsyntax-only", f"-I{device.include()}", str(source)]
        done = subprocess.run(command, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr[:4000]
