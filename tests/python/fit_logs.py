"""Simulated logs with known truth, for the tests of fits."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

import flexspline
from flexspline import _core
from flexspline.effects import Effect, effect
from flexspline.logs.log import Log
from flexspline.signals import core_channels, gear_of

WIDTH = 0.05  # rad/s, the direction width of the simulated joints
HELD = {"direction_width": WIDTH}


def motion(
    seed: int = 0, samples: int = 2000, rate: float = 100.0, speed: float = 2.0
) -> dict[str, np.ndarray]:
    """Channels of a smooth motion with reversals; velocity and acceleration are exact."""
    generator = np.random.default_rng([seed, 17])
    time = np.arange(samples) / rate
    position, velocity, acceleration = np.zeros((3, samples))
    for frequency, share in ((0.131, 1.0), (0.083, 0.5), (0.37, 0.3)):
        omega = 2 * np.pi * frequency * generator.uniform(0.9, 1.1)
        phase = generator.uniform(0, 2 * np.pi)
        position += share * speed / omega * np.sin(omega * time + phase)
        velocity += share * speed * np.cos(omega * time + phase)
        acceleration -= share * speed * omega * np.sin(omega * time + phase)
    return {
        "time": time,
        "output_position": position,
        "output_velocity": velocity,
        "output_acceleration": acceleration,
    }


def autoregressive(generator, samples: int, phi: float = 0.9, innovation: float = 0.02):
    """AR(1) noise (samples,), in its steady state from the first row."""
    white = generator.normal(scale=innovation, size=samples + 300)
    return lfilter([1.0], [1.0, -phi], white)[300:]


def chosen(*effects: str | Effect) -> list[Effect]:
    return [e if isinstance(e, Effect) else effect(e) for e in effects]


def rows_of(effects, log: Log, known_load: str | None = None, coefficients=()) -> np.ndarray:
    """The plain rows (N, P) of effects, straight from the core."""
    effects = chosen(*effects)
    gear = gear_of(log.facts, "motor_position" in log)
    design = _core.Design([e.for_core() for e in effects], **gear)
    channels = core_channels(log, effects, known_load)
    return np.array(design.rows(channels, len(log), np.asarray(coefficients, dtype=float)))


def log_with(channels, torque=None, name: str = "run", facts=None, **more) -> Log:
    """A log of channels with `torque` as its sensor torque."""
    columns = {**channels, **more}
    if torque is not None:
        columns["sensor_torque"] = torque
    return Log.from_arrays(facts={"name": name, **(facts or {})}, **columns)


def simulated(effects, coefficients, channels, noise=0.0, name: str = "run", **more) -> Log:
    """A log whose sensor torque is rows of effects times coefficients, and noise (N,)."""
    bare = log_with(channels, name=name, **more)
    torque = rows_of(effects, bare, None, coefficients) @ np.asarray(coefficients, dtype=float)
    return log_with(channels, torque + noise, name, **more)


def friction(width: float = WIDTH) -> list[Effect]:
    """Offset, Coulomb, viscous friction and inertia: a small, well-posed model."""
    return chosen(
        "offset", effect("coulomb_friction", direction_width=width), "viscous_friction", "inertia"
    )


FRICTION = np.array([-0.12, 0.3, 0.15, 0.02])  # coefficients of `friction`


def run_of(seed: int, samples: int, phi: float = 0.9, shift: float = 0.0, **more) -> Log:
    """A log of a joint with `friction` alone, AR(1) noise and a shift of the sensor torque."""
    noise = autoregressive(np.random.default_rng(seed), samples, phi) + shift
    return simulated(friction(), FRICTION, motion(seed, samples), noise, f"run {seed}", **more)


def fitted(effects, logs, **options) -> flexspline.Fit:
    """A fit to the sensor torque that holds the width, unless `options` say otherwise."""
    options = {"fixed": HELD, "checks": False, **options}
    return flexspline.fit(effects, logs, "sensor_torque", **options)
