"""What each effect contributes; effects that cannot be told apart only as their sum."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from flexspline.logs.derive import lowpass

if TYPE_CHECKING:
    from flexspline.least_squares.result import Fit, FittedRun

__all__ = ["contributions", "shares"]

Array = NDArray[np.float64]


def contributions(fit: Fit, run: FittedRun) -> dict[str, Array]:
    """Return the contribution (N,) of each effect of a fit to a run, in the target's unit.

    Effects that share a confounded group are summed and called "a + b", since only that is known.
    The low pass of the fit is applied.
    """
    parts = fit.model.components(run.log, fit.target)
    time = run.log["time"]
    found = {}
    for group in _groups(fit, list(parts)):
        total = np.sum([parts[name] for name in group], axis=0)
        smooth = total if fit.lowpass is None else lowpass(total, time, fit.lowpass).values
        found[" + ".join(group)] = smooth
    return found


def shares(fit: Fit) -> dict[str, float]:
    """Return the RMS contribution of each effect over all rows, in the unit of the target."""
    squares: dict[str, float] = {}
    count = sum(int(run.counts.sum()) for run in fit.runs)
    for run in fit.runs:
        for name, values in contributions(fit, run).items():
            squares[name] = squares.get(name, 0.0) + float(np.nansum(values[run.counts] ** 2))
    return {name: float(np.sqrt(total / count)) for name, total in squares.items()}


def _groups(fit: Fit, effects: list[str]) -> list[list[str]]:
    """Effects in their order, joined where a confounded group holds coefficients of several."""
    groups = [[name] for name in effects]
    for confounded in fit.confounded:
        tied = {name.split(".")[0] for name in confounded.names}
        joined = [name for group in groups if tied & set(group) for name in group]
        at = next((k for k, group in enumerate(groups) if tied & set(group)), 0)
        rest = [group for group in groups if not tied & set(group)]
        groups = [*rest[:at], joined, *rest[at:]] if joined else rest
    return groups
