"""Terms of which each run has a coefficient of its own, while all others are common to all runs.

A payload differs between runs (gravity, inertia), a sensor is zeroed again (offset), a thermometer
is moved. With one coefficient for all runs the differences go where they can: into other terms, or
into what passes for very slow noise. With one for each of R runs

    y_r = X β + Z_r n_r + e,     r = 1 … R

Few runs have columns of their own. In many, Z is taken out of target and rows: with Q_r an
orthonormal basis of Z_r over the rows of the run that count [FrischWaugh1933], [Lovell1963],

    y_r − Q_r Q_rᵀ y_r = (X − Q_r Q_rᵀ X) β + …,     n_r = Z_r⁺ (y_r − X β)

to the last digit, so work and memory grow with the runs and not with their square. For the offset
alone Q is 1/√n, and that is `offsets.py`.

    cov n_r = σ² Hᵀ H + A_r cov β A_rᵀ,   H: columns of Z_r⁺ᵀ filtered by 1/A,   A_r = Z_r⁺ X

which leaves out what the run's own directions tell of β: nothing in white noise.

What can be told. A shift of the thermometer by ΔT makes c₁ ΔT of a linear drift: that is an offset,
and runs tell offsets from it only where the drift bends. A payload is gravity, sine and cosine, and
where the joint accelerates inertia; a run at one angle tells neither from an offset.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from flexspline.effects import Effect
from flexspline.effects.causes import OFFSET
from flexspline.errors import InputError, listed
from flexspline.least_squares.between_runs import BetweenRuns, OwnValues, between_runs
from flexspline.least_squares.estimate import Estimate, Given
from flexspline.least_squares.offsets import MANY_RUNS, TAIL, ZERO, offset_errors, root_of
from flexspline.least_squares.options import FitOptions, coefficient_names, resolve, shapes_of
from flexspline.least_squares.problem import Problem, columns_of
from flexspline.least_squares.result import Parameter
from flexspline.least_squares.uncertainty import Uncertainty

__all__ = [
    "compared_runs",
    "holding_own",
    "own_parameters",
    "own_terms",
    "projected_effects",
]

Array = NDArray[np.float64]

MOST_COLUMNS = 64  # of terms that are not: twice as many take eight times as long


def own_terms(
    effects: Sequence[Effect], how: FitOptions, fixed: Sequence[str], runs: int
) -> tuple[str, ...]:
    """Return the terms, "effect.term", of which each run has its own, in the order of the effects.

    Parameters
    ----------
    fixed : names of parameters that are not fitted.
    runs : how many there are.

    Raises
    ------
    InputError
        For a name that is no term, or a term that cannot be each run's own.
    """
    asked = [how.per_run] if isinstance(how.per_run, str) else [*how.per_run]
    names = coefficient_names(effects)
    if how.offset_per_run and ZERO not in names:
        raise InputError(f"offset_per_run needs the effect '{OFFSET}'; add it to the effects")
    asked += [OFFSET] if how.offset_per_run else []
    found: set[str] = set()
    for each in asked:
        effect = next((e for e in effects if e.name == each), None)
        if effect is not None:
            found |= {f"{each}.{term.name}" for term in effect.terms}
        else:
            found.add(names[resolve(each, names, "per_run")])
        _require_own(effects, each, fixed, runs)
    return tuple(name for name in names if name in found)


def _require_own(effects: Sequence[Effect], asked: str, fixed: Sequence[str], runs: int) -> None:
    """Refuse a term that cannot be each run's own."""
    name = asked.split(".")[0]
    effect = next(e for e in effects if name in (e.name, *(term.name for term in e.terms)))
    if runs < 2 and asked != OFFSET:
        raise InputError(
            f"per_run: '{asked}' of one run is that of all; give several runs, or leave it out"
        )
    if effect.ripple:
        raise InputError(
            f"per_run: the orders of {effect.name} are those of all runs; leave it out of per_run"
        )
    loose = [s.name for s in shapes_of([effect]) if not {s.name, s.info.name} & {*fixed}]
    if loose:
        raise InputError(
            f"per_run: {effect.name} has {listed(loose)}, which all runs share; fix it "
            f"(fixed, --fix {loose[0]}=VALUE), or leave {effect.name} out of per_run"
        )
    if "load" in effect.reads and any(e.info.carries_load for e in effects):
        raise InputError(
            f"per_run: {effect.name} depends on the load that inertia and gravity make; leave "
            "these out, or leave it out of per_run"
        )


