"""From a regression to the parameters whose simulation misses the measured motion least.

The result is the `Fit` of the regression, with the parameters of the motion. Where a log of a servo
has no motor torque, the regression starts from that of the duty which the servo reported:

    τ_m = k u (or k V u) − k_e q̇,     0 while it is not enabled

Errors of the parameters. A missing effect acts alike in every row of a run, so residuals of one run
are not independent. Two jackknives count runs (or blocks of few runs) as the independent units: one
over m clusters by a Gauss-Newton step each, one over K folds that are fitted again,

    s² = (m − 1)/m Σ_c d_c²,     d_c = (JᵀJ − J_cᵀJ_c)⁻¹ J_cᵀ e_c
    s² = (K − 1)/K Σ_fold (z_fold − z)²

The first does not see other minima, the second may get stuck at a local one.
Each parameter has the larger of its two errors, correlations are those of (JᵀJ)⁻¹, and an
interval is z ± t s with Student's t of K − 1 degrees of freedom: it holds the estimates of all
folds, because t √((K − 1)/K) > 1. All in the coordinates of the search (logarithms of what is
positive); the ends are carried over to the parameter.
Sources: [EfronStein1981]; for clusters [BellMcCaffrey2002] (CR3), [CameronMiller2015].
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from flexspline.effects import Effect
from flexspline.effects.causes import INERTIA
from flexspline.errors import InputError, listed, require_kind
from flexspline.fitting import fit, runs_of, with_orders
from flexspline.forward import DriveInputs, drive_inputs, require_no_delay
from flexspline.forward.servo import PositionServo
from flexspline.least_squares.options import FitOptions, MotionOptions, bounds_of
from flexspline.least_squares.problem import problem_of, target_range
from flexspline.least_squares.result import (
    Fit,
    FittedRun,
    Parameter,
    RunGap,
    SimulationFit,
    StartEnd,
)
from flexspline.least_squares.uncertainty import Uncertainty
from flexspline.least_squares.validation import scores_of
from flexspline.logs.derive import differentiate
from flexspline.logs.log import Log
from flexspline.model import Model
from flexspline.output_error.cost import (
    Cost,
    best_of,
    by_pieces,
    descend,
    drawn_starts,
    folds_of,
    refitted,
    space_of,
)
from flexspline.part import PART_OF
from flexspline.progress import Progress
from flexspline.schema import plain_json

if TYPE_CHECKING:
    from flexspline.least_squares.options import Bounds
    from flexspline.logs.read import LogLike
    from flexspline.output_error.cost import Descent, Folds, Searched

__all__ = [
    "EVALUATIONS",
    "Errors",
    "Settings",
    "assembled",
    "cost_of",
    "errors_of",
    "fit_motion",
    "require_drive",
    "require_motion",
    "settings_of",
    "starts_of",
    "with_servo_torque",
]


STILL = 1e-6  # rad: an output that moves less does not move
ENOUGH = 1e-3  # of the regression's miss: what half the steps may change
MOST_STEPS = 16
EVALUATIONS = 25  # of each descent

Array = NDArray[np.float64]

AT_END = 1e-4  # of a coordinate: as near to a bound it is said to be there
ELSEWHERE = 1.1  # of the best RMSE: a start that ends below, outside an interval, is warned of

LEAST_CLUSTERS = 8
NEXT_TO_NOTHING = 1e-8  # of an eigenvalue of the scaled JᵀJ: the runs do not see this direction
LOOSE = 1.0  # error of a logarithm from which the number is not determined
MEMBER = 0.1  # share of such a direction from which a parameter is not determined


@dataclass(frozen=True)
class Settings:
    """How a fit by simulation searches: the servo's law, or None, and the options."""

    controller: PositionServo | None
    options: MotionOptions = field(default_factory=MotionOptions)

    def __post_init__(self) -> None:
        if self.free and self.controller is None:
            raise InputError("free_controller names fields of a controller; give the controller")

    @property
    def free(self) -> tuple[str, ...]:
        """Fields of the law that are fitted."""
        free = self.options.free_controller
        return (free,) if isinstance(free, str) else tuple(free)


