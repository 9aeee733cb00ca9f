"""Noise of six kinds: white, with memory, swinging, with heavy tails."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

__all__ = ["NOISES", "Noise"]

Array = NDArray[np.float64]

SETTLED = 800  # samples before the first that is used
SWING = 0.95  # radius of the poles of the swinging noise
TAILS = 4.0  # degrees of freedom of the heavy tails


@dataclass(frozen=True)
class Noise:
    """Autoregressive noise: `denominator` is A in A(z) e = w; `tails`: of Student's w, or None."""

    denominator: tuple[float, ...]
    tails: float | None = None

    def drawn(self, generator: np.random.Generator, rows: int, size: float) -> Array:
        """Return noise (rows,) of the standard deviation `size`, in its steady state."""
        if self.tails is None:
            white = generator.normal(size=rows + SETTLED)
        else:
            white = generator.standard_t(self.tails, size=rows + SETTLED)
            white = white * np.sqrt((self.tails - 2.0) / self.tails)
        coloured = lfilter([1.0], self.denominator, white)[SETTLED:]
        return np.asarray(size * coloured / self._gain())

    def innovation(self, size: float) -> float:
        """Standard deviation of w where that of e is `size`."""
        return size / self._gain()

    def _gain(self) -> float:
        impulse = np.zeros(4000)
        impulse[0] = 1.0
        return float(np.linalg.norm(lfilter([1.0], self.denominator, impulse)))


NOISES: Mapping[str, Noise] = {
    "white": Noise((1.0,)),
    "AR 0.6": Noise((1.0, -0.6)),
    "AR 0.9": Noise((1.0, -0.9)),
    "AR 0.97": Noise((1.0, -0.97)),
    "swinging": Noise((1.0, -2.0 * SWING * np.cos(0.5), SWING**2)),
    "heavy tails": Noise((1.0, -0.6), TAILS),
}
