"""Terms of which each run has a coefficient of its own, while all others are common to all runs.

A payload differs between runs (gravity, inertia), a sensor is zeroed again (offset), a thermometer
is moved. With one coefficient for all runs the differences go where they can: into other terms, or
into what passes for very slow noise. With one for each of R runs

    y_r = X β + Z_r n_r + e,     r = 1 … R

Few runs have columns of their own. In many, Z is taken out of target and rows: with Q_r an
orthonormal basis of Z_r over the rows of the run that count [FrischWaugh1933], [Lovell1963],

    y_r − Q_r Q_rᵀ y_r = (X − Q_r Q_rᵀ X) β + …,     n_r = Z_r⁺ (y_r − X β)

to the last digit, so work and memory grow with the runs and not with their square. For the offset
alone Q is 1/√n (below).

    cov n_r = σ² Hᵀ H + A_r cov β A_rᵀ,   H: columns of Z_r⁺ᵀ filtered by 1/A,   A_r = Z_r⁺ X

which leaves out what the run's own directions tell of β: nothing in white noise.

What can be told. A shift of the thermometer by ΔT makes c₁ ΔT of a linear drift: that is an offset,
and runs tell offsets from it only where the drift bends. A payload is gravity, sine and cosine, and
where the joint accelerates inertia; a run at one angle tells neither from an offset.

One offset for each of many runs. Least squares beside it is least squares on rows and target less
their means in the run,

    y − X β − o_r  →  (y − ȳ_r) − (X − X̄_r) β,     o_r = ȳ_r − X̄_r β

and the error of an offset is that of the mean of the noise in its run and of the terms that all
runs share:

    var o_r = σ² Σ_t h_t² + X̄_r cov β X̄_rᵀ,     h: 1/n in each of the run's rows, filtered by 1/A

which leaves out what the mean of a run tells of β: nothing in white noise.

Whether such values differ between the runs, and by how much. Of R values n_r with covariance Σ = D
+ U Uᵀ (D: noise of each run, U: terms that all share)

    n̄ = Σ n_r / R,   s² = Σ (n_r − n̄)² / (R − 1),   v = 1ᵀΣ1 / R²   (variance of n̄)
    τ² = max(s² − (tr Σ − R v) / (R − 1), 0)

over the runs that determine their own. τ is the spread between runs. A new run has n̄ ± e with

    e² = τ² (1 + 1/R) + v

Test (Wald) of whether one value for all would do, with m the best one,

    F = min over m of (n − m)ᵀ Σ⁻¹ (n − m) / (R − 1)  ~  F(R − 1, ν),    ν of the errors

by Σ⁻¹ = D⁻¹ − D⁻¹ U (I + Uᵀ D⁻¹ U)⁻¹ Uᵀ D⁻¹, so that work and memory grow with R alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexspline.effects import Effect, unit_in
from flexspline.effects.causes import OFFSET
from flexspline.errors import InputError, listed
from flexspline.formatting import short_names
from flexspline.least_squares.estimate import Estimate, Given, residuals_of
from flexspline.least_squares.identifiability import NEGLIGIBLE, Confounded
from flexspline.least_squares.options import FitOptions, coefficient_names, resolve, shapes_of
from flexspline.least_squares.problem import OwnBasis, Problem, Run, columns_of, own_basis_of
from flexspline.least_squares.result import Parameter
from flexspline.least_squares.uncertainty import Uncertainty, half_widths
from flexspline.least_squares.validation import steps_without_runs
from flexspline.logs.log import Log

__all__ = [
    "LEVEL",
    "MANY_RUNS",
    "ZERO",
    "BetweenRuns",
    "OwnValues",
    "between_runs",
    "compared_runs",
    "holding_own",
    "offset_parameters",
    "own_parameters",
    "own_terms",
    "own_warnings",
    "projected_effects",
    "taken_out",
    "with_own",
]

Array = NDArray[np.float64]

MOST_COLUMNS = 64  # of terms that are not: twice as many take eight times as long

ZERO = f"{OFFSET}.{OFFSET}"
MANY_RUNS = 16  # from which offsets are taken out; few are columns, whose intervals were tested
TAIL = 8  # times the noise's memory that a filter rings on

LEVEL = 0.01
"""Chance that a term is said to differ between runs that does not; as of zeros in a calibration.

