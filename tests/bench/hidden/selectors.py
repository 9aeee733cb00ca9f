"""Methods of others that select columns: which effects do they name on the same dictionary?

How many columns a method takes is decided by validation: each run left out in turn, the columns
chosen on the others refitted there by least squares.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping

import numpy as np
from numpy.typing import NDArray
from pysindy.optimizers import FROLS, SSR, STLSQ
from sklearn.linear_model import Lasso, LassoCV, OrthogonalMatchingPursuitCV
from sklearn.model_selection import LeaveOneGroupOut

from hidden.dictionary import Columns
from hidden.rig import Array

__all__ = ["METHODS"]

MOST = 16  # columns that a method may choose
THRESHOLDS = np.geomspace(3e-3, 1.0, 14)  # of the target's deviation
RIDGE = 1e-8

Mask = NDArray[np.bool_]
Supports = list[Mask]
"""Choices of columns, (C,) of bool each, the i-th of them the method's i-th try."""


def _lasso(c: Columns) -> Mask:
    return np.asarray(_lasso_path(c).coef_ != 0.0)


def _plain_lasso(c: Columns) -> Mask:
    """Take the largest penalty whose squares are within one standard error of the least."""
    path = _lasso_path(c)
    mean = path.mse_path_.mean(axis=1)
    best = int(np.argmin(mean))
    error = path.mse_path_[best].std(ddof=1) / np.sqrt(path.mse_path_.shape[1])
    alpha = path.alphas_[mean <= mean[best] + error].max()
    fitted = Lasso(alpha=alpha, fit_intercept=False, max_iter=5000).fit(c.X, c.y)
    return np.asarray(fitted.coef_ != 0.0)


def _lasso_path(c: Columns) -> LassoCV:
    folds = list(LeaveOneGroupOut().split(c.X, c.y, c.runs))
    return LassoCV(fit_intercept=False, cv=folds, eps=1e-3, alphas=40, max_iter=3000).fit(c.X, c.y)


def _pursuit(c: Columns) -> Mask:
    folds = list(LeaveOneGroupOut().split(c.X, c.y, c.runs))
    most = min(MOST, c.X.shape[1])
    made = OrthogonalMatchingPursuitCV(fit_intercept=False, cv=folds, max_iter=most)
    return np.asarray(made.fit(c.X, c.y).coef_ != 0.0)


def _stepwise(c: Columns) -> Mask:
    """Add the column that lowers BIC = n ln(SSE / n) + k ln n most, as long as one does."""
    chosen = np.zeros(c.X.shape[1], dtype=bool)
    left, beside, squares = c.y.copy(), c.X.copy(), float(c.y @ c.y)
    while chosen.sum() < min(MOST * 4, len(chosen)):
        lengths = np.maximum(np.sum(beside**2, axis=0), 1e-300)
        gain = np.where(chosen | (lengths < 1e-9 * c.rows), 0.0, (beside.T @ left) ** 2 / lengths)
        best = int(np.argmax(gain))
        if -c.rows * np.log1p(-min(gain[best] / squares, 1 - 1e-12)) < np.log(c.rows):
            break
        along = beside[:, best] / np.sqrt(lengths[best])
        left = left - along * (along @ left)
        beside = beside - np.outer(along, along @ beside)
        chosen[best], squares = True, float(left @ left)
    return chosen


def _thresholded(X: Array, y: Array) -> Supports:
    size = np.sqrt(np.mean(y**2)) / np.sqrt(np.mean(X**2))
    made = []
    for threshold in THRESHOLDS * size:
        fitted = STLSQ(threshold=threshold, alpha=RIDGE).fit(X, y[:, None])
        made.append(fitted.coef_[0] != 0.0)
    return [*made, np.zeros(X.shape[1], dtype=bool)]


def _backward(X: Array, y: Array) -> Supports:
    fitted = SSR(alpha=RIDGE, max_iter=X.shape[1]).fit(X, y[:, None])
    return _by_size([h[0] != 0.0 for h in fitted.history_], X.shape[1])


def _forward(X: Array, y: Array) -> Supports:
    most = min(MOST, X.shape[1])
    fitted = FROLS(alpha=RIDGE, max_iter=most).fit(X, y[:, None])
    return _by_size([h[0] != 0.0 for h in fitted.history_], X.shape[1])


def _by_size(supports: Supports, columns: int) -> Supports:
    """One choice of each size from none to MOST; a size that is missing repeats the one below."""
    sized = {int(s.sum()): s for s in supports}
    made = [np.zeros(columns, dtype=bool)]
    for size in range(1, min(MOST, columns) + 1):
        made.append(sized.get(size, made[-1]))
    return made


def _validated(supports: Callable[[Array, Array], Supports]) -> Callable[[Columns], Mask]:
    """Choose among the tries of a method by the squares on runs left out."""

    def chosen(c: Columns) -> Mask:
        errors = np.sum([_errors(c, own, supports) for own in _folds(c)], axis=0)
        return supports(c.X, c.y)[int(np.argmin(errors))]

    return chosen


def _folds(c: Columns) -> Iterator[Mask]:
    for run in np.unique(c.runs):
        yield c.runs == run


def _errors(c: Columns, out: Mask, supports: Callable[[Array, Array], Supports]) -> list[float]:
    made = []
    for kept in supports(c.X[~out], c.y[~out]):
        beta = np.linalg.lstsq(c.X[~out][:, kept], c.y[~out], rcond=None)[0]
        made.append(float(np.sum((c.y[out] - c.X[out][:, kept] @ beta) ** 2)))
    return made


def _quiet(method: Callable[[Columns], Mask]) -> Callable[[Columns], Mask]:
    def chosen(c: Columns) -> Mask:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of columns that nothing is gained by
            return method(c)

    return chosen


METHODS: Mapping[str, Callable[[Columns], Mask]] = {
    name: _quiet(method)
    for name, method in {
        "LassoCV": _lasso,
        "LassoCV, 1 SE": _plain_lasso,
        "OMP (CV)": _pursuit,
        "stepwise BIC": _stepwise,
        "STLSQ": _validated(_thresholded),
        "SSR": _validated(_backward),
        "FROLS": _validated(_forward),
    }.items()
}
"""Which columns (C,) each method chooses."""
