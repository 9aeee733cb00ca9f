"""How likely a name is right: its weight among all that may stand behind what it explains.

    p = 1 / (1 + n + (1 − s) + l + exp(−e / 2)),    at most 1 − α

Besides the name, of weight one, there are its n aliases, each as good; a cause without a name, as
far as functions of the channels take its gain from it (a share 1 − s) and leave as much beside it
(l, over its gain); and chance, by what the name gains above its price, e in χ². Weights of
explanations that runs cannot tell apart are equal: p is rather too low than too high.
"""

from __future__ import annotations

import numpy as np

from flexspline.discovery.settings import SETTINGS, TINY

__all__ = ["confidence"]


def confidence(gain: float, above: float, survives: float, left: float, aliases: int) -> float:
    """Return the probability that a name is right; gains in χ², see the head of this file.

    Parameters
    ----------
    gain, above : what the name gains, and that above its price, by search and final fit.
    survives : share of its gain that it keeps beside functions without a name.
    left : gain of these beside it.
    aliases : how many names explain the runs as well.
    """
    chance = np.exp(-0.5 * max(above, 0.0))
    nameless = 1.0 - float(np.clip(survives, 0.0, 1.0)) + left / max(gain, TINY)
    return float(min(1.0 / (1.0 + aliases + nameless + chance), 1.0 - SETTINGS.alpha))