Measured in coloured noise, two terms each: 2.0 % of 300 fits of 5 runs, 0.3 % of 150 fits of 20.
"""

LOOSE = 10.0
"""Times the median error from which a run is said not to determine its own value.

Half and twice of it say so of the same runs wherever a run stands still that others move in.
"""


@dataclass(frozen=True, eq=False)
class OwnValues:
    """One term as R runs have it, in `unit`: values, their errors as D (R,) and U (R, F).

    `told`: (R,), runs that determine it. `freedom`: of the errors.
    """

    term: str
    unit: str
    runs: tuple[str, ...]
    values: Array
    own_variance: Array
    shared: Array
    told: NDArray[np.bool_]
    freedom: float

    @property
    def errors(self) -> Array:
        """Standard errors, (R,)."""
        return np.asarray(np.sqrt(self.own_variance + np.sum(self.shared**2, axis=1)))


@dataclass(frozen=True)
class BetweenRuns:
    """One term of which each run has its own, in `unit`.

    Parameters
    ----------
    term : "effect.term".
    runs, values, standard_errors : of each run, (R,).
    determined : (R,), whether the run determines its value; others do not count below. The
        standard error of a value that is fixed or at a bound is 0, and it is not determined.
    mean : what the model predicts a new run with.
    spread : standard deviation between the runs, without what the errors make of it.
    new_run_error : standard error of `mean` as the value of a new run, with as many degrees of
        freedom as there are runs that determine theirs, less one.
    p : of the test that one value would do for all runs; NaN where fewer than two determine it.
    new_run_rmse : RMS residual, in the target's unit, of all runs, each predicted by a fit to the
        others with their means; one number for all terms of a fit. NaN where none of the others
        determines a term. Shapes follow along the tangent.
    """

    term: str
    unit: str
    runs: tuple[str, ...]
    values: tuple[float, ...]
    standard_errors: tuple[float, ...]
    determined: tuple[bool, ...]
    mean: float
    spread: float
    new_run_error: float
    p: float
    new_run_rmse: float = float("nan")

    @property
    def differs(self) -> bool:
        """Whether the runs differ by more than noise makes them once in a hundred fits."""
        return self.p < LEVEL

    @property
    def verdict(self) -> str:
        """Whether the runs differ, in words."""
        if sum(self.determined) < 2:
            return "fewer than two runs determine it"
        if not np.isfinite(self.p):
            return "there is no noise by which a difference could be judged"
        chance = "< 0.0001" if self.p < 1e-4 else f"= {self.p:.3g}"
        if self.differs:
            return f"the runs differ (p {chance})"
        return (
            f"no difference between the runs is shown (p {chance}, level {LEVEL:g}); one for all "
            "may do"
        )

    def to_json(self) -> dict[str, Any]:
        """Return the term as `model.json` keeps it."""
        return {**asdict(self), "differs": self.differs}


def between_runs(own: OwnValues) -> BetweenRuns:
    """Return mean, spread and test of one term."""
    told = _told(own)
    count = int(told.sum())
    values = own.values[told] if count else own.values
    mean, spread, error = float(values.mean()), float("nan"), float("nan")
    if count > 1:
        around = float(values.var(ddof=1))
        noise, shared = own.own_variance[told], own.shared[told]
        of_mean = float((noise.sum() + np.sum(shared.sum(axis=0) ** 2)) / count**2)
        of_errors = float(noise.sum() + np.sum(shared**2) - count * of_mean) / (count - 1)
        spread = float(np.sqrt(max(around - of_errors, 0.0)))
        error = float(np.sqrt(spread**2 * (1.0 + 1.0 / count) + of_mean))
    return BetweenRuns(
        own.term,
        own.unit,
        own.runs,
        tuple(own.values.tolist()),
        tuple(own.errors.tolist()),
        tuple(told.tolist()),
        mean,
        spread,
        error,
        _chance(own, told),
    )


def _told(own: OwnValues) -> NDArray[np.bool_]:
    """Runs that determine their value about as well as the others do, (R,)."""
    if not own.told.any():
        return own.told
    usual = float(np.median(own.errors[own.told]))
    return np.asarray(own.told & (own.errors <= LOOSE * usual))


def _chance(own: OwnValues, told: NDArray[np.bool_]) -> float:
    """P(F > what is seen); NaN for less than two values, or of exact ones."""
    from scipy.stats import f

    count = int(told.sum())
    noise, shared = own.own_variance[told], own.shared[told]
    if count < 2 or not (noise > 0.0).all():
        return float("nan")

    def weighed(values: Array) -> Array:
        """Σ⁻¹ values."""
        over = shared / noise[:, None]
        inner = np.eye(shared.shape[1]) + shared.T @ over
        return np.asarray(values / noise - over @ np.linalg.solve(inner, over.T @ values))

    ones, values = np.ones(count), own.values[told]
    best = float(ones @ weighed(values)) / float(ones @ weighed(ones))
    apart = values - best
    squares = max(float(apart @ weighed(apart)), 0.0)
    return float(f.sf(squares / (count - 1), count - 1, own.freedom))


def own_warnings(terms: Sequence[BetweenRuns]) -> list[str]:
    """Return a sentence for each term that some runs do not determine."""
    said = []
    for each in terms:
        every = zip(each.runs, each.determined, each.standard_errors, strict=True)
        loose = [run for run, known, error in every if not known and error != 0.0]
        if loose:
            said.append(
                f"{each.term}: {listed(loose, 6)} do{'es' if len(loose) == 1 else ''} not "
                f"determine {'its' if len(loose) == 1 else 'their'} own value and do"
                f"{'es' if len(loose) == 1 else ''} not count in its mean and spread; record runs "
                "that move so that they tell it from other terms"
            )
    return said


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
        its = [name for name in names if name.split(".")[0] == each]
        its = its or [names[resolve(each, names, "per_run")]]
        _require_own(effects, its[0].split(".")[0], fixed)
        found |= {*its}
    if runs < 2 and found - {ZERO}:
        raise InputError(
            f"per_run: nothing differs between the runs where there is one alone; give several, or "
            f"leave {listed(map(short_names, sorted(found)))} out"
        )
    return tuple(name for name in names if name in found)


def _require_own(effects: Sequence[Effect], name: str, fixed: Sequence[str]) -> None:
    """Refuse terms of an effect that cannot be each run's own."""
    effect = next(e for e in effects if e.name == name)
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
    words = {word for name in own for word in name.split(".")}
    asked = [*given.fixed, *given.bounds, *given.priors]
    known = [name for name in asked if words & {*name.split(".")}]
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
    white = uncertainty.noise.variance * uncertainty.noise.decimation
    found: list[Parameter] = []
    for number, (values, core, beside) in enumerate(_own_errors(problem, made, uncertainty)):
        basis = problem.own_basis(number)
        errors = np.sqrt(np.diag(core) + np.sum(beside**2, axis=1))
        shared = _towards(problem, made, number, basis) @ uncertainty.basis
        naive = np.sqrt(
            white * np.sum(basis.to_terms**2, axis=1)
            + np.einsum("ij,jk,ik->i", shared, uncertainty.naive_core, shared)
        )
        for k, term in enumerate(values):
            name, numbers = names[len(found)], (float(term), float(errors[k]), float(naive[k]))
            told = not basis.hidden[k]
            found.append(_own_parameter(name, *numbers, units[k], uncertainty, told))
    return found


