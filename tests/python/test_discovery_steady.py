"""A velocity's noise is found as a fault before friction is named for it. A second together."""

from __future__ import annotations

import numpy as np

from flexspline.discovery.steady import steadied
from flexspline.effects import effect
from flexspline.logs.log import Log

RATE, WIDTH, LEVEL = 200.0, 0.03, 0.4
BASE = (effect("offset"), effect("coulomb_friction"), effect("viscous_friction"))


def run(seed: int, noise: float) -> Log:
    """Strokes with rests; friction of the true velocity; a measured one with this noise."""
    generator = np.random.default_rng([seed, 5])
    time = np.arange(0.0, 12.0, 1.0 / RATE)
    sides = np.sign(np.sin(1.3 * time + seed)) * (np.sin(0.4 * time) ** 2 > 0.2)
    kernel = np.hanning(41) / np.hanning(41).sum()
    velocity = np.convolve(0.5 * sides, kernel, mode="same")
    angle = np.cumsum(velocity) / RATE
    velocity = np.gradient(angle, time)
    torque = 0.1 + LEVEL * np.tanh(velocity / WIDTH) + 0.2 * velocity
    return Log.from_arrays(
        facts={"name": f"run {seed}"},
        time=time,
        output_position=angle,
        output_velocity=velocity + noise * generator.normal(size=len(time)),
        sensor_torque=torque + 0.01 * generator.normal(size=len(time)),
    )


def looked_at(noise: float) -> tuple[list[Log], list[Log], int]:
    logs = [run(seed, noise) for seed in range(4)]
    made, faults = steadied(logs, BASE, "sensor_torque", None, {}, lambda log: log)
    assert {fault.name for fault in faults} <= {"velocity_noise"}
    return logs, made, len(faults)


def off(logs: list[Log]) -> float:
    """RMS by which velocities differ from the true ones."""
    true = [run(seed, 0.0)["output_velocity"] for seed in range(4)]
    pairs = zip(logs, true, strict=True)
    return float(np.sqrt(np.mean([(log["output_velocity"] - v) ** 2 for log, v in pairs])))


def test_a_noisy_velocity_is_a_fault_and_a_steadier_one_is_taken() -> None:
    logs, made, faults = looked_at(0.004)
    assert faults == 4
    assert off(made) < 0.5 * off(logs)
    assert all("output_velocity" in log.history[-1] for log in made)


def test_a_smooth_velocity_stays_as_it_is() -> None:
    logs, made, faults = looked_at(0.0)
    assert faults == 0
    assert all(a is b for a, b in zip(logs, made, strict=True))
