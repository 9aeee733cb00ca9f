"""Rows in which the recorder does not resolve the motion: there a model's error says nothing.

Around a reversal, and where a joint starts to move, friction changes within milliseconds. A motion
that was smoothed up to B is blurred there, and what a model then leaves looks like friction of the
path or of low speeds. So the rows are asked: by how much does the prediction move when the motion
is smoothed at half its bandwidth? Where that is more than the noise of the target, the inputs do
not say what the model should predict, and the rows do not count.

The model that is asked is the base with Coulomb and viscous friction, which turn over fastest.

Near the ends of a recording a smoother has rows on one side only, and its derivatives are many
times as noisy there as elsewhere: within its reach the rows do not count either.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from flexspline.discovery.refit import started
from flexspline.discovery.rest import SECONDS
from flexspline.discovery.settings import SETTINGS
from flexspline.discovery.whitening import Whitening
from flexspline.discovery.working import working
from flexspline.effects import Effect
from flexspline.fit.problem import Problem
from flexspline.logs.log import Log
from flexspline.prepared import Preparation

__all__ = ["away_from_ends", "coarser", "resolved"]

Array = NDArray[np.float64]
Masks = list[NDArray[np.bool_]]

HALF = 0.5  # of the bandwidth: what a smoother that is off by an octave would tell
FASTEST = ("coulomb_friction", "viscous_friction")
MOTION = ("output_position", "output_velocity", "output_acceleration")
REACH = 1.0  # over the bandwidth: how far a smoother's rows lie on both sides
LEAST = 0.5  # of a run: where less would count, all of it does


def coarser(ways: Sequence[Preparation]) -> tuple[Preparation, ...]:
    """Return the preparations with the output's motion smoothed at half its bandwidth."""
    return tuple(
        replace(way, bandwidth=HALF * way.bandwidth) if way.channel in MOTION else way
        for way in ways
    )


def away_from_ends(recorded: Log, log: Log, ways: Sequence[Preparation]) -> NDArray[np.bool_]:
    """Return which rows (N,) of a part of a recording no end of it blurs."""
    reach = max((REACH / way.bandwidth for way in ways if way.channel in MOTION), default=0.0)
    first, last = recorded["time"][[0, -1]]
    inside = (log["time"] >= first + reach) & (log["time"] <= last - reach)
    return inside if np.mean(inside) >= LEAST else np.ones(len(log), dtype=bool)


def resolved(
    base: Sequence[Effect],
    fixed: Mapping[str, float],
    posed: Callable[[Sequence[Effect], bool], Problem],
) -> Masks:
    """Return which rows of each run count, (N,).

    Parameters
    ----------
    posed : makes the problem of effects, with the motion as it is prepared or smoothed further.
    """
    names = {effect.name for effect in base}
    effects = [*base, *(Effect(name) for name in FASTEST if name not in names)]
    fine, coarse = posed(effects, False), posed(effects, True)
    plain = Whitening(np.ones(1), 1.0, fine.decimation)
    work, _ = started(fine, working(effects, len(effects), fixed), plain)
    both = [(work.predict(fine, k), work.predict(coarse, k)) for k in range(len(fine.runs))]
    left = [run.target - told for run, (told, _) in zip(fine.runs, both, strict=True)]
    noise = float(np.median([_noise(run.log, rest) for run, rest in
                             zip(fine.runs, left, strict=True)]))  # fmt: skip
    return [np.abs(told - other) <= noise for told, other in both]


def _noise(log: Log, residual: Array) -> float:
    """Standard deviation of what a model leaves, from its median change after a short time."""
    lag = max(1, min(round(SETTINGS.little * SECONDS * log.rate), len(residual) - 1))
    return float(
        np.median(np.abs(residual[lag:] - residual[:-lag]))
        / norm.isf(SETTINGS.quarter)
        / np.sqrt(2.0)
    )
