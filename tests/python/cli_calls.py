"""Calling the command line in a test, and runs to call it with."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
from click.testing import CliRunner, Result
from undrawn import undrawn

from flexspline.cli import commands
from flexspline.logs.log import Log
from flexspline.logs.writing import write_log
from flexspline.rigs import Rig, sensor_rig

EFFECTS = "offset,coulomb_friction,viscous_friction,inertia"


def call(*arguments: object) -> Result:
    """Call `flexspline` with these arguments, in this process."""
    return CliRunner().invoke(commands, [str(argument) for argument in arguments])


@cache
def small_rig() -> Rig:
    return sensor_rig(2, duration=12.0, rate=200.0, seed=3)


def write_runs(folder: Path) -> list[Path]:
    """Write the runs of a small rig as CSV and return their paths."""
    paths = [folder / f"{log.name}.csv" for log in small_rig().logs]
    for log, path in zip(small_rig().logs, paths, strict=True):
        write_log(log, path)
    return paths


def write_holed(log: Log, channel: str, path: Path) -> Path:
    """Write a run whose row 7 has no reading of a channel."""
    values = log[channel].copy()
    values[7] = np.nan
    write_log(log.with_columns({channel: values}, note="hole"), path)
    return path


def fitted(folder: Path, runs: list[Path], *more: object) -> Path:
    """Fit the runs by the command line and return the folder that it wrote, figures undrawn."""
    out = folder / "joint"
    with undrawn():
        result = call(
            "fit", *runs, "--target", "sensor_torque", "--effects", EFFECTS, "--out", out, *more
        )
    assert result.exit_code == 0, result.stderr
    return out
