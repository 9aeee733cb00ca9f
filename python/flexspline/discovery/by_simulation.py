"""`discover` by simulation: missing effects searched for in the forward simulation.

All errors are of the output's angle [rad], driven from the first row to the end by fits that held
the row out. The noise floor is the resolution of its encoder: no simulation gets below it, and
what remains above it is reported as unexplained.

Each effect of the catalogue that can be driven forward is fitted beside the base by the motion
(`output_error/fitting.py`), from the base's own optimum and from the regression's. Those that lower
the error most are fitted again without each fold, and one is named where the error of the held-out
rows decreases, run by run:

    d_r = ln(RMS_r of the base / RMS_r with it)        t = mean(d) √n / s(d)

with Student's t of n − 1 degrees of freedom and one chance in twenty shared among all candidates.
Rows of one run are not independent, so runs (blocks, of fewer than four) are the units. Of the
candidates within two standard errors of d from the one with the lowest held-out error, the one with
the fewest terms is chosen, and the others are reported. Then the search goes on from there.

A name has to be significant in the final fit, too, or it is withdrawn: k coefficients β with the
covariance C that the fit reports, ν degrees of freedom (`output_error/fitting.py`),

    F = βᵀ C⁻¹ β / k,     p = P(F_{k,ν} > F) < 0.05

For one coefficient this says that its printed interval does not reach zero. A bound, or what the
runs do not determine, tells nothing from zero. Where a name takes its significance from an earlier
one, the earlier one is withdrawn and the search goes on from before it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as fisher
from scipy.stats import t as student

from flexspline.comparison.result import Comparison
from flexspline.comparison.result import assembled as compared_all
from flexspline.comparison.runs import resolution
from flexspline.comparison.search import analysed
from flexspline.discovery.candidates import possible
from flexspline.discovery.faults import DataFault
from flexspline.discovery.result import (
    BY_ENCODER,
    NOT_SIGNIFICANT,
    Discovery,
    Found,
    Motion,
    NoiseFloor,
    Unexplained,
)
from flexspline.discovery.slices import HeldRun, compared_motion
from flexspline.effects import Effect
from flexspline.effects.causes import TORQUE_SCALE
from flexspline.errors import InputError, listed
from flexspline.fitting import fit
from flexspline.least_squares.options import FitOptions, coefficient_names
from flexspline.least_squares.result import Fit, Parameter
from flexspline.logs.derive import with_motion
from flexspline.logs.log import Log
from flexspline.model import Model
from flexspline.output_error.cost import UNSEEN, Cost, Descent, Folds, best_of, descend, folds_of
from flexspline.output_error.fitting import (
    EVALUATIONS,
    Errors,
    Settings,
    assembled,
    cost_of,
    errors_of,
    require_drive,
    require_motion,
    starts_of,
    with_servo_torque,
)

__all__ = ["Driven", "Missing", "Step", "discover_by_simulation", "search", "told"]

CHANNELS = {
    "speed": "output_velocity",
    "direction": "output_velocity",
    "position": "output_position",
    "position_order": "output_position",
    "acceleration": "output_acceleration",
    "load": "reference_torque",
    "reversal_angle": "output_position",
    "reversal_time": "output_velocity",
}
"""Channel of each covariate of a comparison that is not named after its own."""

Array = NDArray[np.float64]
Say = Callable[[str], object]

CHANCE = 0.05
"""That noise alone makes one name, shared among all candidates (Bonferroni); and that coefficients
which are zero look significant, as of all printed intervals."""
SAME = 2.0
"""Standard errors over runs up to which two candidates are indistinguishable."""
FINALISTS = 3
"""Candidates that are fitted without each fold, too: of the others the fit to all rows says enough.
Half of it may miss one that holds better than it fits; twice it doubles the time."""
SCREENED = 8
"""Evaluations of a candidate's descents before the finalists are chosen."""
SINGULAR, EXACT, TINY = 1e-10, 1e-12, 1e-300  # of correlations; of a value; of all
MOST = 3
"""Names; of the rows that twelve runs of motion give, a fourth was never told."""