def with_own(
    confounded: Sequence[Confounded],
    problem: Problem,
    made: Estimate,
    effects: Sequence[Effect],
    names: Sequence[str],
) -> list[Confounded]:
    """Return the groups with those own terms that were taken out and make the same of their run.

    A common term that is constant in each run is an offset there: of what is taken out it leaves
    nothing, which looks as if the runs did not excite it.

    Parameters
    ----------
    problem : with `own`; effects : that have them; names : of the parameters, run after run.
    """
    directions, fitted = made.linear.solution.null_space, [made.names[k] for k in made.fitted]
    if not directions.shape[1]:
        return [*confounded]
    moved = np.array([
        _moved_own(problem, made, number, effects, directions)
        for number in range(len(problem.runs))
    ])  # fmt: skip
    moved = moved.reshape(len(names), -1)
    found = []
    for group in confounded:
        members = directions[[fitted.index(name) for name in group.names]]
        its = np.abs(members).max(axis=0) > NEGLIGIBLE * np.abs(directions).max(axis=0)
        more = [name for name, one in zip(names, moved, strict=True) if one[its].any()]
        found.append(replace(group, names=(*group.names, *more)))
    return found


def _moved_own(
    problem: Problem, made: Estimate, number: int, effects: Sequence[Effect], directions: Array
) -> NDArray[np.bool_]:
    """Which of a run's own terms move along directions of the common coefficients: (K, n)."""
    run, columns = problem.runs[number], problem.own_rows(effects, number)
    rows = made.tangent.whole(number)[:, : len(directions)]
    parts = [slice(first, last) for first, last in run.stretches]
    sizes = sum(np.sum(rows[part] ** 2, axis=0) for part in parts) ** 0.5 @ np.abs(directions)
    lengths = sum(np.sum(columns[part] ** 2, axis=0) for part in parts) ** 0.5
    towards = _towards(problem, made, number, own_basis_of(run, columns))
    shares = lengths[:, None] * np.abs(towards[:, : len(directions)] @ directions)
    return np.asarray(shares > NEGLIGIBLE * np.maximum(sizes, 1e-300))


