"""Fitting effects to logs, and what the data say of the result."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flexspline.lazy import attached

if TYPE_CHECKING:
    from flexspline.least_squares.identifiability import Combination, Confounded
    from flexspline.least_squares.result import Fit, FittedRun, Parameter
    from flexspline.least_squares.sums import Solution, Sums, accumulate
    from flexspline.least_squares.validation import Score

__all__ = [
    "Combination",
    "Confounded",
    "Fit",
    "FittedRun",
    "Parameter",
    "Score",
    "Solution",
    "Sums",
    "accumulate",
]

_HOME = {
    "Combination": "identifiability",
    "Confounded": "identifiability",
    "Fit": "result",
    "FittedRun": "result",
    "Parameter": "result",
    "Score": "validation",
    "Solution": "sums",
    "Sums": "sums",
    "accumulate": "sums",
}

__getattr__ = attached(__name__, _HOME)
