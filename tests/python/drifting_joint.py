"""A joint whose friction drifts, made without the core: what an adaptation has to follow."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import flexspline
from flexspline import Collision, Observer
from flexspline.logs.log import Log
from flexspline.model import Model

Array = NDArray[np.float64]

RATIO = 101.0
FACTS = {"gear_ratio": 100.0, "output_spline": "circular", "joint": "drifting"}
INERTIA, COULOMB, VISCOUS = 0.8, 6.0, 9.0
WIDTH = 0.01  # rad/s
RATE = 250.0  # Hz
TORQUE_STEP, VELOCITY_STEP = 2e-4, 2e-4  # Nm at the motor, rad/s: of the drive's registers
EFFECTS = ("inertia", "coulomb_friction", "viscous_friction")
NAMES = ("coulomb_friction.level", "viscous_friction.viscosity")


def motion(time: Array, stands: NDArray[np.bool_] | None = None) -> tuple[Array, Array]:
    """Velocity and acceleration of a Fourier swing; zero where it stands."""
    waves = ((0.45, 0.6, 0.0), (0.3, 1.7, 1.0), (0.15, 0.23, 2.0))
    v = sum(a * np.sin(w * time + p) for a, w, p in waves)
    a = sum(a * w * np.cos(w * time + p) for a, w, p in waves)
    if stands is not None:
        v, a = np.where(stands, 0.0, v), np.where(stands, 0.0, a)
    return np.asarray(v), np.asarray(a)


def log(
    seconds: float,
    seed: int,
    growth: float = 0.0,
    *,
    stands: tuple[float, float] | None = None,
    push: tuple[float, float, float] | None = None,
    start: float = 1.0,
) -> tuple[Log, Array]:
    """A log, and friction over its values at the start, (rows,).

    Parameters
    ----------
    growth : by which friction has grown at the end, in proportion to time.
    stands : first and last second without motion; the motor then holds 3 Nm at the output.
    push : first and last second, and Nm at the output from outside.
    start : of friction, over its nominal values.
    """
    random = np.random.default_rng(seed)
    time = np.arange(int(seconds * RATE)) / RATE
    still = np.zeros(len(time), dtype=bool)
    if stands is not None:
        still = (time >= stands[0]) & (time < stands[1])
    v, a = motion(time, still)
    worn = start * (1.0 + growth * time / seconds)
    output = INERTIA * a + worn * (COULOMB * np.tanh(v / WIDTH) + VISCOUS * v)
    output[still] = 3.0
    if push is not None:
        output += push[2] * ((time >= push[0]) & (time < push[1]))
    noise = ar_noise(random, len(time), 0.95, 0.25) + 0.15 * random.standard_normal(len(time))
    torque = np.round((output + noise) / RATIO / TORQUE_STEP) * TORQUE_STEP
    seen = v + 2e-4 * random.standard_normal(len(time))
    velocity = np.round(seen / VELOCITY_STEP) * VELOCITY_STEP
    made = Log.from_arrays(
        time=time,
        motor_torque=torque,
        output_velocity=velocity,
        output_acceleration=a,
        output_position=np.cumsum(v) / RATE,
        facts=FACTS,
    )
    return made, worn


def ar_noise(random: np.random.Generator, count: int, pole: float, size: float) -> Array:
    """Noise of this standard deviation that forgets with this pole, (count,)."""
    from scipy.signal import lfilter

    white = random.standard_normal(count) * size * np.sqrt(1.0 - pole**2)
    return np.asarray(lfilter([1.0], [1.0, -pole], white))


def fitted(seed: int = 1) -> Model:
    """The joint as a fit of a minute finds it, with an observer and a detector of contacts."""
    made = flexspline.fit(EFFECTS, log(60.0, seed)[0], "motor_torque").model
    return made.with_estimator(Observer(40.0, "motor_torque")).with_estimator(
        Collision("observer", (), (5.0,), (5.0,), 0.8, 0.1)
    )
