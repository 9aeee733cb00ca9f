"""Scores of a fit: overall, by group, and cross-validated.

All scores are of residuals e = measured − predicted on the rows that count; the cross-validated
ones are those to believe.

    RMSE = √(mean e²),  bias = mean e,  variance = mean (e − bias)²,  R² = 1 − Σe² / Σ(y − ȳ)²

Whole runs are held out where there are at least four, else contiguous blocks; of many runs several
together, so that the work grows with the rows and not with rows times runs. A fold's fit follows
from sums over the other folds, around the solution of all:

    δ = argmin Σ_other folds w (r − Z δ)²
    (Σ_other w Z Zᵀ) δ = Σ_other w Z r = −Σ_fold w Z r

with Z the tangent rows. The last step holds because Σ w Z r of all folds is zero at the solution;
with priors it is their share, which every fold has. Without shapes the fold's residual is r − Z δ.
With shapes Z is true near the solution only: where one moves further, the shapes go all, half or
none of the way that δ says, whichever suits the other folds best, and the coefficients are solved
for again there. Of generalised least squares Z and r are filtered, and folds are fitted anew.

Where the runs' own offsets are taken out (`Problem.centred`), Z and r have no mean in a run. With
s, c the sums of z and r over the m rows of it that a fold holds out, the n others have the means
−s/n and −c/n, and centred about these

    Σ_other Z Zᵀ − s sᵀ/n,     Σ_other Z r − s c/n,     offset's move (sᵀδ − c)/n

Of other terms that runs have of their own (`Problem.projected`), with the orthonormal columns Q of
`Problem.own_basis`, s = Qᵀz and c = Qᵀr over the m rows, and G = QᵀQ over the n others:

    Σ_other Z Zᵀ − s G⁺ sᵀ,     Σ_other Z r − s G⁺ c,     the move along Q G⁺(sᵀδ − c)

A held-out block is so predicted with what the rest of its run says of the run's own terms.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from flexspline.effects import Effect
from flexspline.formatting import told_apart
from flexspline.least_squares.estimate import Estimate, counts_of, newton
from flexspline.least_squares.linear import LinearFit, fit_linear
from flexspline.least_squares.problem import Problem
from flexspline.least_squares.shapes import filtered_pieces
from flexspline.logs.log import Log
from flexspline.logs.segments import near_reversal, output_velocity, standstill

__all__ = [
    "Score",
    "Validation",
    "bands",
    "cross_validate",
    "folds_of",
    "groups",
    "score",
    "scores_of",
    "steps_without_runs",
]

Array = NDArray[np.float64]
Fold = tuple[tuple[int, int, int], ...]
"""Rows that are left out together: run and half-open range of each part."""

RUNS_NEEDED = 4
BLOCKS = 8
MOST_FOLDS = 40  # runs or blocks beyond are left out several at a time
WAYS = (0.0, 0.5, 1.0)
LEFT = 1e-9  # share of a run's own direction in its other rows, from which these tell of it
NEAR = 0.01  # of its value that a shape may move along the tangent alone
FARTHEST = np.log(4.0)  # that a shape may go from the solution of all, as a factor

Mask = NDArray[np.bool_]

SPEED_BANDS = 5
TEMPERATURE_BANDS = 3
REVERSAL_SECONDS = 0.1
LEAST_ROWS = 10
ROUND = 1e-3  # of the span of all bands: no band is narrower, and an edge nearer zero reads 0


@dataclass(frozen=True, eq=False)
class Validation:
    """Held-out residuals, an array (N,) for each run; NaN on rows that do not count.

    `by`: "runs", "blocks" or "folds of runs". `folds`: how many.
    """

    residuals: tuple[Array, ...]
    by: str
    folds: int


@dataclass(frozen=True, eq=False)
class _Moves:
    """What leaving folds out does: δ (F + S,) of each, and the move of what a run has of its own.

    `offsets`: by fold and run, where offsets are taken out; `along`: along the directions of
    `Problem.own_basis`, where other terms are.
    """

    steps: list[Array]
    offsets: dict[tuple[int, int], float]
    along: dict[tuple[int, int], Array]


def cross_validate(made: Estimate) -> Validation:
    """Leave out one run, or one block, or several of many, after the other."""
    folds, by = folds_of(made.tangent.problem)
    moves = _moves(made, folds)
    find = _moved if _nearly_linear(made, moves.steps) else _refitted
    return Validation(find(made, folds, moves), by, len(folds))


def folds_of(problem: Problem) -> tuple[list[Fold], str]:
    """Return what is left out in turn, and what that is in words."""
    own_offsets = bool(problem.own) or problem.centred
    by_runs = len(problem.runs) >= RUNS_NEEDED and not own_offsets
    parts = [
        (number, first, last)
        for number in range(len(problem.runs))
        for first, last in pairwise(run_edges(problem, number, by_runs))
    ]
    count = min(len(parts), MOST_FOLDS)
    many = len(parts) > MOST_FOLDS
    by = ("folds of runs" if many else "runs") if by_runs else "blocks"
    return [tuple(parts[k::count]) for k in range(count)], by


def _nearly_linear(made: Estimate, moves: list[Array]) -> bool:
    """Whether no fold moves a shape so far that the tangent would be wrong there."""
    values = np.array([shape.value(made.linear.effects) for shape in made.free_shapes])
    return all((np.abs(move[len(made.fitted) :]) <= NEAR * values).all() for move in moves)


def _moves(made: Estimate, folds: Sequence[Fold]) -> _Moves:
    """What the fit does without each fold."""
    width, problem = made.basis.shape[1], made.tangent.problem
    products = np.zeros((len(folds), width, width))
    correlations = np.zeros((len(folds), width))
    sums: dict[tuple[int, int], Array] = defaultdict(lambda: np.zeros(width + 2))
    owned: dict[tuple[int, int], Array] = {}
    parts = _by_run(folds)
    pieces = made.tangent.pieces()
    if made.denominator is not None:
        pieces = filtered_pieces(made.tangent, made.denominator)
    for number, rows, chunk in pieces:
        z = chunk.rows @ made.basis
        weighted = z if chunk.weights is None else z * chunk.weights[:, None]
        for fold, part in _inside(parts[number], rows):
            products[fold] += weighted[part].T @ z[part]
            correlations[fold] += weighted[part].T @ chunk.residual[part]
            if problem.centred:
                total = [chunk.residual[part].sum(), part.stop - part.start]
                sums[fold, number] += np.append(z[part].sum(axis=0), total)
            if problem.projected:
                own = problem.own_basis(number).rows[rows][part]
                both = own.T @ np.column_stack([z[part], chunk.residual[part], own])
                owned[fold, number] = owned.get((fold, number), np.zeros_like(both)) + both
    known = made.prior_rows @ made.basis
    whole = products.sum(axis=0) + known.T @ known
    left = {key: problem.runs[key[1]].counted - int(total[-1]) for key, total in sums.items()}
    for key, count in left.items():
        of_rows, of_residual = sums[key][:-2], sums[key][-2]
        products[key[0]] += np.outer(of_rows, of_rows) / max(count, 1)
        correlations[key[0]] += of_rows * of_residual / max(count, 1)
    inverses = {key: _others(both[:, width + 1 :]) for key, both in owned.items()}
    for key, both in owned.items():
        spread = both[:, :width].T @ inverses[key]
        products[key[0]] += spread @ both[:, :width]
        correlations[key[0]] += spread @ both[:, width]
    steps = [
        np.linalg.lstsq(whole - without, -pull, rcond=1e-13)[0]
        for without, pull in zip(products, correlations, strict=True)
    ]
    offsets = {
        key: float(sums[key][:-2] @ steps[key[0]] - sums[key][-2]) / max(count, 1)
        for key, count in left.items()
    }
    along = {
        key: inverses[key] @ (both[:, :width] @ steps[key[0]] - both[:, width])
        for key, both in owned.items()
    }
    return _Moves([made.basis @ step for step in steps], offsets, along)


def _others(held_out: Array) -> Array:
    """G⁺ of the rows that are not held out, of whose products (R, R) all rows have the identity."""
    values, vectors = np.linalg.eigh(np.eye(len(held_out)) - held_out)
    left = values > LEFT
    return np.asarray(vectors[:, left] / values[left] @ vectors[:, left].T)


def steps_without_runs(made: Estimate) -> list[Array]:
    """Return δ (F + S,) of the fit without each run in turn.

    It moves nothing that the run alone determines, as terms of its own.
    """
    runs = made.tangent.problem.runs
    return _moves(made, [((number, 0, len(run)),) for number, run in enumerate(runs)]).steps


def _moved(made: Estimate, folds: Sequence[Fold], moves: _Moves) -> tuple[Array, ...]:
    """Held-out residuals of a linear fit, r − Z δ."""
    residuals = [np.full(len(run), np.nan) for run in made.tangent.problem.runs]
    parts = _by_run(folds)
    for number, rows, chunk in made.tangent.pieces():
        for fold, part in _inside(parts[number], rows):
            held_out = chunk.residual[part] - chunk.rows[part] @ moves.steps[fold]
            held_out -= moves.offsets.get((fold, number), 0.0)
            if moves.along:
                own = made.tangent.problem.own_basis(number).rows[rows][part]
                held_out -= own @ moves.along[fold, number]
            residuals[number][rows.start + part.start : rows.start + part.stop] = held_out
    return tuple(residuals)


def _refitted(made: Estimate, folds: Sequence[Fold], moves: _Moves) -> tuple[Array, ...]:
    """Held-out residuals of a fit with shapes."""
    problem = made.tangent.problem
    residuals = [np.full(len(run), np.nan) for run in problem.runs]
    for fold, move in zip(folds, moves.steps, strict=True):
        others = _without(problem, fold)
        best = _fit_without(made, others, move)
        for number, first, last in fold:
            run = problem.runs[number]
            predicted = others.predict_run(best.effects, best.coefficients, number)
            rows = np.flatnonzero(counts_of(run))
            rows = rows[(rows >= first) & (rows < last)]
            residuals[number][rows] = (run.target - predicted)[rows]
    return tuple(residuals)


def _fit_without(made: Estimate, others: Problem, move: Array) -> LinearFit:
    """The best fit to the other folds on the way that δ says."""
    if made.denominator is not None:
        apart = newton(replace(made, tangent=replace(made.tangent, problem=others)))
        if apart is not None:
            return apart.linear
    tries = [
        fit_linear(
            others,
            _shifted(made, way * move[len(made.fitted) :]),
            made.constraints,
            start=made.linear.coefficients,
            weights=made.tangent.weights,
            noise_variance=made.noise_variance,
            exact=made.linear.exact,
        )
        for way in WAYS
    ]
    return min(tries, key=lambda fit: fit.squares)


def _shifted(made: Estimate, step: Array) -> tuple[Effect, ...]:
    """The effects with their shapes moved by `step` (S,), in proportion, within their bounds."""
    effects = made.linear.effects
    for shape, change in zip(made.free_shapes, step, strict=True):
        value = shape.value(effects)
        factor = np.exp(np.clip(change / value, -FARTHEST, FARTHEST))
        effects = shape.set(
            effects, float(np.clip(value * factor, shape.info.lower, shape.info.upper))
        )
    return effects


def _without(problem: Problem, fold: Fold) -> Problem:
    """The problem without the rows of a fold."""
    runs = list(problem.runs)
    for number, begin, end in fold:
        kept = [
            piece
            for first, last in runs[number].stretches
            for piece in ((first, min(last, begin)), (max(first, end), last))
            if piece[0] < piece[1]
        ]
        runs[number] = replace(runs[number], stretches=tuple(kept))
    return replace(problem, runs=tuple(runs))


def run_edges(problem: Problem, number: int, by_runs: bool) -> list[int]:
    """Rows at which the folds of a run begin, and its end."""
    size = len(problem.runs[number])
    if by_runs:
        return [0, size]
    count = max(2, round(BLOCKS / len(problem.runs)))
    return [int(row) for row in np.linspace(0, size, count + 1)]


def _by_run(folds: Sequence[Fold]) -> dict[int, list[tuple[int, int, int]]]:
    """Number of the fold and row range of all parts of each run."""
    found: dict[int, list[tuple[int, int, int]]] = defaultdict(list)
    for at, fold in enumerate(folds):
        for number, first, last in fold:
            found[number].append((at, first, last))
    return found


def _inside(parts: Sequence[tuple[int, int, int]], rows: slice) -> list[tuple[int, slice]]:
    """Folds that a piece of a run touches, with the rows of the piece that lie in each."""
    found = []
    for fold, first, last in parts:
        begin, end = max(first, rows.start), min(last, rows.stop)
        if begin < end:
            found.append((fold, slice(begin - rows.start, end - rows.start)))
    return found


@dataclass(frozen=True)
class Score:
    """Residuals of one part of the rows. Units: the target's, variance its square.

    `group`: "all", "run", "direction", "speed", "temperature" or "reversals"; `label`: which
    part; `cv_rmse`: the RMSE on rows that the fit never saw.
    """

    group: str
    label: str
    rows: int
    rmse: float
    cv_rmse: float
    bias: float
    variance: float
    r_squared: float


def score(group: str, label: str, y: Array, residual: Array, held_out: Array) -> Score:
    """Return the score of some rows, all arrays of shape (n,)."""
    bias = float(residual.mean())
    squares, spread = float(residual @ residual), _about(y, float(y.mean()))
    return Score(
        group,
        label,
        len(y),
        float(np.sqrt(squares / len(y))),
        float(np.sqrt(held_out @ held_out / len(y))),
        bias,
        _about(residual, bias) / len(y),
        1.0 - squares / spread if spread > 0.0 else float("nan"),
    )


def _about(values: Array, middle: float) -> float:
    """Σ (value − middle)²"""
    apart = values - middle
    return float(apart @ apart)


def scores_of(
    problem: Problem, residuals: Sequence[Array], held_out: Sequence[Array]
) -> tuple[Score, ...]:
    """Score residuals by run, direction, speed, temperature and nearness to a reversal.

    Parameters
    ----------
    residuals, held_out : an array (N,) for each run; NaN in `held_out` on rows that do not count.
    """
    counts = [np.isfinite(rows) for rows in held_out]
    y, inside, outside = (
        _joined([v if c.all() else v[c] for v, c in zip(list_, counts, strict=True)])
        for list_ in ([run.target for run in problem.runs], residuals, held_out)
    )
    found = [score("all", "all rows", y, inside, outside)]

    def scored(part: tuple[str, str, Mask]) -> Score:
        group, label, mask = part
        return score(group, label, y[mask], inside[mask], outside[mask])

    parts = groups([run.log for run in problem.runs], counts)
    seen = (part for part in parts if part[-1].sum() >= LEAST_ROWS)
    return (*found, *map(scored, seen))  # by one thread: each part is a copy of its rows


def groups(logs: Sequence[Log], counts: Sequence[Mask]) -> Iterator[tuple[str, str, Mask]]:
    """Yield group, label and the rows (n,) of each part of the n rows that count.

    Parameters
    ----------
    logs : runs.
    counts : (N,) for each run, which of its rows count.
    """
    number = np.concatenate([np.full(c.sum(), k) for k, c in enumerate(counts)])
    if len(logs) > 1:
        for k, log in enumerate(logs):
            yield "run", log.name, number == k
    if all("output_velocity" in log or "output_position" in log for log in logs):
        yield from _by_motion(logs, counts)
    if all("temperature" in log for log in logs):
        temperature = _channel(logs, counts, "temperature")
        yield from bands("temperature", temperature, TEMPERATURE_BANDS, "°C")


def _by_motion(logs: Sequence[Log], counts: Sequence[Mask]) -> Iterator[tuple[str, str, Mask]]:
    still = _masks(logs, counts, standstill)
    velocity = _joined([output_velocity(log)[c] for log, c in zip(logs, counts, strict=True)])
    yield "direction", "forward", ~still & (velocity > 0)
    yield "direction", "backward", ~still & (velocity < 0)
    yield from bands("speed", np.where(still, np.nan, np.abs(velocity)), SPEED_BANDS, "rad/s")
    yield "direction", "standstill", still
    near = _masks(logs, counts, lambda log: near_reversal(log, REVERSAL_SECONDS))
    yield "reversals", f"within ±{REVERSAL_SECONDS:g} s of a reversal", near
    yield "reversals", "elsewhere", ~near


def bands(group: str, values: Array, count: int, unit: str) -> Iterator[tuple[str, str, Mask]]:
    """Yield bands of about as many rows each; one band is no news."""
    finite = values[np.isfinite(values)]
    if not len(finite):
        return
    edges = np.unique(np.quantile(finite, np.linspace(0.0, 1.0, count + 1)))
    edges = edges[np.concatenate([[True], np.diff(edges) > ROUND * (edges[-1] - edges[0])])]
    if len(edges) < 3:
        return
    told = told_apart(np.where(np.abs(edges) < ROUND * (edges[-1] - edges[0]), 0.0, edges).tolist())
    for (low, high), (first, end) in zip(pairwise(edges), pairwise(told), strict=True):
        last = high == edges[-1]
        mask = (values >= low) & ((values <= high) if last else (values < high))
        yield group, f"{first} to {end} {unit}", mask


def _channel(logs: Sequence[Log], counts: Sequence[Mask], channel: str) -> Array:
    parts = zip((log[channel] for log in logs), counts, strict=True)
    return _joined([values if c.all() else values[c] for values, c in parts])


def _joined(parts: Sequence[Array]) -> Array:
    """One array behind the other; a long one alone is not copied."""
    return parts[0] if len(parts) == 1 else np.concatenate(parts)


def _masks(logs: Sequence[Log], counts: Sequence[Mask], of: Callable[[Log], Mask]) -> Mask:
    return np.concatenate([of(log)[c] for log, c in zip(logs, counts, strict=True)])
