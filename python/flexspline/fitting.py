"""`fit`: from logs and names of effects to a model with errors and scores."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from flexspline.effects import Effect, effect
from flexspline.effects.causes import OFFSET
from flexspline.errors import InputError, listed, require_kind
from flexspline.formatting import short
from flexspline.progress import Progress

if TYPE_CHECKING:  # what is heavy is imported where it is used: `flexspline --help` is quick
    import numpy as np
    from numpy.typing import NDArray

    from flexspline.least_squares.estimate import Estimate, Given
    from flexspline.least_squares.options import Bounds, FitOptions
    from flexspline.least_squares.problem import Problem
    from flexspline.least_squares.result import Fit
    from flexspline.logs.channel_noise import ChannelNoise
    from flexspline.logs.checks import Finding
    from flexspline.logs.log import Log
    from flexspline.logs.read import LogLike
    from flexspline.model import Model
    from flexspline.prepared import Preparation
    from flexspline.signals import Carried
    from flexspline.simulator import Simulated

__all__ = ["checked", "fit", "fit_near", "posing", "runs_of", "solved", "with_orders"]

ROWS_A_PARAMETER = 3
SPARE_ROWS = 20  # beyond those, for the residual to be judged
SETTLING_ROUNDS = 3


def fit(
    effects: str | Effect | Iterable[str | Effect],
    logs: LogLike | Iterable[LogLike],
    target: str,
    *,
    known_load: str | None = None,
    lowpass: float | None = None,
    orders: Mapping[str, Sequence[int]] | None = None,
    fixed: Mapping[str, float] | None = None,
    bounds: Mapping[str, Bounds] | None = None,
    priors: Mapping[str, tuple[float, float]] | None = None,
    checks: bool = True,
    into: Model | None = None,
    options: FitOptions | None = None,
) -> Fit:
    """Fit effects to logs by least squares of the target on the measured motion.

    To fit the motion that these effects make when simulated, see `fit_motion`.

    Parameters
    ----------
    effects : names of `CATALOGUE`, or `Effect` with shapes to start from and orders, your own
        (`own_effect`) among them.
    logs : one or several runs (as `read_log` takes them) of one joint.
    target : "sensor_torque" [Nm], "motor_torque" [Nm at the output], "motor_current" [A] or
        "torsion" [rad].
    known_load : channel that holds τ_load [Nm], such as "reference_torque". Without it a
        reference channel is left unused.
    lowpass : Hz; zero phase, on the target and on every row alike.
    orders : {"output_ripple": [1, 2, 4]}; a ripple effect without orders gets those that the
        order analysis finds in the residual of the others; low ones of the output, where the runs
        cover part of a turn, those that explain most beside the others, with a warning.
    fixed : {"inertia": 0.02}: parameters that are not fitted, by "effect.term", shape name, or
        effect alone where that is unique; in their units.
    bounds : {"viscous_friction": (0, None)}: limits; a parameter that ends there is said to.
    priors : {"inertia": (0.0192, 0.001)}: value and standard error known from elsewhere.
    checks : look at the logs first; what makes a fit meaningless is refused, faults are warned of.
    into : a model of the same joint that receives this part. A torsion follows the torque through
        the gear: `known_load` plus the gravity of the model's drive (or sensor), where that was
        fitted beside the same known load. Without a known load of its own it may be in the channel
        already, and a warning says that it is taken to.
    options : what few calls need, see `FitOptions`.

    Returns
    -------
    Fit

    Raises
    ------
    InputError
        For unknown names, missing channels, values that are not finite, or too few rows.

    Notes
    -----
    Least squares: turlapati_intrinsic_dynamics (3)–(6), (15), (16). The design matrix of (16)
    has no inverse as printed; what it leaves undetermined is found and named (see
    `Fit.confounded`).
    """
    from flexspline.least_squares.assemble import assembled
    from flexspline.least_squares.estimate import Given, estimate
    from flexspline.least_squares.late_load import beside_delay, can_be_late
    from flexspline.least_squares.options import FitOptions
    from flexspline.least_squares.per_run_terms import (
        ZERO,
        holding_own,
        own_terms,
        projected_effects,
        taken_out,
    )
    from flexspline.least_squares.ripple import with_found_orders
    from flexspline.model import carried_beside, require_model
    from flexspline.prepared import preparations_for
    from flexspline.signals import require_one_unit, without_unread

    require_kind(options, FitOptions, "options")
    if into is not None:
        require_model(into, "into")
    how = FitOptions() if options is None else options
    runs = runs_of(logs)
    chosen = with_orders(effects, orders or {})
    if known_load is None:
        chosen = [e.without_load() for e in chosen]
    require_one_unit(chosen, target, known_load)
    runs, simulated, remarks = _with_simulation(runs, target, known_load, how)
    read, warnings = without_unread(runs, chosen, target, known_load)
    warnings += checked(read, chosen, target, known_load) if checks else []
    carried, unsure = carried_beside(into, read, target, known_load)
    warnings += unsure
    given = Given(fixed or {}, bounds or {}, priors or {}, how.robust == "huber")
    own = own_terms(chosen, how, [*given.fixed], len(runs))
    centred = own == (ZERO,) and taken_out(chosen, runs, given)
    projected = projected_effects(chosen, own, len(runs), given)
    given = holding_own(given, own) if projected else given
    at = [e.name for e in chosen].index(OFFSET) if centred else 0
    offset = (at, chosen.pop(at)) if centred else None

    noise, problem = posing(
        runs,
        chosen,
        target,
        known_load,
        lowpass,
        how,
        own=() if centred else own,
        simulated=simulated,
        carried=carried,
        taken_out={"centred": centred, "projected": projected},
        together=True,
    )

    def again(problem: Problem, made: Estimate) -> Estimate:
        return estimate(problem, made.linear.effects, given, bar.step, near=True)

    with Progress("solving", how.progress, unit=" solves") as bar:
        chosen, found, said = with_found_orders(chosen, problem)
        posed = problem(chosen)
        _require_rows(posed, chosen)
        posed, made = solved(posed, chosen, given, bar.step)
        late = None
        if can_be_late(posed, [e.name for e in chosen]):
            made, late = beside_delay(posed, made, again)
        bar.say("errors and validation")
        said = [*remarks, *warnings, *said]
        inputs = tuple(noise.values())
        raw = how.bandwidth == math.inf and bool(preparations_for(noise, target, known_load))
        whole = assembled(posed, made, into, said, found, offset, inputs, late, raw)
        return replace(whole, bandwidth=how.bandwidth)


def posing(
    runs: Sequence[Log],
    effects: Sequence[Effect],
    target: str,
    known_load: str | None,
    lowpass: float | None,
    how: FitOptions,
    *,
    own: Sequence[str] = (),
    simulated: Simulated | None = None,
    carried: Carried | None = None,
    taken_out: Mapping[str, Any] | None = None,
    together: bool = False,
) -> tuple[dict[str, ChannelNoise], Callable[[Sequence[Effect]], Problem]]:
    """Make runs ready for a fit: what a fit does before it has rows, and nothing after.

    Parameters
    ----------
    effects : as they are asked for; which rows count depends on what they read.
    own, simulated, carried : as `problem_of` takes them.
    taken_out : `centred` and `projected` of the problem.
    together : whether these are all runs of the fit, so that an acceleration that noise makes all
        of in each of them is zero: they do not excite what reads it.

    Returns
    -------
    Noise of each channel, and what makes the problem of effects.

    Raises
    ------
    InputError
        As `problem_of`, and for a bandwidth that does not suit the runs.
    """
    from flexspline.least_squares.problem import problem_of
    from flexspline.prepared import ACCELERATION, learned, prepared, without_noise_alone

    noise, ways = learned(runs, target, known_load, how.bandwidth)
    ways = _read_by(effects, known_load, ways)
    fine = [prepared(log, ways) for log in runs]
    if together and any(ACCELERATION in effect.reads for effect in effects):
        fine, zero = without_noise_alone(runs, fine, ways)
        ways = tuple(way for way in ways if not (zero and way.channel == ACCELERATION))

    def posed_on(
        inputs: Sequence[Log], these: Sequence[Effect], rows: Sequence[NDArray[np.bool_]] | None
    ) -> Problem:
        made = problem_of(
            runs,
            these,
            target,
            known_load=known_load,
            lowpass_hz=lowpass,
            threads=how.threads,
            own=own,
            preparations=ways,
            inputs=inputs,
            counted=rows,
            simulated=simulated,
            carried=carried,
            scatter=noise[known_load].noise if known_load in noise else 0.0,
        )
        return replace(made, **(taken_out or {}))

    counted = _resolved(runs, fine, effects, ways, target, posed_on)
    return noise, lambda these: posed_on(fine, these, counted)


def _with_simulation(
    runs: list[Log], target: str, known_load: str | None, how: FitOptions
) -> tuple[list[Log], Simulated | None, list[str]]:
    """The runs with what a simulation says of them, where there is one, and what is said of it."""
    if how.simulation is None and how.simulated_torque is None:
        return runs, None, []
    from flexspline.simulator import take

    taken = take(runs, target, known_load, how.simulation, how.simulated_torque)
    return [*taken.logs], taken.simulated, [remark.sentence for remark in taken.remarks]


def _read_by(
    effects: Sequence[Effect], known_load: str | None, ways: Sequence[Preparation]
) -> tuple[Preparation, ...]:
    """The preparations of channels that rows of these effects read."""
    read = {channel for effect in effects for channel in effect.reads}
    if "motor_position" in read:  # without a motor encoder it is made of the output's
        read.add("output_position")
    if known_load is not None:
        read.add(known_load)
    return tuple(way for way in ways if way.channel in read)


def _resolved(
    runs: Sequence[Log],
    fine: Sequence[Log],
    effects: Sequence[Effect],
    ways: Sequence[Preparation],
    target: str,
    posed: Callable[[Sequence[Log], Sequence[Effect], list[NDArray[np.bool_]] | None], Problem],
) -> list[NDArray[np.bool_]] | None:
    """Rows that the recorder resolves (`least_squares/problem.py`); None: all, of exact runs.

    Of an acceleration alone all do, unless a smoother takes more than the noise of all rows: rows
    that are left out break the noise's memory, and inertia needs none of them for its shape.
    """
    import numpy as np

    from flexspline.least_squares.estimate import Given, estimate
    from flexspline.least_squares.problem import (
        away_from_ends,
        coarser,
        resolved_rows,
        with_fastest,
    )
    from flexspline.prepared import ACCELERATION, MOTION, VELOCITY, prepared

    if not ways:
        return None
    inside = [away_from_ends(log, log, ways) for log in runs]
    made_here = {way.channel for way in ways}
    if target == "torsion" or made_here.isdisjoint({VELOCITY, ACCELERATION}):
        return inside
    these = [e for e in effects if e.harmonics or not e.ripple]
    these = with_fastest(these) if VELOCITY in made_here else these
    exact = posed(fine, these, inside)
    motion = [way for way in coarser(ways) if way.channel in MOTION]
    coarse = [
        one.with_columns(
            {w.channel: made[w.channel] for w in motion}, note="motion further smoothed"
        )
        for one, made in ((one, prepared(log, motion)) for one, log in zip(fine, runs, strict=True))
    ]
    blurred = posed(coarse, these, inside)
    made = estimate(exact, these, Given({}, {}, {}, False), lambda: None).linear
    both = [problem.predict(made.effects, made.coefficients) for problem in (exact, blurred)]
    measured = [run.target for run in exact.runs]
    told = resolved_rows(runs, measured, list(zip(*both, strict=True)))
    resolved = [a & b for a, b in zip(inside, told, strict=True)]
    if VELOCITY in made_here:
        return resolved
    kept = np.concatenate(resolved)
    if not kept.any():
        return inside
    taken = np.concatenate([one - other for one, other in zip(*both, strict=True)])
    left = np.concatenate([y - one for y, one in zip(measured, both[0], strict=True)])
    return resolved if np.nanmean(taken**2) > np.mean(left[kept] ** 2) else inside


def fit_near(
    problem: Problem,
    effects: Sequence[Effect],
    fixed: Mapping[str, float],
    bounds: Mapping[str, Bounds],
    into: Model | None,
    *,
    general: bool = False,
) -> Fit:
    """Fit effects whose orders and shapes a search has found: both are refined, none looked for.

    Parameters
    ----------
    problem : as `problem_of` makes it for these effects.
    fixed, bounds, into : as for `fit`.
    general : by generalised least squares where that and plain least squares agree as those of a
        right model do (`least_squares/assemble.py`).

    Raises
    ------
    InputError
        For too few rows.
    """
    from flexspline.least_squares.assemble import assembled, generalised

    problem, made = _solved_near(problem, effects, fixed, bounds)
    if general:
        made = generalised(made) or made
    return assembled(problem, made, into, [], None, blurred=False)


def held_out_near(
    problem: Problem,
    effects: Sequence[Effect],
    fixed: Mapping[str, float],
    bounds: Mapping[str, Bounds],
    like: Fit | None = None,
) -> tuple[NDArray[np.float64], ...]:
    """Return what `fit_near` leaves of rows held out, (N,) of each run.

    NaN on rows that do not count. `like`: a fit of another model to the same runs; where that is
    by generalised least squares, so is this, in its noise. Other arguments and errors are those of
    `fit_near`.
    """
    from flexspline.least_squares.estimate import newton

    _, made = _solved_near(problem, effects, fixed, bounds)
    if like is not None and like.generalised and like.solved is not None:
        made = newton(replace(made, denominator=like.solved.denominator)) or made
    return made.validation.residuals


def _solved_near(
    problem: Problem,
    effects: Sequence[Effect],
    fixed: Mapping[str, float],
    bounds: Mapping[str, Bounds],
) -> tuple[Problem, Estimate]:
    from flexspline.least_squares.estimate import Given
    from flexspline.least_squares.problem import settled

    _require_rows(problem, effects)
    problem, given = settled(problem, effects), Given(fixed, bounds, {}, False)
    return solved(problem, effects, given, lambda: None, near=True)


def runs_of(logs: LogLike | Iterable[LogLike]) -> list[Log]:
    """Return logs as a list of runs that can be fitted together.

    Raises
    ------
    InputError
        Where there is none, something else, or one twice.
    """
    from flexspline.logs.read import as_logs
    from flexspline.signals import require_apart

    runs = as_logs(logs)
    if not runs:
        raise InputError("there is no log to fit; give at least one")
    require_apart(runs)
    rows = sum(map(len, runs))
    if rows < SPARE_ROWS and min(map(len, runs)) > 1:  # one row is called no run further down
        raise InputError(
            f"the logs have {rows} rows and a fit needs {SPARE_ROWS} at least; record longer runs"
        )
    return runs


def with_orders(
    effects: str | Effect | Iterable[str | Effect], orders: Mapping[str, Sequence[int]]
) -> list[Effect]:
    """Return effects by their names, ripples with the orders that are given by name of effect."""
    from flexspline.least_squares.options import resolve

    if not isinstance(orders, Mapping):
        raise InputError(
            f"orders is a {type(orders).__name__}; give a dictionary, from an effect's name to the "
            "list of its orders"
        )
    named = [effects] if isinstance(effects, (str, Effect)) else effects
    chosen = [e if isinstance(e, Effect) else effect(e) for e in named]
    for name, its in orders.items():
        at = resolve(name, [e.name for e in chosen], "orders")
        chosen[at] = chosen[at].with_orders(its)
    return chosen


def checked(
    runs: Sequence[Log], effects: Sequence[Effect], target: str, known_load: str | None
) -> list[str]:
    """Refuse what makes a fit meaningless and return the faults as sentences.

    The checks know a load as reference_torque; with another channel they cannot judge effects
    that read it, and the fit looks after these itself.
    """
    from flexspline.logs.checks import check_runs
    from flexspline.logs.checks.load import unused_load

    elsewhere = known_load not in (None, "reference_torque")
    asked = [e.name for e in effects if not (e.own or (elsewhere and "load" in e.reads))]
    sentences = unused_load(runs, target, known_load)
    alike: dict[tuple[Any, ...], list[tuple[str, Finding]]] = {}
    for log, findings in zip(runs, check_runs(runs, effects=asked, target=target), strict=True):
        findings.raise_forbidding(target)
        for number, fault in enumerate(findings.faults):
            whole = fault.rows == (0, len(log))  # what is of some rows is told of each run
            key = (fault.name, fault.channel, fault.unit, *(() if whole else (log.name, number)))
            alike.setdefault(key, []).append((log.name, fault))
    return [*sentences, *(_fault_of_runs(found) for found in alike.values())]


def _fault_of_runs(found: Sequence[tuple[str, Finding]]) -> str:
    """What one or several runs have, of the run where it is largest, and how small it gets."""
    name, worst = max(found, key=lambda one: abs(one[1].size))
    others = [other for other, _ in found if other != name]
    said = f"{name}: {worst.sentence}"
    if others:
        least = min(abs(fault.size) for _, fault in found)
        ms = worst.unit == "s"
        amount = f"{short(1e3 * least)} ms" if ms else f"{short(least)} {worst.unit}".rstrip()
        said += f" The same in {listed(others)}, where it is {amount} or more."
    return f"{said} {worst.remedy}".rstrip()


def solved(
    problem: Problem,
    effects: Sequence[Effect],
    given: Given,
    tick: Callable[[], object],
    *,
    near: bool = False,
) -> tuple[Problem, Estimate]:
    """Return coefficients and shapes, and the problem whose rows count with the widths found.

    It is estimated again until the rows left out for unknown memory are those of these widths.
    `tick` and `near`: as `estimate` takes them.
    """
    from flexspline.least_squares.estimate import estimate
    from flexspline.least_squares.problem import settled

    made = estimate(problem, effects, given, tick, near=near)
    for _ in range(SETTLING_ROUNDS):
        again = settled(problem, made.linear.effects)
        if [run.stretches for run in again.runs] == [run.stretches for run in problem.runs]:
            break
        problem, made = again, estimate(again, made.linear.effects, given, tick, near=near)
    return problem, made


def _require_rows(problem: Problem, effects: Sequence[Effect]) -> None:
    rows = sum(run.counted for run in problem.runs)
    own = len(problem.own) if problem.projected else int(problem.centred)
    parameters = problem.parameters(effects) + own * len(problem.runs)
    needed = ROWS_A_PARAMETER * parameters + SPARE_ROWS
    if rows < needed:
        raise InputError(
            f"the logs have {rows} rows that count, but {parameters} "
            f"coefficients need {needed} at least; record longer runs or leave effects out"
        )
