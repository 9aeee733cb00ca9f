"""How far off parameters fitted to a simulation can be.

What a model lacks is the same in every row of a run, so residuals of one run are no news of each
other. Two estimates of the covariance count runs (or blocks of few runs) as the news there is:

    sandwich over clusters c:   A⁻¹ (m/(m − 1) Σ_c g_c g_cᵀ) A⁻¹,   A = JᵀJ,  g_c = J_cᵀ e_c
    jackknife over K folds:     s_k² = (K − 1)/K Σ_fold (z_fold − z)²

Each parameter has the larger of its two errors, correlations are those of A⁻¹, and an interval is
z ± t s with Student's t of K − 1 degrees of freedom: it holds what every fold finds, because
t √((K − 1)/K) > 1. All in the coordinates of the search (logarithms of what is positive), ends
carried over to the parameter.
Sources: White 1982 and Liang & Zeger 1986 (sandwich); Efron & Stein 1981 (jackknife).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from flexspline.output_error.cost import Cost

__all__ = ["Errors", "errors_of"]

Array = NDArray[np.float64]

LEAST_CLUSTERS = 8
NEXT_TO_NOTHING = 1e-8  # of an eigenvalue of the scaled JᵀJ: the runs do not see this direction
LOOSE = 1.0  # error of a logarithm from which the number is not determined
MEMBER = 0.1  # share of such a direction from which a parameter is not determined


@dataclass(frozen=True)
class Errors:
    """Of P searched coordinates: standard errors (P,), correlations (P, P), which are determined.

    `sandwich`, `jackknife`, `naive`: (P,) each, the two that `standard` is the larger of, and that
    of white noise. `degrees`: of freedom. `rows`: that counted.
    """

    standard: Array
    correlation: Array
    determined: NDArray[np.bool_]
    sandwich: Array
    jackknife: Array
    naive: Array
    degrees: int
    rows: int

    @property
    def half_widths(self) -> Array:
        """(P,), of the 95 % intervals."""
        return float(student.ppf(0.975, self.degrees)) * self.standard


def errors_of(cost: Cost, point: Array, folds: Sequence[Array]) -> Errors:
    """Return the errors at the best point; `folds`: where each refit without a fold ended."""
    jacobian, rest = cost.jacobian(point), cost.residuals(point)
    scale = np.linalg.norm(jacobian, axis=0)
    seen = scale > NEXT_TO_NOTHING * max(float(scale.max()), 1e-300)
    scaled = jacobian / np.where(seen, scale, 1.0)
    values, vectors = np.linalg.eigh(scaled.T @ scaled)
    null = values < NEXT_TO_NOTHING * values[-1]
    blind = (np.abs(vectors[:, null]) > MEMBER).any(axis=1) | ~seen
    inverse = (vectors[:, ~null] / values[~null]) @ vectors[:, ~null].T
    units = np.where(seen, scale, np.inf)
    free = max(len(rest) - len(point), 1)
    naive = np.sqrt(np.diag(inverse) * float(rest @ rest) / free) / units
    scores = _scores(scaled, rest, _clusters(cost))
    middle = inverse @ (scores.T @ scores) @ inverse * len(scores) / (len(scores) - 1)
    sandwich = np.sqrt(np.diag(middle)) / units
    moved = np.asarray(folds) - point
    jackknife = np.sqrt((len(folds) - 1) / len(folds) * (moved**2).sum(axis=0))
    root = np.sqrt(np.where(np.diag(inverse) > 0.0, np.diag(inverse), 1.0))
    larger = np.maximum(sandwich, jackknife)
    blind |= larger > np.where([one.logarithmic for one in cost.space.searched], LOOSE, np.inf)
    standard = np.where(blind, np.nan, larger)
    return Errors(standard, inverse / np.outer(root, root), ~blind, sandwich, jackknife, naive,
                  len(folds) - 1, len(rest))  # fmt: skip


def _clusters(cost: Cost) -> NDArray[np.intp]:
    """Number of the cluster of each row that counts: its run, or blocks of runs if they are few."""
    each = -(-LEAST_CLUSTERS // len(cost.runs)) if len(cost.runs) < LEAST_CLUSTERS else 1
    labels = [
        (number * each + np.arange(len(count)) * each // len(count))[count]
        for number, count in enumerate(cost.counts)
    ]
    return np.concatenate(labels)


def _scores(jacobian: Array, rest: Array, clusters: NDArray[np.intp]) -> Array:
    """g_c of each cluster, (m, P)."""
    each = jacobian * rest[:, None]
    starts = np.flatnonzero(np.diff(clusters, prepend=-1))
    return np.add.reduceat(each, starts, axis=0)