def discover_by_simulation(
    effects: Sequence[Effect],
    logs: Sequence[Log],
    target: str,
    known_load: str | None,
    fixed: Mapping[str, float],
    exclude: Iterable[str],
    settings: Settings,
    into: Model | None,
    faults: tuple[DataFault, ...],
    say: Say,
) -> Discovery:
    """Find what a drive lacks by the motion that it makes.

    Parameters
    ----------
    effects : the base, inertia among them.
    into : the model that it is of, or None.
    faults : of the data.

    Raises
    ------
    InputError
        As for a fit by simulation.
    """
    require_drive(effects, target)
    require_motion(logs)
    made = search(effects, logs, target, known_load, fixed, exclude, settings, say)
    say("errors")
    final = made.final
    errors = errors_within(final)
    fit = assembled(
        final.regression, final.cost, final.found, final.folds, final.without, errors,
        settings.controller, logs, into,
    )  # fmt: skip
    held = _held(made, logs)
    floor = resolution([run.measured for run in held])
    units = "runs" if final.folds.by == "folds of runs" else "blocks"
    return Discovery(
        target=target,
        unit="rad",
        base_effects=tuple(effect.name for effect in effects),
        found=tuple(_found(made, step, errors, fit, units) for step in made.steps),
        base_rmse=made.base.rmse,
        final_rmse=final.rmse,
        floor=NoiseFloor(floor, float("nan"), BY_ENCODER),
        validated_by=units,
        data_faults=faults,
        unexplained=_unexplained(made, held, floor),
        next_experiment=None,
        fit=fit,
        runs=held,
        motion=Motion("output_position", "rad", held),
        not_tried=made.not_tried,
        refused=made.refused,
        doubted=(),
        by="simulation",
    )


def _held(made: Missing, logs: Sequence[Log]) -> tuple[HeldRun, ...]:
    """Measured angle, and what base and extended model make of rows that no fit counted."""
    found = []
    for number, log in enumerate(logs):
        measured = np.asarray(log["output_position"])
        base, final = (
            measured + one.held_out[number] for one in (made.base, made.final)
        )  # held_out is simulated less measured
        found.append(HeldRun(with_motion(log), measured, base, final, None))
    return tuple(found)


def _found(made: Missing, step: Step, errors: Errors, fit: Fit, units: str) -> Found:
    """One name with its evidence."""
    gap = made.base.rmse**2 - made.final.rmse**2
    before, after = step.before.rmse, step.after.rmse
    lower = int(np.count_nonzero(step.after.sizes() < step.before.sizes()))
    evidence = (
        f"Driven forward through {units} that no fit counted, the simulated angle is off by "
        f"{1e3 * after:.3g} instead of {1e3 * before:.3g} mrad, and by less in {lower} of "
        f"{len(step.after.sizes())} of them (t = {step.t:.1f} over these)."
    )
    return Found(
        effect=step.effect.name,
        rmse_before=before,
        rmse_after=after,
        confidence=step.weight,
        indistinguishable_from=step.alike,
        where=_where(step.before, step.after, fit),
        evidence=evidence,
        t=step.t,
        rivals=(),
        coefficients_p=p_of_zero(made.final, step.effect, errors),
        share_of_gap=(before**2 - after**2) / gap,
    )


def _where(before: Driven, after: Driven, fit: Fit) -> str:
    """The runs in which the motion gains most."""
    names = [run.log.name for run in fit.runs]
    squares = [
        [float(np.nanmean(rows**2)) if np.isfinite(rows).any() else 0.0 for rows in one.held_out]
        for one in (before, after)
    ]
    gained = np.array(squares[0]) - np.array(squares[1])
    most = [names[k] for k in np.argsort(-gained) if gained[k] > 0.5 * gained.max()]
    return f"most in {listed(most)}"


