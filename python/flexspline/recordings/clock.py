"""The time of each row: a column and its unit, or the rate at which rows follow each other."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from flexspline.recordings.columns import Column
from flexspline.recordings.physics import step_of

__all__ = ["SECONDS", "Clock", "clock_of", "nice"]

SECONDS: Final = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "day": 86_400.0}

USUAL: Final = (20.0, 20_000.0)
"""Hz at which joints are recorded: where a file does not state the unit of its time, the one under
which its rate lies here. Three decades, as far as the units are apart."""

SURE: Final = (50.0, 5000.0)  # Hz, inside of which another unit would be out of the usual
EPOCH: Final = (1.2e9, 2.5e9)  # seconds since 1970: of the years 2008 to 2049
ROUND: Final = 0.005  # by how much its rate may be off a round one
EVEN: Final = 0.25  # of the median step: what an unnamed clock may be off, mostly
EXCEL: Final = (36_000.0, 60_000.0)  # days since 1900: of the years 1998 to 2064


@dataclass(frozen=True)
class Clock:
    """A column of time stamps with its unit, or a rate [Hz]; how it is known, and how surely."""

    column: Column | None = None
    unit: str | None = None
    rate: float | None = None
    reason: str = ""
    unsure: str = ""

    @property
    def step(self) -> float:
        """Seconds from row to row, or NaN where they are not known."""
        if self.rate is not None:
            return 1.0 / self.rate
        if self.column is None or self.column.values is None:
            return math.nan
        seconds = 1.0 if self.column.stamps else SECONDS[self.unit or "s"]
        return step_of(self.column.values) * seconds


def clock_of(columns: Sequence[Column], preamble: Sequence[str]) -> Clock:
    """Return the clock of a recording, from its columns or from what its preamble says."""
    forward = [c for c in columns if c.values is not None and step_of(c.values) > 0]
    named = [c for c in forward if c.says.quantity == "time" and c.says.role != "other"]
    stamped = [c for c in forward if c.stamps]
    step = _step_said(preamble)
    sure = [c for c in named if c.says.unit in SECONDS and not c.stamps]
    likeliest = next(iter((*sure, *stamped, *named)), None)
    if likeliest is not None:
        return _of_column(likeliest, step)
    if step is not None:
        return Clock(rate=1.0 / step, reason=f"the preamble says {1.0 / step:g} Hz")
    unnamed = [c for c in forward if c.says.quantity is None and _even(c)]
    if unnamed and unnamed[0].number <= 1:
        found = _of_column(unnamed[0], None)
        if nice(1.0 / found.step, ROUND) is None:
            return Clock()
        return replace(found, unsure=found.unsure or "its name says no time, but it grows evenly")
    return Clock()


def _even(column: Column) -> bool:
    assert column.values is not None
    step = step_of(column.values)
    return bool(np.mean(np.abs(np.diff(column.values) / step - 1.0) < EVEN) > 0.8)


def _of_column(column: Column, step: float | None) -> Clock:
    assert column.values is not None
    if back := int(np.sum(np.diff(column.values) < 0)):
        return replace(_forward(column, step), unsure=f"it goes back {back} times: it may wrap")
    return _forward(column, step)


def _forward(column: Column, step: float | None) -> Clock:
    assert column.values is not None
    if column.stamps:
        return Clock(column, None, reason="dates and times of day, counted from the first")
    if column.says.unit in SECONDS:
        return Clock(column, column.says.unit, reason="its unit is stated")
    own, first = step_of(column.values), abs(float(column.values[0]))
    if step is not None:
        unit = min(SECONDS, key=lambda name: abs(math.log(SECONDS[name] * own / step)))
        return Clock(column, unit, reason=f"the preamble says {1.0 / step:g} Hz")
    for unit in ("s", "ms", "us", "ns"):
        if EPOCH[0] < first * SECONDS[unit] < EPOCH[1]:
            return Clock(column, unit, reason=f"{unit} since 1970")
    if EXCEL[0] < first < EXCEL[1] and own < 1e-4:
        return Clock(column, "day", reason="days of a spreadsheet")
    usual = [u for u in ("s", "ms", "us", "ns") if USUAL[0] <= 1 / (own * SECONDS[u]) < USUAL[1]]
    unit = usual[0] if usual else "s"
    rate = 1.0 / (own * SECONDS[unit])
    unsure = (
        "" if SURE[0] <= rate <= SURE[1] else f"no unit is stated; in {unit} it is {rate:.4g} Hz"
    )
    return Clock(column, unit, reason=f"steps of {own:.6g}: in {unit} {rate:.4g} Hz", unsure=unsure)


NUMBER: Final = r"([-+]?\d+(?:[.,]\d+)?(?:[eE][-+]?\d+)?)"
STEP: Final = re.compile(
    r"(?:sampl\w*|cycle|abtast\w*|tast\w*|scan|time|delta)[\s_-]*"
    r"(?:time|period|intervall?|zeit|periode|step|x|schritt|increment|resolution)"
    rf"[\s\[(:;=,\t_]*(µs|us|ms|s|sec|ns)?[\s\])\"':;=,\t]*{NUMBER}\s*(µs|us|ms|ns|s\b)?",
    re.IGNORECASE,
)
RATE: Final = re.compile(
    r"(?:(?:sampl\w*|abtast\w*|scan|mess|record\w*|data)[\s_-]*)?(?:rate|frequen[cz]y?|freq)\b"
    rf"[\s\[(:;=,\t_]*(k?hz|s/s)?[\s\])\"':;=,\t]*{NUMBER}\s*(k?hz|s/s|1/s)?",
    re.IGNORECASE,
)


def _step_said(preamble: Sequence[str]) -> float | None:
    """Return the seconds from row to row that lines above the table state."""
    for line in preamble:
        if found := STEP.search(line):
            unit = (found[1] or found[3] or "s").lower().replace("µ", "u").replace("sec", "s")
            value = _number(found[2]) * SECONDS.get(unit, 1.0)
        elif found := RATE.search(line):
            kilo = 1000.0 if (found[1] or found[3] or "").lower().startswith("k") else 1.0
            value = 1.0 / (kilo * _number(found[2])) if _number(found[2]) > 0 else 0.0
        else:
            continue
        if 1.0 / USUAL[1] / 10 < value < 10.0 / USUAL[0]:
            return value
    return None


def _number(text: str) -> float:
    return float(text.replace(",", "."))


def nice(rate: float, within: float = 0.02) -> float | None:
    """Return the round rate [Hz] nearest to one that was measured, or None where none is near."""
    rounds = [m * 10.0**e for e in range(1, 5) for m in (1, 1.2, 1.25, 2, 2.4, 2.5, 3, 4, 5, 6, 8)]
    near = min(rounds, key=lambda each: abs(math.log(each / rate))) if rate > 0 else 0.0
    return near if near and abs(near / rate - 1) < within else None
