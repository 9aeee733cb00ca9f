"""Logs of a joint with friction that hide one thing each from its model, for comparisons."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache

import numpy as np
from fit_logs import FRICTION, autoregressive, friction, log_with, motion, rows_of
from numpy.typing import NDArray

import flexspline
from flexspline.comparison.result import Comparison
from flexspline.logs import Log
from flexspline.logs.segments import since_reversal
from flexspline.model import Model, Part

Array = NDArray[np.float64]
Channels = Mapping[str, Array]

FACTS: dict[str, str | float | int] = {"gear_ratio": 100.0, "output_spline": "circular"}
PHI, INNOVATION = 0.9, 0.02
NOISE = INNOVATION / np.sqrt(1.0 - PHI**2)  # Nm, standard deviation


def model() -> Model:
    """The model that knows friction and nothing else."""
    return Model({"sensor": Part("sensor_torque", tuple(friction()), FRICTION)}, FACTS)


def _slow(at: Channels) -> Array:
    velocity = at["output_velocity"]
    return 0.3 * np.tanh(velocity / 0.05) * np.exp(-((velocity / 0.15) ** 2))


def _ripple(at: Channels) -> Array:
    return 0.1 * np.cos(2.0 * at["output_position"]) + 0.06 * np.cos(7.0 * at["output_position"])


def _warm(at: Channels) -> Array:
    return 0.02 * (at["temperature"] - 30.0)


def _reversal(at: Channels) -> Array:
    since = since_reversal(at["time"], at["output_position"], at["output_velocity"], 0.0)
    return np.asarray(-0.3 * since.direction * np.exp(-np.nan_to_num(since.angle, nan=9.0) / 0.1))


def _loaded(at: Channels) -> Array:
    return 0.05 * np.abs(at["reference_torque"]) * np.tanh(at["output_velocity"] / 0.05)


def _bent(at: Channels) -> Array:
    return 0.1 * at["reference_torque"] ** 3


def _nothing(at: Channels) -> Array:
    return np.zeros(len(at["time"]))


HIDDEN: dict[str, Callable[[Channels], Array]] = {
    "nothing": _nothing,
    "slow": _slow,
    "ripple": _ripple,
    "warm": _warm,
    "reversal": _reversal,
    "loaded": _loaded,
    "bent": _bent,
}


def channels(number: int, samples: int) -> dict[str, Array]:
    """A smooth motion with a warming joint and a load of its own rhythm."""
    made = motion(number, samples)
    time = made["time"]
    made["temperature"] = 25.0 + 10.0 * (1.0 - np.exp(-time / 40.0)) + 2.0 * (number % 4)
    made["reference_torque"] = 3.0 * np.sin(0.9 * time + number) + 2.0 * np.sin(0.23 * time)
    return made


def logs(hidden: str, seed: int = 1, *, runs: int = 4, samples: int = 12_000) -> list[Log]:
    """Runs at 100 Hz that hide one thing, under AR(1) noise."""
    found = []
    for run in range(runs):
        at = channels(100 * seed + run, samples)
        generator = np.random.default_rng([seed, run, 5])
        noise = autoregressive(generator, samples, PHI, INNOVATION)
        known = rows_of(friction(), log_with(at), None, FRICTION) @ FRICTION
        found.append(log_with(at, known + HIDDEN[hidden](at) + noise, f"run {run}", FACTS))
    return found


@cache
def comparison(hidden: str) -> Comparison:
    """The comparison of the model with runs that hide this."""
    return flexspline.compare(model(), logs(hidden))