def settings_of(
    controller: PositionServo | str | os.PathLike[str] | None, options: MotionOptions
) -> Settings:
    """Return `Settings`; the law may be a path of its `servo.json`.

    Raises
    ------
    InputError
        Where that file is no law, or fields are to be fitted of none.
    """
    if isinstance(controller, (str, os.PathLike)):
        controller = PositionServo.load(controller)
    return Settings(controller, options)


def with_servo_torque(log: Log, law: PositionServo, target: str) -> Log:
    """Return the log with what its motor gave, in `motor_torque` or `motor_current`.

    Raises
    ------
    InputError
        Where the log has neither that channel nor `duty`.
    """
    channel = "motor_current" if target == "motor_current" else "motor_torque"
    if channel in log or (channel == "motor_torque" and "motor_current" in log):
        return log
    if "duty" not in log:
        raise InputError(
            f"log '{log.name}': the regression that a fit by simulation starts from needs the "
            f"channel {channel} or duty; it has {listed(log.channels)}; map a column to one"
        )
    moving = log if "output_velocity" in log else differentiate(log)
    volts = log["supply_voltage"] if law.supply else 1.0
    given = law.torque * volts * log["duty"] - law.back_emf * moving["output_velocity"]
    if "enabled" in log:
        given = np.where(log["enabled"] == 0.0, 0.0, given)
    return log.with_columns({channel: given}, note=f"{channel} from duty by the controller's law")


def assembled(
    regression: Fit,
    cost: Cost,
    found: Sequence[Descent],
    folds: Folds,
    without: Sequence[Descent],
    errors: Errors,
    law: PositionServo | None,
    logs: Sequence[Log],
    into: Model | None,
) -> Fit:
    """Return the regression's fit with model, parameters, errors and scores of the motion.

    Parameters
    ----------
    found : descents from all starts. without : those without each fold.
    law : of the servo as it was given. logs : as they were given.
    into : model that receives the part, or None.
    """
    best = best_of(found)
    fitted, moved = cost.space.at(best.point)
    servo = None if law is None else law.with_fields(moved)
    parameters = _parameters(regression, cost, best.point, errors)
    uncertainty = _uncertainty(regression, cost, best.point, errors)
    record = _record(cost, found, folds, without, servo, logs)
    given = logs if servo is None else [with_servo_torque(g, servo, fitted.target) for g in logs]
    runs = _runs(regression, cost, given, best, folds, without)
    problem = problem_of(
        given, fitted.effects, fitted.target, known_load=fitted.known_load,
        lowpass_hz=regression.lowpass, threads=cost.threads, inputs=[run.log for run in runs],
    )  # fmt: skip
    residuals = [run.residual for run in runs]
    scores = scores_of(problem, residuals, [run.held_out for run in runs])
    kept = {
        **regression.part.record,
        **target_range(problem),  # of a servo, by the law as it was fitted
        "parameters": [p.to_json() for p in parameters],
        "covariance": {
            "names": [one.name for one in cost.space.searched],
            "matrix": uncertainty.covariance.tolist(),
        },
        "confounded": [],
        "scores": [asdict(s) for s in scores],
        "validated": {"by": folds.by, "folds": len(folds)},
        "simulation": record.to_json(),
    }
    part = replace(fitted, record=plain_json(kept))
    model = (into or Model({})).with_part(part, dict(regression.model.facts))
    return replace(
        regression,
        model=model,
        parameters=parameters,
        confounded=(),
        runs=runs,
        scores=scores,
        validated_by=folds.by,
        folds=len(folds),
        uncertainty=uncertainty,
        covariance=uncertainty.covariance,
        warnings=(*regression.warnings, *_warnings(parameters, record)),
        simulation=record,
        solved=None,
        late=None,
    )


def _parameters(regression: Fit, cost: Cost, point: Array, errors: Errors) -> tuple[Parameter, ...]:
    """Those of the motion; what it does not see (fixed ones, a width) as the regression left it."""
    searched = cost.space.searched
    made = {
        one.name: _parameter(one, k, float(point[k]), cost, errors)
        for k, one in enumerate(searched)
    }
    kept = [made.pop(p.name, p) for p in regression.parameters]
    return (*kept, *made.values())