def _unexplained(made: Missing, held: Sequence[HeldRun], floor: float) -> Unexplained | None:
    """What is left above what the encoder resolves, as a share of the base's, and where."""
    first, last = (max(one.rmse**2 - floor**2, 0.0) for one in (made.base, made.final))
    if last == 0.0 or first == 0.0:
        return None
    names = [CHANNELS.get(follow.name, follow.name) for follow in _left(held).follows]
    return Unexplained(min(last / first, 1.0), tuple(dict.fromkeys(names)) or ("time",))


def _left(held: Sequence[HeldRun]) -> Comparison:
    """The comparison of what the extended model leaves."""
    compared = compared_motion(held, "final")
    try:
        return compared_all(compared, analysed(compared, lambda _: None), {})
    except InputError as error:
        raise InputError(f"what the simulation leaves cannot be looked at: {error}") from error


@dataclass(frozen=True, eq=False)
class Driven:
    """A model fitted by its motion, and what its fits without each fold miss.

    `held_out`: simulated − measured [rad] of every run by the fit that never counted the row; NaN
    where a row does not count.
    """

    effects: tuple[Effect, ...]
    regression: Fit
    cost: Cost
    found: tuple[Descent, ...]
    folds: Folds
    without: tuple[Descent, ...] = ()
    held_out: tuple[Array, ...] = field(default=(), repr=False)

    @property
    def best(self) -> Descent:
        return best_of(self.found)

    @property
    def rmse(self) -> float:
        """Held out, rad."""
        left = np.concatenate(self.held_out)
        return float(np.sqrt(np.nanmean(left**2)))

    def sizes(self) -> Array:
        """Logarithm of the held-out RMS of each run and fold."""
        found = []
        for out in self.folds.left_out:
            for rows, mask in zip(self.held_out, out, strict=True):
                some = rows[mask & np.isfinite(rows)]
                if len(some):
                    found.append(0.5 * np.log(max(float(np.mean(some**2)), 1e-30)))
        return np.array(found)

    def values(self) -> dict[str, float]:
        """What was fitted, by name."""
        names = [one.name for one in self.cost.space.searched]
        return dict(zip(names, self.cost.space.values(self.best.point).tolist(), strict=True))


@dataclass(frozen=True, eq=False)
class Step:
    """One name: the model before and with it, t over runs, its weight among the candidates that are
    told from it, and those that are not."""

    effect: Effect
    before: Driven
    after: Driven
    t: float
    weight: float
    alike: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Missing:
    """The base, the names in their order, and why other effects were not tried or not taken."""

    base: Driven
    steps: tuple[Step, ...]
    not_tried: Mapping[str, str]
    refused: Mapping[str, str]

    @property
    def final(self) -> Driven:
        return self.steps[-1].after if self.steps else self.base


@dataclass(frozen=True)
class _Way:
    """How every model of a search is fitted."""

    logs: Sequence[Log]
    target: str
    known_load: str | None
    fixed: Mapping[str, float]
    settings: Settings

    def posed(
        self,
        effects: Sequence[Effect],
        steps: int | None = None,
        held: Mapping[str, Parameter] | None = None,
    ) -> tuple[Fit, Cost, Folds]:
        """The regression, the miss around it, and the folds.

        `steps`: from row to row. `held`: what the motion does not see, as another fit found it.
        """
        held = held or {}
        fixed = {**self.fixed, **{name: p.value for name, p in held.items()}}
        regression = fit(
            effects, self.logs, self.target, known_load=self.known_load, fixed=fixed,
            checks=False, options=FitOptions(threads=self.settings.options.threads),
        )  # fmt: skip
        told = tuple(held.get(p.name, p) for p in regression.parameters)
        regression = replace(regression, parameters=told)
        cost = cost_of(regression, self.logs, self.settings, {}, lambda: None, steps)
        return regression, cost, folds_of(cost.counts, self.settings.options.folds)


