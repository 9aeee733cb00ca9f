"""One offset for each of many runs, without a column for each.

The offset of a run is in no other run. Least squares beside it is least squares on rows and target
less their means in the run [FrischWaugh1933], [Lovell1963],

    y − X β − o_r  →  (y − ȳ_r) − (X − X̄_r) β,     o_r = ȳ_r − X̄_r β

to the last digit, so work and memory grow with the runs and not with their square. The error of an
offset is that of the mean of the noise in its run and of the terms that all runs share:

    var o_r = σ² Σ_t h_t² + X̄_r cov β X̄_rᵀ,     h: 1/n in each of the run's rows, filtered by 1/A

which leaves out what the mean of a run tells of β: nothing in white noise.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from flexspline.effects import Effect, unit_in
from flexspline.effects.causes import OFFSET
from flexspline.least_squares.estimate import Estimate, Given, residuals_of
from flexspline.least_squares.options import coefficient_names
from flexspline.least_squares.problem import Problem, Run
from flexspline.least_squares.result import Parameter
from flexspline.least_squares.uncertainty import Uncertainty
from flexspline.logs.log import Log

__all__ = [
    "MANY_RUNS",
    "TAIL",
    "ZERO",
    "offset_errors",
    "offset_parameters",
    "own_parameter",
    "root_of",
    "taken_out",
]

Array = NDArray[np.float64]

ZERO = f"{OFFSET}.{OFFSET}"
MANY_RUNS = 16  # from which offsets are taken out; few are columns, whose intervals were tested
TAIL = 8  # times the noise's memory that a filter rings on


def taken_out(effects: Sequence[Effect], logs: Sequence[Log], given: Given) -> bool:
    """Whether the runs' offsets can be taken out: many, with nothing known of one alone."""
    if len(logs) < MANY_RUNS or given.robust or OFFSET not in [e.name for e in effects]:
        return False
    names = coefficient_names(effects, [log.name for log in logs], (ZERO,))
    offsets = [name for name in names if name.startswith(f"{OFFSET}.")]
    parts = {part for name in offsets for part in (name, *name.split(".", 1))}
    return not parts & {*given.fixed, *given.bounds, *given.priors}


def offset_parameters(
    problem: Problem, made: Estimate, uncertainty: Uncertainty, offset: Effect
) -> list[Parameter]:
    """Return the offset of each run with its error, in the order of the runs."""
    runs = [run.log.name for run in problem.runs]
    names = coefficient_names([offset], runs, (ZERO,))
    unit = unit_in(offset.terms[0].unit, problem.target, problem.known_load)
    width = len(made.fitted) + len(made.free_shapes)
    noise, covariance = uncertainty.noise, uncertainty.covariance
    spread = _residual_variance(problem, made, uncertainty)
    white = uncertainty.basis @ uncertainty.naive_core @ uncertainty.basis.T
    found = []
    for name, run, mean in zip(names, problem.runs, _means(made, width), strict=True):
        value = _value(problem, made, run)
        of_mean = noise.innovation_variance * _squares(run, uncertainty)
        error = float(np.sqrt(of_mean + mean @ covariance @ mean))
        independent = run.counted / noise.decimation
        naive = float(np.sqrt(spread / independent + mean @ white @ mean))
        found.append(own_parameter(name, value, error, naive, unit, uncertainty))
    return found


def own_parameter(
    name: str, value: float, error: float, naive: float, unit: str, uncertainty: Uncertainty,
    told: bool = True,
) -> Parameter:  # fmt: skip
    """Return a coefficient of one run that was taken out; `told`: whether the run determines it."""
    freedom = float(max(uncertainty.noise.samples - uncertainty.noise.parameters, 1))
    quantile = float(student.ppf(0.975, freedom))
    ends = (value - quantile * error, value + quantile * error)
    worth = uncertainty.rows * (naive / error) ** 2 if error > 0.0 else float("nan")
    state = "fitted" if told else "not determined"
    return Parameter(
        name, "coefficient", value, error, naive, ends, unit, state, told, None, worth, freedom
    )


def offset_errors(
    problem: Problem, made: Estimate, uncertainty: Uncertainty
) -> tuple[Array, Array]:
    """Return σ² Σ h², (R,), and U (R, F) with U Uᵀ = X̄ cov β X̄ᵀ, of the runs' offsets."""
    width = len(made.fitted) + len(made.free_shapes)
    noise = [uncertainty.noise.innovation_variance * _squares(r, uncertainty) for r in problem.runs]
    return np.array(noise), np.array([*_means(made, width)]) @ root_of(uncertainty)


def root_of(uncertainty: Uncertainty) -> Array:
    """Return B (P, K) with B Bᵀ = cov β."""
    values, vectors = np.linalg.eigh(uncertainty.core)
    return np.asarray(uncertainty.basis @ (vectors * np.sqrt(np.maximum(values, 0.0))))


def _value(problem: Problem, made: Estimate, run: Run) -> float:
    """o_r = ȳ_r − X̄_r β"""
    design = problem.design(made.linear.effects)
    shared = np.asarray(design.predict(run.channels, len(run), made.linear.coefficients))
    return float(run.mean(run.target) - run.mean(problem.smooth(run, shared)))


def _residual_variance(problem: Problem, made: Estimate, uncertainty: Uncertainty) -> float:
    """s², of residuals as if they were white."""
    squares = sum(
        float(residual[first:last] @ residual[first:last])
        for run, residual in zip(problem.runs, residuals_of(problem, made.linear), strict=True)
        for first, last in run.stretches
    )
    free = max(uncertainty.rows - uncertainty.noise.parameters, 1)
    return squares / sum(run.counted for run in problem.runs) * uncertainty.rows / free


def _means(made: Estimate, width: int) -> Iterator[Array]:
    """X̄ of each run, (F + S,)."""
    tangent = made.tangent
    for number, run in enumerate(tangent.problem.runs):
        rows = tangent.whole(number)[:, :width]
        yield run.mean(rows)


def _squares(run: Run, uncertainty: Uncertainty) -> float:
    """Σ h²."""
    noise, total = uncertainty.noise, 0.0
    ringing = int(TAIL * noise.memory) + noise.order
    for first, last in run.stretches:
        share = np.zeros((-(-(last - first) // noise.decimation) + ringing, 1))
        share[: len(share) - ringing] = noise.decimation / run.counted
        total += float(np.sum(noise.filter(share, np.zeros((noise.order, 1)))[0] ** 2))
    return total
