"""Velocity and acceleration as a device makes them: late, from samples that it has seen."""

from __future__ import annotations

import math

import numpy as np

from flexspline import _core
from flexspline.logs.local_fit import require_bandwidth
from flexspline.logs.log import Log
from flexspline.logs.segments import runs

__all__ = ["differentiate_causal", "lateness"]


def lateness(bandwidth: float) -> str:
    """Return how late the causal velocity and acceleration of a bandwidth [Hz] are, in words."""
    late = 1e3 / (2.0 * math.pi * bandwidth)
    return f"causal, −3 dB at {bandwidth:.4g} Hz, late by {late:.3g} and {2 * late:.3g} ms"


def differentiate_causal(
    log: Log,
    *,
    bandwidth: float,
    of: str = "output_position",
    channels: tuple[str, str] = ("output_velocity", "output_acceleration"),
) -> Log:
    """Add velocity and acceleration by the core's causal differentiator.

    It is what runs on the joint (`flexspline/estimators/differentiator.hpp`): two first-order
    stages, −3 dB at `bandwidth` each, so velocity is late by 1/(2π bandwidth), acceleration by
    twice that. Each run without a gap starts at rest. Compare with
    `differentiate`, which has no delay, to see what a device loses.

    Parameters
    ----------
    bandwidth : Hz, at most a quarter of the rate.
    of : an angle [rad] that moves less than half a turn from sample to sample; it may wrap.
    channels : where velocity [rad/s] and acceleration [rad/s²] go.

    Raises
    ------
    InputError
        Where the bandwidth does not suit the rate.
    """
    require_bandwidth(bandwidth, log.rate, f"{log.name}, derivative of {of}")
    velocity, acceleration = np.empty(len(log)), np.empty(len(log))
    for first, last in runs(log["time"]):
        rows = slice(int(first), int(last))
        velocity[rows], acceleration[rows] = _core.replay_differentiator(
            log["time"][rows], log[of][rows], bandwidth
        )
    note = f"{channels[0]} and {channels[1]} derived from {of}: {lateness(bandwidth)}"
    return log.with_columns({channels[0]: velocity, channels[1]: acceleration}, note=note)
