"""What explains a change of a parameter other than wear: a zero that moved, or another motion.

Amplitude A and quadrature Q of gravity are a vector. A mass that changed makes it longer or
shorter; a zero of the encoder that moved, or an axis that was mounted otherwise, turns it and
leaves its length. With (A, Q) before a change and (A', Q') at the last session

    angle = atan2(Q', A') − atan2(Q, A),        length changed by |(A', Q')| − |(A, Q)|

each with the errors of both, to first order.

A form that the model lacks, such as friction that grows towards standstill, goes into the terms
that it has, by how fast, how far or how loaded the sessions run. So where the range of a channel
changed with a parameter, at the same sessions, that is the likelier cause.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from flexspline.effects import CATALOGUE
from flexspline.effects.causes import PRESLIDING
from flexspline.logs.channels import CHANNELS
from flexspline.part import PART_OF
from flexspline.tracking.attribution import Told, moved
from flexspline.tracking.changes import LEAST_SESSIONS
from flexspline.tracking.history import AMPLITUDE, QUADRATURE, TOLD, WARMTHS, History

__all__ = ["OtherRange", "Turned", "negative", "other_ranges", "turned_by"]

Array = NDArray[np.float64]


WIDER: Final = 0.25
"""Of the wider of two ranges: by how much an end of it moves where sessions run differently."""
FOLLOWS: Final = 0.5
"""Share of the variance of a range's end, over the sessions, that a change explains."""
AT_ONCE: Final = 0.9
"""Of what the best step explains of a range's end: less, and it moved at another date."""


@dataclass(frozen=True)
class OtherRange:
    """A channel whose range changed with a parameter: (low, high) of sessions before and since."""

    channel: str
    unit: str
    before: tuple[float, float]
    since: tuple[float, float]

    @property
    def old(self) -> str:
        """What the sessions covered before."""
        return self._words(self.before)

    @property
    def new(self) -> str:
        """What they cover since."""
        return self._words(self.since)

    def _words(self, ends: tuple[float, float]) -> str:
        return f"{ends[0]:.3g} to {ends[1]:.3g} {self.unit}"


@dataclass(frozen=True)
class Turned:
    """By how much the direction of gravity turned, in degrees, with its standard error."""

    degrees: float
    error: float


def turned_by(history: History, change: Told) -> Turned | None:
    """Return by how much gravity turned with a change; None where its length is not known to stay.

    Parameters
    ----------
    history : with amplitude and quadrature, see `History.turned`.
    """
    effect, _, term = history.names[change.parameters[0]].partition(".")
    info = CATALOGUE.get(effect)
    names = [f"{effect}.{word}" for word in (AMPLITUDE, QUADRATURE)]
    if info is None or not info.carries_load or len(change.causes) > 1:
        return None
    if f"{effect}.{term}" not in names or not set(names) <= set(history.names):
        return None
    both = [moved(history, history.names.index(n), change.shape, change.others) for n in names]
    if not all(np.isfinite(each.error) for each in both):
        return None
    course = float(change.shape.of(history.days[-1:])[0])
    before = complex(*(each.level for each in both))
    after = before + course * complex(*(each.size for each in both))
    angle, length = float(np.angle(after / before)), abs(after) - abs(before)

    def error_of(at_first: complex, at_last: complex) -> float:
        """Of a number with these slopes over amplitude and quadrature."""
        slopes = [(at_last - at_first), course * at_last]
        parts = (np.array([s.real for s in slopes]), np.array([s.imag for s in slopes]))
        squares = [g @ each.covariance @ g for g, each in zip(parts, both, strict=True)]
        return float(np.sqrt(sum(squares)))

    length_error = error_of(before / abs(before), after / abs(after))
    error = error_of(1j * before / abs(before) ** 2, 1j * after / abs(after) ** 2)
    least = max(error, length_error / abs(after))  # a mass as large could hide in the latter
    if abs(length) > TOLD * length_error or abs(angle) < TOLD * least:
        return None
    return Turned(float(np.degrees(angle)), float(np.degrees(error)))


def other_ranges(history: History, change: Told, turned: bool) -> tuple[OtherRange, ...]:
    """Return the channels whose ranges changed where a parameter did, those that did most first.

    Temperature is none of them: it is accounted for. An angle whose zero moved (`turned`) has
    another range by that, and so has the load of a joint that carries another one.
    """
    info = CATALOGUE.get(change.causes[0].partition(".")[0].partition(",")[0])
    carries = info is not None and info.carries_load
    found = []
    for channel, ends in history.ranges.items():
        unit = CHANNELS[channel].unit if channel in CHANNELS else "Nm"
        if channel in WARMTHS or (turned and unit == "rad") or (carries and unit == "Nm"):
            continue
        each = _other_range(history, change, ends)
        if each is not None:
            share, before, since = each
            found.append((share, OtherRange(channel, unit, before, since)))
    return tuple(each for _, each in sorted(found, key=lambda pair: -pair[0]))


def _other_range(
    history: History, change: Told, ends: Array
) -> tuple[float, tuple[float, float], tuple[float, float]] | None:
    """By which share of a range it changed with a change, and what it was before and is since."""
    known = np.isfinite(ends).all(axis=1)
    days, ends = history.days[known], ends[known]
    course = change.shape.of(days)
    if len(days) < LEAST_SESSIONS or not np.ptp(course):
        return None
    half = 0.5 * course[-1]
    before, since = (np.median(ends[rows], axis=0) for rows in (course < half, course >= half))
    width = max(float(np.ptp(before)), float(np.ptp(since)))
    moves = np.abs(since - before)
    end = int(np.argmax(moves))
    if not moves[end] > WIDER * width:
        return None
    steps = [(days >= day).astype(np.float64) for day in np.unique(days)[1:]]
    best = max(_explained(step, ends[:, end]) for step in steps)
    if _explained(course, ends[:, end]) < max(FOLLOWS, AT_ONCE * best):
        return None
    low, high = before.tolist(), since.tolist()
    return float(moves[end]) / width, (low[0], low[1]), (high[0], high[1])


def _explained(course: Array, values: Array) -> float:
    """Share of the variance of values (S,) that a course (S,) explains."""
    both = np.array([course - course.mean(), values - values.mean()])
    size = float(np.prod(np.linalg.norm(both, axis=1)))
    return float(both[0] @ both[1] / size) ** 2 if size > 0.0 else 0.0


def negative(history: History, name: str, level: tuple[float, float]) -> str:
    """Return what a level below zero would be that no drive has, friction or inertia, or "".

    Beside presliding the level of Coulomb friction is a share, and has no sign.
    """
    effect = name.partition(".")[0]
    info = CATALOGUE.get(effect)
    if info is None or not info.traits.one_signed or len(info.terms) != 1:
        return ""
    if PART_OF.get(history.target) != "drive" or level[0] + TOLD * level[1] >= 0.0:
        return ""
    names = {each.partition(".")[0] for each in history.names}
    return "" if PRESLIDING in names else effect.rpartition("_")[2]