def projected_effects(
    effects: Sequence[Effect], own: Sequence[str], runs: int, given: Given
) -> tuple[Effect, ...]:
    """Return the effects of own terms that are taken out of target and rows; () for none.

    These are many, have no shapes, make no load that others read, and nothing is known of one.

    Raises
    ------
    InputError
        Where they cannot be taken out and are too many for columns.
    """
    if not own or own == (ZERO,) or runs < MANY_RUNS:
        return ()
    its = tuple(e for e in effects if columns_of([e], own))
    asked = {*given.fixed, *given.bounds, *given.priors}
    known = asked & {part for name in own for part in (name, *name.split(".", 1))}
    known |= {name for name in asked if any(name.startswith(f"{e.name}.") for e in its)}
    carried = any(e.info.carries_load for e in its) and any("load" in e.reads for e in effects)
    if not (known or given.robust or carried or shapes_of(its)):
        return its
    if len(own) * runs > MOST_COLUMNS:
        why = (
            f"something is given of {listed(known)}" if known
            else "robust weighs each row" if given.robust
            else "other effects read the load that they make" if carried
            else f"{listed(s.name for s in shapes_of(its))} is one for all"
        )  # fmt: skip
        raise InputError(
            f"per_run: {len(own)} terms of {runs} runs are {len(own) * runs} coefficients, more "
            f"than {MOST_COLUMNS}, and {why}; fit fewer runs together, or leave that out"
        )
    return ()


def holding_own(given: Given, own: Sequence[str]) -> Given:
    """Return what is given, with terms that are taken out held at zero beside."""
    fixed = {**given.fixed, **dict.fromkeys(own, 0.0)}
    return Given(fixed, given.bounds, given.priors, given.robust)


def own_parameters(
    problem: Problem, made: Estimate, uncertainty: Uncertainty, units: Sequence[str]
) -> list[Parameter]:
    """Return what each run has of its own where that was taken out, run after run.

    `units`: of the terms in `problem.own`.
    """
    runs = [run.log.name for run in problem.runs]
    names = coefficient_names(problem.projected, runs, problem.own)[-len(runs) * len(problem.own) :]
    noise = uncertainty.noise
    freedom = float(max(noise.samples - noise.parameters, 1))
    quantile = float(student.ppf(0.975, freedom))
    white = noise.variance * noise.decimation
    found: list[Parameter] = []
    for number, (values, core, beside) in enumerate(_own_errors(problem, made, uncertainty)):
        basis = problem.own_basis(number)
        errors = np.sqrt(np.diag(core) + np.sum(beside**2, axis=1))
        shared = _towards(problem, made, number, basis.to_terms) @ uncertainty.basis
        naive = np.sqrt(
            white * np.sum(basis.to_terms**2, axis=1)
            + np.einsum("ij,jk,ik->i", shared, uncertainty.naive_core, shared)
        )
        for k, term in enumerate(values):
            told, error = not basis.hidden[k], float(errors[k])
            worth = uncertainty.rows * (naive[k] / error) ** 2 if error > 0.0 else float("nan")
            found.append(
                Parameter(
                    names[len(found)],
                    "coefficient",
                    float(term),
                    error,
                    float(naive[k]),
                    (float(term) - quantile * error, float(term) + quantile * error),
                    units[k],
                    "fitted" if told else "not determined",
                    told,
                    None,
                    float(worth),
                    freedom,
                )
            )
    return found


def _own_errors(
    problem: Problem, made: Estimate, uncertainty: Uncertainty
) -> Iterator[tuple[Array, Array, Array]]:
    """Give n_r (K,), σ² Hᵀ H (K, K), and U (K, F) with U Uᵀ = A_r cov β A_rᵀ, of each run."""
    root = root_of(uncertainty)
    for number, run in enumerate(problem.runs):
        basis = problem.own_basis(number)
        shared = problem.design(made.linear.effects).predict(
            run.channels, len(run), made.linear.coefficients
        )
        left = run.target - problem.smooth(run, np.asarray(shared))
        parts = [slice(first, last) for first, last in run.stretches]
        own = basis.to_terms @ sum(basis.rows[part].T @ left[part] for part in parts)
        core = basis.to_terms @ _filtered(problem, number, uncertainty) @ basis.to_terms.T
        yield own, core, _towards(problem, made, number, basis.to_terms) @ root


def _towards(problem: Problem, made: Estimate, number: int, to_terms: Array) -> Array:
    """A_r = Z_r⁺ X: what a run's own terms take of the shared ones, (K, F + S)."""
    run, basis = problem.runs[number], problem.own_basis(number)
    rows = made.tangent.whole(number)[:, : len(made.fitted) + len(made.free_shapes)]
    parts = [slice(first, last) for first, last in run.stretches]
    return np.asarray(to_terms @ sum(basis.rows[part].T @ rows[part] for part in parts))