def _own_errors(
    problem: Problem, made: Estimate, uncertainty: Uncertainty
) -> Iterator[tuple[Array, Array, Array]]:
    """Give n_r (K,), σ² Hᵀ H (K, K), and U (K, F) with U Uᵀ = A_r cov β A_rᵀ, of each run."""
    root = _root_of(uncertainty)
    for number, run in enumerate(problem.runs):
        basis = problem.own_basis(number)
        shared = problem.design(made.linear.effects).predict(
            run.channels, len(run), made.linear.coefficients
        )
        left = run.target - problem.smooth(run, np.asarray(shared))
        parts = [slice(first, last) for first, last in run.stretches]
        own = basis.to_terms @ sum(basis.rows[part].T @ left[part] for part in parts)
        core = basis.to_terms @ _filtered(problem, number, uncertainty) @ basis.to_terms.T
        yield own, core, _towards(problem, made, number, basis) @ root


def _towards(problem: Problem, made: Estimate, number: int, basis: OwnBasis) -> Array:
    """A_r = Z_r⁺ X: what a run's own terms take of the shared ones, (K, F + S)."""
    rows = made.tangent.whole(number)[:, :-1]
    parts = [slice(first, last) for first, last in problem.runs[number].stretches]
    return np.asarray(basis.to_terms @ sum(basis.rows[part].T @ rows[part] for part in parts))


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
        told = np.array([p.determined and p.standard_error > 0.0 for p in its])
        values = np.array([p.value for p in its])
        freedom = float(np.nanmin([p.degrees_of_freedom for p in its] or [np.nan]))
        kept = OwnValues(term, its[0].unit, runs, values, *errors[k], told, freedom)
        found.append(between_runs(kept))
    return _with_rmse(replace(problem, own=own), made, effects, found, residuals)


def _all_errors(
    problem: Problem, made: Estimate, uncertainty: Uncertainty, own: Sequence[str]
) -> list[tuple[Array, Array]]:
    """D (R,) and U (R, F) of each own term."""
    if problem.centred:
        return [_offset_errors(problem, made, uncertainty)]
    if problem.projected:
        each = [
            (np.diag(core), beside) for _, core, beside in _own_errors(problem, made, uncertainty)
        ]
        return [
            (np.array([noise[k] for noise, _ in each]), np.array([u[k] for _, u in each]))
            for k in range(len(own))
        ]
    first = len(made.names) - len(own) * len(problem.runs)
    numbers = [np.arange(first + k, len(made.names), len(own)) for k in range(len(own))]
    return [_split(made, uncertainty, its) for its in numbers]


