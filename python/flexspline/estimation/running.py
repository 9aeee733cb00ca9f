"""The core's chain over the stretches of a log, each from a fresh state."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexspline import _core
from flexspline.logs.log import Log

__all__ = ["last_good", "run_chain"]

Array = NDArray[np.float64]
Runs = NDArray[np.intp]


def run_chain(
    config: Mapping[str, Any], log: Log, inputs: Mapping[str, Array], ranges: Runs
) -> dict[str, Any]:
    """Return what a chain with these stages gives, (N,) each, by the core's names.

    Parameters
    ----------
    config, inputs : as `_core.Chain` takes them; the time is the log's.
    ranges : (R, 2), first and last row of each stretch without a gap.
    """
    chain = _core.Chain(dict(config))
    pieces = []
    for first, last in ranges:
        rows = slice(int(first), int(last))
        columns = {name: data[rows] for name, data in {"time": log["time"], **inputs}.items()}
        pieces.append(chain.run(columns, int(last - first)))
    return {name: np.concatenate([piece[name] for piece in pieces]) for name in pieces[0]}


def last_good(values: Array, ranges: Runs) -> Array:
    """Return values (N,) with NaN replaced by the last number before it in the same stretch."""
    rows = np.where(np.isfinite(values), np.arange(len(values)), -1)
    rows[ranges[:, 0]] = ranges[:, 0]
    return np.asarray(values[np.maximum.accumulate(rows)])
