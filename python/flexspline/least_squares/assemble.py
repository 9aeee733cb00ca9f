"""From an estimate to a `Fit`: errors, confounded groups, scores, and the model to keep.

Generalised least squares take the place of plain ones where the model is adequate. In
autocorrelated noise, e = A⁻¹ w, plain least squares treats slow noise as independent samples.
Filtered by A rows and target have white noise, and least squares on them is the best there is
([Aitken1936]; A from the residual: [CochraneOrcutt1949]),

    β_g = (X̃ᵀX̃)⁻¹ X̃ᵀỹ,     cov β_g = σ² (X̃ᵀX̃)⁻¹,     X̃ = A X

if the model is right. If it lacks something, both are biased, each in its own way, and the plain
fit is the one that predicts. The distance between them tells [Hausman1978]:

    H = (β_g − β)ᵀ (cov β − cov β_g)⁺ (β_g − β)     χ² with the rank's degrees of freedom

over the directions that generalised least squares knows better. So do held-out rows, which a wrong
model fitted to fast changes predicts worse. The test alone lets many wrong models pass, whose
misfit looks like slow noise; the held-out rows do not.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from flexspline.effects import Effect, unit_in
from flexspline.effects.causes import INERTIA, LOAD_SCALES
from flexspline.errors import InputError
from flexspline.formatting import plus_minus, short, short_names
from flexspline.least_squares.derived import loop_warnings, sign_warnings
from flexspline.least_squares.estimate import (
    Estimate,
    counts_of,
    newton,
    noise_of,
    read_of,
    residuals_of,
)
from flexspline.least_squares.identifiability import Confounded, confounded_groups
from flexspline.least_squares.late_load import Beside, LateLoad, basis_beside
from flexspline.least_squares.noise_model import Chunk, Chunks, noise_beside_own, noise_model
from flexspline.least_squares.options import bounds_of
from flexspline.least_squares.per_run_terms import (
    ZERO,
    BetweenRuns,
    compared_runs,
    offset_parameters,
    own_parameters,
    own_warnings,
    with_own,
)
from flexspline.least_squares.problem import (
    Problem,
    Run,
    columns_of,
    memory_warnings,
    noise_of_acceleration,
    noise_of_load,
    target_range,
    unresolved_speed,
)
from flexspline.least_squares.result import Delay, Fit, FittedRun, Parameter
from flexspline.least_squares.ripple import late_ripple_warnings
from flexspline.least_squares.shapes import Tangent, filtered
from flexspline.least_squares.uncertainty import (
    Prior,
    Uncertainty,
    parameter_uncertainty,
)
from flexspline.least_squares.validation import scores_of
from flexspline.logs.channel_noise import ChannelNoise
from flexspline.model import Model, Part
from flexspline.parallel import together
from flexspline.schema import plain_json

__all__ = ["assembled", "generalised", "uncertainty_of"]

Array = NDArray[np.float64]

BOUND = {-1: "at lower bound", 0: "fitted", 1: "at upper bound"}
WIDTH = "direction_width"
# Of a width: those that were off by a fifth and more were known to more than this, those that were
# known to less were off by 2 % at most. At half of it strokes behind 20 bit count too; at twice of
# it widths do not that are off by five standard errors of their noise.
RESOLVED = 0.1
LOOSE = 1.0  # a shape whose error is larger than itself is not determined

MOST_ROWS = 1_000_000  # above, what slow noise costs a fit is little
CONTRADICTED = 3.0  # standard errors: by chance one right prior of 370 is as far from its data
LEFT_BY_PRIOR = 1e-6  # share of an estimate that is not its prior's, from which the rest is known
APART = 0.01  # share of right models that the test holds for wrong
WORSE = 1.03  # times the plain fit's error on held-out rows at most; in slow noise both vary
ADDED = 0.3  # of a direction's variance, that it may seem to add: what starts a filter is lost
TOLD = 0.02  # of a direction's variance, that generalised least squares takes off it at least


def generalised(made: Estimate) -> Estimate | None:
    """Return the estimate by generalised least squares; None where the plain one is to stay.

    That is where the noise has no memory, where rows are weighed otherwise (low pass, robust,
    priors), where logs are long or so short that their noise is not known, where a bound is in the
    way, where nothing is gained, and where the two are too far apart for a right model or the plain
    one predicts better.
    """
    problem, tangent = made.tangent.problem, made.tangent
    rows = sum(run.counted for run in problem.runs)
    weighed = problem.lowpass is not None or tangent.weights is not None or len(made.prior_rows)
    if weighed or rows > MOST_ROWS or not made.basis.size:
        return None
    plain = made.uncertainty
    if not plain.noise.order:
        return None
    best = newton(replace(made, denominator=plain.noise.denominator))
    try:
        if best is None or not _same(made, best, plain, best.uncertainty):
            return None
        return best if _left_out(best) <= WORSE * _left_out(made) else None
    except InputError:  # too few rows are left once filters have started
        return None


def _same(plain: Estimate, other: Estimate, of_plain: Uncertainty, of_other: Uncertainty) -> bool:
    """Whether two estimates are as near to each other as those of a right model (Hausman)."""
    step = np.linalg.pinv(plain.basis) @ (_values(other) - _values(plain))
    values, vectors = np.linalg.eigh(of_plain.core)
    seen = values > 1e-12 * values[-1]
    to_one = vectors[:, seen] / np.sqrt(values[seen])
    gained, ways = np.linalg.eigh(to_one.T @ (of_plain.core - of_other.core) @ to_one)
    told = gained > TOLD
    if not told.any() or (gained < -ADDED).any():
        return False
    apart = ways[:, told].T @ (to_one.T @ step)
    return bool(np.sum(apart**2 / gained[told]) <= chi2.isf(APART, int(told.sum())))


def _left_out(made: Estimate) -> float:
    """RMS of what a fit to the others leaves of each fold."""
    residuals = np.concatenate(made.validation.residuals)
    return float(np.sqrt(np.nanmean(residuals**2)))


def _values(made: Estimate) -> Array:
    """Of fitted coefficients and free shapes, in this order."""
    shapes = [shape.value(made.linear.effects) for shape in made.free_shapes]
    return np.concatenate([made.linear.coefficients[made.fitted], shapes])


def uncertainty_of(made: Estimate, columns: Sequence[Array] | None = None) -> Uncertainty:
    """Return the errors of fitted coefficients and free shapes, in this order.

    `columns`: one of each run, (N,), beside which the estimate was made; its error comes last.
    """
    if made.denominator is not None:
        return _generalised(made, made.denominator)
    every, basis, known = read_of(made), made.basis, made.prior_rows
    tangent: Tangent | Beside = made.tangent
    if columns is not None:
        tangent = Beside(made.tangent, tuple(columns))
        basis = basis_beside(made, columns)
        known = np.hstack([known, np.zeros((len(known), 1))])
    problem, chunks = made.tangent.problem, tangent.some(every)
    if problem.projected:
        noise = noise_beside_own(tangent, problem, basis)
    else:
        noise = noise_model(chunks, basis, decimation=problem.decimation, offsets=problem.centred)
    prior = None
    if len(known):  # weighed against every row, while the noise model may skip some
        scale = np.sqrt(noise.decimation)
        errors = np.full(len(known), np.sqrt(made.noise_variance) / scale)
        prior = Prior(known / scale, errors)
    rows = sum(run.counted for run in problem.runs) // noise.decimation
    if every > 1:
        return parameter_uncertainty(chunks, basis, noise, prior, rows)
    left_out = sum(last - first for run in problem.runs for first, last in _rows_left_out(run))
    chunks = _going_on(tangent, problem) if left_out else chunks
    left_out //= noise.decimation
    return parameter_uncertainty(chunks, basis, noise, prior, left_out=left_out)


def _rows_left_out(run: Run) -> list[tuple[int, int]]:
    """Row ranges [first, last) between rows that count, through which the recording goes on."""
    return [
        (end, start)
        for (_, end), (start, _) in pairwise(run.stretches)
        if start > end and any(a < end and start < b for a, b in run.whole or ())
    ]


def _going_on(tangent: Tangent | Beside, problem: Problem) -> Chunks:
    """The rows of a fit, and rows of nothing where some inside a run do not count.

    Noise goes on while rows are left out, and couples what stands on both sides.
    """

    def chunks() -> Iterator[Chunk]:
        gaps = [{start: start - end for end, start in _rows_left_out(run)} for run in problem.runs]
        for number, rows, chunk in tangent.pieces():
            gap = gaps[number].get(rows.start, 0)
            if gap:
                nothing = np.zeros(gap)
                on = np.zeros(gap, dtype=bool)
                yield Chunk(np.zeros((gap, chunk.rows.shape[1])), nothing, on)
                chunk = replace(chunk, starts=np.zeros(len(chunk.residual), dtype=bool))
            yield chunk

    return chunks


def _generalised(made: Estimate, denominator: Array) -> Uncertainty:
    """Errors on the filtered rows; what else is told of the noise is that of the rows as such."""
    noise = noise_of(made)
    plain = parameter_uncertainty(made.tangent, made.basis, noise)
    chunks = filtered(made.tangent, denominator)
    found = parameter_uncertainty(chunks, made.basis, noise_model(chunks, made.basis))
    freedom = np.minimum(found.degrees_of_freedom, plain.degrees_of_freedom)
    return replace(plain, core=found.core, degrees_of_freedom=freedom)


def assembled(
    problem: Problem,
    made: Estimate,
    into: Model | None,
    warnings: Sequence[str],
    orders: Any,
    offset: tuple[int, Effect] | None = None,
    inputs: tuple[ChannelNoise, ...] = (),
    late: LateLoad | None = None,
    as_recorded: bool = False,
    blurred: bool = True,
) -> Fit:
    """Put everything together that a user sees of a fit.

    Parameters
    ----------
    into : model that receives the part, or None for a new one.
    warnings : sentences of the checks; those of the fit are added.
    orders : the order analysis that chose orders, or None.
    offset : where these were taken out, the effect of which each run has its own and its place
        among the effects; else None.
    inputs : noise of each channel of the runs.
    late : the delay of the load beside which the estimate was made, or None. What it makes of the
        target stays in the residuals.
    as_recorded : whether noisy channels are read as recorded, for the user asked for that.
    blurred : whether errors hold what the smoothed speed leaves of the width of friction; not where
        they decide on names.
    """
    (uncertainty, delay), validation = together(
        problem.threads,
        lambda: _errors(made, late, inputs if blurred else None),
        lambda: made.validation,
    )
    held_out_residuals = validation.residuals
    if late is not None:
        held_out_residuals = tuple(
            residual + late.of(k) for k, residual in enumerate(validation.residuals)
        )
    confounded = _confounded(problem, made, uncertainty)
    parameters = _parameters(problem, made, uncertainty, confounded)
    effects, values = made.linear.effects, _shared(problem, made)
    if offset is not None:
        own = offset_parameters(problem, made, uncertainty, offset[1])
        posed = replace(problem, own=(ZERO,))
        confounded, own = _told(confounded, own, posed, made, [offset[1]])
        parameters = (*parameters[: len(made.names)], *own, *parameters[len(made.names) :])
        before = effects[: offset[0]]
        mean = float(np.mean([p.value for p in own]))
        values = np.insert(values, sum(len(e.terms) for e in before), mean)
        effects = (*before, offset[1], *effects[offset[0] :])
    residuals = residuals_of(problem, made.linear)
    if problem.projected:
        units = _own_units(problem)
        own = own_parameters(problem, made, uncertainty, units)
        confounded, own = _told(confounded, own, problem, made, problem.projected)
        kept = [p for p in parameters if p.name not in problem.own]
        shared = len(made.names) - len(problem.own)
        parameters = (*kept[:shared], *own, *kept[shared:])
    between = compared_runs(problem, made, uncertainty, parameters, effects, residuals)
    values, between = _with_means(values, effects, between)
    scores = scores_of(problem, residuals, held_out_residuals)
    runs = tuple(
        FittedRun(run.log, run.target, run.target - residual, held_out, counts_of(run))
        for run, residual, held_out in zip(problem.runs, residuals, held_out_residuals, strict=True)
    )
    covariance = uncertainty.covariance
    validated: dict[str, Any] = {"by": validation.by, "folds": validation.folds}
    if between:
        validated["per_run"] = [term.to_json() for term in between]
    record = _record(problem, made, parameters, confounded, uncertainty)
    record["scores"] = [asdict(s) for s in scores]
    record["validated"] = validated
    if as_recorded:
        record["prepared"] = []
    if delay is not None:
        record["delay"] = asdict(delay)
    part = Part(
        problem.target,
        effects,
        values,
        problem.known_load,
        plain_json(record),
        problem.simulated,
    )
    facts = _facts(problem)
    model = (into or Model({})).with_part(part, facts)
    found = Fit(
        model=model,
        target=problem.target,
        parameters=parameters,
        confounded=tuple(confounded),
        runs=runs,
        scores=scores,
        validated_by=validation.by,
        folds=validation.folds,
        uncertainty=uncertainty,
        covariance=covariance,
        lowpass=problem.lowpass,
        warnings=(*warnings, *_warnings(made, uncertainty), *own_warnings(between)),
        exact=made.linear.exact,
        condition=made.linear.solution.condition,
        orders=orders,
        inputs=inputs,
        delay=delay,
        solved=made.bare(),
        late=late,
        between_runs=between,
    )
    said = (*sign_warnings(found), *loop_warnings(found), *late_ripple_warnings(found))
    return replace(found, warnings=(*found.warnings, *said))


def _errors(
    made: Estimate, late: LateLoad | None, inputs: Sequence[ChannelNoise] | None
) -> tuple[Uncertainty, Delay | None]:
    """Errors of the parameters, and the delay of the load with its own.

    `inputs`: noise of each channel; None where what a smoothed motion does to them is left out.
    """
    if late is None:
        return _moved(made, made.uncertainty, inputs), None
    whole = uncertainty_of(made, late.columns)
    freedom = whole.degrees_of_freedom
    shape = replace(whole, basis=whole.basis[:-1], degrees_of_freedom=freedom[:-1])
    error = float(whole.standard_errors[-1])
    counts = [counts_of(run) for run in made.tangent.problem.runs]
    makes = np.concatenate([late.of(k)[rows] for k, rows in enumerate(counts)])
    rms = float(np.sqrt(np.mean(makes**2)))
    return _moved(made, shape, inputs), Delay(late.channel, late.seconds, error, rms)


def _moved(
    made: Estimate, uncertainty: Uncertainty, inputs: Sequence[ChannelNoise] | None
) -> Uncertainty:
    """The errors, with what noisy regressors do to the coefficients."""
    found = _moved_by_load(made, uncertainty)
    if inputs is None:
        return found
    found = _blurred(made, found)
    return replace(found, core=found.core + _attenuation(made, uncertainty, inputs))


def _attenuation(made: Estimate, uncertainty: Uncertainty, inputs: Sequence[ChannelNoise]) -> Array:
    """What noise that is left in a derived acceleration adds to the covariance's core, (R, R).

    It adds its own squares V to those S of the acceleration beside the other rows, which moves an
    inertia J by −J V / S, and so all. The square of that counts, and the estimate is not moved: the
    noise of an encoder is white in the mean of many motions, and in one of them more or less.
    """
    names = [made.names[k].split(".")[0] for k in made.fitted]
    if INERTIA not in names:
        return np.zeros_like(uncertainty.core)
    by, place = made.denominator, names.index(INERTIA)
    problem, along = made.tangent.problem, uncertainty.basis[place]
    if by is not None:
        along = uncertainty.core @ along / uncertainty.noise.innovation_variance
    rows = sum(run.counted for run in problem.runs)
    noise = rows * noise_of_acceleration(problem, inputs, np.ones(1) if by is None else by)
    moved = made.linear.coefficients[made.fitted[place]] * noise
    return np.asarray(moved**2 * np.outer(along, along))


def _moved_by_load(made: Estimate, uncertainty: Uncertainty) -> Uncertainty:
    """The errors, with what the noise of a known load moves a scale of it by, and so all.

    That is −V / S, where other channels tell the load but for S of its squares: they know it better
    than its channel does. Its square is added to the covariance.
    """
    names = [made.names[k].split(".")[0] for k in made.fitted]
    scale = next((k for k, name in enumerate(names) if name in LOAD_SCALES), None)
    problem, by = made.tangent.problem, made.denominator
    if scale is None or not problem.scatter:
        return uncertainty
    rows, along = sum(run.counted for run in problem.runs), uncertainty.basis[scale]
    if by is not None:
        along = uncertainty.core @ along / uncertainty.noise.innovation_variance
    noise = rows * noise_of_load(problem, np.ones(1) if by is None else by)
    return replace(uncertainty, core=uncertainty.core + noise**2 * np.outer(along, along))


def _blurred(made: Estimate, uncertainty: Uncertainty) -> Uncertainty:
    """The errors, with what the smoothed speed leaves of the width of friction, and so of all.

    With the width off by r, the others are off by r cov(θ, w) / var(w): r² times the square of
    that is added to the covariance.
    """
    free = [shape.name for shape in made.free_shapes]
    if WIDTH not in free:
        return uncertainty
    value = made.free_shapes[free.index(WIDTH)].value(made.linear.effects)
    speed = unresolved_speed(made.tangent.problem, value)
    along = uncertainty.core @ uncertainty.basis[len(made.fitted) + free.index(WIDTH)]
    variance = float(uncertainty.basis[len(made.fitted) + free.index(WIDTH)] @ along)
    if not speed > RESOLVED * value or not variance > 0.0:
        return uncertainty
    core = uncertainty.core + (speed / variance) ** 2 * np.outer(along, along)
    return replace(uncertainty, core=core)


def _confounded(problem: Problem, made: Estimate, uncertainty: Uncertainty) -> list[Confounded]:
    """Groups among the coefficients that are neither fixed nor at a bound."""
    shapes = len(made.free_shapes)

    def errors_of(directions: Array) -> Array:
        return uncertainty.errors_of(np.hstack([directions, np.zeros((len(directions), shapes))]))

    units = _units(problem, made)
    return confounded_groups(
        made.linear.solution,
        [made.names[k] for k in made.fitted],
        [units[k] for k in made.fitted],
        made.linear.coefficients[made.fitted],
        errors_of,
        made.linear.prior_rows,
    )


def _told(
    confounded: list[Confounded],
    own: list[Parameter],
    problem: Problem,
    made: Estimate,
    effects: Sequence[Effect],
) -> tuple[list[Confounded], list[Parameter]]:
    """Groups and parameters of single runs that were taken out, each with what the others say."""
    groups = with_own(confounded, problem, made, effects, [p.name for p in own])
    hidden = {name for group in groups for name in group.names}
    told = [
        replace(p, state="not determined", determined=False) if p.name in hidden else p for p in own
    ]
    return groups, told


def _own_units(problem: Problem) -> list[str]:
    """Unit of each term in `own` that is taken out."""
    terms = [term for effect in problem.projected for term in effect.terms]
    units = [unit_in(term.unit, problem.target, problem.known_load) for term in terms]
    return [units[column] for column in columns_of(problem.projected, problem.own)]


def _with_means(
    values: Array, effects: Sequence[Effect], between: tuple[BetweenRuns, ...]
) -> tuple[Array, tuple[BetweenRuns, ...]]:
    """Coefficients (P,) with the mean over runs of terms that each run has of its own.

    That of offsets alone is the mean of all runs, and is there.
    """
    at = [columns_of(effects, [each.term])[0] for each in between]
    if [term.term for term in between] == [ZERO]:
        return values, (replace(between[0], mean=float(values[at[0]])),)
    values = values.copy()
    values[at] = [each.mean for each in between]
    return values, between


def _units(problem: Problem, made: Estimate) -> list[str]:
    """Unit of each coefficient, in the order of `names`."""
    load, terms = problem.known_load, [t for e in made.linear.effects for t in e.terms]
    units = [unit_in(term.unit, problem.target, load) for term in terms]
    ordered = [""] * len(made.names)
    for number in range(len(problem.runs)):
        for column, at in enumerate(problem.place(made.linear.effects, number)):
            ordered[at] = units[column]
    return ordered


def _parameters(
    problem: Problem,
    made: Estimate,
    uncertainty: Uncertainty,
    confounded: Sequence[Confounded],
) -> tuple[Parameter, ...]:
    hidden = {name for group in confounded for name in group.names}
    values = np.concatenate(
        [
            made.linear.coefficients[made.fitted],
            [shape.value(made.linear.effects) for shape in made.free_shapes],
        ]
    )
    table = {
        "error": uncertainty.standard_errors,
        "naive": uncertainty.naive_standard_errors,
        "low": uncertainty.intervals(values)[:, 0],
        "high": uncertainty.intervals(values)[:, 1],
        "news": uncertainty.effective_samples_of,
        "freedom": uncertainty.degrees_of_freedom,
    }
    units = _units(problem, made)
    found = []
    for k, name in enumerate(made.names):
        at = int(np.searchsorted(made.fitted, k))
        row = at if at < len(made.fitted) and made.fitted[at] == k else None
        held = bool(np.isfinite(made.constraints.held[k]))
        state = "fixed" if held else BOUND[int(made.linear.at_bound[k])]
        prior = None
        if np.isfinite(made.constraints.prior[k]):
            prior = (float(made.constraints.prior[k]), float(made.constraints.prior_error[k]))
        determined = name not in hidden
        state = state if determined else "not determined"
        value = float(made.linear.coefficients[k])
        one = _parameter(name, "coefficient", value, units[k], state, determined, prior, table, row)
        limits = made.constraints.lower[k], made.constraints.upper[k]
        found.append(replace(one, bounds=bounds_of(*limits)))
    return (*found, *_shape_parameters(made, table))


def _shape_parameters(made: Estimate, table: Mapping[str, Array]) -> list[Parameter]:
    found = []
    free = [shape.name for shape in made.free_shapes]
    for shape in made.shapes:
        value = shape.value(made.linear.effects)
        row = len(made.fitted) + free.index(shape.name) if shape.name in free else None
        determined, state = True, "fixed"
        if shape.name in made.searched.flat:
            determined, state = False, "not determined"
        elif shape.name in made.searched.at_bound:
            state = BOUND[made.searched.at_bound[shape.name]]
        if row is not None and not table["error"][row] < LOOSE * value:
            determined, state = False, "not determined"
        one = _parameter(
            shape.name, "shape", value, shape.info.unit, state, determined, None, table, row
        )
        held = (shape.info.lower, shape.info.upper)
        limits = made.limits.get(shape.name, held)
        found.append(one if state == "fixed" else replace(one, bounds=limits))
    return found


def _parameter(
    name: str,
    kind: str,
    value: float,
    unit: str,
    state: str,
    determined: bool,
    prior: tuple[float, float] | None,
    table: Mapping[str, Array],
    row: int | None,
) -> Parameter:
    def at(key: str) -> float:
        return float("nan") if row is None else float(table[key][row])

    interval = (at("low"), at("high")) if row is not None else (value, value)
    return Parameter(
        name,
        kind,
        value,
        at("error"),
        at("naive"),
        interval,
        unit,
        state,
        determined,
        prior,
        at("news"),
        at("freedom"),
    )


def _shared(problem: Problem, made: Estimate) -> Array:
    """Coefficients in the order of the effects' terms; offsets of runs become their mean."""
    places = [problem.place(made.linear.effects, k) for k in range(len(problem.runs))]
    return np.asarray(np.mean([made.linear.coefficients[place] for place in places], axis=0))


