"""Drift with temperature: how much before and after, and whether warming differs from cooling.

zhang_disturbance_elimination §4.2 ignores the difference, because there the temperature only
rose. A body that warms from one side lags its thermistor, so that on the way up the reading is
that of a colder body: the two
legs part. What is left of it after the compensation says whether a thermal lag is worth fitting.

Means over a tenth of the range of temperatures each, of the rows without load where there are any
(up to 2 % of the full scale), else of all rows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexspline.calibration.accuracy import Figure, Leg, legs_of, slack_of

__all__ = [
    "Thermal",
    "ThermalLeg",
    "count_temperatures",
    "thermal_figures",
    "thermal_legs",
    "thermal_means",
    "unloaded",
]

Array = NDArray[np.float64]

SAME_TEMPERATURE = 0.5  # K
SAME_IN_NOISE = 6.0  # standard deviations of the thermometer's noise
BINS = 10
LEAST_ROWS = 8
SLACK_SHARE = 0.03  # of the span: a thermostat swings about its set point
LEAST_LEG = 0.3  # of the span
UNLOADED = 0.02  # of the full scale
STILL_LOADED = 0.1  # of all rows: with fewer without load, all are taken

DEFINITIONS = {
    "drift, uncompensated": "largest less least mean reading over temperature",
    "drift, compensated": "the same with the compensation",
    "thermal hysteresis, uncompensated": "heating less cooling at the same temperature",
    "thermal hysteresis, compensated": "the same with the compensation",
}


@dataclass(frozen=True)
class ThermalLeg:
    """One way of the temperature in one run. `error`: reading less reference, compensated, Nm.

    `bias`: its mean, `rmse`: its root mean square.
    """

    run: str
    heating: bool
    low: float
    high: float
    bias: float
    rmse: float


@dataclass(frozen=True)
class Thermal:
    """Means over temperature, (bins,): °C, and Nm before and after the compensation.

    `heating`, `cooling`: (bins, 2), before and after; NaN in bins with too few rows.
    `noise`: standard error of a mean, Nm.
    """

    centre: Array
    both: Array
    heating: Array
    cooling: Array
    noise: float


def count_temperatures(columns: Sequence[Array], noise: float) -> int:
    """How many temperatures there are that lie half a kelvin, and more than the noise, apart."""
    apart = max(SAME_TEMPERATURE, SAME_IN_NOISE * noise)
    ordered = np.sort(np.concatenate(columns))
    count, at = 0, 0
    while at < len(ordered):
        count += 1
        at = int(np.searchsorted(ordered, ordered[at] + apart, side="left"))
    return count


def thermal_legs(columns: Sequence[Array]) -> list[Leg]:
    """Heating (rising) and cooling legs of the temperature in all runs."""
    span = max(float(c.max()) for c in columns) - min(float(c.min()) for c in columns)
    return legs_of(columns, slack_of(columns, SLACK_SHARE), LEAST_LEG * span)


def thermal_means(
    legs: Sequence[Leg],
    temperatures: Sequence[Array],
    torques: Sequence[Array],
    errors: Sequence[Array],
    full_scale: float | None,
) -> Thermal:
    """Average the errors of reading over temperature, over all rows and over the legs.

    Parameters
    ----------
    errors : (N, 2) for each run, Nm: reading less reference, before and after the compensation.
    """
    chosen = unloaded(torques, full_scale)
    low, high = min(float(t.min()) for t in temperatures), max(float(t.max()) for t in temperatures)
    edges = np.linspace(low, high, BINS + 1)
    masks = {True: [m & False for m in chosen], False: [m & False for m in chosen]}
    for leg in legs:
        rows = slice(leg.start, leg.stop)
        masks[leg.rising][leg.run][rows] |= chosen[leg.run][rows]
    return Thermal(
        0.5 * (edges[1:] + edges[:-1]),
        _binned(edges, temperatures, errors, chosen),
        _binned(edges, temperatures, errors, masks[True]),
        _binned(edges, temperatures, errors, masks[False]),
        _noise(legs, edges, temperatures, errors, chosen),
    )


def unloaded(torques: Sequence[Array], full_scale: float | None) -> list[NDArray[np.bool_]]:
    """Rows without load, (N,) for each run; all of them where too few are."""
    if full_scale is None:
        return [np.ones(len(t), dtype=bool) for t in torques]
    free = [np.abs(t) <= UNLOADED * full_scale for t in torques]
    share = sum(int(m.sum()) for m in free) / sum(len(m) for m in free)
    return free if share >= STILL_LOADED else [np.ones(len(t), dtype=bool) for t in torques]


def _binned(
    edges: Array,
    temperatures: Sequence[Array],
    errors: Sequence[Array],
    masks: Sequence[NDArray[np.bool_]],
) -> Array:
    """Means (bins, 2), NaN where there are too few rows."""
    t = np.concatenate([values[m] for values, m in zip(temperatures, masks, strict=True)])
    e = np.concatenate([values[m] for values, m in zip(errors, masks, strict=True)])
    place = _places(edges, t)
    means = np.full((BINS, 2), np.nan)
    for k in range(BINS):
        inside = e[place == k]
        if len(inside) >= LEAST_ROWS:
            means[k] = inside.mean(axis=0)
    return means


def _noise(
    legs: Sequence[Leg],
    edges: Array,
    temperatures: Sequence[Array],
    errors: Sequence[Array],
    masks: Sequence[NDArray[np.bool_]],
) -> float:
    """Standard error of a mean, Nm, from the halves of what each leg has in a bin."""
    gaps = []
    for leg in legs:
        rows = slice(leg.start, leg.stop)
        place = np.where(masks[leg.run][rows], _places(edges, temperatures[leg.run][rows]), -1)
        for k in range(BINS):
            inside = errors[leg.run][rows, 1][place == k]
            if len(inside) >= LEAST_ROWS:
                middle = len(inside) // 2
                gaps.append(inside[:middle].mean() - inside[middle:].mean())
    return 0.5 * float(np.sqrt(np.mean(np.square(gaps)))) if gaps else 0.0


def _places(edges: Array, temperature: Array) -> NDArray[np.intp]:
    return np.clip(np.searchsorted(edges, temperature, side="right") - 1, 0, BINS - 1)


def thermal_figures(
    thermal: Thermal | None, full_scale: float | None, missing: str
) -> tuple[Figure, ...]:
    """Return the figures of `DEFINITIONS`; `missing` says why there are none at all."""
    names = list(DEFINITIONS)
    if thermal is None or full_scale is None:
        return tuple(Figure.none(n, DEFINITIONS[n], missing) for n in names)
    made = []
    for column, name in enumerate(names[:2]):
        values = thermal.both[:, column]
        spread = values - np.nanmin(values)
        made.append(_figure(name, spread, thermal, full_scale))
    gap = np.abs(thermal.heating - thermal.cooling)
    for column, name in enumerate(names[2:]):
        if np.isfinite(gap[:, column]).any():
            made.append(_figure(name, gap[:, column], thermal, full_scale))
        else:
            made.append(Figure.none(name, DEFINITIONS[name], _one_way(thermal)))
    return tuple(made)


def _figure(name: str, values: Array, thermal: Thermal, full_scale: float) -> Figure:
    shown = thermal.noise * float(np.sqrt(4.0 * np.log(2.0 * BINS)))
    return Figure.of(name, DEFINITIONS[name], values, thermal.centre, shown, full_scale, "°C")


def _one_way(thermal: Thermal) -> str:
    warmed = bool(np.isfinite(thermal.heating[:, 0]).any())
    cooled = bool(np.isfinite(thermal.cooling[:, 0]).any())
    if warmed and not cooled:
        return "the temperature only rises: record the cooling as well"
    if cooled and not warmed:
        return "the temperature only falls: record the heating as well"
    return "no temperature was passed both on the way up and on the way down"
