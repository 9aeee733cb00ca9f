"""The regression of a calibration, with the sums, solver and noise model of fits.

    V = s τ + v₀ + Σ_k d_k (T_b − T₀)^k + h (T − T_b),      k = 1 … degree

This is zhang_disturbance_elimination (10) solved for V, and (11) where τ = 0. The drift's columns
come from the core's compensation, fed with one coefficient at a time, so the fitted columns are
those that run on the joint, but for where a body that lags starts: a joint has one reading of that,
a run the rows behind it as well (`CalibrationRun.temperature_of_body`).

The voltage is regressed on the reference, not the reference on the voltage as (25) has it: the
reference is the trusted one, and noise in a regressor attenuates its coefficient by
noise²/(noise² + signal²), however long the log. Noise of the voltage (amplifier, ripple, converter)
then only widens the errors; k = 1/s. The effect of noise in the reference is small, and reported.

The thermal lag is a shape: an outer search around the linear solve, as in
`least_squares/shapes.py`.

Noise model. Nonlinearity and hysteresis repeat with every cycle: they are properties of the sensor,
not noise. Left in the residual they would pass for very slow noise, and the errors of k and zero
would be those of an experiment in which the sensor differs each time. So the noise is estimated
beside a square, a cube, and elastic-plastic elements in series (Prandtl and Ishlinskii) of the
reference, and beside a gain that changes with temperature, where there is load at several
temperatures; the coefficients themselves, and the size of their errors, are those of the straight
line. Reference and temperature enter denoised, as centres of plays that they pull along: a noise
model that whitens strongly would otherwise explain noise by noise.

A zero of its own for each run (`Shape.contrasts`) adds one column less than there are runs. Their
rows sum to zero over the runs, so v₀ is the mean of the runs' zeros. A run that is held out whole
has an unknown zero and is read with the mean of the others'; a block with that of its own run.

Validation. Whole runs are held out where there are at least four and the others still hold load and
temperature, else contiguous blocks. The lag is estimated again for each fold, within a factor of
four of that of all rows: sums of blocks at a grid of lags serve every fold, and a parabola through
the best three interpolates.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexspline import _core
from flexspline.calibration.runs import CalibrationRun
from flexspline.least_squares.noise_model import BLOCK, Chunk, noise_model
from flexspline.least_squares.sums import Solution, Sums, solve
from flexspline.least_squares.uncertainty import Uncertainty, parameter_uncertainty
from flexspline.least_squares.validation import BLOCKS, FARTHEST, RUNS_NEEDED
from flexspline.logs.quantisation import white_noise
from flexspline.logs.segments import median_step, play

__all__ = [
    "Lag",
    "Regression",
    "Shape",
    "Validation",
    "cross_validate",
    "drift_columns",
    "quiet",
    "regress",
    "residuals_of",
    "rows_of",
    "target_of",
]

Array = NDArray[np.float64]
Edges = list[list[int]]

GRID = 13
LAG_TOLERANCE = 1e-4  # of the logarithm of the lag
FLAT = 1e-7
NEAR_BOUND = 1e-3
BEND = 1e-3  # of the lag, relative, for the central difference
LONG = 1_000_000  # rows from which the noise model reads one chunk of several
LEAST_LAG_STEPS = 2.0

SLACK = 5.0  # standard deviations of white noise that a play does not follow
LEAST_WARMTH = 2.0  # K: what gain_temperature_dependence demands of a run
SLIPS = (1 / 24, 1 / 12, 1 / 6, 1 / 3)  # of the largest reference

VALIDATION_GRID = 17
CARRIES = 0.5  # of the spread of load and temperature that has to stay when a run is left out


@dataclass(frozen=True)
class Lag:
    """How the search for the lag ended. `bound`: −1, 0 or 1. `flat`: the runs say nothing of it."""

    value: float
    bound: int
    flat: bool


@dataclass(frozen=True, eq=False)
class Regression:
    """Coefficients (P,) in V per unit of their column, with the errors of these and of the lag.

    `solution`: of the linear part. `uncertainty`: of P coefficients and, where `lag_free`, the
    lag [s]. `residuals`: V, an array (N,) for each run.
    """

    shape: Shape
    coefficients: Array
    solution: Solution
    uncertainty: Uncertainty
    lag: Lag | None
    lag_free: bool
    residuals: tuple[Array, ...]


def regress(runs: Sequence[CalibrationRun], shape: Shape, *, find_lag: bool) -> Regression:
    """Solve, search the lag if asked to, and find the errors."""
    whole = [[0, len(run)] for run in runs]
    lag = search_lag(runs, shape, whole) if find_lag else None
    shape = shape if lag is None else replace(shape, lag=lag.value)
    solution = solution_of(sums_of(runs, shape, whole))
    residuals = residuals_of(runs, shape, solution)
    free = lag is not None and lag.bound == 0 and not lag.flat
    uncertainty = _uncertainty(runs, shape, solution, residuals, free)
    return Regression(
        shape, solution.coefficients, solution, uncertainty, lag, free, tuple(residuals)
    )


def sums_of(runs: Sequence[CalibrationRun], shape: Shape, edges: Edges) -> Sums:
    """Sums of products of [rows, target], a block between each two edges of a run."""
    highs, lows, numbers, counts = [], [], [], []
    for number, (run, cuts) in enumerate(zip(runs, edges, strict=True)):
        drift = drift_columns(run, shape)
        rows, target = rows_of(run, shape, drift), target_of(run, shape, drift)
        blocks = list(pairwise(cuts))
        high, low = _core.accumulate_rows(rows, target, blocks, None, True, 1)
        highs.append(high)
        lows.append(low)
        numbers += [number] * len(blocks)
        counts += [last - first for first, last in blocks]
    return Sums(
        np.concatenate(highs),
        np.concatenate(lows),
        np.array(counts, dtype=np.int64),
        np.array(numbers, dtype=np.int64),
    )


def solution_of(sums: Sums, blocks: Sequence[int] | None = None) -> Solution:
    """Least squares over all or some blocks."""
    return solve(*sums.total(blocks))


def search_lag(runs: Sequence[CalibrationRun], shape: Shape, edges: Edges) -> Lag:
    """Find the lag of least squares: a grid in its logarithm, then Brent's search.

    From each minimum of the grid: a short lag with a large gradient is a slope of the temperature,
    and may lie below the grid's nearest to a lag that is better yet.
    """
    from scipy.optimize import minimize_scalar

    low, high = np.log(_limits(runs))

    def squares(logarithm: float) -> float:
        trial = replace(shape, lag=float(np.exp(logarithm)))
        return float(solution_of(sums_of(runs, trial, edges)).residual_squares)

    grid = np.linspace(low, high, GRID)
    seen = np.array([squares(point) for point in grid])
    if seen.max() <= seen.min() * (1.0 + FLAT):
        return Lag(float(np.exp(low)), 0, True)

    def refined(start: int) -> tuple[float, float]:
        inside = (grid[max(start - 1, 0)], grid[min(start + 1, GRID - 1)])
        found = minimize_scalar(
            squares, bounds=inside, method="bounded", options={"xatol": LAG_TOLERANCE}
        )
        return min((float(found.fun), float(found.x)), (float(seen[start]), float(grid[start])))

    _, at = min(refined(start) for start in np.flatnonzero(_lowest_nearby(seen)).tolist())
    bound = -1 if at - low < NEAR_BOUND else 1 if high - at < NEAR_BOUND else 0
    return Lag(float(np.exp(at)), bound, False)


def _lowest_nearby(values: Array) -> NDArray[np.bool_]:
    """Which values are no higher than either neighbour, (N,)."""
    walled = np.concatenate([[np.inf], values, [np.inf]])
    return np.asarray((values <= walled[:-2]) & (values <= walled[2:]))


def _limits(runs: Sequence[CalibrationRun]) -> Array:
    """From two samples to half of the longest run, s."""
    step = max(median_step(run.log["time"]) for run in runs)
    longest = max(run.log.duration for run in runs)
    return np.array([LEAST_LAG_STEPS * step, max(0.5 * longest, 4.0 * step)])


def residuals_of(runs: Sequence[CalibrationRun], shape: Shape, solution: Solution) -> list[Array]:
    """Voltage measured less predicted, V, an array (N,) for each run."""
    found = []
    for run in runs:
        drift = drift_columns(run, shape)
        predicted = rows_of(run, shape, drift) @ solution.coefficients
        found.append(np.asarray(target_of(run, shape, drift) - predicted))
    return found


def _uncertainty(
    runs: Sequence[CalibrationRun],
    shape: Shape,
    solution: Solution,
    residuals: Sequence[Array],
    lag_free: bool,
) -> Uncertainty:
    rows = [_tangent(run, shape, solution, lag_free) for run in runs]
    basis = _basis(rows, residuals) if lag_free else solution.basis
    total = sum(len(run) for run in runs)
    still = [quiet(run) for run in runs]
    smooth = [_tangent(run, shape, solution, lag_free) for run in still]
    wide, left, beside = beside_structure(still, smooth, residuals)
    noise = noise_model(chunks_of(runs, wide, left), beside.basis, every=1 + total // LONG)
    return parameter_uncertainty(chunks_of(runs, rows, residuals), basis, noise)


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


def _tangent(run: CalibrationRun, shape: Shape, solution: Solution, lag_free: bool) -> Array:
    """Rows with a column more where the lag is free, ∂(prediction)/∂lag."""
    rows = rows_of(run, shape)
    if not lag_free:
        return rows
    ends = []
    for factor in (1.0 - BEND, 1.0 + BEND):
        moved = replace(shape, lag=factor * shape.lag)
        drift = drift_columns(run, moved)
        predicted = rows_of(run, moved, drift) @ solution.coefficients
        ends.append(predicted - target_of(run, moved, drift))
    bend = (ends[1] - ends[0]) / (2.0 * BEND * shape.lag)
    return np.column_stack([rows, bend])


def _basis(rows: Sequence[Array], residuals: Sequence[Array]) -> Array:
    """Directions of coefficients and lag that the data determine; rows @ basis is orthonormal."""
    blocks = [
        _core.accumulate_rows(np.asfortranarray(r), v, [(0, len(r))], None, True, 1)
        for r, v in zip(rows, residuals, strict=True)
    ]
    high = np.concatenate([block[0] for block in blocks])
    low = np.concatenate([block[1] for block in blocks])
    return solve(*_core.merge(high, low, list(range(len(blocks))))).basis


@dataclass(frozen=True)
class Shape:
    """What is regressed on what.

    `degree`: of the drift, 0 for none. `reference_temperature`: T₀, °C. `lag`: s, of T_b behind T,
    0 for T_b = T. `gradient`: whether h is fitted; `held_gradient`: Nm/K, taken off the reference
    beforehand. `sensitivity`: whether s is fitted; `held_sensitivity`: Nm/V, known, or None.
    `contrasts`: names of the columns, last of all, by which zeros differ between runs.
    """

    degree: int
    reference_temperature: float
    lag: float
    gradient: bool
    held_gradient: float
    sensitivity: bool
    held_sensitivity: float | None
    contrasts: tuple[str, ...] = ()

    @property
    def shared(self) -> int:
        """Number of columns that all runs share, all but the contrasts."""
        return len(self.names) - len(self.contrasts)

    @property
    def names(self) -> list[str]:
        """Of the columns, in order."""
        drift = [f"drift_{k}" for k in range(1, self.degree + 1)]
        return [
            *(["sensitivity"] if self.sensitivity else []),
            "zero",
            *drift,
            *(["gradient"] if self.gradient else []),
            *self.contrasts,
        ]


def drift_columns(run: CalibrationRun, shape: Shape) -> Array:
    """(N, degree + 1): (T_b − T₀)^k, and T − T_b last; units K^k."""
    temperature = run.temperature_of_body if shape.lag > 0.0 else run.temperature
    if temperature is None:
        return np.zeros((len(run), 1))
    ones = np.eye(max(shape.degree, 1))
    fed = [(tuple(row), 0.0) for row in ones[: shape.degree]] + [((0.0,), 1.0)]
    columns = [
        _core.temperature_compensation(
            run.log["time"],
            temperature,
            coefficients=coefficients,
            reference_temperature=shape.reference_temperature,
            gradient=gradient,
            thermal_lag=shape.lag,
        )
        for coefficients, gradient in fed
    ]
    return np.column_stack(columns)


def rows_of(run: CalibrationRun, shape: Shape, drift: Array | None = None) -> Array:
    """(N, P), columns as in `shape.names`. `drift`: of `drift_columns`, if they are there."""
    drift = drift_columns(run, shape) if drift is None else drift
    columns = [np.ones((len(run), 1)), drift[:, : shape.degree]]
    if shape.sensitivity:
        columns.insert(0, _torque(run, shape, drift)[:, None])
    if shape.gradient:
        columns.append(drift[:, -1:])
    if shape.contrasts:
        columns.append(np.tile(run.contrast, (len(run), 1)))
    return np.asfortranarray(np.hstack(columns))


def target_of(run: CalibrationRun, shape: Shape, drift: Array | None = None) -> Array:
    """(N,), V: the voltage, less what a known sensitivity says of it."""
    if shape.held_sensitivity is None:
        return run.voltage
    drift = drift_columns(run, shape) if drift is None else drift
    return np.asarray(run.voltage - _torque(run, shape, drift) / shape.held_sensitivity)


def _torque(run: CalibrationRun, shape: Shape, drift: Array) -> Array:
    if shape.held_gradient == 0.0:
        return run.torque
    return np.asarray(run.torque - shape.held_gradient * drift[:, -1])


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


@dataclass(frozen=True, eq=False)
class Validation:
    """Held-out residuals, V, an array (N,) for each run. `by`: "runs" or "blocks".

    `rmses`: (folds,), V, of each part that was left out, and `labels` what it was.
    """

    residuals: tuple[Array, ...]
    by: str
    rmses: Array
    labels: tuple[str, ...]


def cross_validate(runs: Sequence[CalibrationRun], made: Regression) -> Validation:
    """Leave out one run, or one block, after the other."""
    by_runs = len(runs) >= RUNS_NEEDED and all(_carried(runs, k) for k in range(len(runs)))
    edges = [_edges(run, len(runs), by_runs) for run in runs]
    sums = sums_of(runs, made.shape, edges)
    grid = _lag_grid(made)
    at_grid = [sums_of(runs, replace(made.shape, lag=lag), edges) for lag in grid]
    held_out = [np.full(len(run), np.nan) for run in runs]
    parts = [(k, a, b) for k, cuts in enumerate(edges) for a, b in pairwise(cuts)]
    for fold, (number, first, last) in enumerate(parts):
        others = [other for other in range(len(parts)) if other != fold]
        shape = made.shape
        if made.lag_free:
            squares = [solution_of(s, others).residual_squares for s in at_grid]
            shape = replace(shape, lag=_least(grid, np.array(squares)))
        solution = solution_of(sums if shape == made.shape else sums_of(runs, shape, edges), others)
        read = _unknown_zero(runs[number]) if by_runs and shape.contrasts else runs[number]
        residual = residuals_of([read], shape, solution)[0]
        held_out[number][first:last] = residual[first:last]
    rmses = np.array([_rms(held_out[k][a:b]) for k, a, b in parts])
    labels = tuple(_label(runs[k], a, b, by_runs) for k, a, b in parts)
    return Validation(tuple(held_out), "runs" if by_runs else "blocks", rmses, labels)


def _unknown_zero(run: CalibrationRun) -> CalibrationRun:
    """The run with the mean zero of the others: their contrasts are minus its own, summed."""
    return replace(run, contrast=-run.contrast / len(run.contrast))


def _lag_grid(made: Regression) -> Array:
    """Lags around that of all rows, s; none where it is not fitted."""
    if not made.lag_free:
        return np.empty(0)
    return np.asarray(made.shape.lag * np.exp(np.linspace(-FARTHEST, FARTHEST, VALIDATION_GRID)))


def _least(grid: Array, squares: Array) -> float:
    """The lag of least squares: the vertex through the best point and its neighbours."""
    best = int(np.argmin(squares))
    if not 0 < best < len(grid) - 1:
        return float(grid[best])
    before, at, behind = squares[best - 1 : best + 2]
    bend = before - 2.0 * at + behind
    if not bend > 0.0:
        return float(grid[best])
    step = np.log(grid[1] / grid[0])
    return float(grid[best] * np.exp(0.5 * step * (before - behind) / bend))


def _edges(run: CalibrationRun, count: int, by_runs: bool) -> list[int]:
    parts = 1 if by_runs else max(2, round(BLOCKS / count))
    return [int(row) for row in np.linspace(0, len(run), parts + 1)]


def _carried(runs: Sequence[CalibrationRun], left_out: int) -> bool:
    """Whether the other runs hold enough of the load and of the temperatures."""
    others = [run for k, run in enumerate(runs) if k != left_out]
    return _spread(others) >= CARRIES * _spread(runs) and (
        _spread(others, warmth=True) >= CARRIES * _spread(runs, warmth=True)
    )


def _spread(runs: Sequence[CalibrationRun], *, warmth: bool = False) -> float:
    """Standard deviation of load or temperature over all rows; 0 without."""
    columns = [run.temperature if warmth else run.torque for run in runs]
    return float(np.std(np.concatenate([c if c is not None else np.zeros(1) for c in columns])))


def _label(run: CalibrationRun, first: int, last: int, by_runs: bool) -> str:
    if by_runs:
        return run.log.name
    time = run.log["time"]
    return f"{run.log.name}, {time[first]:.4g} to {time[last - 1]:.4g} s"


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
