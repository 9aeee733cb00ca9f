"""Writes files of every kind again and again, killed at random moments: write_until_killed FOLDER.

Prints, for each kind, how many of the kills came while a file was being written, and how often what
was there afterwards was neither the old file nor the new one.
"""

from __future__ import annotations

import os
import random
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from flexspline import Calibration, Certificate, Model, effect
from flexspline.certification import Cost, OutputDifference
from flexspline.estimation import Estimate
from flexspline.exporting import export
from flexspline.files import atomic_write
from flexspline.logs.log import Log
from flexspline.logs.writing import write_log
from flexspline.part import Part

HITS = 8  # kills in the middle of a write, of each kind
MOST = 400  # kills until so many have come
LONGEST = 0.02  # s until a kill


def model(level: float) -> Model:
    part = Part("sensor_torque", (effect("offset"),), np.array([level]))
    return Model({"sensor": part}, {"gear_ratio": 100.0}).with_estimator(Calibration(level, 0.1))


def certificate(level: float) -> Certificate:
    cost = Cost(1, 1, 1, None, "", None, None, "", None, "")
    log = {"name": "run", "rows": 1, "sha256": None}
    named = ("host", "this machine", None, "c++", ("-O2",) * int(1000 * level), "estimators", "0")
    output = OutputDifference("sensor_torque", "Nm", 1, 0, 0, 0.0, level, level)
    return Certificate(*named, log, 1, True, (output,), 0, cost)


def columns(level: float) -> dict[str, np.ndarray]:
    time = np.arange(500) * 0.001
    return {"time": time, "sensor_torque": level * np.sin(time)}


WRITERS: dict[str, Callable[[Path, float], object]] = {
    "model.json": lambda path, level: model(level).save(path),
    "joint.hpp": lambda path, level: export(model(level), path),
    "joint.bin": lambda path, level: export(model(level), path, format="binary"),
    "cert.json": lambda path, level: certificate(level).save(path),
    "estimate.csv": lambda path, level: Estimate("run", columns(level)).save(path),
    "log.csv": lambda path, level: write_log(Log.from_arrays(**columns(level)), path),
    "report.html": lambda path, level: atomic_write(path, f"<p>{level}</p>\n" * 20_000),
}


def write_for_ever(write: Callable[[Path, float], object], path: Path) -> None:
    while True:
        for level in (0.25, 0.5):
            write(path, level)


def killed(write: Callable[[Path, float], object], path: Path, delay: float) -> bool:
    """Kill a process that writes; whether it left a draft, so that it was writing."""
    child = os.fork()
    if child == 0:
        write_for_ever(write, path)
    time.sleep(delay)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    drafts = list(path.parent.glob(f".{path.name}.*"))
    for draft in drafts:
        draft.unlink()
    return bool(drafts)


def main(folder: Path) -> None:
    moments = random.Random(6)
    for name, write in WRITERS.items():
        path = folder / name
        whole = set()
        for level in (0.25, 0.5):
            write(path, level)
            whole.add(path.read_bytes())
        assert len(whole) == 2, name
        hit = torn = 0
        for _ in range(MOST):
            if hit == HITS:
                break
            hit += killed(write, path, moments.uniform(0.0, LONGEST))
            torn += path.read_bytes() not in whole
        print(name, hit, torn)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