def _record(
    problem: Problem,
    made: Estimate,
    parameters: Sequence[Parameter],
    confounded: Sequence[Confounded],
    uncertainty: Uncertainty,
) -> dict[str, Any]:
    channels = [*problem.ranges]
    return {
        "parameters": [p.to_json() for p in parameters],
        "covariance": {
            "names": [made.names[k] for k in made.fitted] + [s.name for s in made.free_shapes],
            "matrix": uncertainty.covariance.tolist(),
        },
        "confounded": [asdict(group) for group in confounded],
        "noise": {
            "autoregression": uncertainty.noise.coefficients.tolist(),
            "innovation_variance": uncertainty.noise.innovation_variance,
            "effective_samples": uncertainty.effective_samples,
            "filtered": made.denominator is not None,
        },
        "lowpass": problem.lowpass,
        **(
            {"prepared": [p.to_json() for p in problem.preparations]}
            if problem.preparations
            else {}
        ),
        **({"carried": problem.carried.to_json()} if problem.carried else {}),
        "channels": channels,
        "validity": {name: [*ends] for name, ends in problem.ranges.items()},
        **target_range(problem),
        "logs": [
            {
                "name": run.log.name,
                "sha256": run.log.source.sha256 if run.log.source else None,
                "rows": len(run),
                "history": list(run.log.history),
            }
            for run in problem.runs
        ],
    }


