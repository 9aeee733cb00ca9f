"""What a hand does to a joint over a pulley: pushes that drive it, and pushes that do not."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

__all__ = ["pushes"]

Array = NDArray[np.float64]

DRIVING = (6.5, 14.0)  # Nm
RESTING = (1.0, 4.8)  # Nm
LENGTHS = {True: (2.0, 5.0), False: (1.0, 3.0)}  # s of a push that drives, and that does not
PAUSES = (0.2, 0.8)  # s between pushes
SOFTNESS = 0.06  # s, of a hand that begins and ends
TREMOR = 0.025  # s, over which a shaking hand's torque hangs together


def pushes(time: Array, rng: np.random.Generator, *, tremor: float = 0.04) -> Array:
    """Return the torque of a hand, (N,), Nm at the output, positive where it drives q forward.

    Driving and resting pushes take turns. The driving ones go there and back, the resting ones
    either way by chance; the last ends 1 s before the end.

    Parameters
    ----------
    time : (N,), s, evenly spaced.
    rng : draws strengths, lengths, directions and tremor.
    tremor : share of the torque.
    """
    period = float(time[1] - time[0])
    torque, now, drives = np.zeros(len(time)), rng.uniform(*PAUSES), True
    way = {True: rng.choice([-1.0, 1.0]), False: rng.choice([-1.0, 1.0])}
    while True:
        length = rng.uniform(*LENGTHS[drives])
        if now + length > time[-1] - time[0] - 1.0:
            break
        strength = way[drives] * rng.uniform(*(DRIVING if drives else RESTING))
        first, last = int(now / period), int((now + length) / period)
        along = np.linspace(0.0, 1.0, last - first)
        torque[first:last] = strength * np.interp(along, [0.0, 0.25, 0.75, 1.0], [0.3, 1, 1, 0.3])
        now += length + rng.uniform(*PAUSES)
        way[drives] = -way[drives] if drives else rng.choice([-1.0, 1.0])
        drives = not drives
    smooth = gaussian_filter1d(torque, SOFTNESS / period)
    shaking = gaussian_filter1d(rng.normal(size=len(time)), TREMOR / period)
    return np.asarray(smooth * (1.0 + tremor * shaking / shaking.std()))
