"""Structural damping (sd of Table I): the formula is the core's, its parameters from training.

A reading: the paper names only its ref. 23 [Ismail2021]; see
`flexspline/estimators/structural_damping.hpp`. The torsion has the kinematic error and the wave
generator taken off, as for the compliance. For a time constant T the torque is linear in B and τ_0,
so only T is searched.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from flexspline import _core
from flexspline.errors import InputError

__all__ = ["StructuralDamping", "fit_structural_damping"]

Array = NDArray[np.float64]

SHORTEST_STEPS = 3.0  # sampling steps, of the time constants that are tried
GRID = 16


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
    grid = np.linspace(np.log(shortest), np.log(max(longest, 2.0 * shortest)), GRID)
    best = int(np.argmin([solved(float(x))[0] for x in grid]))
    around = (float(grid[max(best - 1, 0)]), float(grid[min(best + 1, GRID - 1)]))
    at = float(minimize_scalar(lambda x: solved(x)[0], bounds=around, method="bounded").x)
    damping, initial = solved(at)[1]
    if not damping > 0.0:
        raise InputError(
            "structural damping: the torsion does not rise with the torque in the training logs; "
            "check the signs of load and motor angle or leave out 'sd'"
        )
    return StructuralDamping(float(damping), float(np.exp(at)), float(initial), threshold)
