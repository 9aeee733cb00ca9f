"""The exported header, compiled and run sample by sample, beside what `predict` says."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from flexspline.about import get_include
from flexspline.exporting import namespace_of
from flexspline.exporting.cpp_text import include
from flexspline.logs.log import Log
from flexspline.model import Model
from flexspline.prepared import prepared
from flexspline.signals import channels_for, core_channels

__all__ = ["run_exported"]

COMPILERS = ("c++", "g++", "clang++")
FLAGS = ("-std=c++20", "-O2", "-ffp-contract=off")
SECONDS = 120.0
SMOOTHED = "\n   Both read inputs smoothed without delay; the header smooths nothing by itself."
ANGLES = ("output_position", "motor_position")

PROGRAM = """\
#include <cstdio>
{include}

int main() {{
  flexspline::Sample<double> at;
  [[maybe_unused]] {namespace}::Model<double>::State state;
  double in[{count}], torque = 0;
  for (;;) {{
    for (double& value : in) {{
      if (std::scanf("%lf", &value) != 1) return 0;
    }}
{assignments}
    if ({namespace}::model<double>.predict({given}) != flexspline::Status::ok) return 1;
    std::printf("%.17g\\n", torque);
  }}
}}
"""


def run_exported(header: Path, model: Model, log: Log) -> str:
    """Compile a header with a small program, stream a log through it, and say what came out.

    Parameters
    ----------
    header : what `export` wrote of a model with one part.
    model : that model.
    log : a run with the channels that the model reads.

    Returns
    -------
    str
        One sentence: the largest difference from `Model.predict` in the unit of the target, or
        why it was not tried.
    """
    compiler = next(filter(None, map(shutil.which, COMPILERS)), None)
    if compiler is None:
        return f"Not compiled: no C++ compiler here ({', '.join(COMPILERS)})."
    part = model.part()
    inputs = prepared(log, part.preparations)
    ready = channels_for(inputs, part.effects, part.known_load)
    channels = core_channels(ready, part.effects, part.known_load)
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "main.cpp"
        remembers = any(effect.info.remembers for effect in part.effects)
        source.write_text(_program(header, list(channels), remembers))
        device = Path(folder) / "device"
        include = ["-I", get_include(), "-I", str(header.parent.resolve())]
        built = _run([compiler, *FLAGS, *include, str(source), "-o", str(device)])
        if built.returncode:
            why = next(iter(built.stderr.splitlines()), "no message")
            return f"Not compiled: {Path(compiler).name} does not take it as C++20 ({why})."
        rows = np.column_stack(list(channels.values()))
        ran = _run([str(device)], "\n".join(map(repr, rows.ravel().tolist())))
    torque = np.array(ran.stdout.split(), dtype=np.float64)
    expected = model.predict(log).predicted
    if torque.shape != expected.shape:
        return f"The compiled program stopped after {len(torque)} of {len(expected)} samples."
    largest = float(np.abs(torque - expected).max())
    return (
        f"Compiled joint.hpp with {Path(compiler).name} and ran {len(torque)} samples of "
        f"{log.name} through it:\n   the largest difference from predict is "
        f"{largest:.2g} {part.unit}.{SMOOTHED if part.preparations else ''}"
    )


def _program(header: Path, channels: list[str], remembers: bool) -> str:
    lines = [
        f"    if (flexspline::read_radians(in[{k}], at.{name}) != flexspline::Status::ok) return 1;"
        if name in ANGLES
        else f"    at.{name} = in[{k}];"
        for k, name in enumerate(channels)
    ]
    return PROGRAM.format(
        include=include(header.name),
        count=len(channels),
        assignments="\n".join(lines),
        namespace=namespace_of(header),
        given="at, state, torque" if remembers else "at, torque",
    )


def _run(command: list[str], given: str = "") -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        command, input=given, capture_output=True, text=True, timeout=SECONDS, check=False
    )
