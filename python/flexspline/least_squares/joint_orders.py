"""Low orders of the output, chosen together with all else that a model has.

Over part of a turn waves of the output are not orthogonal to each other, nor to offset and gravity:
these take most of order 2, and what they leave of it looks like order 4 or 5. So no order is read
off a residual there. All candidates are fitted beside the model at once; with the columns X of the
candidates projected on what the model's own leave, G = XᵀX and g = Xᵀy, a set S of orders takes

    g_Sᵀ G_SS⁻¹ g_S - c s² |S|

off the squares, less what it has to: c the significance threshold of one order, s² the long-run
variance of the noise beside all candidates. The set that takes most is the best subset: all sets of
few orders are compared, more are added one at a time. Of sets of as many orders that the data do
not tell from the best, that of the lowest orders is taken.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from flexspline.least_squares.estimate import Estimate, noise_of

__all__ = ["best_orders"]

Array = NDArray[np.float64]

COMPARED = 4  # orders of the largest sets that are all compared
DEPENDENT = 1e-9  # share of a column's squares, below which others explain it


def best_orders(
    made: Estimate, pairs: Sequence[tuple[int, int]], orders: Sequence[int], costs: float,
    same: float,
) -> tuple[int, ...]:  # fmt: skip
    """Return the orders that best explain, beside the rest of a model, what was measured.

    Parameters
    ----------
    made : an estimate with all candidates, which it was not pruned of.
    pairs : columns of cosine and sine among the fitted ones, of each candidate.
    orders : periods per turn, of each candidate.
    costs : χ² that an order has to take off.
    same : χ² by which sets may differ and be indistinguishable.
    """
    gram, moment, variance = _beside(made, np.array(pairs).ravel())

    def gain(chosen: tuple[int, ...]) -> float:
        at = np.array([[2 * k, 2 * k + 1] for k in chosen], dtype=np.intp).ravel()
        inverse = np.linalg.pinv(gram[np.ix_(at, at)], rcond=DEPENDENT, hermitian=True)
        return float(moment[at] @ inverse @ moment[at]) / variance - costs * len(chosen)

    gains = {chosen: gain(chosen) for chosen in _sets(len(orders))}
    best = max(gains, key=lambda chosen: gains[chosen])
    alike = [c for c in gains if len(c) == len(best) and gains[c] > gains[best] - same]
    lowest = min(alike, key=lambda chosen: sum(orders[k] for k in chosen))
    while len(lowest) >= COMPARED:
        more = [(*lowest, k) for k in range(len(orders)) if k not in lowest]
        further = max(more, key=gain, default=lowest)
        if gain(further) <= gain(lowest):
            break
        lowest = further
    return tuple(sorted(orders[k] for k in lowest))


def _sets(count: int) -> Iterator[tuple[int, ...]]:
    for size in range(min(COMPARED, count) + 1):
        yield from combinations(range(count), size)


def _beside(made: Estimate, at: NDArray[np.intp]) -> tuple[Array, Array, float]:
    """XᵀX (K, K) and Xᵀy (K,) of columns beside all others, and the variance of the noise."""
    width = made.basis.shape[0]
    gram, pull = np.zeros((width, width)), np.zeros(width)
    for chunk in made.tangent():
        rows = chunk.rows
        gram += rows.T @ rows
        pull += rows.T @ chunk.residual
    solution = np.zeros(width)
    solution[: len(made.fitted)] = made.linear.coefficients[made.fitted]
    moment = gram @ solution + pull  # of the target, linear around the shapes found
    scale = np.sqrt(np.diag(gram))
    scale = np.where(scale > 0.0, scale, 1.0)
    gram, moment = gram / np.outer(scale, scale), moment / scale
    others = np.setdiff1d(np.arange(width), at)
    shared = gram[np.ix_(at, others)] @ np.linalg.pinv(
        gram[np.ix_(others, others)], rcond=DEPENDENT, hermitian=True
    )
    noise = noise_of(made)
    variance = noise.long_run_variance * noise.decimation
    inner = gram[np.ix_(at, at)] - shared @ gram[np.ix_(others, at)]
    return inner, moment[at] - shared @ moment[others], max(variance, np.finfo(float).tiny)
