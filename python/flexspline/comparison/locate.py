"""Where on its axis one thing that the residual follows is at work."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from flexspline.comparison.covariates import Covariate
from flexspline.comparison.search import CellTest, Step

__all__ = ["Place", "place_of"]

Array = NDArray[np.float64]

LARGE = 0.25  # of the largest mean square: half of the largest RMS
BOTH = 0.1  # of the larger direction's mean square: still both directions
NEAR_ZERO = 0.34  # a band from below this part of its upper end starts at 0 for what starts there


@dataclass(frozen=True)
class Place:
    """Bands (lower, upper) of a covariate, None where open, and directions, in which it is large.

    `kinds`: labels instead of bands, for runs and directions, with `means` of each in the unit
    of the comparison. `whole`: as large over the whole range. `turns_sign`: with the direction.
    """

    bands: tuple[tuple[float | None, float | None], ...]
    directions: tuple[str, ...]
    turns_sign: bool
    kinds: tuple[str, ...]
    means: tuple[float, ...]
    whole: bool


def place_of(step: Step, tested: CellTest) -> Place:
    """Return where a step is large; `tested` are its cells."""
    covariate = step.covariate
    assert covariate is not None
    power = np.maximum(step.fitted**2 - tested.error**2, 0.0) * (tested.rows / tested.tau >= 2.0)
    total, count = covariate.bins(power * tested.rows), covariate.bins(tested.rows)
    level = total / np.maximum(count, 1.0)
    large = level >= LARGE * level.max()
    weight = power * tested.rows * large[covariate.bin_of]
    directions = _directions(covariate, weight)
    turns = _turns_sign(covariate, np.sign(step.fitted) * weight)
    if covariate.edges is None:
        kinds = tuple(np.array(covariate.labels)[large].tolist())
        means = covariate.bins(step.fitted * tested.rows) / np.maximum(count, 1.0)
        return Place((), directions, turns, kinds, tuple(means[large].tolist()), False)
    return Place(_bands(covariate, large), directions, turns, (), (), bool(large[count > 0].all()))


def _bands(
    covariate: Covariate, large: NDArray[np.bool_]
) -> tuple[tuple[float | None, float | None], ...]:
    edges = covariate.edges
    assert edges is not None
    found = []
    for wanted, group in groupby(range(len(large)), key=lambda k: bool(large[k])):
        if wanted:
            members = list(group)
            low, high = float(edges[members[0]]), float(edges[members[-1] + 1])
            if edges[0] == 0.0 and np.isfinite(high) and low < NEAR_ZERO * high:
                low = 0.0 if covariate.name != "position" else low
            found.append((low if np.isfinite(low) else None, high if np.isfinite(high) else None))
    return tuple(found)


def _directions(covariate: Covariate, power: Array) -> tuple[str, ...]:
    """ "forward" and "backward" where the share of each is large."""
    each = [float(power[covariate.direction_of == way].sum()) for way in (1, 2)]
    if not max(each) > 0.0:
        return ()
    return tuple(
        word
        for word, size in zip(("forward", "backward"), each, strict=True)
        if size >= BOTH * max(each)
    )


def _turns_sign(covariate: Covariate, signed: Array) -> bool:
    """Whether most of what is large has opposite signs in the two directions of its bin."""
    forward, backward = (
        covariate.bins(np.where(covariate.direction_of == way, signed, 0.0)) for way in (1, 2)
    )
    opposite = np.where(forward * backward < 0.0, np.abs(forward) + np.abs(backward), 0.0)
    return bool(opposite.sum() > 0.5 * np.abs(signed).sum())