def search(
    base: Sequence[Effect],
    logs: Sequence[Log],
    target: str,
    known_load: str | None,
    fixed: Mapping[str, float],
    exclude: Iterable[str],
    settings: Settings,
    say: Say,
) -> Missing:
    """Find what a drive lacks by the motion that it makes.

    Raises
    ------
    InputError
        As for a fit by simulation, of the base.
    """
    law = settings.controller
    driven = [log if law is None else with_servo_torque(log, law, target) for log in logs]
    way = _Way(driven, target, known_load, fixed, settings)
    say("the base")
    first = driven_model(way, base)
    effects, reasons = possible(base, driven, target, known_load, exclude)
    free = {TORQUE_SCALE} if "torque" in settings.free else set()
    for effect in list(effects):
        if effect.ripple or effect.name in free:
            effects.remove(effect)
            why = "its orders" if effect.ripple else "the controller's torque"
            reasons[effect.name] = f"{why} cannot be searched by simulation; put it in the base"
    steps: list[Step] = []
    refused: dict[str, str] = {}
    withdrawn: dict[str, str] = {}
    while len(steps) < MOST:
        here = steps[-1].after if steps else first
        gone = {effect.name for effect in here.effects} | withdrawn.keys()
        step, refused = _next(way, here, [e for e in effects if e.name not in gone], say)
        if step is None:
            break
        steps.append(step)
        lost, p = _lost(steps)
        if p >= CHANCE:
            name = steps[lost].effect.name
            withdrawn[name] = f"{NOT_SIGNIFICANT} beside {step.effect.name}, p = {p:.2g}"
            steps = steps[:lost]
    return Missing(first, tuple(steps), reasons, {**refused, **withdrawn})


def _lost(steps: Sequence[Step]) -> tuple[int, float]:
    """The least significant name in the last fit: its number, and p."""
    last = steps[-1].after
    errors = errors_within(last)
    every = [p_of_zero(last, step.effect, errors) for step in steps]
    worst = int(np.argmax(every))
    return worst, every[worst]


def driven_model(way: _Way, effects: Sequence[Effect]) -> Driven:
    """Fit a model by its motion, from the regression and other starts, and without each fold."""
    regression, cost, folds = way.posed(effects)
    starts = starts_of(cost, regression, way.settings)
    found = tuple(descend(cost, start, EVALUATIONS) for start in starts)
    return _held_out(Driven(tuple(effects), regression, cost, found, folds))


def told(before: Driven, after: Driven) -> float:
    """Return by how many standard errors over runs `after` misses held-out rows by less."""
    gain = before.sizes() - after.sizes()
    spread = float(np.std(gain, ddof=1) / np.sqrt(len(gain)))
    return float(np.mean(gain)) / max(spread, 1e-12)


def errors_within(made: Driven) -> Errors:
    """Return the errors of a fit and of its refits without each fold."""
    return errors_of(made.cost, made.best.point, [one.point for one in made.without])


def p_of_zero(made: Driven, effect: Effect, errors: Errors) -> float:
    """Return p of the F test that all coefficients of an effect are zero; 1 where none is known."""
    own = coefficient_names([effect])
    searched = enumerate(made.cost.space.searched)
    at = [k for k, one in searched if one.name in own and errors.determined[k]]
    if not at:
        return 1.0
    values = made.best.point[at]
    scaled = values / np.maximum(errors.standard[at], EXACT * np.abs(values) + TINY)
    told = np.linalg.lstsq(errors.correlation[np.ix_(at, at)], scaled, rcond=SINGULAR)[0]
    return float(fisher.sf(scaled @ told / len(at), len(at), errors.degrees))