def _parameter(one: Searched, k: int, at: float, cost: Cost, errors: Errors) -> Parameter:
    low, high = (ends[k] for ends in cost.space.bounds)
    determined = bool(errors.determined[k])
    state = "fitted" if determined else "not determined"
    if at - low < AT_END:
        state = "at lower bound"
    elif high - at < AT_END:
        state = "at upper bound"
    half, slope = float(errors.half_widths[k]), one.slope(at)
    ends = (one.value(at - half), one.value(at + half)) if determined else (np.nan, np.nan)
    ratio = errors.naive[k] / errors.standard[k]
    return Parameter(
        one.name,
        one.kind,
        one.value(at),
        float(slope * errors.standard[k]),
        float(slope * errors.naive[k]),
        (float(ends[0]), float(ends[1])),
        one.unit,
        state,
        determined,
        None,
        float(errors.rows * ratio**2),
        float(errors.degrees),
        bounds_of(one.lower, one.upper),
        one.logarithmic,
    )


def _uncertainty(regression: Fit, cost: Cost, point: Array, errors: Errors) -> Uncertainty:
    slopes = cost.space.slopes(point)

    def covariance(deviations: Array) -> Array:
        own = np.nan_to_num(slopes * deviations)
        return np.asarray(np.outer(own, own) * errors.correlation)

    return replace(
        regression.uncertainty,
        basis=np.eye(len(point)),
        core=covariance(errors.standard),
        naive_core=covariance(errors.naive),
        degrees_of_freedom=np.full(len(point), float(errors.degrees)),
    )


def _record(
    cost: Cost,
    found: Sequence[Descent],
    folds: Folds,
    without: Sequence[Descent],
    servo: PositionServo | None,
    logs: Sequence[Log],
) -> SimulationFit:
    space, best = cost.space, best_of(found)

    def plain(point: Array) -> tuple[float, ...]:
        return tuple(space.values(point).tolist())

    return SimulationFit(
        runs=_gaps(cost, best, folds, without),
        starts=tuple(StartEnd(d.first_rmse, d.rmse, d.evaluations, plain(d.point)) for d in found),
        names=tuple(one.name for one in space.searched),
        regressed=plain(space.start),
        fitted=plain(best.point),
        folds=np.array([space.values(fold.point) for fold in without]),
        folds_by=folds.by,
        controller=servo,
        steps_per_sample=cost.steps,
        logs=tuple(logs),
    )


def _gaps(
    cost: Cost, best: Descent, folds: Folds, without: Sequence[Descent]
) -> tuple[RunGap, ...]:
    here, before = cost.by_run(best.point), cost.by_run(cost.space.start)
    held = [np.full(len(rows), np.nan) for rows in here]
    for fold, out in zip(without, folds.left_out, strict=True):
        for rows, made, mask in zip(held, cost.by_run(fold.point), out, strict=True):
            rows[mask] = made[mask]
    found = []
    for k, run in enumerate(cost.runs):
        count = cost.counts[k]
        rms = [float(np.sqrt(np.mean(rest[k][count] ** 2))) for rest in (here, held, before)]
        found.append(RunGap(run.name, int(count.sum()), *rms))
    return tuple(found)


def _runs(
    regression: Fit,
    cost: Cost,
    logs: Sequence[Log],
    best: Descent,
    folds: Folds,
    without: Sequence[Descent],
) -> tuple[FittedRun, ...]:
    """Targets and residuals of the torque, by the parameters of the motion.

    `logs`: as recorded, with the torque of the fitted law; rows read them as the regression does.
    """
    runs = []
    for k, (old, log) in enumerate(zip(regression.runs, logs, strict=True)):
        made = _predicted(regression, cost, best.point, log)
        held_out = np.full(len(log), np.nan)
        for fold, out in zip(without, folds.left_out, strict=True):
            rows = out[k] & old.counts
            if rows.any():
                other = _predicted(regression, cost, fold.point, log)
                held_out[rows] = (other.measured - other.predicted)[rows]
        runs.append(FittedRun(_derived(old.log, log), made.measured, made.predicted, held_out,
                              old.counts))  # fmt: skip
    return tuple(runs)