def _filtered(problem: Problem, number: int, uncertainty: Uncertainty) -> Array:
    """σ² Hᵀ H of a run's orthonormal directions, (R, R)."""
    noise, basis, run = uncertainty.noise, problem.own_basis(number).rows, problem.runs[number]
    ringing = int(TAIL * noise.memory) + noise.order
    total = np.zeros((basis.shape[1], basis.shape[1]))
    for first, last in run.stretches:
        rows = basis[first : last : noise.decimation] * noise.decimation
        rows = np.vstack([rows, np.zeros((ringing, basis.shape[1]))])
        made = noise.filter(rows, np.zeros((noise.order, basis.shape[1])))[0]
        total += made.T @ made
    return noise.innovation_variance * total


def compared_runs(
    problem: Problem,
    made: Estimate,
    uncertainty: Uncertainty,
    parameters: Sequence[Parameter],
    effects: Sequence[Effect],
    residuals: Sequence[Array],
) -> tuple[BetweenRuns, ...]:
    """Return how each term that the runs have of their own differs between them; () of one run.

    Parameters
    ----------
    parameters : of the fit, those of single runs among them.
    effects : of the model, with those that were taken out.
    residuals : (N,) of each run, with its own values.
    """
    own = (ZERO,) if problem.centred else problem.own
    if not own or len(problem.runs) < 2:
        return ()
    runs = tuple(run.log.name for run in problem.runs)
    names = coefficient_names(effects, runs, own)
    shared = len(names) - len(own) * len(runs)
    by_name = {p.name: p for p in parameters}
    found = []
    errors = _all_errors(problem, made, uncertainty, own)
    for k, term in enumerate(own):
        its = [by_name[name] for name in names[shared + k :: len(own)]]
        told = np.array([p.determined for p in its])
        values = np.array([p.value for p in its])
        freedom = float(np.nanmin([p.degrees_of_freedom for p in its] or [np.nan]))
        kept = OwnValues(term, its[0].unit, runs, values, *errors[k], told, freedom)
        found.append(between_runs(kept))
    return _with_rmse(replace(problem, own=own), effects, found, residuals)


def _all_errors(
    problem: Problem, made: Estimate, uncertainty: Uncertainty, own: Sequence[str]
) -> list[tuple[Array, Array]]:
    """D (R,) and U (R, F) of each own term."""
    if problem.centred:
        return [offset_errors(problem, made, uncertainty)]
    if problem.projected:
        each = [
            (np.diag(core), beside) for _, core, beside in _own_errors(problem, made, uncertainty)
        ]
        return [
            (np.array([noise[k] for noise, _ in each]), np.array([u[k] for _, u in each]))
            for k in range(len(own))
        ]
    count = len(problem.runs)
    first = len(made.names) - len(own) * count
    return [
        _split(_covariance(made, uncertainty, list(range(first + k, len(made.names), len(own)))))
        for k in range(len(own))
    ]


def _covariance(made: Estimate, uncertainty: Uncertainty, numbers: Sequence[int]) -> Array:
    """Of coefficients by number; zero where one is fixed or at a bound."""
    found = np.zeros((len(numbers), len(numbers)))
    at = [k for k, number in enumerate(numbers) if number in made.fitted]
    rows = uncertainty.basis[np.searchsorted(made.fitted, [numbers[k] for k in at])]
    found[np.ix_(at, at)] = rows @ uncertainty.core @ rows.T
    return found


def _split(covariance: Array) -> tuple[Array, Array]:
    """D and U with D + U Uᵀ a covariance (R, R): half of the least eigenvalue, and the rest."""
    values, vectors = np.linalg.eigh(covariance)
    least = 0.5 * max(float(values[0]), 0.0)
    return np.full(len(values), least), vectors * np.sqrt(np.maximum(values - least, 0.0))


def _with_rmse(
    problem: Problem,
    effects: Sequence[Effect],
    terms: Sequence[BetweenRuns],
    residuals: Sequence[Array],
) -> tuple[BetweenRuns, ...]:
    """The terms with the error of each run, predicted with the mean of the others."""
    its = [effect for effect in effects if columns_of([effect], problem.own)]
    squares, rows = 0.0, 0
    for number, run in enumerate(problem.runs):
        shift = np.array([_from_others(term, number) for term in terms])
        columns = problem.own_rows(its, number)
        residual = residuals[number] + columns @ shift
        squares += sum(float(np.sum(residual[a:b] ** 2)) for a, b in run.stretches)
        rows += run.counted
    rmse = float(np.sqrt(squares / max(rows, 1)))
    return tuple(replace(term, new_run_rmse=rmse) for term in terms)


def _from_others(term: BetweenRuns, number: int) -> float:
    """What a run has more than the mean of the others that determine theirs."""
    values, told = np.array(term.values), np.array(term.determined)
    told[number] = False
    return float(values[number] - values[told].mean()) if told.any() else 0.0
