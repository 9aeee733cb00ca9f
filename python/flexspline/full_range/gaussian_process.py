"""Gaussian process (gp of Table I): scikit-learn's, on the inputs that the paper lists.

The inputs are printed as [q, θ, q̇, θ, τ_m]; the second θ is read as θ̇. The process is an
anisotropic squared exponential and white noise, on inputs scaled to unit spread. The paper has
22070 training samples and does not say whether all enter the kernel (that takes 3.9 GB); here
`rows` of the training logs do, evenly spread in time, and a share of these sets the kernel's
lengths. As q and θ say almost the same and the torsion is their small difference, these inputs
hide it: that is the paper's choice, not ours.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import InputError
from flexspline.full_range.methods import with_velocities
from flexspline.logs.log import Log

__all__ = ["INPUTS", "GaussianProcess", "fit_gaussian_process", "require_rows"]

Array = NDArray[np.float64]

INPUTS = ("output_position", "motor_position", "output_velocity", "motor_velocity", "motor_torque")
KERNEL_ROWS = 400
LEAST_ROWS, MOST_ROWS = 20, 25_000  # some per length of the kernel; a matrix of 5 GB
CHUNK = 4096


@dataclass(frozen=True)
class GaussianProcess:
    """A fitted process: `regressor` is scikit-learn's; `rows` of `available` entered it."""

    regressor: Any
    middle: Array
    scale: Array
    rows: int
    available: int

    def torque(self, log: Log) -> Array:
        """Return the outward torque of a log, (N,), Nm."""
        inputs = (_inputs(log) - self.middle) / self.scale
        parts = [inputs[k : k + CHUNK] for k in range(0, len(inputs), CHUNK)]
        return np.concatenate([self.regressor.predict(part) for part in parts])

    @property
    def sentence(self) -> str:
        """What was trained on, and the kernel."""
        return (
            f"gp: {self.rows} of {self.available} training rows, evenly spread in time; "
            f"{self.regressor.kernel_}"
        )


def require_rows(rows: object) -> None:
    """Refuse a number of rows that no kernel matrix can have.

    Raises
    ------
    InputError
        Where it is no whole number from `LEAST_ROWS` to `MOST_ROWS`.
    """
    whole = isinstance(rows, int | np.integer) and not isinstance(rows, bool)
    if not whole or not LEAST_ROWS <= int(rows) <= MOST_ROWS:  # type: ignore[call-overload]
        raise InputError(
            f"gp_rows = {rows!r} is not allowed; give a whole number from {LEAST_ROWS} to "
            f"{MOST_ROWS}, or leave 'gp' out of methods"
        )


def fit_gaussian_process(
    logs: Sequence[Log], references: Sequence[Array], *, rows: int = 1000, seed: int = 0
) -> GaussianProcess:
    """Fit the process to training logs.

    Parameters
    ----------
    logs : with output and motor angle and motor torque; missing velocities are derived.
    references : the torque to learn, (N,) of each log, Nm outward.
    rows : samples that enter the kernel matrix; its cost grows with their third power.
    seed : of the search for the kernel's lengths.

    Raises
    ------
    InputError
        Without scikit-learn, or where a channel is missing.
    """
    try:
        from sklearn.gaussian_process import GaussianProcessRegressor
        from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel
    except ImportError as error:
        raise InputError(
            "the method gp needs scikit-learn; install flexspline[baselines] or leave 'gp' out "
            "of methods"
        ) from error
    inputs = np.concatenate([_inputs(log) for log in logs])
    torque = np.concatenate(references)
    good = np.flatnonzero(np.isfinite(inputs).all(axis=1) & np.isfinite(torque))
    kept = good[_spread(len(good), rows)]
    middle, scale = inputs[kept].mean(axis=0), inputs[kept].std(axis=0)
    scale[scale == 0.0] = 1.0
    x, y = (inputs[kept] - middle) / scale, torque[kept]
    kernel = ConstantKernel(float(np.var(y)), (1e-4, 1e6)) * RBF(
        np.ones(x.shape[1]), (1e-2, 1e3)
    ) + WhiteKernel(0.1 * float(np.var(y)), (1e-6, 1e4))
    some = _spread(len(kept), KERNEL_ROWS)
    searched = GaussianProcessRegressor(kernel, normalize_y=True, random_state=seed)
    _quietly(searched, x[some], y[some])
    final = GaussianProcessRegressor(searched.kernel_, optimizer=None, normalize_y=True)
    return GaussianProcess(final.fit(x, y), middle, scale, len(kept), len(torque))


def _quietly(regressor: Any, x: Array, y: Array) -> None:
    """Fit without the warnings of a length at its bound: an input that tells nothing ends there."""
    import warnings

    from sklearn.exceptions import ConvergenceWarning

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        regressor.fit(x, y)


def _inputs(log: Log) -> Array:
    """[q, θ, q̇, θ̇, τ_m] of each row, (N, 5)."""
    log = with_velocities(log)
    return np.column_stack([log[name] for name in INPUTS])


def _spread(available: int, wanted: int) -> NDArray[np.intp]:
    """At most `wanted` row numbers, evenly spread."""
    return np.unique(np.linspace(0, available - 1, min(wanted, available)).astype(np.intp))
