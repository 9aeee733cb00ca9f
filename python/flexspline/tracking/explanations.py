"""What explains a change of a parameter other than wear: an angle whose zero moved.

Amplitude A and quadrature Q of gravity are a vector. A mass that changed makes it longer or
shorter; a zero of the encoder that moved, or an axis that was mounted otherwise, turns it and
leaves its length. With (A, Q) before a change and (A', Q') at the last session

    angle = atan2(Q', A') − atan2(Q, A),        length changed by |(A', Q')| − |(A, Q)|

each with the errors of both, to first order.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexspline.effects import CATALOGUE
from flexspline.tracking.attribution import Told, moved
from flexspline.tracking.history import AMPLITUDE, QUADRATURE, TOLD, History

__all__ = ["Turned", "turned_by"]


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
