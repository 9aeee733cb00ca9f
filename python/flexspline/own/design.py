"""The one door to rows of effects: the core's for the catalogue's, a function's for one's own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from flexspline import _core
from flexspline.effects import Effect
from flexspline.own.effect import OwnEffect

__all__ = ["Design", "Mixed", "core_design", "design_of", "is_own"]

Array = NDArray[np.float64]


class Mixed:
    """Effects of the catalogue and of the user's own, with the methods of the core's design.

    Own effects read channels alone and carry no load, so that the rows of the others are those of
    a design without them.
    """

    def __init__(self, effects: Sequence[Effect], gear: Mapping[str, Any]) -> None:
        self._core = core_design([e for e in effects if not e.own], gear)
        self._own: list[tuple[OwnEffect, slice]] = []
        own, first = is_own(effects), 0
        self._of_core = np.flatnonzero(~own)
        self._of_own = np.flatnonzero(own)
        self.columns = len(own)
        for effect in effects:
            last = first + len(effect.terms)
            if isinstance(effect, OwnEffect):
                self._own.append((effect, slice(first, last)))
            first = last

    def rows(self, channels: dict[str, Array], size: int, coefficients: Array) -> Array:
        """Design matrix, shape (size, columns)."""
        made = np.empty((size, self.columns), order="F")
        made[:, self._of_core] = self._core.rows(channels, size, self._core_of(coefficients))
        for effect, at in self._own:
            made[:, at] = effect.columns(channels, size)
        return made

    def predict(self, channels: dict[str, Array], size: int, coefficients: Array) -> Array:
        """Rows times coefficients, shape (size,)."""
        values = np.array(self._core.predict(channels, size, self._core_of(coefficients)))
        for effect, at in self._own:
            values += effect.columns(channels, size) @ coefficients[at]
        return values

    def settled(
        self, channels: dict[str, Array], size: int, coefficients: Array
    ) -> NDArray[np.bool_]:
        """Rows that no longer depend on what an effect remembered before its run, (size,)."""
        made = self._core.settled(channels, size, self._core_of(coefficients))
        return np.asarray(made)

    def accumulate(
        self,
        channels: dict[str, Array],
        target: Array,
        blocks: Sequence[tuple[int, int]],
        coefficients: Array,
        held: Array,
        weights: Array | None,
        double_double: bool,
        structured: bool,
        threads: int,
    ) -> tuple[Array, Array]:
        """Sums of products of [rows, target] of each block: (high, low)."""
        rows = self.rows(channels, len(target), coefficients)
        left = target - rows @ held if held.size else target
        if weights is not None and double_double:
            root = np.sqrt(weights)
            rows, left, weights = rows * root[:, None], left * root, None
        return _core.accumulate_rows(rows, left, blocks, weights, double_double, threads)

    def _core_of(self, coefficients: Array) -> Array:
        return coefficients[self._of_core] if coefficients.size else coefficients


Design: TypeAlias = _core.Design | Mixed


def design_of(effects: Sequence[Effect], gear: Mapping[str, Any]) -> Design:
    """Return what makes the rows of effects.

    Parameters
    ----------
    gear : as `_core.Design` takes it: effective ratio, output spline, whether the motor's angle is
        measured.
    """
    own = any(effect.own for effect in effects)
    return Mixed(effects, gear) if own else core_design(effects, gear)


def core_design(effects: Sequence[Effect], gear: Mapping[str, Any]) -> _core.Design:
    """Return the design of effects of the catalogue, as `design_of` does."""
    return _core.Design([effect.for_core() for effect in effects], **gear)


def is_own(effects: Sequence[Effect]) -> NDArray[np.bool_]:
    """Return for each column of effects whether it is one of an own effect, (P,)."""
    return np.array([effect.own for effect in effects for _ in effect.terms], dtype=bool)
