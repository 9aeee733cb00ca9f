"""Where the recorded runs fit worse, planned ones will too: noise by speed.

Around reversals a model of friction is least exact, and the residual there is not small noise. The
innovation variance of each band of speed, over that of all rows where it is larger, is what a row
at that speed is worth less.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexspline.least_squares.problem import Problem
from flexspline.logs.log import Log
from flexspline.regression.gram import Whitening
from flexspline.regression.working import Working

__all__ = ["Trust", "trust_of"]

Array = NDArray[np.float64]

SHARES = (0.02, 0.05, 0.1, 0.2, 0.4, 0.7)  # of all rows, that are slower than a band's end


@dataclass(frozen=True, eq=False)
class Trust:
    """`edges` (K,) between bands of speed [rad/s], `excess` (K + 1,) of their variance, ≥ 1."""

    edges: Array
    excess: Array

    def weights(self, log: Log, rows: NDArray[np.intp]) -> Array:
        """What rows (N,) of a log are multiplied with, at most 1."""
        return np.asarray(
            1.0 / np.sqrt(self.excess[np.searchsorted(self.edges, _speed(log)[rows])])
        )


def trust_of(problem: Problem, work: Working, whitening: Whitening) -> Trust:
    """Compare what a model leaves at each speed with what it leaves overall."""
    squares, speeds = [], []
    for number, run in enumerate(problem.runs):
        left = run.target - work.predict(problem, number)
        values, rows = whitening(left[:, None], run)
        squares.append(values[:, 0] ** 2 / whitening.variance)
        speeds.append(_speed(run.log)[rows])
    square, speed = np.concatenate(squares), np.concatenate(speeds)
    edges = np.unique(np.quantile(speed, SHARES))
    band = np.searchsorted(edges, speed)
    count = np.maximum(np.bincount(band, minlength=len(edges) + 1), 1)
    mean = np.bincount(band, weights=square, minlength=len(edges) + 1) / count
    return Trust(edges, np.maximum(mean, 1.0))


def _speed(log: Log) -> Array:
    """(N,) [rad/s], 0 where nothing is known of it."""
    return np.abs(log["output_velocity"]) if "output_velocity" in log else np.zeros(len(log))