def _derived(old: Log, again: Log) -> Log:
    """The log with the channels that the regression derived, and the torque of the fitted law."""
    news = [name for name in again.channels if name in ("motor_torque", "motor_current")]
    changed = {name: again[name] for name in news if not np.array_equal(again[name], old[name])}
    return old.with_columns(changed, note="torque by the fitted law") if changed else old


def _predicted(regression: Fit, cost: Cost, point: Array, log: Log) -> Any:
    part, _ = cost.space.at(point)
    record = regression.part.record
    kept = {key: record[key] for key in ("channels", "lowpass", "prepared") if key in record}
    model = Model({}).with_part(replace(part, record=kept), dict(regression.model.facts))
    return model.predict(log, part.target, lowpass_hz=regression.lowpass)


def _warnings(parameters: Sequence[Parameter], record: SimulationFit) -> list[str]:
    said = [f"{p.name} ended on its {p.state[3:]}" for p in parameters if p.state[:3] == "at "]
    by_name = {p.name: p for p in parameters}
    best = min(start.rmse for start in record.starts)
    others = [s for s in record.starts if s.rmse <= ELSEWHERE * best]
    for k, name in enumerate(record.names):
        low, high = by_name[name].interval
        if any(not low <= start.values[k] <= high for start in others) and np.isfinite(low):
            said.append(f"{name}: starts that end nearly as low leave its interval; see the starts")
    return said


@dataclass(frozen=True, eq=False)
class Errors:
    """Of P searched coordinates: standard errors (P,), correlations (P, P), which are determined.

    `clusters`, `folds`, `naive`: (P,) each, the two that `standard` is the larger of, and that of
    white noise. `degrees`: of freedom. `rows`: that counted.
    """

    standard: Array
    correlation: Array
    determined: NDArray[np.bool_]
    clusters: Array
    folds: Array
    naive: Array
    degrees: int
    rows: int

    @property
    def half_widths(self) -> Array:
        """(P,), of the 95 % intervals."""
        return float(student.ppf(0.975, self.degrees)) * self.standard


def errors_of(cost: Cost, point: Array, folds: Sequence[Array]) -> Errors:
    """Return the errors at the best point; `folds`: where each refit without a fold ended."""
    jacobian, rest = cost.jacobian(point, central=True), cost.residuals(point)
    norms = np.linalg.norm(jacobian, axis=0)
    seen = norms > NEXT_TO_NOTHING * max(float(norms.max()), 1e-300)
    units = np.where(seen, norms, np.inf)
    scaled = jacobian / units
    inverse, blind = _inverse(scaled)
    variances = np.diag(inverse)
    free = max(len(rest) - len(point), 1)
    clusters = _clustered(scaled, rest, _labels(cost)) / units
    moved = np.asarray(folds) - point
    refitted = np.sqrt((len(folds) - 1) / len(folds) * (moved**2).sum(axis=0))
    larger = np.maximum(clusters, refitted)
    loose = larger > np.where([one.logarithmic for one in cost.space.searched], LOOSE, np.inf)
    known = seen & ~blind & ~loose
    root = np.sqrt(np.where(variances > 0.0, variances, 1.0))
    return Errors(
        standard=np.where(known, larger, np.nan),
        correlation=inverse / np.outer(root, root),
        determined=known,
        clusters=clusters,
        folds=refitted,
        naive=np.sqrt(variances * float(rest @ rest) / free) / units,
        degrees=len(folds) - 1,
        rows=len(rest),
    )


def _inverse(scaled: Array) -> tuple[Array, NDArray[np.bool_]]:
    """(JᵀJ)⁻¹ without directions that the runs do not see, and which parameters these move."""
    values, vectors = np.linalg.eigh(scaled.T @ scaled)
    null = values < NEXT_TO_NOTHING * values[-1]
    blind = (np.abs(vectors[:, null]) > MEMBER).any(axis=1)
    return (vectors[:, ~null] / values[~null]) @ vectors[:, ~null].T, blind


