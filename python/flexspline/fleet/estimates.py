"""Estimates and errors from sums of blocks, of one run or of a joint's runs together.

Least squares of the rows of all blocks b with products A_b = X_bᵀX_b and c_b = X_bᵀy_b,

    β = (Σ A_b)⁻¹ Σ c_b,     s_b = c_b − A_b β      (the score of a block)

have errors from how far the scores scatter, whatever the noise within a block is (cluster-robust
[LiangZeger1986]), and where it goes on into the next blocks of the run, with Bartlett's weights
[NeweyWest1987]:

    cov β = A⁻¹ H A⁻¹,   H = Σ_b s_b s_bᵀ + Σ_j w_j Σ_b (s_b s_{b+j}ᵀ + s_{b+j} s_bᵀ)
    w_j = 1 − j/(L+1),   j = 1 … L

A fit makes scores smaller than the noise's are, the more a block tells of a parameter; each is
divided by that (CR2 [BellMcCaffrey2002]; in coordinates γ in which A is the unit matrix),

    s_b → (I − A_b)^(−1/2) s_b

What one block alone tells, as of a single reversal, it fits without a rest: there the scatter of
other scores stands in, with σ² of a row and m ≥ 1, how many rows go together, of the directions
that many blocks tell,

    H → H + σ² m Σ_b A_b²

which adds 1/B to what B blocks tell alike. Intervals are Student's with ν degrees of freedom, by
how evenly a parameter's information is spread over the blocks ([Satterthwaite1946]; lags make
neighbours one):

    ν_k = (Σ_b a_b)² / (Σ_b a_b² (1 + 2 Σ_j w_j²)),     a_b = (A_b)_kk of the parameter's direction

L is one, and more where the scores' own correlation asks for it [Andrews1991]; what Bartlett's
weights miss of it is made up for.

In `tests/bench/fleet.py coverage` 95 % intervals cover 92 to 98 % where the noise's memory is a
sixtieth of the run or less, and more than 90 % up to a thirtieth. In 30 s of noise with a memory of
2 s that of an offset covers 83 %: so slow a noise is not known from so short a run.

Where runs do not determine a parameter, β is the solution of least norm and the errors are those of
what they determine: `basis` spans it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import InputError
from flexspline.fleet.accumulators import RunSums, merged
from flexspline.least_squares.sums import solve
from flexspline.least_squares.uncertainty import half_widths

__all__ = ["Scored", "estimate_of", "squares_of"]

Array = NDArray[np.float64]

LEAST_BLOCKS = 4
"""More than parameters: fewer scores than that tell no error."""
STIFFEST = 0.05
"""Least eigenvalue of I − A_b: a block that alone tells of a direction has no score of it."""
STEEPEST = 0.8
"""Of the scores from block to block: noise that is slower than that is not known in a run."""
BLOCKS_A_LAG = 8
TINY = float(np.finfo(float).tiny)
UNTOLD = 1e-5
"""Of the size of columns: what a direction makes of them less than that no instrument tells. Half
and twice of it are the same for all runs seen."""
HIDDEN = 1e-6
"""Share of a parameter that the determined directions leave, from which it is not determined."""


@dataclass(frozen=True, eq=False)
class Scored:
    """An estimate from sums of blocks.

    Parameters
    ----------
    values : (P,).
    covariance : (P, P), of the part that is determined.
    basis : (P, R), directions that the runs determine, basisᵀ A basis = I.
    reading : (R, P), γ = reading β of any β.
    core : (R, R), covariance of γ.
    degrees_of_freedom : (P,).
    determined : (P,), parameters that the runs tell by themselves.
    rows, rmse : of the fit, the target's unit.
    gram : (P, P), A.
    blocks : how many.
    """

    values: Array
    covariance: Array
    basis: Array
    reading: Array
    core: Array
    degrees_of_freedom: Array
    determined: NDArray[np.bool_]
    rows: int
    rmse: float
    gram: Array = field(repr=False)
    blocks: int

    @property
    def errors(self) -> Array:
        """Standard errors (P,); NaN where a parameter is not determined."""
        variances = np.maximum(np.diag(self.covariance), 0.0)
        return np.where(self.determined, np.sqrt(variances), np.nan)

    def intervals(self, level: float = 0.95) -> Array:
        """(P, 2), ends of the confidence intervals; NaN where they are not known."""
        half = half_widths(self.errors, self.degrees_of_freedom, level)
        return np.column_stack([self.values - half, self.values + half])


def estimate_of(runs: Sequence[RunSums], between: Array | None = None) -> Scored:
    """Return the estimate of runs together.

    Parameters
    ----------
    runs : of one joint, one or several.
    between : (P,), variances of what parameters differ by from run to run, or None: each run then
        moves the estimate by its share A⁻¹ A_r w_r.

    Raises
    ------
    InputError
        Where there are too few blocks to tell an error.
    """
    ordered = sorted(runs, key=lambda run: run.run)
    high, low = merged(ordered)
    gram, rows = (high + low)[:-1, :-1], sum(run.rows for run in ordered)
    values, basis = _determined(high, low)
    reading = basis.T @ gram
    shared = [run.shared()[2] for run in ordered]
    count, width = sum(map(len, shared)), basis.shape[1] + sum(len(run.own) for run in ordered)
    if count < width + LEAST_BLOCKS:
        raise InputError(
            f"{ordered[0].label}: {count} blocks of rows are too few for the errors of {width} "
            "parameters; record longer, or leave effects out"
        )
    squares = _squares(high, low, values)
    told = [np.einsum("ki,bkl,lj->bij", basis, blocks[:, :-1, :-1], basis, optimize=True)
            for blocks in shared]  # fmt: skip
    scores = [_scores(blocks, values) @ basis for blocks in shared]
    core, lagged = _core_of(scores, told, squares / max(rows - width, 1))
    if between is not None:
        for blocks in shared:
            moved = basis.T @ blocks[:, :-1, :-1].sum(axis=0)
            core += (moved * between) @ moved.T
    hidden = 1.0 - np.einsum("pr,rp->p", basis, reading) > HIDDEN
    return Scored(
        values,
        basis @ core @ basis.T,
        basis,
        reading,
        core,
        _freedom(np.concatenate(told), basis, lagged),
        ~hidden,
        rows,
        float(np.sqrt(squares / rows)),
        gram,
        count,
    )


def _determined(high: Array, low: Array) -> tuple[Array, Array]:
    """Values (P,) of least norm in the directions that the rows tell, and these (P, R)."""
    solution = solve(high, low)
    scaled = solution.factor / solution.lengths
    _, sizes, right = np.linalg.svd(scaled, full_matrices=False)
    seen = sizes > UNTOLD * max(float(sizes.max(initial=0.0)), 1.0)
    basis = right[seen].T / sizes[seen] / solution.lengths[:, None]
    along = right[seen] @ (solution.coefficients * solution.lengths)
    return (right[seen].T @ along) / solution.lengths, basis


def _core_of(
    scores: Sequence[Array], told: Sequence[Array], variance: float
) -> tuple[Array, float]:
    """H in coordinates in which A is the unit matrix, and 1 + 2 Σ w² of its lags.

    Parameters
    ----------
    scores : (B, R) of each run; `told` : (B, R, R), A_b.
    variance : of the residual at a row.
    """
    sharpened = [_sharpened(part, own) for part, own in zip(told, scores, strict=True)]
    lags, widen = _going_on(sharpened)
    core = sum((_long_run(part, lags) for part in sharpened), np.zeros((told[0].shape[1],) * 2))
    core = widen[:, None] * core * widen
    alone = sum((np.einsum("bij,bjk->ik", part, part) for part in told), np.zeros(core.shape))
    spread = np.clip(1.0 - np.diag(alone), 0.0, 1.0)
    memory = float(spread @ np.diag(core)) / max(variance * float(spread.sum()), TINY)
    core = core + variance * max(memory, 1.0) * alone
    weights = 1.0 - np.arange(1, lags + 1) / (lags + 1.0)
    return core, 1.0 + 2.0 * float(weights @ weights)


def _squares(high: Array, low: Array, values: Array) -> float:
    turned = np.append(-values, 1.0)
    return max(float(turned @ high @ turned + turned @ low @ turned), 0.0)


def squares_of(run: RunSums, values: Array) -> float:
    """Return the squares that values (P,) leave of a run, its own terms fitted beside them."""
    high, low, _ = run.shared()
    return _squares(high, low, values)


def _scores(blocks: Array, values: Array) -> Array:
    """(B, P)."""
    return np.asarray(blocks[:, :-1, -1] - blocks[:, :-1, :-1] @ values)


def _sharpened(part: Array, scores: Array) -> Array:
    """Scores (B, R) over (I − A_b)^½."""
    values, vectors = np.linalg.eigh(np.eye(part.shape[1]) - part)
    root = 1.0 / np.sqrt(np.maximum(values, STIFFEST))
    along = np.einsum("bij,bi->bj", vectors, scores) * root
    return np.asarray(np.einsum("bij,bj->bi", vectors, along))


def _long_run(scores: Array, lags: int) -> Array:
    """H of one run."""
    made = scores.T @ scores
    for lag in range(1, min(lags, len(scores) - 1) + 1):
        product = scores[lag:].T @ scores[:-lag]
        made += (1.0 - lag / (lags + 1.0)) * (product + product.T)
    return np.asarray(made)


def _going_on(scores: Sequence[Array]) -> tuple[int, Array]:
    """L of Bartlett's weights, and by what these still fall short of each direction's error (R,).

    With a slope r of the scores from block to block, which an estimate from n of them falls short
    of by (1 + 3 r)/n [Kendall1954], scores have (1 + r)/(1 − r) of their variance in the long run,
    and Bartlett's weights count 1 + 2 Σ w_j r^j of it.
    """
    count = sum(map(len, scores))
    power = np.sum([np.sum(part**2, axis=0) for part in scores], axis=0)
    product = np.sum([np.sum(part[1:] * part[:-1], axis=0) for part in scores], axis=0)
    slope = product / np.where(power > 0.0, power, 1.0)
    slope = np.clip(slope + (1.0 + 3.0 * slope) / count, -STEEPEST, STEEPEST)
    numerator = np.sum(4.0 * slope**2 * power**2 / ((1.0 - slope) ** 6 * (1.0 + slope) ** 2))
    denominator = np.sum(power**2 / (1.0 - slope) ** 4)
    alpha = float(numerator / denominator) if denominator > 0.0 else 0.0
    found = 1.1447 * (alpha * count) ** (1.0 / 3.0)
    lags = int(np.clip(np.floor(found), 1, max(1, count // BLOCKS_A_LAG)))
    up = np.clip(slope, 0.0, None)
    steps = np.arange(1, lags + 1)
    counted = 1.0 + 2.0 * (1.0 - steps / (lags + 1.0)) @ up[None, :] ** steps[:, None]
    return lags, np.sqrt((1.0 + up) / (1.0 - up) / counted)


def _freedom(told: Array, basis: Array, lagged: float) -> Array:
    """Degrees of freedom (P,) from the blocks' A_b (B, R, R)."""
    shares = np.einsum("kr,brs,ks->bk", basis, told, basis, optimize=True)
    squares = np.sum(shares**2, axis=0)
    found = np.sum(shares, axis=0) ** 2 / np.maximum(squares, TINY) / lagged
    return np.asarray(np.maximum(found, 1.0))
