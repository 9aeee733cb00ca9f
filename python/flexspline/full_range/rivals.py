"""Torque estimates that the third paper compares its transition with (Table I): gp, kalman, sd.

Gaussian process (gp): scikit-learn's, on the inputs that the paper lists. They are printed as [q,
θ, q̇, θ, τ_m]; the second θ is read as θ̇. The kernel is an anisotropic squared exponential with
white noise, on inputs scaled to unit spread. The paper has 22070 training samples and does not say
whether all enter the kernel (that takes 3.9 GB); here `rows` of the training logs do, evenly spread
in time, and a share of these sets the kernel's lengths. As q and θ are nearly proportional and the
torsion is their small difference, these inputs hide it: that is the paper's choice, not ours.

Kalman filter, the rival of (19): the core's (`flexspline/estimators/kalman_merge.hpp`). The noise
of each estimate at rest and in motion is its RMSE there on the training logs. These errors are
autocorrelated, while the filter assumes white noise, so the wander of the torque is not taken from
the torque but chosen for the least RMSE: only the ratio of wander and noise matters. Other rivals
of (19) are not included. It is a complementary filter already, whose share depends on speed; an
IMM, filters for rest and motion weighted by their likelihoods, would infer from the estimates what
the measured speed says at once.

Structural damping (sd): the formula is the core's, its parameters from training. The paper names
only its ref. 23 [Ismail2021]; our reading is in `flexspline/estimators/structural_damping.hpp`. The
torsion has the kinematic error and the wave generator taken off, as for the compliance. For a time
constant T the torque is linear in B and τ_0, so only T is searched.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from flexspline import _core
from flexspline.errors import InputError
from flexspline.estimators import Merge
from flexspline.full_range.methods import with_velocities
from flexspline.logs.log import Log

__all__ = [
    "INPUTS",
    "GaussianProcess",
    "MergeRun",
    "StructuralDamping",
    "fit_gaussian_process",
    "fit_kalman",
    "fit_structural_damping",
    "merged_by_kalman",
    "require_rows",
]

Array = NDArray[np.float64]

INPUTS = ("output_position", "motor_position", "output_velocity", "motor_velocity", "motor_torque")
KERNEL_ROWS = 400
LEAST_ROWS, MOST_ROWS = 20, 25_000  # some per length of the kernel; a matrix of 5 GB
CHUNK = 4096

SHUT = 4.0  # α of the change from rest to motion, in units of 1 / motion speed: λ(0) = 0.018
LEAST_NOISE = 1e-6  # Nm
WANDER_GRID = 13

SHORTEST_STEPS = 3.0  # sampling steps, of the time constants that are tried
TIME_GRID = 16


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


@dataclass(frozen=True)
class MergeRun:
    """What a merge reads of one run, arrays (N,): s, rad/s at the output, Nm."""

    time: Array
    velocity: Array
    observer: Array
    compliance: Array
    reference: Array


def merged_by_kalman(merge: Merge, run: MergeRun) -> Array:
    """Return the merged torque of one run, (N,), Nm."""
    assert merge.walk and merge.observer_noise and merge.compliance_noise  # as Merge checks
    return np.asarray(
        _core.merge_kalman(
            run.time,
            run.velocity,
            run.observer,
            run.compliance,
            alpha=merge.alpha,
            transition_velocity=merge.transition_velocity,
            walk=merge.walk,
            observer_rest=merge.observer_noise[0],
            observer_motion=merge.observer_noise[1],
            compliance_rest=merge.compliance_noise[0],
            compliance_motion=merge.compliance_noise[1],
        )
    )


def fit_kalman(runs: Sequence[MergeRun], motion_speed: float) -> Merge:
    """Return the filter with the least RMSE over the runs.

    Parameters
    ----------
    runs : training runs with their reference.
    motion_speed : rad/s at the output, between rest and motion.
    """
    moving = np.concatenate([np.abs(run.velocity) for run in runs]) >= motion_speed

    def noise(name: str) -> tuple[float, float]:
        error = np.concatenate([getattr(run, name) - run.reference for run in runs])
        still, driven = (float(np.sqrt(np.nanmean(error[m] ** 2))) for m in (~moving, moving))
        return max(still, LEAST_NOISE), max(driven, LEAST_NOISE)

    sizes = noise("observer"), noise("compliance")

    def made(log_walk: float) -> Merge:
        return Merge(
            SHUT / motion_speed,
            motion_speed,
            method="kalman",
            walk=float(np.exp(log_walk)),
            observer_noise=sizes[0],
            compliance_noise=sizes[1],
        )

    def cost(log_walk: float) -> float:
        merge = made(log_walk)
        errors = [merged_by_kalman(merge, run) - run.reference for run in runs]
        return float(np.nanmean(np.concatenate(errors) ** 2))

    period = float(np.median(np.diff(runs[0].time)))
    middle = np.log(np.sqrt(sizes[0][1] * sizes[1][0] / period))
    grid = middle + np.linspace(-8.0, 4.0, WANDER_GRID)
    best = int(np.argmin([cost(x) for x in grid]))
    around = (float(grid[max(best - 1, 0)]), float(grid[min(best + 1, WANDER_GRID - 1)]))
    return made(float(minimize_scalar(cost, bounds=around, method="bounded").x))


@dataclass(frozen=True)
class StructuralDamping:
    """Parameters of the method.

    Parameters
    ----------
    damping : B, Nm·s/rad at the output.
    time_constant : T, s.
    initial_torque : τ_0, Nm.
    threshold : torsion below which there is no rate, rad at the output.
    """

    damping: float
    time_constant: float
    initial_torque: float = 0.0
    threshold: float = 0.0

    @property
    def stiffness(self) -> float:
        """B/T, Nm/rad at the output: of the spring that it is for changes faster than T."""
        return self.damping / self.time_constant

    def torque(self, time: Array, torsion: Array) -> Array:
        """Return the outward torque (N,), Nm, of a torsion (N,), rad at the output, over time."""
        return np.asarray(_core.structural_damping_torque(time, torsion, **vars(self)))


def fit_structural_damping(
    runs: Sequence[tuple[Array, Array, Array]], *, threshold: float = 0.0
) -> StructuralDamping:
    """Return the parameters with the least RMSE.

    Parameters
    ----------
    runs : (time, torsion, reference torque) of each run: s, rad at the output, Nm, all (N,).
    threshold : rad at the output; the text of ref. 23 has one, its value is not known to us.

    Raises
    ------
    InputError
        Where the torsion does not follow the torque at all.
    """
    reference = np.concatenate([run[2] for run in runs])

    def solved(log_time_constant: float) -> tuple[float, Array]:
        unit = StructuralDamping(1.0, float(np.exp(log_time_constant)), 0.0, threshold)
        passed = np.concatenate([unit.torque(time, torsion) for time, torsion, _ in runs])
        rows = np.column_stack([passed, np.ones_like(passed)])
        found = np.linalg.lstsq(rows, reference, rcond=None)[0]
        return float(np.mean((rows @ found - reference) ** 2)), found

    shortest = SHORTEST_STEPS * float(np.median(np.diff(runs[0][0])))
    longest = max(float(time[-1] - time[0]) for time, _, _ in runs)
    grid = np.linspace(np.log(shortest), np.log(max(longest, 2.0 * shortest)), TIME_GRID)
    best = int(np.argmin([solved(float(x))[0] for x in grid]))
    around = (float(grid[max(best - 1, 0)]), float(grid[min(best + 1, TIME_GRID - 1)]))
    at = float(minimize_scalar(lambda x: solved(x)[0], bounds=around, method="bounded").x)
    damping, initial = solved(at)[1]
    if not damping > 0.0:
        raise InputError(
            "structural damping: the torsion does not rise with the torque in the training logs; "
            "check the signs of load and motor angle or leave out 'sd'"
        )
    return StructuralDamping(float(damping), float(np.exp(at)), float(initial), threshold)
