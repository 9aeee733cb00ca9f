"""Play: what follows a channel once it has gone further than the slack between both."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["play"]

Array = NDArray[np.float64]


def play(position: Array, slip: float) -> Array:
    """Return where the far end of an elastic-plastic element sits, (N,).

    p_k = min(q_k + s, max(q_k − s, p_{k−1})),  p_0 = q_0: it follows once the spring is
    stretched by s. Clamps compose to clamps, so the recursion is a scan in log2(N) passes over
    the arrays [HillisSteele1986].
    """
    low, high = position - slip, position + slip
    low[0] = high[0] = position[0]
    step = 1
    while step < len(position):
        before_low, before_high = low[:-step], high[:-step]
        now_low, now_high = low[step:], high[step:]
        new_low = np.clip(before_low, now_low, now_high)
        new_high = np.clip(before_high, now_low, now_high)
        low, high = np.concatenate([low[:step], new_low]), np.concatenate([high[:step], new_high])
        step *= 2
    return low
