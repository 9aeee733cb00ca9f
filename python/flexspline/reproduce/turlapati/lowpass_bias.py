"""What a low pass on the torque alone does to the ripple that a fit finds (§3.1).

A first-order filter of 1 Hz passes 1/√(1 + (o v / 2π)²) of order o at the speed v: 0.84 of order
8 at 0.5 rad/s, 0.53 of order 20, 0.06 of order 200. Rows that pass the same filter give the
amplitude back.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.signal import butter, lfilter

from flexspline.effects import effect
from flexspline.fitting import fit
from flexspline.logs.log import Log

__all__ = ["Left", "amplitude_left"]

SPEED = 0.5  # rad/s
RATE = 1000.0  # Hz
LOWPASS = 1.0  # Hz, §3.1
AMPLITUDE = 0.2  # Nm


@dataclass(frozen=True)
class Left:
    """Amplitude found over the true one: theory, filter on the target alone, rows alike."""

    theory: float
    target_only: float
    rows_alike: float


@cache
def amplitude_left(order: int) -> Left:
    """Return what is left of a ripple of this order at 0.5 rad/s."""
    time = np.arange(0.0, 4 * np.pi / SPEED, 1.0 / RATE)
    angle = SPEED * time
    rng = np.random.default_rng(8)
    torque = AMPLITUDE * np.cos(order * angle) + rng.normal(0.0, 0.02, len(time))
    passed = lfilter(*butter(1, LOWPASS, fs=RATE), torque)
    settled = time > 2.0
    log = Log(
        {"time": time[settled], "output_position": angle[settled], "sensor_torque": passed[settled]}
    )
    raw = Log({"time": time, "output_position": angle, "sensor_torque": torque})
    return Left(
        float(1.0 / np.hypot(1.0, order * SPEED / (2 * np.pi * LOWPASS))),
        _amplitude(log, order, None),
        _amplitude(raw, order, LOWPASS),
    )


def _amplitude(log: Log, order: int, hertz: float | None) -> float:
    ripple = effect("output_ripple", orders=[order])
    made = fit(["offset", ripple], log, "sensor_torque", lowpass=hertz, checks=False)
    return float(np.hypot(*made.part.coefficients[1:])) / AMPLITUDE
