"""What a sensor does beyond a straight line, for the noise model alone.

Bend and hysteresis repeat with every cycle: they are figures of the sensor, not noise. Left in the
residual they would pass for very slow noise, and the errors of k and zero would be those of an
experiment in which the sensor is bent another way each time. So the noise is that which is left
beside a square, a cube, and elastic-plastic elements in series (Prandtl and Ishlinskii) of the
reference; the coefficients themselves, and what is said of their errors' size, are those of the
straight line. Reference and temperature enter without their own noise, as centres of plays that
they pull along: a noise model that whitens strongly would otherwise explain noise by noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flexspline import _core
from flexspline.calibration.runs import CalibrationRun
from flexspline.least_squares.sums import Solution, solve
from flexspline.logs.quantisation import white_noise
from flexspline.logs.segments import play

__all__ = ["beside_structure", "quiet", "structure_columns"]

Array = NDArray[np.float64]

SLACK = 5.0  # standard deviations of white noise that a play does not follow
SLIPS = (1 / 24, 1 / 12, 1 / 6, 1 / 3)  # of the largest reference


def quiet(run: CalibrationRun) -> CalibrationRun:
    """The run with reference and temperature as they would be without their white noise."""
    warmth = run.temperature
    return replace(
        run,
        torque=_held(run.torque) if run.loaded else run.torque,
        temperature=None if warmth is None else _held(warmth),
    )


def _held(values: Array) -> Array:
    slack = SLACK * white_noise(values)
    return play(values, slack) if slack > 0.0 else values


def structure_columns(run: CalibrationRun, largest: float) -> Array:
    """(N, 6), of order one; zeros where the run is without load."""
    if not run.loaded:
        return np.zeros((len(run), 2 + len(SLIPS)))
    share = run.torque / largest
    bend = [share**2, share**3]
    return np.column_stack(bend + [share - play(share, slip) for slip in SLIPS])


def beside_structure(
    runs: Sequence[CalibrationRun], rows: Sequence[Array], residuals: Sequence[Array]
) -> tuple[list[Array], list[Array], Solution]:
    """Rows with the columns of structure, residuals without its share, and the solution.

    Parameters
    ----------
    runs : quiet ones.
    rows : (N, P) for each run; residuals: (N,), V.
    """
    largest = max(float(np.abs(run.torque).max()) for run in runs) or 1.0
    wide = [
        np.asfortranarray(np.hstack([r, structure_columns(run, largest)]))
        for run, r in zip(runs, rows, strict=True)
    ]
    blocks = [
        _core.accumulate_rows(w, v, [(0, len(w))], None, True, 1)
        for w, v in zip(wide, residuals, strict=True)
    ]
    high = np.concatenate([block[0] for block in blocks])
    low = np.concatenate([block[1] for block in blocks])
    solution = solve(*_core.merge(high, low, list(range(len(blocks)))))
    left = [np.asarray(v - w @ solution.coefficients) for w, v in zip(wide, residuals, strict=True)]
    return wide, left, solution