def _split(
    made: Estimate, uncertainty: Uncertainty, numbers: NDArray[np.intp]
) -> tuple[Array, Array]:
    """D and U with D + U Uᵀ the covariance of coefficients by number; zero of one that is held.

    D is half of the least eigenvalue.
    """
    free = np.isin(numbers, made.fitted)
    rows = uncertainty.basis[np.searchsorted(made.fitted, numbers[free])]
    values, vectors = np.linalg.eigh(rows @ uncertainty.core @ rows.T)
    least = 0.5 * max(float(values.min(initial=np.inf)), 0.0)
    noise, shared = np.zeros(len(numbers)), np.zeros((len(numbers), len(values)))
    noise[free] = least
    shared[free] = vectors * np.sqrt(np.maximum(values - least, 0.0))
    return noise, shared


def _with_rmse(
    problem: Problem,
    made: Estimate,
    effects: Sequence[Effect],
    terms: Sequence[BetweenRuns],
    residuals: Sequence[Array],
) -> tuple[BetweenRuns, ...]:
    """The terms with the error of runs that the fit has not seen.

    Without run r the common terms are β + δ (`validation.py`), the own terms of the others
    n_s − A_s δ, and what is left of r

        e_r − X_r δ + Z_r (n_r − m),     m = mean over s ≠ r of n_s − A_s δ
    """
    its = [effect for effect in effects if columns_of([effect], problem.own)]
    columns = [problem.own_rows(its, number) for number in range(len(problem.runs))]
    bases = [own_basis_of(*both) for both in zip(problem.runs, columns, strict=True)]
    towards = np.array([_towards(problem, made, *both) for both in enumerate(bases)])
    values = np.array([term.values for term in terms]).T
    told = np.array([term.determined for term in terms]).T
    others = told.sum(axis=0) - told
    if not others.all():
        return tuple(terms)
    alone = len(problem.own_columns(made.linear.effects)) * len(problem.runs)
    common = np.ones(len(made.fitted) + len(made.free_shapes), dtype=bool)
    common[: len(made.fitted)] = made.fitted < len(made.names) - alone
    squares, rows = 0.0, 0
    for number, step in enumerate(steps_without_runs(made)):
        run, step = problem.runs[number], np.where(common, step, 0.0)
        moved = values - towards @ step
        mean = (np.sum(told * moved, axis=0) - told[number] * moved[number]) / others[number]
        left = residuals[number] - made.tangent.whole(number)[:, :-1] @ step
        left += columns[number] @ (values[number] - mean)
        squares += sum(float(np.sum(left[a:b] ** 2)) for a, b in run.stretches)
        rows += run.counted
    rmse = float(np.sqrt(squares / max(rows, 1)))
    return tuple(replace(term, new_run_rmse=rmse) for term in terms)


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
        found.append(_own_parameter(name, value, error, naive, unit, uncertainty))
    return found


def _own_parameter(
    name: str, value: float, error: float, naive: float, unit: str, uncertainty: Uncertainty,
    told: bool = True,
) -> Parameter:  # fmt: skip
    """Return a coefficient of one run that was taken out; `told`: whether the run determines it."""
    freedom = float(max(uncertainty.noise.samples - uncertainty.noise.parameters, 1))
    half = float(half_widths(error, freedom))
    ends = (value - half, value + half)
    worth = uncertainty.rows * (naive / error) ** 2 if error > 0.0 else float("nan")
    state = "fitted" if told else "not determined"
    return Parameter(
        name, "coefficient", value, error, naive, ends, unit, state, told, None, worth, freedom
    )


def _offset_errors(
    problem: Problem, made: Estimate, uncertainty: Uncertainty
) -> tuple[Array, Array]:
    """Return σ² Σ h², (R,), and U (R, F) with U Uᵀ = X̄ cov β X̄ᵀ, of the runs' offsets."""
    width = len(made.fitted) + len(made.free_shapes)
    noise = [uncertainty.noise.innovation_variance * _squares(r, uncertainty) for r in problem.runs]
    return np.array(noise), np.array([*_means(made, width)]) @ _root_of(uncertainty)


def _root_of(uncertainty: Uncertainty) -> Array:
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
