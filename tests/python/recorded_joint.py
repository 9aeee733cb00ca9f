"""Short runs of a joint with friction and a load, through a recorder that is noisy or exact."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from fit_logs import WIDTH, motion
from hidden_logs import load_at
from numpy.typing import NDArray

from flexspline.effects import Effect, effect
from flexspline.logs.log import Log

Array = NDArray[np.float64]

LOAD = "reference_torque"
RATE, SAMPLES = 200.0, 2000  # 10 s
RATIO = 101.0  # the circular spline is the output
FACTS = {"gear_ratio": 100.0, "output_spline": "circular"}
LEVEL, VISCOUS, INERTIA, OFFSET = 0.3, 0.5, 0.02, -0.12
QUANTUM = 2.0 * np.pi / 2**19  # rad
LOAD_NOISE, TORQUE_NOISE = 0.004, 0.01  # Nm

Added = Callable[[dict[str, Array]], Array]


def base() -> list[Effect]:
    """What the joint has, but for what is added to it."""
    names = ("viscous_friction", "inertia")
    sliding = effect("coulomb_friction", direction_width=WIDTH)
    return [effect("offset"), sliding, *(effect(n) for n in names)]


def friction(c: dict[str, Array]) -> Array:
    """Offset, Coulomb and viscous friction, and inertia, Nm (N,)."""
    v = c["output_velocity"]
    held = OFFSET + LEVEL * np.tanh(v / WIDTH) + VISCOUS * v
    return np.asarray(held + INERTIA * c["output_acceleration"])


def exact(seed: int) -> dict[str, Array]:
    """The motion (N,) by channel, and the load as it is."""
    c = motion(seed, SAMPLES, RATE)
    c[LOAD] = load_at(c["time"], np.random.default_rng([seed, 41]).uniform(0, 6.3, 5))
    return c


def recorded(
    seed: int,
    *,
    target: str = "sensor_torque",
    late: float = 0.0,
    offset: bool = True,
    added: Added | None = None,
    noise: float = TORQUE_NOISE,
) -> Log:
    """A run as a laboratory has it: one encoder, a load cell and the target, none of them exact.

    `late`: s, of the load cell. `added`: Nm beside `friction`, from the exact channels.
    """
    c, generator = exact(seed), np.random.default_rng([seed, 43])
    torque = c[LOAD] + friction(c) - (0.0 if offset else OFFSET)
    if added is not None:
        torque = torque + added(c)
    torque = torque + generator.normal(0.0, noise, SAMPLES)
    shift = np.random.default_rng([seed, 41]).uniform(0, 6.3, 5)
    cell = load_at(c["time"] - late, shift) + generator.normal(0.0, LOAD_NOISE, SAMPLES)
    position = QUANTUM * np.round(c["output_position"] / QUANTUM)
    return Log.from_arrays(
        facts={"name": f"run{seed}", **FACTS},
        time=c["time"],
        output_position=position,
        **{LOAD: cell, target: torque / (RATIO if target == "motor_torque" else 1.0)},
    )


def runs(count: int = 5, **how: object) -> list[Log]:
    """Several runs, each with another motion and load; `how` as in `recorded`."""
    return [recorded(seed, **how) for seed in range(count)]  # type: ignore[arg-type]
