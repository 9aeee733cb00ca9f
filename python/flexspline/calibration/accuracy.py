"""Accuracy of a torque sensor in data-sheet terms, from loading and unloading runs, in %FS.

Let D be the reading less the reference, averaged at each level of the reference, up: on rising
legs, down: on falling ones. All figures are largest values over the levels, divided by the full
scale.

    calibration curve   C = (up + down) / 2; up alone at the turning points, or where the runs
                        rise only
    non-linearity       |C − line|, the line that makes it least ("independent" linearity, best
                        straight line), that of the calibration itself (least squares, as in
                        zhang_disturbance_elimination §4.3), or the one through the ends
                        ("terminal based")
    hysteresis          |up − down| at the same reference, averages over the cycles ([VDI2008]
                        and [ISO2011] call it reversibility error, and divide by the actual value)
    repeatability       largest less least D at the same reference approached from the same side,
                        over the cycles
    combined error      |D| of any single leg: the total error of one reading

Sources: [ISA1979] (R1993), the terms "linearity", "hysteresis", "repeatability" and
"accuracy, measured"; [VDI2008]; [JCGM2012] (VIM) 2.21, 2.39. What a set of runs cannot
show is None with the reason: there is no hysteresis without unloading, no repeatability without a
second cycle. zhang_disturbance_elimination §4.3 describes loading in one direction only, yet
prints 0.903 % of hysteresis; that 0.878 % and 0.903 % are percent of 70 Nm is our reading.

A leg ends where the reference turns back by more than its noise: an elastic-plastic element of
half-width `slack` follows the channel and does not move before. Plateaus, ramps and their noise
give the same legs, and steps need no list of levels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexspline.logs.quantisation import white_noise
from flexspline.logs.segments import play, true_ranges

__all__ = [
    "Figure",
    "Leg",
    "Points",
    "legs_of",
    "load_figures",
    "points_on",
    "slack_of",
]

Array = NDArray[np.float64]

LEAST_LEVELS = 3
RANGE_OF_NORMALS = (0.0, 0.0, 1.128, 1.693, 2.059, 2.326, 2.534, 2.704, 2.847, 2.970, 3.078)

DEFINITIONS = {
    "non-linearity": "from the best straight line (least largest deviation; ISA-51.1 independent)",
    "non-linearity, least squares": "from the line of the calibration (least squares)",
    "non-linearity, terminal based": "from the line through both ends (ISA-51.1)",
    "hysteresis": "rising less falling at the same reference (ISA-51.1)",
    "repeatability": "spread at the same reference from the same side, over cycles (ISA-51.1)",
    "combined error": "of any reading of a single leg (ISA-51.1 measured accuracy)",
}

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
class Figure:
    """One figure. `percent`: of full scale; `torque`: the same in Nm; None where unknown.

    `noise`: %FS that noise alone would show. `at`: where it is largest, in `at_unit`.
    `reason`: why there is none, "" where there is one.
    """

    name: str
    percent: float | None
    torque: float | None
    noise: float | None
    at: float | None
    at_unit: str
    definition: str
    reason: str = ""

    @property
    def resolved(self) -> bool:
        """Whether it stands above what noise alone would show."""
        return self.percent is not None and self.noise is not None and self.percent > self.noise

    @classmethod
    def of(
        cls,
        name: str,
        definition: str,
        values: Array,
        at: Array,
        noise: float,
        full_scale: float,
        unit: str = "Nm",
    ) -> Figure:
        """Return the largest of `values` (n,), Nm; `noise`: Nm."""
        most = int(np.nanargmax(values))
        torque, share = float(values[most]), 100.0 / full_scale
        return cls(name, share * torque, torque, share * noise, float(at[most]), unit, definition)

    @classmethod
    def none(cls, name: str, definition: str, reason: str) -> Figure:
        return cls(name, None, None, None, None, "", definition, reason)


def load_figures(
    legs: Sequence[Leg], points: Points | None, full_scale: float | None, missing: str
) -> tuple[Figure, ...]:
    """Return all figures of `DEFINITIONS`.

    Parameters
    ----------
    points : on the legs of the reference; y[:, 0] is the reading less the reference, Nm.
    full_scale : Nm.
    missing : why there are no points at all, used where there are none.
    """
    if points is None or full_scale is None or not legs:
        reason = missing or "no leg of the reference spans half of its range"
        return tuple(Figure.none(name, text, reason) for name, text in DEFINITIONS.items())
    table = points.table(0, len(legs))
    rising = np.array([leg.rising for leg in legs])
    noise = float(points.noise[0])
    return (
        *_linearity(table, rising, points.levels, noise, full_scale),
        _hysteresis(table, rising, points.levels, noise, full_scale),
        _repeatability(table, rising, points.levels, noise, full_scale),
        _combined(table, points.levels, noise, full_scale),
    )


def _mean(table: Array) -> Array:
    """Mean over legs (L,), NaN where no leg has the level."""
    counts = np.isfinite(table).sum(axis=0)
    return np.where(counts > 0, np.nansum(table, axis=0) / np.maximum(counts, 1), np.nan)


def _curve(table: Array, rising: NDArray[np.bool_]) -> Array:
    """Mean of both ways; at the turning points, which only one leg holds, of that one."""
    return _mean(np.array([_mean(side) for side in (table[rising], table[~rising]) if len(side)]))


def _linearity(
    table: Array, rising: NDArray[np.bool_], levels: Array, noise: float, full_scale: float
) -> list[Figure]:
    names = list(DEFINITIONS)[:3]
    curve = _curve(table, rising)
    good = np.isfinite(curve)
    if good.sum() < LEAST_LEVELS:
        reason = (
            f"the legs share {int(good.sum())} levels of the reference, a line needs "
            f"{LEAST_LEVELS} to be judged; load in more steps"
        )
        return [Figure.none(name, DEFINITIONS[name], reason) for name in names]
    x, d = levels[good], curve[good]
    ends = d[0] + (d[-1] - d[0]) * (x - x[0]) / (x[-1] - x[0])
    shown = _largest_of_noise(noise / np.sqrt(len(table)), len(x))
    one_way = "; of the rising legs alone" if rising.all() else ""
    one_way = "; of the falling legs alone" if not rising.any() else one_way
    return [
        Figure.of(name, DEFINITIONS[name] + one_way, np.abs(left), x, shown, full_scale)
        for name, left in zip(names, (d - best_line(x, d), d, d - ends), strict=True)
    ]


def best_line(x: Array, y: Array) -> Array:
    """The line, at x, with the least largest deviation from y (Chebyshev's)."""
    from scipy.optimize import linprog

    scale = max(float(np.abs(x).max()), 1e-300)
    size = max(float(np.abs(y).max()), 1e-300)
    line = np.column_stack([np.ones(len(x)), x / scale])
    below, above = np.c_[line, -np.ones(len(x))], np.c_[-line, -np.ones(len(x))]
    found = linprog(
        [0.0, 0.0, 1.0],
        A_ub=np.vstack([below, above]),
        b_ub=np.concatenate([y, -y]) / size,
        bounds=[(None, None), (None, None), (0.0, None)],
    )
    return np.asarray(size * (line @ found.x[:2]))


def _hysteresis(
    table: Array, rising: NDArray[np.bool_], levels: Array, noise: float, full_scale: float
) -> Figure:
    name = "hysteresis"
    if rising.all() or not rising.any():
        way = "rises" if rising.all() else "falls"
        reason = f"the reference only {way}: record a run that goes back as well"
        return Figure.none(name, DEFINITIONS[name], reason)
    gap = np.abs(_mean(table[rising]) - _mean(table[~rising]))
    if not np.isfinite(gap).any():
        reason = "rising and falling legs share no level of the reference"
        return Figure.none(name, DEFINITIONS[name], reason)
    error = noise * np.sqrt(1.0 / rising.sum() + 1.0 / (~rising).sum())
    shown = _largest_of_noise(error, int(np.isfinite(gap).sum()))
    return Figure.of(name, DEFINITIONS[name], gap, levels, shown, full_scale)


def _repeatability(
    table: Array, rising: NDArray[np.bool_], levels: Array, noise: float, full_scale: float
) -> Figure:
    name = "repeatability"
    spreads, most = [], 0
    for side in (table[rising], table[~rising]):
        counts = np.isfinite(side).sum(axis=0)
        filled = np.where(np.isfinite(side), side, np.nan)
        if len(side) < 2 or not (counts > 1).any():
            continue
        low = np.fmin.reduce(filled, axis=0)
        high = np.fmax.reduce(filled, axis=0)
        spreads.append(np.where(counts > 1, high - low, np.nan))
        most = max(most, int(counts.max()))
    if not spreads:
        reason = "no level was reached twice from the same side: record two cycles or more"
        return Figure.none(name, DEFINITIONS[name], reason)
    spread = np.fmax.reduce(spreads, axis=0)
    usual = RANGE_OF_NORMALS[min(most, len(RANGE_OF_NORMALS) - 1)] * noise
    return Figure.of(name, DEFINITIONS[name], spread, levels, 2.0 * usual, full_scale)


def _combined(table: Array, levels: Array, noise: float, full_scale: float) -> Figure:
    name = "combined error"
    worst = np.fmax.reduce(np.abs(table), axis=0)
    shown = _largest_of_noise(noise, int(np.isfinite(table).sum()))
    return Figure.of(name, DEFINITIONS[name], worst, levels, shown, full_scale)


def _largest_of_noise(error: float, count: int) -> float:
    """About the largest of so many normal deviates of this size."""
    return float(error * np.sqrt(2.0 * np.log(2.0 * count)))


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


@dataclass(frozen=True, eq=False)
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