def _labels(cost: Cost) -> NDArray[np.intp]:
    """Number of the cluster of each row that counts: its run, or blocks of runs if they are few."""
    each = -(-LEAST_CLUSTERS // len(cost.runs)) if len(cost.runs) < LEAST_CLUSTERS else 1
    labels = [
        (number * each + np.arange(len(count)) * each // len(count))[count]
        for number, count in enumerate(cost.counts)
    ]
    return np.concatenate(labels)


def _clustered(jacobian: Array, rest: Array, labels: NDArray[np.intp]) -> Array:
    """Errors (P,) by leaving out each cluster, one Gauss-Newton step from the best point."""
    whole = jacobian.T @ jacobian
    edges = np.flatnonzero(np.diff(labels, prepend=-1, append=-1))
    squares = np.zeros(len(whole))
    for first, last in pairwise(edges.tolist()):
        own, missed = jacobian[first:last], rest[first:last]
        step = np.linalg.lstsq(whole - own.T @ own, own.T @ missed, rcond=NEXT_TO_NOTHING)[0]
        squares += step**2
    count = len(edges) - 1
    return np.asarray(np.sqrt((count - 1) / count * squares))


def fit_motion(
    effects: str | Effect | Iterable[str | Effect],
    logs: LogLike | Iterable[LogLike],
    target: str,
    *,
    controller: PositionServo | str | os.PathLike[str] | None = None,
    known_load: str | None = None,
    lowpass: float | None = None,
    orders: Mapping[str, Sequence[int]] | None = None,
    fixed: Mapping[str, float] | None = None,
    bounds: Mapping[str, Bounds] | None = None,
    checks: bool = True,
    into: Model | None = None,
    options: MotionOptions | None = None,
) -> Fit:
    """Fit a drive's effects so that the simulated motion is the measured one.

    From the regression that `fit` makes on to the parameters whose forward simulation, from the
    first row to the end, misses the measured output_position least.

    Parameters
    ----------
    effects : as for `fit`; inertia is among them.
    logs : one or several runs of one joint, with output_position [rad].
    target : "motor_torque" [Nm at the output] or "motor_current" [A].
    controller : the servo's law that drives the simulation, or the path of its `servo.json`; None:
        the measured motor torque does. Without a torque channel, `duty` gives the regression's.
    known_load, orders, fixed, bounds, checks, into : as for `fit`.
    lowpass : Hz, of the regression and the torque's errors; the motion is compared as it is.
    options : what few calls need, see `MotionOptions`.

    Returns
    -------
    Fit; what is said of the motion is in `Fit.simulation`.

    Raises
    ------
    InputError
        As for `fit`; for a target that is not the drive, without inertia or motion, and where a
        scale of all torques is free.

    Notes
    -----
    [Ljung1999], System identification, output-error models.
    """
    require_kind(options, MotionOptions, "options")
    how = MotionOptions() if options is None else options
    settings, runs = settings_of(controller, how), runs_of(logs)
    chosen = with_orders(effects, orders or {})
    regression = FitOptions(bandwidth=how.bandwidth, robust=how.robust, threads=how.threads)
    regress = partial(
        fit, chosen, target=target, known_load=known_load, lowpass=lowpass, fixed=fixed,
        bounds=bounds, checks=checks, options=regression,
    )  # fmt: skip
    require_drive(chosen, target)
    require_motion(runs)
    return _best_motion(runs, target, settings, regress, bounds or {}, into)


def _best_motion(
    logs: Sequence[Log],
    target: str,
    settings: Settings,
    regress: Callable[[Sequence[Log]], Fit],
    bounds: Mapping[str, Bounds],
    into: Model | None,
) -> Fit:
    """Descend from the regression, and from around it, to where the motion is missed least."""

    law = settings.controller
    driven = [log if law is None else with_servo_torque(log, law, target) for log in logs]
    shown = settings.options.progress
    with Progress("fitting the motion", shown, unit=" simulations") as bar:
        bar.say("regression")
        regression = regress(driven)
        cost = cost_of(regression, driven, settings, bounds, bar.step)
        found = []
        for number, start in enumerate(starts_of(cost, regression, settings)):
            bar.say(f"start {number + 1} of {settings.options.starts}")
            found.append(descend(cost, start, EVALUATIONS))
        best = best_of(found)
        bar.say("without each fold")
        folds = folds_of(cost.counts, settings.options.folds)
        without = refitted(cost, best, folds, EVALUATIONS)
        errors = errors_of(cost, best.point, [fold.point for fold in without])
        return assembled(regression, cost, found, folds, without, errors, law, logs, into)


def cost_of(
    regression: Fit,
    driven: Sequence[Log],
    settings: Settings,
    bounds: Mapping[str, Bounds],
    tick: Callable[[], object],
    steps: int | None = None,
) -> Cost:
    """Return the miss of the motion around a regression of `driven` runs, to be descended.

    `steps`: from row to row; None: as many as change little.

    Raises
    ------
    InputError
        Where a scale of all torques is free, and as `drive_inputs`.
    """
    law, target = settings.controller, regression.target
    _require_scale(regression, settings.free)
    space = space_of(regression.part, law, regression.parameters, bounds, settings.free)
    runs = [drive_inputs(regression.model, log, target=target, controller=law) for log in driven]
    cost = Cost(space, runs, [_counts(run) for run in runs], 1, settings.options.threads, tick)
    return replace(cost, steps=_steps(cost) if steps is None else steps)


def starts_of(cost: Cost, regression: Fit, settings: Settings) -> list[Any]:
    """The regression, where pieces of the runs are missed least, and points drawn around it."""
    drawn = drawn_starts(cost, settings.options.starts, settings.options.seed)
    if settings.options.starts == 1:
        return drawn
    velocities = [_velocity(run.log) for run in regression.runs]
    shooting = descend(by_pieces(cost, velocities), cost.space.start, EVALUATIONS)
    return [drawn[0], shooting.point, *drawn[1:-1]]


def _velocity(log: Log) -> Any:
    made = log if "output_velocity" in log else differentiate(log)
    return made["output_velocity"]


def require_drive(effects: Sequence[Effect], target: str) -> None:
    if PART_OF.get(target, "drive") != "drive":
        raise InputError(
            f"a simulated motion is that of a drive, but the target is {target}; give the target "
            "motor_torque or motor_current, or fit the target itself"
        )
    names = [effect.name for effect in effects]
    if INERTIA not in names:
        raise InputError(
            f"a simulated motion needs the effect {INERTIA}, without which nothing can be driven "
            f"forward; the effects are {listed(names) or 'none'}; add it"
        )
    require_no_delay(effects, target)


def require_motion(logs: Sequence[Log]) -> None:
    for log in logs:
        if "output_position" not in log:
            raise InputError(
                f"log '{log.name}': a simulated motion is compared with output_position, which is "
                f"not among {listed(log.channels)}; map a column to it"
            )
    if all(np.ptp(log["output_position"]) < STILL for log in logs):
        raise InputError(
            "no log moves, so no simulated motion can be compared; record runs that move"
        )


def _require_scale(regression: Fit, free: Sequence[str]) -> None:
    """Torques are known by what is fixed in Nm, or by the motor's constant: one of the two."""
    held = [p for p in regression.parameters if p.kind == "coefficient" and p.state == "fixed"]
    if "torque" in free and not any(p.value for p in held):
        raise InputError(
            "the controller's torque scales all coefficients alike, so it can only be fitted where "
            "one of them is known; fix one, such as gravity.sine, or leave torque out"
        )


def _counts(run: DriveInputs) -> Any:
    """Rows that are driven through and measured."""
    driven = np.zeros(len(run.time), dtype=bool)
    for first, last in run.stretches:
        driven[first:last] = True
    return driven & np.isfinite(run.measured)


def _steps(cost: Cost) -> int:
    """Fewest steps from row to row of which twice as many change little beside the miss."""
    point = cost.space.start
    steps, coarse = 1, cost.residuals(point)
    enough = ENOUGH * float(np.sqrt(np.mean(coarse**2)))
    while steps < MOST_STEPS:
        fine = replace(cost, steps=2 * steps).residuals(point)
        if float(np.sqrt(np.mean((fine - coarse) ** 2))) <= enough:
            return steps
        steps, coarse = 2 * steps, fine
    return steps
