"""How terms that each run has of its own differ between the runs, and whether they do.

Of R values n_r with covariance Σ = D + U Uᵀ (D: noise of each run, U: terms that all share)

    n̄ = Σ n_r / R,   s² = Σ (n_r − n̄)² / (R − 1),   v = 1ᵀΣ1 / R²   (variance of n̄)
    τ² = max(s² − (tr Σ − R v) / (R − 1), 0)

over the runs that determine their own. τ is the spread between runs. A new run has n̄ ± e with

    e² = τ² (1 + 1/R) + v

Test (Wald) of whether one value for all would do, with m the best one,

    F = min over m of (n − m)ᵀ Σ⁻¹ (n − m) / (R − 1)  ~  F(R − 1, ν),    ν of the errors

by Σ⁻¹ = D⁻¹ − D⁻¹ U (I + Uᵀ D⁻¹ U)⁻¹ Uᵀ D⁻¹, so that work and memory grow with R alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import listed

__all__ = ["LEVEL", "BetweenRuns", "OwnValues", "between_runs", "own_warnings"]

Array = NDArray[np.float64]

LEVEL = 0.01
"""Chance that a term is said to differ between runs that does not; as of zeros in a calibration.

Measured in coloured noise, two terms each: 2.0 % of 300 fits of 5 runs, 0.3 % of 150 fits of 20.
"""

LOOSE = 10.0
"""Times the median error from which a run is said not to determine its own value.

Half and twice of it say so of the same runs wherever a run stands still that others move in.
"""


@dataclass(frozen=True)
class OwnValues:
    """One term as R runs have it, in `unit`: values, their errors as D (R,) and U (R, F).

    `told`: (R,), runs that determine it. `freedom`: of the errors.
    """

    term: str
    unit: str
    runs: tuple[str, ...]
    values: Array
    own_variance: Array
    shared: Array
    told: NDArray[np.bool_]
    freedom: float

    @property
    def errors(self) -> Array:
        """Standard errors, (R,)."""
        return np.asarray(np.sqrt(self.own_variance + np.sum(self.shared**2, axis=1)))


@dataclass(frozen=True)
class BetweenRuns:
    """One term of which each run has its own, in `unit`.

    Parameters
    ----------
    term : "effect.term".
    runs, values, standard_errors : of each run, (R,).
    determined : (R,), whether the run determines its value; others do not count below. The
        standard error of a value that is fixed or at a bound is 0, and it is not determined.
    mean : what the model predicts a new run with.
    spread : standard deviation between the runs, without what the errors make of it.
    new_run_error : standard error of `mean` as the value of a new run, with as many degrees of
        freedom as there are runs that determine theirs, less one.
    p : of the test that one value would do for all runs; NaN where fewer than two determine it.
    new_run_rmse : RMS residual, in the target's unit, of all runs, each predicted by a fit to the
        others with their means; one number for all terms of a fit. NaN where none of the others
        determines a term. Shapes follow along the tangent.
    """

    term: str
    unit: str
    runs: tuple[str, ...]
    values: tuple[float, ...]
    standard_errors: tuple[float, ...]
    determined: tuple[bool, ...]
    mean: float
    spread: float
    new_run_error: float
    p: float
    new_run_rmse: float = float("nan")

    @property
    def differs(self) -> bool:
        """Whether the runs differ by more than noise makes them once in a hundred fits."""
        return self.p < LEVEL

    @property
    def verdict(self) -> str:
        """Whether the runs differ, in words."""
        if sum(self.determined) < 2:
            return "fewer than two runs determine it"
        if not np.isfinite(self.p):
            return "there is no noise by which a difference could be judged"
        chance = "< 0.0001" if self.p < 1e-4 else f"= {self.p:.3g}"
        if self.differs:
            return f"the runs differ (p {chance})"
        return (
            f"no difference between the runs is shown (p {chance}, level {LEVEL:g}); one for all "
            "may do"
        )

    def to_json(self) -> dict[str, Any]:
        """Return the term as `model.json` keeps it."""
        return {**asdict(self), "differs": self.differs}


def between_runs(own: OwnValues) -> BetweenRuns:
    """Return mean, spread and test of one term."""
    told = _told(own)
    count = int(told.sum())
    values = own.values[told] if count else own.values
    mean, spread, error = float(values.mean()), float("nan"), float("nan")
    if count > 1:
        around = float(values.var(ddof=1))
        noise, shared = own.own_variance[told], own.shared[told]
        of_mean = float((noise.sum() + np.sum(shared.sum(axis=0) ** 2)) / count**2)
        of_errors = float(noise.sum() + np.sum(shared**2) - count * of_mean) / (count - 1)
        spread = float(np.sqrt(max(around - of_errors, 0.0)))
        error = float(np.sqrt(spread**2 * (1.0 + 1.0 / count) + of_mean))
    return BetweenRuns(
        own.term,
        own.unit,
        own.runs,
        tuple(own.values.tolist()),
        tuple(own.errors.tolist()),
        tuple(told.tolist()),
        mean,
        spread,
        error,
        _chance(own, told),
    )


def _told(own: OwnValues) -> NDArray[np.bool_]:
    """Runs that determine their value about as well as the others do, (R,)."""
    if not own.told.any():
        return own.told
    usual = float(np.median(own.errors[own.told]))
    return np.asarray(own.told & (own.errors <= LOOSE * usual))


def _chance(own: OwnValues, told: NDArray[np.bool_]) -> float:
    """P(F > what is seen); NaN for less than two values, or of exact ones."""
    from scipy.stats import f

    count = int(told.sum())
    noise, shared = own.own_variance[told], own.shared[told]
    if count < 2 or not (noise > 0.0).all():
        return float("nan")

    def weighed(values: Array) -> Array:
        """Σ⁻¹ values."""
        over = shared / noise[:, None]
        inner = np.eye(shared.shape[1]) + shared.T @ over
        return np.asarray(values / noise - over @ np.linalg.solve(inner, over.T @ values))

    ones, values = np.ones(count), own.values[told]
    best = float(ones @ weighed(values)) / float(ones @ weighed(ones))
    apart = values - best
    squares = max(float(apart @ weighed(apart)), 0.0)
    return float(f.sf(squares / (count - 1), count - 1, own.freedom))


def own_warnings(terms: Sequence[BetweenRuns]) -> list[str]:
    """Return a sentence for each term that some runs do not determine."""
    said = []
    for each in terms:
        every = zip(each.runs, each.determined, each.standard_errors, strict=True)
        loose = [run for run, known, error in every if not known and error != 0.0]
        if loose:
            said.append(
                f"{each.term}: {listed(loose, 6)} do{'es' if len(loose) == 1 else ''} not "
                f"determine {'its' if len(loose) == 1 else 'their'} own value and do"
                f"{'es' if len(loose) == 1 else ''} not count in its mean and spread; record runs "
                "that move so that they tell it from other terms"
            )
    return said
