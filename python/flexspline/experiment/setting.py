"""Load and temperature of a run: levels at which its motion is repeated, or slow changes under it.

A part of a run has a load that stands or goes to and fro as a cosine, and a temperature that
stands or rises exponentially. Between parts the joint rests while the load changes. Parts at
different temperatures are runs of their own, with a gap between them in the file's time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from flexspline.experiment.limits import Bounds, Range
from flexspline.experiment.words import joined, short

__all__ = ["Part", "Setting", "settings"]

Array = NDArray[np.float64]

LEAST_KELVIN = 1.0  # below, temperature is a constant
MOST_PARTS = 6
WARM = 3.0  # time constants of a warm-up in a part


@dataclass(frozen=True)
class Part:
    """`load`: from, to [Nm] and how often to and fro, 0 for standing at the first; or None.

    `temperature`: at the start and, after a warm-up, at the end [°C]; or None.
    """

    load: tuple[float, float, int] | None
    temperature: Range | None

    def loads(self, share: Array) -> Array:
        """Load (N,) over the share of the part that has gone."""
        assert self.load is not None
        low, high, times = self.load
        return np.asarray(low + 0.5 * (high - low) * (1.0 - np.cos(2 * np.pi * times * share)))

    def temperatures(self, share: Array) -> Array:
        """Temperature (N,) over the share of the part that has gone."""
        assert self.temperature is not None
        cold, warm = self.temperature
        return np.asarray(cold + (warm - cold) * np.expm1(-WARM * share) / np.expm1(-WARM))


@dataclass(frozen=True)
class Setting:
    """Parts of a run, each with the same motion."""

    parts: tuple[Part, ...]

    @property
    def words(self) -> str:
        loads = list(dict.fromkeys(p.load for p in self.parts if p.load))
        temperatures = list(dict.fromkeys(p.temperature for p in self.parts if p.temperature))
        said = [_load_words(loads), _temperature_words(temperatures)]
        return ", ".join(s for s in said if s)


def settings(bounds: Bounds) -> list[Setting]:
    """All settings worth trying, the one that visits most first."""
    made = [
        Setting(tuple(Part(a, b) for b, a in product(temperatures, loads)))
        for loads, temperatures in product(_loads(bounds), _temperatures(bounds))
        if len(loads) * len(temperatures) <= MOST_PARTS
    ]
    return list(dict.fromkeys(made))


def _loads(bounds: Bounds) -> list[list[tuple[float, float, int] | None]]:
    if bounds.load is None:
        return [[None]]
    low, high = bounds.load
    least = float(np.clip(0.0, low, high))
    levels = [sorted({low, high}), sorted({low, least, high}), [high], [least], [low],
              sorted({least, max(low, high, key=abs)})]  # fmt: skip
    made: list[list[tuple[float, float, int] | None]] = [[(v, v, 0) for v in row] for row in levels]
    period = np.pi * (high - low) / max(bounds.load_rate, 1e-12)
    often = int(min(bounds.duration / max(period, 1e-3), 1000.0))
    return made + [[(low, high, n)] for n in sorted({often, often // 4, 2}) if 0 < n <= often]


def _temperatures(bounds: Bounds) -> list[list[Range | None]]:
    if bounds.temperature is None:
        return [[None]]
    cold, warm = bounds.temperature
    if warm - cold < LEAST_KELVIN:
        middle = 0.5 * (cold + warm)
        return [[(middle, middle)]]
    made: list[list[Range | None]] = [[(cold, cold), (warm, warm)], [(warm, warm)], [(cold, cold)]]
    rise = min(bounds.warming * bounds.duration, warm - cold)
    return [*made, [(cold, cold + rise)]] if rise >= LEAST_KELVIN else made


def _load_words(loads: Sequence[tuple[float, float, int]]) -> str:
    if not loads:
        return ""
    low, high, times = loads[0]
    if times:
        return f"while the load goes {times} times from {short(low)} to {short(high)} Nm and back"
    if len(loads) == 1:
        return f"at a load of {short(low)} Nm"
    return joined(f"once at {short(load[0])} Nm" for load in loads)


def _temperature_words(temperatures: Sequence[Range]) -> str:
    if not temperatures:
        return ""
    cold, warm = temperatures[0]
    if warm > cold:
        return f"while the joint warms up from {short(cold)} to {short(warm)} °C"
    if len(temperatures) == 1:
        return f"at {short(cold)} °C"
    each = joined(f"once at {short(t[0])} °C" for t in temperatures)
    return f"{each}, each a run of its own"
