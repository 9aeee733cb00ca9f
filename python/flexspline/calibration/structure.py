"""Bend and hysteresis of a sensor: columns that stand for them, and tests beside these.

They repeat with every cycle of the load: properties of the sensor, not noise. The columns are a
square, a cube, and elastic-plastic elements in series (Prandtl and Ishlinskii) of the reference,
and a gain that changes with temperature, where there is load at several temperatures.

Reference and temperature enter denoised, as centres of plays that they pull along: a noise model
that whitens strongly would otherwise explain noise by noise.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexspline import _core
from flexspline.calibration.runs import CalibrationRun
from flexspline.least_squares.noise_model import BLOCK, Chunk, noise_model
from flexspline.least_squares.sums import Solution, solve
from flexspline.least_squares.uncertainty import Uncertainty, parameter_uncertainty
from flexspline.logs.quantisation import white_noise
from flexspline.logs.segments import play

__all__ = [
    "LEVEL",
    "LONG",
    "NEGLIGIBLE",
    "WaldTest",
    "Warmth",
    "beside_structure",
    "chunks_of",
    "largest_of",
    "quiet",
    "structure_columns",
    "wald_test",
    "warmth_under_load",
]

Array = NDArray[np.float64]

LONG = 1_000_000  # rows from which the noise model reads one chunk of several
SLACK = 5.0  # standard deviations of white noise that a play does not follow
LEAST_WARMTH = 2.0  # K: what gain_temperature_dependence demands of a run
SLIPS = (1 / 24, 1 / 12, 1 / 6, 1 / 3)  # of the largest reference
NEGLIGIBLE = 1e-7  # share of a contrast in what the runs do not determine

LEVEL = 0.01
"""Chance that `zero_test` reports a zero that has not moved.

Measured over 3000 simulated calibrations with coloured noise, rounding and a drift of degree 2:
1.3 % of them; at half of this level 0.8 %, at twice of it 2.5 %. Noise that is slower than a run is
a zero that moves.
"""


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


def structure_columns(run: CalibrationRun, largest: float, warmth: Warmth | None) -> Array:
    """(N, 6), of order one, and one more with `warmth`; zeros where the run is without load."""
    count = 2 + len(SLIPS) + (warmth is not None)
    if not run.loaded:
        return np.zeros((len(run), count))
    share = run.torque / largest
    columns = [share**2, share**3, *(share - play(share, slip) for slip in SLIPS)]
    if warmth is not None and run.temperature is not None:
        columns.append(share * (run.temperature - warmth.middle) / warmth.span)
    return np.column_stack(columns)


class Warmth(NamedTuple):
    """Temperatures at which there was load: largest less least, and the middle, °C."""

    middle: float
    span: float


def warmth_under_load(runs: Sequence[CalibrationRun]) -> Warmth | None:
    """Temperatures of rows with half of the largest load; None where they are but one.

    Parameters
    ----------
    runs : quiet ones.
    """
    half = 0.5 * largest_of(runs)
    columns = [
        run.temperature[np.abs(run.torque) >= half]
        for run in runs
        if run.loaded and run.temperature is not None
    ]
    under = np.concatenate([np.empty(0), *columns])
    if any(run.temperature is None for run in runs if run.loaded) or not len(under):
        return None
    low, high = float(under.min()), float(under.max())
    return Warmth(0.5 * (low + high), high - low) if high - low >= LEAST_WARMTH else None


def largest_of(runs: Sequence[CalibrationRun]) -> float:
    """The largest load, Nm; 1 without any."""
    return max(float(np.abs(run.torque).max()) for run in runs) or 1.0


def beside_structure(
    runs: Sequence[CalibrationRun], rows: Sequence[Array], residuals: Sequence[Array]
) -> tuple[list[Array], list[Array], Solution]:
    """Rows with the columns of structure, residuals without its share, and the solution.

    Parameters
    ----------
    runs : quiet ones.
    rows : (N, P) for each run; residuals: (N,), V.
    """
    largest, warmth = largest_of(runs), warmth_under_load(runs)
    wide = [
        np.asfortranarray(np.hstack([r, structure_columns(run, largest, warmth)]))
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


def chunks_of(
    runs: Sequence[CalibrationRun], rows: Sequence[Array], residuals: Sequence[Array]
) -> Callable[[], Iterator[Chunk]]:
    """Give rows and residuals in pieces, as the noise model reads them."""

    def give() -> Iterator[Chunk]:
        for run, columns, residual in zip(runs, rows, residuals, strict=True):
            for first in range(0, len(run), BLOCK):
                part = slice(first, first + BLOCK)
                yield Chunk(columns[part], residual[part], run.starts[part])

    return give


@dataclass(frozen=True, eq=False)
class WaldTest:
    """Coefficients (R,) with their standard errors, and L, (q, R): what the runs tell of them.

    `p`: chance of such L a where all coefficients are zero.
    """

    coefficients: Array
    errors: Array
    combinations: Array
    p: float


def wald_test(
    runs: Sequence[CalibrationRun], rows: Sequence[Array], residuals: Sequence[Array], own: slice
) -> WaldTest | None:
    """Test columns beside all others and those of structure; None where these can take them over.

    Parameters
    ----------
    runs : quiet ones.
    rows : (N, P) for each run; residuals: (N,), V.
    own : the columns that are tested, of these and of those of structure, in this order.
    """
    wide, left, beside = beside_structure(runs, rows, residuals)
    combinations = _testable(beside, own)
    if not len(combinations):
        return None
    every = 1 + sum(len(run) for run in runs) // LONG
    noise = noise_model(chunks_of(runs, wide, left), beside.basis, every=every)
    known = parameter_uncertainty(chunks_of(runs, wide, left), beside.basis, noise)
    values = beside.coefficients[own]
    p = _chance(combinations @ values, combinations, known, own)
    return WaldTest(values, known.standard_errors[own], combinations, p)


def _chance(values: Array, combinations: Array, known: Uncertainty, own: slice) -> float:
    """P(F > what is seen); ν is the least of the contrasts'."""
    from scipy.stats import f

    basis = combinations @ known.basis[own]
    covariance = basis @ known.core @ basis.T
    squares = float(values @ np.linalg.pinv(covariance, rcond=1e-12, hermitian=True) @ values)
    freedom = float(np.min(known.degrees_of_freedom[own]))
    return float(f.sf(squares / len(values), len(values), freedom))


def _testable(beside: Solution, own: slice) -> Array:
    """(q, R - 1), orthonormal combinations of contrasts that no other column can take over."""
    null_space = beside.null_space * beside.lengths[:, None]
    hidden = null_space / np.maximum(np.linalg.norm(null_space, axis=0), 1e-300)
    left, sizes, _ = np.linalg.svd(hidden[own])
    return np.asarray(left[:, int(np.count_nonzero(sizes > NEGLIGIBLE)) :].T)
