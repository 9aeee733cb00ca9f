"""Fitting effects to logs, and what the data say of the result."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

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


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used (PEP 562)."""
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_HOME[name]}"), name)
