"""How far off parameters fitted to a simulation can be.

What a model lacks is the same in every row of a run, so residuals of one run are no news of each
other. Two jackknives count runs (or blocks of few runs) as the news there is: one over m clusters
by a Gauss-Newton step each, one over K folds that are fitted again,

    s² = (m − 1)/m Σ_c d_c²,     d_c = (JᵀJ − J_cᵀJ_c)⁻¹ J_cᵀ e_c
    s² = (K − 1)/K Σ_fold (z_fold − z)²

The first does not see other valleys, the second may get stuck in front of a small hill.
Each parameter has the larger of its two errors, correlations are those of (JᵀJ)⁻¹, and an
interval is z ± t s with Student's t of K − 1 degrees of freedom: it holds what every fold finds,
because t √((K − 1)/K) > 1. All in the coordinates of the search (logarithms of what is positive);
the ends are carried over to the parameter.
Sources: [EfronStein1981]; for clusters [BellMcCaffrey2002] (CR3), [CameronMiller2015].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

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

    `clusters`, `folds`, `naive`: (P,) each, the two that `standard` is the larger of, and that of
    white noise. `degrees`: of freedom. `rows`: that counted.
    """

    standard: Array
    correlation: Array
    determined: NDArray[np.bool_]
    clusters: Array
    folds: Array
    naive: Array
    degrees: int
    rows: int

    @property
    def half_widths(self) -> Array:
        """(P,), of the 95 % intervals."""
        return float(student.ppf(0.975, self.degrees)) * self.standard


def errors_of(cost: Cost, point: Array, folds: Sequence[Array]) -> Errors:
    """Return the errors at the best point; `folds`: where each refit without a fold ended."""
    jacobian, rest = cost.jacobian(point, central=True), cost.residuals(point)
    norms = np.linalg.norm(jacobian, axis=0)
    seen = norms > NEXT_TO_NOTHING * max(float(norms.max()), 1e-300)
    units = np.where(seen, norms, np.inf)
    scaled = jacobian / units
    inverse, blind = _inverse(scaled)
    variances = np.diag(inverse)
    free = max(len(rest) - len(point), 1)
    clusters = _clustered(scaled, rest, _labels(cost)) / units
    moved = np.asarray(folds) - point
    refitted = np.sqrt((len(folds) - 1) / len(folds) * (moved**2).sum(axis=0))
    larger = np.maximum(clusters, refitted)
    loose = larger > np.where([one.logarithmic for one in cost.space.searched], LOOSE, np.inf)
    known = seen & ~blind & ~loose
    root = np.sqrt(np.where(variances > 0.0, variances, 1.0))
    return Errors(
        standard=np.where(known, larger, np.nan),
        correlation=inverse / np.outer(root, root),
        determined=known,
        clusters=clusters,
        folds=refitted,
        naive=np.sqrt(variances * float(rest @ rest) / free) / units,
        degrees=len(folds) - 1,
        rows=len(rest),
    )


def _inverse(scaled: Array) -> tuple[Array, NDArray[np.bool_]]:
    """(JᵀJ)⁻¹ without directions that the runs do not see, and which parameters these move."""
    values, vectors = np.linalg.eigh(scaled.T @ scaled)
    null = values < NEXT_TO_NOTHING * values[-1]
    blind = (np.abs(vectors[:, null]) > MEMBER).any(axis=1)
    return (vectors[:, ~null] / values[~null]) @ vectors[:, ~null].T, blind


def _labels(cost: Cost) -> NDArray[np.intp]:
    """Number of the cluster of each row that counts: its run, or blocks of runs if they are few."""
    each = -(-LEAST_CLUSTERS // len(cost.runs)) if len(cost.runs) < LEAST_CLUSTERS else 1
    labels = [
        (number * each + np.arange(len(count)) * each // len(count))[count]
        for number, count in enumerate(cost.counts)
    ]
    return np.concatenate(labels)


def _clustered(jacobian: Array, rest: Array, labels: NDArray[np.intp]) -> Array:
    """Errors (P,) by leaving out each cluster, one Gauss-Newton step from the best point."""
    whole = jacobian.T @ jacobian
    edges = np.flatnonzero(np.diff(labels, prepend=-1, append=-1))
    squares = np.zeros(len(whole))
    for first, last in pairwise(edges.tolist()):
        own, missed = jacobian[first:last], rest[first:last]
        step = np.linalg.lstsq(whole - own.T @ own, own.T @ missed, rcond=NEXT_TO_NOTHING)[0]
        squares += step**2
    count = len(edges) - 1
    return np.asarray(np.sqrt((count - 1) / count * squares))
