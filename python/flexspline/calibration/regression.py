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
beside columns of them, S (`calibration/structure.py`).

Bend and hysteresis beside the drift. A straight line leaves them in the residual, and least squares
would let drift and lag make up for them: load in some runs and none in a warm-up looks like a zero
that is another, and the lag is what turns the drift there. Where S is significant (Wald's test),
drift, gradient and lag are therefore found beside it, and k and zero are those of the best line
once the drift is taken off. With L the columns of line and zeros, that is least squares on

    [L, drift, S − L (LᵀL)⁻¹ LᵀS]

whose third part takes nothing from the line. S is left out where it could take over the drift:
load and temperature that change together.

A zero of its own for each run (`Shape.contrasts`) adds one column less than there are runs. Their
rows sum to zero over the runs, so v₀ is the mean of the runs' zeros. A run that is held out whole
has an unknown zero and is read with the mean of the others'; a block with that of its own run.

Validation. Whole runs are held out where there are at least four and the others still hold load and
temperature and determine sensitivity, drift and lag, else contiguous blocks, more of them where one
alone determines one of these: what a fit makes of such a part is no error of reading. The lag is
estimated again for each fold, within a factor of four of that of all rows: sums of blocks at a grid
of lags serve every fold, and a parabola through the best three interpolates.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from flexspline import _core
from flexspline.calibration.runs import CalibrationRun
from flexspline.calibration.structure import (
    LEVEL,
    LONG,
    NEGLIGIBLE,
    beside_structure,
    chunks_of,
    largest_of,
    quiet,
    structure_columns,
    wald_test,
    warmth_under_load,
)
from flexspline.least_squares.noise_model import noise_model
from flexspline.least_squares.sums import Solution, Sums, solve
from flexspline.least_squares.uncertainty import Uncertainty, parameter_uncertainty
from flexspline.least_squares.validation import BLOCKS, FARTHEST, RUNS_NEEDED
from flexspline.logs.segments import median_step

__all__ = [
    "Lag",
    "Regression",
    "Shape",
    "Validation",
    "cross_validate",
    "drift_columns",
    "regress",
    "residuals_of",
    "rows_of",
    "target_of",
]

Array = NDArray[np.float64]
Edges = list[list[int]]
Structure = tuple[Array, ...]

GRID = 13
LAG_TOLERANCE = 1e-4  # of the logarithm of the lag
FLAT = 1e-7
NEAR_BOUND = 1e-3
BEND = 1e-3  # of the lag, relative, for the central difference
LEAST_LAG_STEPS = 2.0

VALIDATION_GRID = 17
CARRIES = 0.5  # of the spread of load and temperature that has to stay when a run is left out
ALONE = 10.0
"""Times that the error of a parameter grows by without a part, which then alone determines it. Of
four runs with one warm-up 14 to 70 without that, 1.7 without any other; half of it would refuse
half of a warm-up as well, twice of it would hold out the only one that tells a lag."""
UNTOLD = 1e-12  # of a scaled diagonal: where nothing tells a combination, its error is 1e6 times


@dataclass(frozen=True)
class Lag:
    """How the search for the lag ended. `bound`: −1, 0 or 1. `flat`: the runs say nothing of it."""

    value: float
    bound: int
    flat: bool


@dataclass(frozen=True, eq=False)
class Regression:
    """Coefficients (P,) in V per unit of their column, with the errors of these and of the lag.

    `solution`: of the linear part, without structure. `uncertainty`: of P coefficients and, where
    `lag_free`, the lag [s]. `residuals`: V, an array (N,) for each run. `structure`: (N, K) for
    each run, columns of bend and hysteresis beside which drift and lag were found, or none.
    `bend_taken`: whether the drift could take these over, so that it may be a bend.
    """

    shape: Shape
    coefficients: Array
    solution: Solution
    uncertainty: Uncertainty
    lag: Lag | None
    lag_free: bool
    residuals: tuple[Array, ...]
    structure: Structure = ()
    bend_taken: bool = False


def regress(runs: Sequence[CalibrationRun], shape: Shape, *, find_lag: bool) -> Regression:
    """Solve, search the lag if asked to, and find the errors.

    Drift and lag are found beside bend and hysteresis where these show.
    """
    made = _regressed(runs, shape, find_lag, ())
    if not shape.degree or not any(run.loaded for run in runs):
        return made
    structure = _structure(runs)
    if _taken(runs, made.shape, structure):
        return replace(made, bend_taken=True)
    return _regressed(runs, shape, find_lag, structure) if _shows(runs, made) else made


def _regressed(
    runs: Sequence[CalibrationRun], shape: Shape, find_lag: bool, structure: Structure
) -> Regression:
    whole = [[0, len(run)] for run in runs]
    lag = search_lag(runs, shape, whole, structure) if find_lag else None
    shape = shape if lag is None else replace(shape, lag=lag.value)
    solution = solution_of(sums_of(runs, shape, whole))
    sums = sums_of(runs, shape, whole, structure)
    coefficients = _coefficients(sums, shape) if structure else solution.coefficients
    residuals = residuals_of(runs, shape, coefficients)
    free = lag is not None and lag.bound == 0 and not lag.flat
    tangents = [
        [_tangent(run, shape, coefficients, free) for run in some]
        for some in (runs, [quiet(run) for run in runs])
    ]
    rows, smooth = tangents
    if structure:
        beside = _beside_line(rows, structure, shape.line)
        rows = [np.hstack(both) for both in zip(rows, beside, strict=True)]
    basis = _basis(rows, residuals) if free or structure else solution.basis
    uncertainty = _uncertainty(runs, rows, basis, smooth, residuals)
    return Regression(
        shape, coefficients, solution, uncertainty, lag, free, tuple(residuals), structure
    )


def _coefficients(sums: Sums, shape: Shape, blocks: Sequence[int] | None = None) -> Array:
    """Drift beside further columns of the sums, and the best line once it is taken off: (P,)."""
    wide = solution_of(sums, blocks).coefficients
    found, line = wide[: len(shape.names)], shape.line
    if len(wide) == len(found):
        return wide
    drift = [k for k in range(len(found)) if k not in line]
    squares = sums.total(blocks)[0]
    left = squares[line, -1] - squares[np.ix_(line, drift)] @ found[drift]
    found[line] = _scaled_solve(squares[np.ix_(line, line)], left[:, None])[:, 0]
    return np.asarray(found)


def _scaled_solve(squares: Array, products: Array) -> Array:
    """(P, M), solutions of normal equations, by columns of length one."""
    unit = 1.0 / np.sqrt(np.maximum(np.diag(squares), 1e-300))[:, None]
    return np.asarray(
        unit * np.linalg.lstsq(unit * squares * unit.T, unit * products, rcond=None)[0]
    )


def _structure(runs: Sequence[CalibrationRun]) -> Structure:
    """Columns of bend and hysteresis, (N, K) for each run."""
    still = [quiet(run) for run in runs]
    largest, warmth = largest_of(still), warmth_under_load(still)
    return tuple(structure_columns(run, largest, warmth) for run in still)


def _taken(runs: Sequence[CalibrationRun], shape: Shape, structure: Structure) -> bool:
    """Whether columns of the regression can be made of those of structure."""
    solution = solution_of(sums_of(runs, shape, [[0, len(run)] for run in runs], structure))
    hidden = solution.null_space * solution.lengths[:, None]
    hidden /= np.maximum(np.linalg.norm(hidden, axis=0), 1e-300)
    return bool(np.abs(hidden[: len(shape.names)]).max(initial=0.0) > NEGLIGIBLE)


def _shows(runs: Sequence[CalibrationRun], made: Regression) -> bool:
    """Whether bend and hysteresis are significant beside line, drift and lag."""
    still = [quiet(run) for run in runs]
    rows = [_tangent(run, made.shape, made.coefficients, made.lag_free) for run in still]
    shown = wald_test(still, rows, made.residuals, slice(rows[0].shape[1], None))
    return shown is not None and shown.p < LEVEL


def _beside_line(rows: Sequence[Array], structure: Structure, line: Sequence[int]) -> list[Array]:
    """S − L (LᵀL)⁻¹ LᵀS for each run; `line`: which of the rows' columns L are."""
    lines = [columns[:, line] for columns in rows]
    squares = np.sum([own.T @ own for own in lines], axis=0)
    products = np.sum([a.T @ b for a, b in zip(lines, structure, strict=True)], axis=0)
    share = _scaled_solve(squares, products)
    return [own - line @ share for line, own in zip(lines, structure, strict=True)]


def sums_of(
    runs: Sequence[CalibrationRun], shape: Shape, edges: Edges, structure: Structure = ()
) -> Sums:
    """Sums of products of [rows, target], a block between each two edges of a run.

    `structure`: more columns of the rows, (N, K) for each run.
    """
    highs, lows, numbers, counts = [], [], [], []
    for number, (run, cuts) in enumerate(zip(runs, edges, strict=True)):
        drift = drift_columns(run, shape)
        rows, target = rows_of(run, shape, drift), target_of(run, shape, drift)
        if structure:
            rows = np.asfortranarray(np.hstack([rows, structure[number]]))
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


def search_lag(
    runs: Sequence[CalibrationRun], shape: Shape, edges: Edges, structure: Structure = ()
) -> Lag:
    """Find the lag of least squares: a grid in its logarithm, then Brent's search.

    From each minimum of the grid: a short lag with a large gradient is a slope of the temperature,
    and may lie below the grid's nearest to a lag that is better yet.
    """
    from scipy.optimize import minimize_scalar

    low, high = np.log(_limits(runs))

    def squares(logarithm: float) -> float:
        trial = replace(shape, lag=float(np.exp(logarithm)))
        return float(solution_of(sums_of(runs, trial, edges, structure)).residual_squares)

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


def residuals_of(runs: Sequence[CalibrationRun], shape: Shape, coefficients: Array) -> list[Array]:
    """Voltage measured less predicted, V, an array (N,) for each run."""
    found = []
    for run in runs:
        drift = drift_columns(run, shape)
        predicted = rows_of(run, shape, drift) @ coefficients
        found.append(np.asarray(target_of(run, shape, drift) - predicted))
    return found


def _uncertainty(
    runs: Sequence[CalibrationRun],
    rows: Sequence[Array],
    basis: Array,
    smooth: Sequence[Array],
    residuals: Sequence[Array],
) -> Uncertainty:
    """Errors of P coefficients and lag.

    `rows`: (N, P), or with columns beside these, for each run. `smooth`: (N, P), of quiet runs.
    """
    total, told = sum(len(run) for run in runs), smooth[0].shape[1]
    wide, left, beside = beside_structure([quiet(run) for run in runs], smooth, residuals)
    noise = noise_model(chunks_of(runs, wide, left), beside.basis, every=1 + total // LONG)
    known = parameter_uncertainty(chunks_of(runs, rows, residuals), basis, noise)
    freedom = known.degrees_of_freedom[:told]
    return replace(known, basis=known.basis[:told], degrees_of_freedom=freedom)


def _tangent(run: CalibrationRun, shape: Shape, coefficients: Array, lag_free: bool) -> Array:
    """Rows with a column more where the lag is free, ∂(prediction)/∂lag."""
    rows = rows_of(run, shape)
    if not lag_free:
        return rows
    ends = []
    for factor in (1.0 - BEND, 1.0 + BEND):
        moved = replace(shape, lag=factor * shape.lag)
        drift = drift_columns(run, moved)
        predicted = rows_of(run, moved, drift) @ coefficients
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
    def line(self) -> list[int]:
        """Numbers of the columns that no temperature enters: sensitivity and zeros."""
        own = ("sensitivity", "zero", *self.contrasts)
        return [k for k, name in enumerate(self.names) if name in own]

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


@dataclass(frozen=True)
class Alone:
    """A part of the runs, of number `run`, without which the parameters `names` are not known."""

    run: int
    label: str
    names: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Validation:
    """Held-out residuals, V, an array (N,) for each run. `by`: "runs" or "blocks".

    `rmses`: (folds,), V, of each part that was left out, and `labels` what it was. `alone`: of
    these parts. `instead`: runs for which blocks are left out, where these would have been.
    """

    residuals: tuple[Array, ...]
    by: str
    rmses: Array
    labels: tuple[str, ...]
    alone: tuple[Alone, ...]
    instead: tuple[Alone, ...]


def cross_validate(runs: Sequence[CalibrationRun], made: Regression) -> Validation:
    """Leave out one run, or one block, after the other."""
    parting = _parting(runs, made)
    edges, by_runs, beside = parting.edges, parting.by_runs, made.structure
    sums = sums_of(runs, made.shape, edges, beside)
    grid = _lag_grid(made)
    at_grid = [sums_of(runs, replace(made.shape, lag=lag), edges, beside) for lag in grid]
    held_out = [np.full(len(run), np.nan) for run in runs]
    parts = [(k, a, b) for k, cuts in enumerate(edges) for a, b in pairwise(cuts)]
    for fold, (number, first, last) in enumerate(parts):
        others = [other for other in range(len(parts)) if other != fold]
        shape = made.shape
        if made.lag_free:
            squares = [solution_of(s, others).residual_squares for s in at_grid]
            shape = replace(shape, lag=_least(grid, np.array(squares)))
        again = sums if shape == made.shape else sums_of(runs, shape, edges, beside)
        coefficients = _coefficients(again, shape, others)
        read = _unknown_zero(runs[number]) if by_runs and shape.contrasts else runs[number]
        residual = residuals_of([read], shape, coefficients)[0]
        held_out[number][first:last] = residual[first:last]
    rmses = np.array([_rms(held_out[k][a:b]) for k, a, b in parts])
    labels = tuple(_label(runs[k], a, b, by_runs) for k, a, b in parts)
    return Validation(
        tuple(held_out),
        "runs" if by_runs else "blocks",
        rmses,
        labels,
        parting.alone,
        parting.instead,
    )


@dataclass(frozen=True)
class _Parting:
    """Rows between which each run is cut, and what parts alone determine, as `Validation`."""

    edges: Edges
    by_runs: bool
    alone: tuple[Alone, ...]
    instead: tuple[Alone, ...]


def _parting(runs: Sequence[CalibrationRun], made: Regression) -> _Parting:
    """Whole runs, or blocks: more of a run as long as one of them alone determines something."""
    whole = [[0, len(run)] for run in runs]
    instead: tuple[Alone, ...] = ()
    if len(runs) >= RUNS_NEEDED and all(_carried(runs, k) for k in range(len(runs))):
        instead = _alone(runs, made, whole)
        if not instead:
            return _Parting(whole, True, (), ())
    counts = [max(2, round(BLOCKS / len(runs)))] * len(runs)
    while True:
        edges = [_edges(run, count) for run, count in zip(runs, counts, strict=True)]
        alone = _alone(runs, made, edges)
        finer = {one.run for one in alone if counts[one.run] < BLOCKS}
        if not finer:
            return _Parting(edges, False, alone, instead)
        counts = [count * (2 if k in finer else 1) for k, count in enumerate(counts)]


def _alone(runs: Sequence[CalibrationRun], made: Regression, edges: Edges) -> tuple[Alone, ...]:
    """Parts without which an error is `ALONE` times as large, and of which parameters.

    Zeros are not asked for: where each run has its own, no other tells it.
    """
    shape, free = made.shape, made.lag_free
    names = [*shape.names, *(["thermal_lag"] if free else [])]
    rows = [_tangent(run, shape, made.coefficients, free) for run in runs]
    asked = [k for k in range(len(names)) if k not in shape.line]
    times = {False: _times(rows, edges)}
    if made.structure:
        times[True] = _times([np.hstack(b) for b in zip(rows, made.structure, strict=True)], edges)
    of_line = [0] if shape.sensitivity else []
    found = []
    parts = [(k, a, b) for k, cuts in enumerate(edges) for a, b in pairwise(cuts)]
    for number, (k, first, last) in enumerate(parts):
        larger = [n for n in of_line if times[False][number][n] > ALONE]
        larger += [n for n in asked if times[bool(made.structure)][number][n] > ALONE]
        if larger:
            label = _label(runs[k], first, last, last - first == len(runs[k]))
            found.append(Alone(k, label, tuple(names[n] for n in larger)))
    return tuple(found)


def _times(rows: Sequence[Array], edges: Edges) -> list[Array]:
    """How many times as large white noise makes the error of each column without each part."""
    squares = [
        columns[first:last].T @ columns[first:last]
        for columns, cuts in zip(rows, edges, strict=True)
        for first, last in pairwise(cuts)
    ]
    whole = np.sum(squares, axis=0)
    unit = 1.0 / np.sqrt(np.maximum(np.diag(whole), 1e-300))
    hold = UNTOLD * np.eye(len(unit))

    def variances(kept: Array) -> Array:
        return np.diag(np.linalg.inv(unit[:, None] * kept * unit + hold))

    known = variances(whole)
    return [np.sqrt(variances(whole - one) / known) for one in squares]


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


def _edges(run: CalibrationRun, parts: int) -> list[int]:
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
