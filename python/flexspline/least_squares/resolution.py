"""Rows in which the recorder does not resolve the motion: there a model's error says nothing.

Around a reversal, and where a joint starts to move, friction changes within milliseconds. A motion
that was smoothed up to B is blurred there, and what a model then leaves looks like friction of the
path or of low speeds. So the rows are asked: by how much does the prediction move when the motion
is smoothed at half its bandwidth? Where that is more than the noise of the target, the inputs do
not say what the model should predict, and the rows do not count.

The model that is asked has Coulomb and viscous friction, which turn over fastest.

Near the ends of a recording a smoother has rows on one side only: derivatives are many times as
noisy there as elsewhere, and a value is off by another share of the curvature. Within its reach the
rows do not count; one row of them would stand out by the jump. So it is with a load, whose slope
tells by how much it is late, beside gaps too: what a motion is off by there, the question above
tells, and a start of motion behind a gap may be all that shows friction at low speed. A temperature
hardly changes within its reach.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flexspline.effects import Effect
from flexspline.logs.local_fit import LocalFit
from flexspline.logs.log import Log
from flexspline.logs.segments import runs
from flexspline.prepared import MOTION, Preparation

__all__ = ["away_from_ends", "coarser", "resolved_rows", "with_fastest"]

Array = NDArray[np.float64]
Masks = list[NDArray[np.bool_]]

HALF = 0.5  # of the bandwidth: what a smoother that is off by an octave would tell
FASTEST = ("coulomb_friction", "viscous_friction")
SLOW = "temperature"
LEAST = 0.5  # of a run: where less would count, all of it does
SHORT = 0.05  # s: the noise of the target is what it differs by after so long, in the median


def coarser(ways: Sequence[Preparation]) -> tuple[Preparation, ...]:
    """Return the preparations with the output's motion smoothed at half its bandwidth."""
    return tuple(
        replace(way, bandwidth=HALF * way.bandwidth) if way.channel in MOTION else way
        for way in ways
    )


def away_from_ends(recorded: Log, log: Log, ways: Sequence[Preparation]) -> NDArray[np.bool_]:
    """Return which rows (N,) of a part of a recording no end of it blurs, nor of its load a gap."""
    moving, time = [way for way in ways if way.channel in MOTION], log["time"]
    other = [way for way in ways if way.channel not in (*MOTION, SLOW)]
    unbroken = runs(recorded["time"])
    first, last = recorded["time"][unbroken[:, 0]], recorded["time"][unbroken[:, 1] - 1]
    own = np.searchsorted(first, time, side="right") - 1
    ends, gaps = _reach([*moving, *other]), _reach(other)
    inside = (time >= first[0] + ends) & (time <= last[-1] - ends)
    inside &= (time >= first[own] + gaps) & (time <= last[own] - gaps)
    return inside if np.mean(inside) >= LEAST else np.ones(len(log), dtype=bool)


def _reach(ways: Sequence[Preparation]) -> float:
    """How far the rows of the widest smoother lie on either side, s."""
    return max((LocalFit(way.bandwidth).half_length for way in ways), default=0.0)


def with_fastest(base: Sequence[Effect]) -> list[Effect]:
    """Return the base with the effects that turn over fastest."""
    names = {effect.name for effect in base}
    return [*base, *(Effect(name) for name in FASTEST if name not in names)]


def resolved_rows(
    logs: Sequence[Log], measured: Sequence[Array], predicted: Sequence[tuple[Array, Array]]
) -> Masks:
    """Return which rows of each run count, (N,).

    Parameters
    ----------
    measured : target of each run, (N,).
    predicted : of each run, with the motion as it is prepared and smoothed further, (N,) both.
    """
    left = [y - told for y, (told, _) in zip(measured, predicted, strict=True)]
    noise = float(np.median([_noise(log, rest) for log, rest in zip(logs, left, strict=True)]))
    return [np.abs(told - other) <= noise for told, other in predicted]


def _noise(log: Log, residual: Array) -> float:
    """Standard deviation of what a model leaves, from its median change after a short time."""
    lag = max(1, min(round(SHORT * log.rate), len(residual) - 1))
    return float(np.nanmedian(np.abs(residual[lag:] - residual[:-lag])) / 0.6745 / np.sqrt(2.0))
