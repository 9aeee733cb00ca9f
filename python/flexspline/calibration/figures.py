"""What a data sheet says of a torque sensor, from loading and unloading runs, in %FS.

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
    combined error      |D| of any single leg: what all of them make of one reading

Sources: [ISA1979] (R1993), the terms "linearity", "hysteresis", "repeatability" and
"accuracy, measured"; [VDI2008]; [JCGM2012] (VIM) 2.21, 2.39. What a set of runs cannot
show is None with the reason: there is no hysteresis without unloading, no repeatability without a
second cycle. zhang_disturbance_elimination §4.3 describes loading in one direction only, yet
prints 0.903 % of hysteresis; that 0.878 % and 0.903 % are percent of 70 Nm is our reading.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexspline.calibration.legs import Leg, Points

__all__ = ["Figure", "load_figures"]

Array = NDArray[np.float64]

LEAST_LEVELS = 3
RANGE_OF_NORMALS = (0.0, 0.0, 1.128, 1.693, 2.059, 2.326, 2.534, 2.704, 2.847, 2.970, 3.078)


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


DEFINITIONS = {
    "non-linearity": "from the best straight line (least largest deviation; ISA-51.1 independent)",
    "non-linearity, least squares": "from the line of the calibration (least squares)",
    "non-linearity, terminal based": "from the line through both ends (ISA-51.1)",
    "hysteresis": "rising less falling at the same reference (ISA-51.1)",
    "repeatability": "spread at the same reference from the same side, over cycles (ISA-51.1)",
    "combined error": "of any reading of a single leg (ISA-51.1 measured accuracy)",
}


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