def _next(
    way: _Way, here: Driven, effects: Sequence[Effect], say: Say
) -> tuple[Step | None, dict[str, str]]:
    """The name that lowers the held-out error most, if one surely does; why others were not."""
    refused: dict[str, str] = {}
    fitted = []
    for effect in effects:
        say(f"{effect.name} beside {len(here.effects)} effects")
        try:
            fitted.append((effect, _beside(way, here, effect)))
        except InputError as error:
            refused[effect.name] = str(error)
    fitted.sort(key=lambda one: one[1].best.rmse)
    finalists = []
    for effect, made in fitted[:FINALISTS]:
        say(f"{effect.name} without each fold")
        finalists.append((effect, _held_out(_descended(made))))
    level = CHANCE / max(len(effects), 1)
    sure = []
    for effect, made in finalists:
        t = told(here, made)
        degrees = len(here.sizes()) - 1
        if made.rmse < here.rmse and student.sf(t, degrees) < level:
            sure.append((effect, made, t))
        else:
            refused[effect.name] = (
                f"does not hold on held-out runs: {here.rmse:.4g} to {made.rmse:.4g} rad, "
                f"t = {t:.1f}"
            )
    significant = []
    for effect, made, t in sure:
        p = p_of_zero(made, effect, errors_within(made))
        if p < CHANCE:
            significant.append((effect, made, t))
        else:
            refused[effect.name] = f"{NOT_SIGNIFICANT}, p = {p:.2g}"
    if not significant:
        return None, refused
    lowest = min(significant, key=lambda one: one[1].rmse)[1]
    same = [one for one in sure if told(one[1], lowest) < SAME]
    ours = (one for one in same if one in significant)
    effect, best, t = min(ours, key=lambda one: (len(one[0].terms), one[1].rmse))
    alike = tuple(e.name for e, _, _ in same if e != effect)
    others = [made for e, made in finalists if e != effect and e.name not in alike]
    weight = _weight(best, [best, here, *others])
    return Step(effect, here, best, t, weight, alike), refused


def _beside(way: _Way, here: Driven, effect: Effect) -> Driven:
    """A model with one effect more, from the optimum without it and from the regression."""
    held = {p.name: p for p in here.regression.parameters if p.name == UNSEEN}
    regression, cost, folds = way.posed([*here.effects, effect], here.cost.steps, held)
    known = here.values()
    warm = cost.space.start.copy()
    for k, one in enumerate(cost.space.searched):
        if one.name in known:
            warm[k] = one.coordinate(min(max(known[one.name], one.lower), one.upper))
        elif one.kind == "coefficient" and not one.logarithmic:
            warm[k] = min(max(0.0, one.lower), one.upper) / one.scale
    starts = [warm, *([cost.space.start] if _moves(cost) else [])]
    found = tuple(descend(cost, start, SCREENED) for start in starts)
    return Driven((*here.effects, effect), regression, cost, found, folds)


def _moves(cost: Cost) -> bool:
    """Whether the regression says more of the motion than a joint that stands still would."""
    moved = [
        (run.measured - run.measured[first])[first:last][count[first:last]]
        for run, count in zip(cost.runs, cost.counts, strict=True)
        for first, last in run.stretches.tolist()
    ]
    return cost.rmse(cost.space.start) < float(np.sqrt(np.mean(np.concatenate(moved) ** 2)))


def _descended(made: Driven) -> Driven:
    more = descend(made.cost, made.best.point, EVALUATIONS)
    return replace(made, found=(more, *made.found))


def _held_out(made: Driven) -> Driven:
    kept = (made.cost.only(made.folds.kept(made.cost.counts, k)) for k in range(len(made.folds)))
    without = tuple(descend(cost, made.best.point, EVALUATIONS) for cost in kept)
    rows = [np.full(len(count), np.nan) for count in made.cost.counts]
    for one, out in zip(without, made.folds.left_out, strict=True):
        missed = made.cost.by_run(one.point)
        for number, mask in enumerate(out):
            some = mask & made.cost.counts[number]
            rows[number][some] = missed[number][some]
    return replace(made, without=without, held_out=tuple(rows))


def _weight(best: Driven, others: Sequence[Driven]) -> float:
    """Share of the likelihood that one model has, each run counted as one observation."""
    logarithms = np.array([-float(np.sum(one.sizes())) for one in others])
    own = -float(np.sum(best.sizes()))
    return float(1.0 / np.sum(np.exp(np.minimum(logarithms - own, 50.0))))
