"""Simulated joints of one type: parameters drawn around a mean, behind a laboratory's recorder."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.signal import lfilter

from flexspline.effects import Effect, effect
from flexspline.logs.log import Log
from flexspline.logs.writing import write_log
from flexspline.model import Model
from flexspline.part import Part
from flexspline.rigs.sensor import FACTS, Recorder

NAMES = ("offset", "coulomb_friction", "viscous_friction")
MEAN = {"offset": -0.1, "coulomb_friction": 0.3, "viscous_friction": 0.12}
SPREAD = {"offset": 0.05, "coulomb_friction": 0.04, "viscous_friction": 0.02}
RATE = 250.0  # Hz


def effects() -> list[Effect]:
    """Of every joint."""
    return [effect(name) for name in NAMES]


def drawn(rng: np.random.Generator) -> dict[str, float]:
    """Return the parameters of one joint."""
    return {name: float(rng.normal(MEAN[name], SPREAD[name])) for name in NAMES}


def run_of(
    truth: Mapping[str, float],
    rng: np.random.Generator,
    seconds: float = 20.0,
    *,
    noise: float = 0.03,
    memory: float = 0.05,
    name: str = "run",
    recorder: Recorder | None = None,
) -> Log:
    """Return a run of a joint: random speeds both ways, noise with a memory [s].

    Without a recorder channels are exact, and the noise is all that is beside the model.
    """
    time = np.arange(round(seconds * RATE)) / RATE
    knots = np.arange(0.0, seconds + 2.0, 1.5)
    velocity = np.interp(time, knots, rng.uniform(-1.5, 1.5, len(knots)))
    position = cumulative_trapezoid(velocity, time, initial=0.0) + rng.uniform(0.0, 6.0)
    motion = Log.from_arrays(
        facts={**FACTS, "name": name},
        time=time,
        output_position=position,
        output_velocity=velocity,
        motor_position=101.0 * position,
        temperature=np.full(len(time), 25.0 + rng.normal(0.0, 1.0)),
    )
    part = Part("sensor_torque", tuple(effects()), np.array([truth[name] for name in NAMES]))
    torque = Model({"sensor": part}, dict(FACTS)).predict(motion).predicted
    torque = torque + coloured(len(time), noise, memory, rng)
    if recorder is not None:
        return recorder.record(motion, torque, rng)
    return motion.with_columns({"sensor_torque": torque}, note="simulated")


def coloured(
    rows: int, noise: float, memory: float, rng: np.random.Generator
) -> NDArray[np.float64]:
    """AR(1) noise of a standard deviation and a memory [s], in its steady state."""
    slope = float(np.exp(-1.0 / (RATE * memory))) if memory > 0.0 else 0.0
    white = rng.normal(0.0, noise * np.sqrt(1.0 - slope**2), rows)
    start = slope * rng.normal(0.0, noise)
    return np.asarray(lfilter([1.0], [1.0, -slope], white, zi=[start])[0])


def fleet_in(
    folder: Path, joints: int, runs: int = 2, *, seed: int = 1, seconds: float = 20.0,
    recorder: Recorder | None = None,
) -> dict[str, dict[str, float]]:  # fmt: skip
    """Write runs of joints as FOLDER/jointN/runM.csv and return the parameters of each."""
    truths = {}
    for number, rng in enumerate(np.random.default_rng(seed).spawn(joints), 1):
        name = f"joint{number:02d}"
        truths[name] = drawn(rng)
        for run in range(1, runs + 1):
            log = run_of(truths[name], rng, seconds, name=f"run{run}", recorder=recorder)
            file = folder / name / f"run{run}.csv"
            file.parent.mkdir(parents=True, exist_ok=True)
            write_log(log, file)
    return truths