def _facts(problem: Problem) -> dict[str, Any]:
    known = ("joint", "gear_ratio", "output_spline", "pole_pairs", "slots", "torque_constant")
    facts = problem.runs[0].log.facts
    return {key: facts[key] for key in known if key in facts}


def _warnings(made: Estimate, uncertainty: Uncertainty) -> list[str]:
    said = []
    if not uncertainty.reliable and uncertainty.noise.parameters:
        said.append(uncertainty.statement)
    for name, side in made.searched.at_bound.items():
        if side:
            said.append(f"{name} ended on its {BOUND[side][3:]}: the model may lack something else")
    for k in np.flatnonzero(made.linear.at_bound):
        side = int(made.linear.at_bound[k])
        said.append(f"{made.names[k]} ended on its {BOUND[side][3:]}")
    said += memory_warnings(made.tangent.problem, made.linear.effects)
    for name in made.searched.flat:
        said.append(f"{name} changes nothing in these runs and keeps its value")
    return [*said, *_prior_warnings(made, uncertainty)]


def _prior_warnings(made: Estimate, uncertainty: Uncertainty) -> Iterator[str]:
    """Say which priors the data contradict, each against the data and all other priors.

    With N the normal equations and k_j what prior j adds to N_jj, an estimate is the mean of the
    prior p ± s and of what the rest says, d ± e, of weights w = k_j (N⁻¹)_jj and 1 − w:

        b_j = w p + (1 − w) d,    var b_j = w² s² + (1 − w)² e²
    """
    weighed = np.sum(made.prior_rows**2, axis=0)
    errors = uncertainty.standard_errors
    for at, number in enumerate(made.fitted):
        prior, error = made.constraints.prior[number], made.constraints.prior_error[number]
        weight = float(weighed[at] * (made.basis[at] @ made.basis[at]))
        if not np.isfinite(prior) or not 1.0 - weight > LEFT_BY_PRIOR:
            continue
        value = float(made.linear.coefficients[number] - weight * prior) / (1.0 - weight)
        variance = float(errors[at] ** 2 - (weight * error) ** 2) / (1.0 - weight) ** 2
        if not variance > 0.0:
            continue
        apart = abs(value - prior) / np.hypot(np.sqrt(variance), error)
        if apart > CONTRADICTED:
            unit = _units(made.tangent.problem, made)[number]
            given = f"{plus_minus(float(prior), float(error))} {unit}".rstrip()
            told = f"{plus_minus(value, float(np.sqrt(variance)))} {unit}".rstrip()
            yield (
                f"the prior of {short_names(made.names[number])}, {given}, contradicts the data, "
                f"which without it give {told}: {short(float(apart))} standard errors apart; "
                "correct the prior, or give it a larger error"
            )
