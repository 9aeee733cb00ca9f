"""Rising and falling legs of a channel, and the points of a calibration on them.

A leg ends where the channel turns back by more than the noise: an elastic-plastic element of
half-width `slack` follows it, and does not move before. So plateaus, ramps, and noise on either
give the same legs, and steps, wherever they are, need no list of levels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexspline.logs.quantisation import white_noise
from flexspline.logs.segments import play, true_ranges

__all__ = ["Leg", "Points", "legs_of", "points_on", "slack_of"]

Array = NDArray[np.float64]
Rows = list[tuple[int, NDArray[np.intp]]]  # number of the leg, and rows of its run

SLACK_SHARE = 0.01  # of the span
SLACK_NOISE = 5.0  # standard deviations
STANDS = 0.25  # slack
PLATEAU = 2.0  # lasts so many times as long as a ramp at the leg's pace takes for a slack
LEAST_ROWS = 8
SETTLING = 0.25  # of a plateau, left out at its start
STEPPED = 0.5  # of a leg's rows on plateaus
BINS = 20  # of a ramp
SAME_LEVEL = 0.25  # of the usual step


@dataclass(frozen=True)
class Leg:
    """Rows [start, stop) of a run in which a channel goes one way, from `first` to `last`."""

    run: int
    start: int
    stop: int
    rising: bool
    first: float
    last: float

    @property
    def span(self) -> float:
        return abs(self.last - self.first)


@dataclass(frozen=True)
class Points:
    """Means on plateaus or bins, arrays (n,): `leg` and `level` are numbers from 0.

    `x`: the channel of the legs; `y`: what is looked at, (n, c). `noise`: standard error of a
    mean, (c,), from the halves of each or a noise model. `stepped`: plateaus, or bins of ramps.
    """

    leg: NDArray[np.intp]
    level: NDArray[np.intp]
    x: Array
    y: Array
    noise: Array
    stepped: bool

    @property
    def levels(self) -> Array:
        """(L,), mean of the channel at each level."""
        count = np.bincount(self.level)
        return np.asarray(np.bincount(self.level, self.x) / count)

    def table(self, column: int, legs: int) -> Array:
        """(legs, L), y by leg and level; NaN where a leg has no such level."""
        shape = (legs, int(self.level.max()) + 1)
        sums, counts = np.zeros(shape), np.zeros(shape)
        np.add.at(sums, (self.leg, self.level), self.y[:, column])
        np.add.at(counts, (self.leg, self.level), 1.0)
        return np.where(counts > 0.0, sums / np.maximum(counts, 1.0), np.nan)


def slack_of(columns: Sequence[Array], share: float = SLACK_SHARE) -> float:
    """Half-width within which a channel is taken to stand: above its noise."""
    span = max(float(c.max()) for c in columns) - min(float(c.min()) for c in columns)
    return max(share * span, SLACK_NOISE * max(white_noise(c) for c in columns))


def legs_of(columns: Sequence[Array], slack: float, least: float) -> list[Leg]:
    """Legs of a channel in all runs, those that span at least `least`."""
    found = []
    for number, values in enumerate(columns):
        moved = np.diff(play(values, slack), prepend=values[0])
        at = np.flatnonzero(moved)
        if not len(at):
            continue
        turns = np.flatnonzero(np.diff(np.sign(moved[at]))) + 1
        starts = [0, *at[turns].tolist(), len(values)]
        rising = [bool(moved[at[0]] > 0.0), *(moved[at[turns]] > 0.0).tolist()]
        found += _cut(number, values, starts, rising, slack)
    return [leg for leg in found if leg.span >= least]


def _cut(run: int, values: Array, starts: list[int], rising: list[bool], slack: float) -> list[Leg]:
    """Move each turn back to the last row at the extreme: the turn shows only a slack later."""
    edges = [starts[0]]
    for k in range(1, len(starts) - 1):
        part = values[edges[-1] : starts[k]]
        far = (
            part >= part.max() - 0.5 * slack if rising[k - 1] else part <= part.min() + 0.5 * slack
        )
        edges.append(edges[-1] + int(np.flatnonzero(far)[-1]) + 1)
    edges.append(starts[-1])
    legs = []
    for first, last, up in zip(edges[:-1], edges[1:], rising, strict=True):
        part = values[first:last]
        low, high = float(part.min()), float(part.max())
        legs.append(Leg(run, first, last, up, low if up else high, high if up else low))
    return legs


def points_on(
    legs: Sequence[Leg],
    columns: Sequence[Array],
    looked_at: Sequence[Array],
    slack: float,
    long_run: Sequence[float] = (),
) -> Points | None:
    """Means of `looked_at`, an array (N, c) for each run, on plateaus or in bins of the legs.

    None where there is nothing to average. `long_run`: (c,), error of a mean times the root of its
    rows, where a noise model knows it; slow noise has no difference between the halves.
    """
    ranges = [_plateaus(leg, columns[leg.run], slack) for leg in legs]
    on_plateaus = sum(int(np.diff(r, axis=1).sum()) for r in ranges)
    stepped = on_plateaus >= STEPPED * sum(leg.stop - leg.start for leg in legs)
    levels: list[int] = []
    if stepped:
        rows = [
            (number, np.arange(first + int(SETTLING * (last - first)), last))
            for number, found in enumerate(ranges)
            for first, last in found.tolist()
        ]
    else:
        rows, levels = _binned(legs, columns)
    if not rows:
        return None
    made = _averaged(rows, levels, legs, columns, looked_at, stepped)
    if not len(long_run):
        return made
    usual = float(np.median([len(at) for _, at in rows]))
    return replace(made, noise=np.maximum(made.noise, np.asarray(long_run) / np.sqrt(usual)))


def _plateaus(leg: Leg, values: Array, slack: float) -> NDArray[np.intp]:
    """Row ranges (k, 2) in which the channel stands for longer than a ramp would."""
    part = values[leg.start : leg.stop]
    width = max(LEAST_ROWS, int(slack * len(part) / leg.span))  # a ramp passes a slack meanwhile
    if len(part) <= width:
        return np.empty((0, 2), dtype=np.intp)
    followed = play(part, slack)
    still = np.abs(followed[width:] - followed[:-width]) < STANDS * slack
    ranges = true_ranges(still)
    ranges[:, 1] += width
    long = np.diff(ranges, axis=1)[:, 0] >= PLATEAU * width
    return np.asarray(leg.start + ranges[long])


def _binned(legs: Sequence[Leg], columns: Sequence[Array]) -> tuple[Rows, list[int]]:
    """Rows of each leg in equal bins of the channel, and the number of the bin."""
    ends = [end for leg in legs for end in (leg.first, leg.last)]
    edges = np.linspace(min(ends), np.nextafter(max(ends), np.inf), BINS + 1)
    rows, levels = [], []
    for number, leg in enumerate(legs):
        place = np.digitize(columns[leg.run][leg.start : leg.stop], edges) - 1
        for level in range(BINS):
            inside = leg.start + np.flatnonzero(place == level)
            if len(inside) >= LEAST_ROWS:
                rows.append((number, inside))
                levels.append(level)
    return rows, levels


def _averaged(
    rows: Rows,
    levels: list[int],
    legs: Sequence[Leg],
    columns: Sequence[Array],
    looked_at: Sequence[Array],
    stepped: bool,
) -> Points:
    x = np.array([columns[legs[n].run][at].mean() for n, at in rows])
    picked = [looked_at[legs[n].run][at] for n, at in rows]
    y = np.array([values.mean(axis=0) for values in picked])
    halves = [
        values[: len(values) // 2].mean(axis=0) - values[len(values) // 2 :].mean(axis=0)
        for values in picked
        if len(values) > 1
    ]
    noise = 0.5 * np.sqrt(np.mean(np.square(halves), axis=0))
    leg = np.array([n for n, _ in rows])
    level = _clustered(x, leg) if stepped else np.unique(levels, return_inverse=True)[1]
    return Points(leg, np.asarray(level, dtype=np.intp), x, y, np.asarray(noise), stepped)


def _clustered(x: Array, leg: NDArray[np.intp]) -> NDArray[np.intp]:
    """Number the plateaus by level: those closer than a quarter of the usual step are one."""
    steps = np.abs(np.diff(x))[np.diff(leg) == 0]
    apart = SAME_LEVEL * float(np.median(steps)) if len(steps) else np.inf
    order = np.argsort(x, kind="stable")
    level = np.zeros(len(x), dtype=np.intp)
    level[order] = np.concatenate([[0], np.cumsum(np.diff(x[order]) > apart)])
    return level
