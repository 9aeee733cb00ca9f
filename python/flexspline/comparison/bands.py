"""RMSE of the residual in each band of each covariate, against the noise floor there.

In band k with residual r, and e what remains when everything that it depends on is taken out:

    RMSE² = mean r²,   floor² = mean e² · (1 + swallowed),   excess² = RMSE² − floor²

Where the noise of what is measured is known, it is the floor instead. Where the velocity is too
noisy for the model's friction, the floor is at least the floor of all rows plus what that noise
does to the prediction. Errors include the noise's autocorrelation.

Of each covariate that the residual depends on, the range is located in which it does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import groupby, pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm as normal

from flexspline.comparison.covariates import Covariate, Turning
from flexspline.comparison.effective_sample_size import Memory
from flexspline.comparison.runs import Rows
from flexspline.comparison.search import ALPHA, CellTest, CellTests, Search, Step

__all__ = [
    "Band",
    "OrderPeak",
    "Place",
    "bands_of",
    "overall",
    "peaks_of",
    "place_of",
    "worst_band",
]

Array = NDArray[np.float64]

LEAST_EFFECTIVE = 5.0  # rows that a band is worth, to be called the worst
_DOUBTFUL = 0.25  # of the floor's square, from which the velocity's noise matters

LARGE = 0.25  # of the largest mean square: half of the largest RMS
BOTH = 0.1  # of the larger direction's mean square: still both directions
NEAR_ZERO = 0.34  # a band from below this part of its upper end starts at 0 for what starts there


@dataclass(frozen=True)
class Band:
    """One band of rows. Numbers in the unit of the comparison, variance in its square.

    `lower`, `upper`: of the covariate, in its unit; None for kinds and where it is open.
    `effective_rows`: independent ones. `noise_floor_error`: standard error of the floor.
    `excess`: RMS above the floor. `chance`: that noise alone shows such a mean, or such a mean
    square above the floor, in any band of this covariate. `significant`: more than chance.
    """

    label: str
    lower: float | None
    upper: float | None
    rows: int
    effective_rows: float
    rmse: float
    variance: float
    bias: float
    noise_floor: float
    noise_floor_error: float
    excess: float
    chance: float
    significant: bool


@dataclass(frozen=True)
class OrderPeak:
    """An order of what turns in the residual; amplitude and error in its unit.

    `order` per turn of `pair`; `label` says what turns; `chance`: that noise alone shows it.
    """

    pair: str
    order: float
    per_output_turn: float
    amplitude: float
    error: float
    chance: float
    label: str
    also: tuple[str, ...]


def overall(rows: Rows, memory: Memory, found: Search, test: CellTests) -> Band:
    """Return the band of all rows."""
    cells = np.zeros(len(rows), dtype=np.int16)
    one = np.zeros(1, dtype=np.intp)
    whole = Covariate("all", "all rows", "", None, ("all rows",), cells, one, one - 1)
    (band,) = bands_of(whole, rows, memory, found, test, len(found.chances))
    chance = min((step.chance for step in found.steps), default=min(found.chances.values()))
    chance = min(1.0, chance * len(found.chances))
    return replace(band, chance=chance, significant=bool(found.steps))


def bands_of(
    covariate: Covariate,
    rows: Rows,
    memory: Memory,
    found: Search,
    test: CellTests,
    family: int,
) -> list[Band]:
    """Return the bands of a covariate that hold rows; `family`: covariates tested together."""
    tested = test(covariate, rows.residual)
    count = covariate.bins(tested.rows)
    inside = np.maximum(count, 1.0)
    mean = covariate.bins(test.sum(covariate, rows.residual)) / inside
    square = covariate.bins(test.sum(covariate, rows.residual**2)) / inside
    floor = _floor(covariate, rows, found, test, inside, square)
    bins = np.append(covariate.bin_of, -1)[covariate.cells].astype(np.int32)
    tau, tau_square = memory.times(bins, len(covariate.labels))
    error = np.sqrt(floor * tau_square / (2.0 * inside))  # half of that of the square, by 2 √floor
    excess = np.sqrt(np.maximum(square - floor, 0.0))
    chance = np.ones(len(covariate.labels))
    np.minimum.at(chance, covariate.bin_of, tested.p)
    above = np.maximum(square - floor, 0.0) / np.maximum(2.0 * np.sqrt(floor) * error, 1e-300)
    chance = np.minimum(2.0 * np.minimum(chance, normal.sf(above)), 1.0 - 1e-12)
    chance = -np.expm1(covariate.count * np.log1p(-chance))
    sure = (chance < ALPHA / family) & (excess > 0.0) & bool(found.steps)
    ends = _ends(covariate)
    return [
        Band(
            covariate.labels[k],
            ends[k][0],
            ends[k][1],
            int(count[k]),
            float(count[k] / tau[k]),
            float(np.sqrt(square[k])),
            float(max(square[k] - mean[k] ** 2, 0.0)),
            float(mean[k]),
            float(np.sqrt(floor[k])),
            float(error[k]),
            float(excess[k]),
            float(chance[k]),
            bool(sure[k]),
        )
        for k in np.flatnonzero(count > 0).tolist()
    ]


def worst_band(bands: Sequence[Band]) -> Band:
    """Return the band with the largest excess, of those with enough rows to tell."""
    known = [band for band in bands if band.effective_rows >= LEAST_EFFECTIVE] or list(bands)
    return max(known, key=lambda band: (band.significant, band.excess, band.rmse))


def peaks_of(turning: Turning) -> list[OrderPeak]:
    """Return the orders found, the largest first."""
    return [
        OrderPeak(o.pair, float(o.order), o.per_output_turn, o.amplitude, o.error, o.chance,
                  o.label, o.aliases[:2])
        for o in turning.found
    ]  # fmt: skip


def _floor(
    covariate: Covariate, rows: Rows, found: Search, test: CellTests, inside: Array, square: Array
) -> Array:
    """Squares of the floor of each band."""
    if rows.floor is not None:
        return np.minimum(rows.floor**2, square)
    left = covariate.bins(test.sum(covariate, found.rest**2)) / inside * found.swallowed
    doubt = covariate.bins(test.sum(covariate, rows.doubt**2)) / inside
    everywhere = max(found.floor_square - float(np.mean(rows.doubt**2)), 0.0)
    least = np.minimum(square, everywhere + doubt)
    return np.where(doubt > _DOUBTFUL * left, np.maximum(left, least), np.minimum(left, square))


def _ends(covariate: Covariate) -> Sequence[tuple[float | None, float | None]]:
    if covariate.edges is None:
        return [(None, None)] * len(covariate.labels)
    closed = [float(e) if np.isfinite(e) else None for e in covariate.edges]
    return list(pairwise(closed))


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
    found: list[tuple[float | None, float | None]] = []
    for wanted, group in groupby(range(len(large)), key=lambda k: bool(large[k])):
        if wanted:
            members = list(group)
            low, high = float(edges[members[0]]), float(edges[members[-1] + 1])
            if edges[0] == 0.0 and np.isfinite(high) and low < NEAR_ZERO * high:
                low = 0.0 if covariate.name != "position" else low
            if low == 0.0:
                found.clear()  # a band from 0 holds those before it
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
