"""What the tests of exported headers share: a compiler, a program, rows for it."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import flexspline
from flexspline.exporting import export
from flexspline.logs.log import Log
from flexspline.logs.segments import runs
from flexspline.model import Model

Array = NDArray[np.float64]

ROOT = Path(__file__).parents[2]
STRICT = (
    "-std=c++20 -O2 -ffp-contract=off -fno-exceptions -fno-rtti "
    "-Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wdouble-promotion -Werror"
)


def lacking(sentence: str) -> None:
    """Skip with a sentence, but fail where everything must be there."""
    if os.environ.get("CI") == "true":
        pytest.fail(sentence)
    pytest.skip(sentence, allow_module_level=True)


def include() -> str:
    """The core's headers: those of the installed package, else those of the checkout."""
    installed = Path(flexspline.get_include())
    return str(installed if installed.is_dir() else ROOT / "cpp" / "include")


def compilers() -> list[str]:
    """C++ compilers of this machine."""
    known = [os.environ.get("CXX", ""), "c++", "clang++"]
    found = list(dict.fromkeys(path for name in known if name and (path := shutil.which(name))))
    if not found:
        lacking("there is no C++ compiler on this machine; install g++ or clang++")
    return found


def compiled(
    model: Model,
    folder: Path,
    compiler: str,
    target: str | None = None,
    name: str = "stream",
    defines: tuple[str, ...] = (),
) -> Path:
    """Export a model and compile `stream.cpp`, or another program of this folder, with it."""
    export(model, folder / "joint.hpp", target=target)
    return _compiled(folder, compiler, name, defines)


def compiled_together(
    models: Mapping[str, Model],
    folder: Path,
    compiler: str,
    name: str = "stream",
    defines: tuple[str, ...] = (),
    holds: Mapping[str, str] | None = None,
) -> Path:
    """Export models by their names and compile `stream.cpp`, or another program, with all of them.

    One program of many models is compiled several times as fast as a program for each.
    `holds`: what else a program is told of each, such as "joint".
    """
    for one, model in models.items():
        export(model, folder / f"{one}.hpp")
    includes = [f'#include "{one}.hpp"' for one in models]
    listed = " ".join(f"X({one}, {holds[one]})" if holds else f"X({one})" for one in models)
    (folder / "models.hpp").write_text("\n".join([*includes, f"#define MODELS(X) {listed}", ""]))
    return _compiled(folder, compiler, name, defines)


def _compiled(folder: Path, compiler: str, name: str, defines: tuple[str, ...]) -> Path:
    program = folder / name
    source = Path(__file__).with_name(f"{name}.cpp")
    folders = (f"-I{include()}", f"-I{folder}")
    command = [compiler, *STRICT.split(), *defines, *folders, str(source)]
    headers = tuple(path.read_bytes() for path in sorted(folder.glob("*.hpp")))
    known = (compiler, name, defines, headers)
    if known not in _PROGRAMS:
        done = subprocess.run([*command, "-o", str(program)], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr[:4000]
        _PROGRAMS[known] = program.read_bytes()
    program.write_bytes(_PROGRAMS[known])
    program.chmod(0o755)
    return program


_PROGRAMS: dict[tuple[object, ...], bytes] = {}
"""What this process of tests has compiled: several tests ask different things of one program."""


def stream(
    program: Path, scalar: str, angles: str, rows: Array, model: str | None = None
) -> tuple[Array, Array]:
    """Stream rows (N, 11) through the program; torques (N,) and statuses (N,).

    `model`: which one, of a program of several.
    """
    words = [str(program), scalar, angles, *([] if model is None else [model])]
    done = subprocess.run(words, input=rows.tobytes(), capture_output=True, check=True)
    results = np.frombuffer(done.stdout).reshape(-1, 2)
    assert len(results) == len(rows)
    return results[:, 0], results[:, 1]


def radian_rows(log: Log, known_load: str | None) -> Array:
    """Rows of `stream.cpp` with angles in radians."""
    rows = np.zeros((len(log), 11))
    rows[:, 6] = 25.0
    rows[1:, 9] = np.diff(log["time"])
    rows[runs(log["time"])[:, 0], 9] = 0.0
    rows[:, 10] = log["time"] - log["time"][0]
    channels = ("output_position", "motor_position", "output_velocity", "output_acceleration")
    channels += ("temperature", known_load, "motor_torque")
    places = dict(zip(channels, (0, 2, 4, 5, 6, 7, 8), strict=True))
    for name, place in places.items():
        if name is not None and name in log:
            rows[:, place] = log[name]
    return rows


def encoder_rows(rows: Array, far: int = 0) -> Array:
    """The rows as a float device reads them: turns (`far` more) and 32 bits; floats else."""
    read = rows.astype(np.float32).astype(np.float64)
    for place in (0, 2):
        turns = rows[:, place] / (2 * np.pi)
        read[:, place] = np.floor(turns) + far
        read[:, place + 1] = np.floor((turns - np.floor(turns)) * 2.0**32)
    return read
