"""`fit`: from logs and names of effects to a model with errors and scores."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from tqdm import tqdm

from flexspline.effects import Effect, effect
from flexspline.errors import InputError

if TYPE_CHECKING:  # what is heavy is imported where it is used: `flexspline --help` is quick
    import numpy as np
    from numpy.typing import NDArray

    from flexspline.fit.estimate import Estimate, Given
    from flexspline.fit.names import Bounds
    from flexspline.fit.problem import Problem
    from flexspline.fit.result import Fit
    from flexspline.forward.servo import PositionServo
    from flexspline.logs.log import Log
    from flexspline.model import Model
    from flexspline.output_error.settings import Settings
    from flexspline.prepared import Preparation
    from flexspline.simulator.record import Simulated

__all__ = ["fit", "fit_near", "simulation_settings", "with_orders"]

ROWS_A_PARAMETER = 3
SETTLING_ROUNDS = 3
NO_TORSION = ("wrapped_angle", "motor_reversed", "gear_ratio")
"""Faults with which q Ñ − θ is hundreds of rad of nothing; of other targets they are warnings."""


def fit(
    effects: str | Effect | Iterable[str | Effect],
    logs: Log | Sequence[Log],
    target: str,
    *,
    known_load: str | None = None,
    lowpass: float | None = None,
    bandwidth: float | None = None,
    orders: Mapping[str, Sequence[int]] | None = None,
    fixed: Mapping[str, float] | None = None,
    bounds: Mapping[str, Bounds] | None = None,
    priors: Mapping[str, tuple[float, float]] | None = None,
    robust: str | None = None,
    offset_per_run: bool = False,
    into: Model | None = None,
    checks: bool = True,
    simulation: Log | Sequence[Log] | None = None,
    simulated_torque: str | None = None,
    threads: int = 1,
    progress: bool = False,
    by: str = "regression",
    controller: PositionServo | str | os.PathLike[str] | None = None,
    free_controller: Sequence[str] = (),
    starts: int = 8,
    folds: int = 4,
    seed: int = 0,
) -> Fit:
    """Fit effects to logs by least squares, of the torque or of the motion that it makes.

    Parameters
    ----------
    effects : names of `CATALOGUE`, or `Effect` with shapes to start from and orders.
    logs : one or several runs of one joint.
    target : "sensor_torque" [Nm], "motor_torque" [Nm at the output], "motor_current" [A] or
        "torsion" [rad].
    known_load : channel that holds τ_load [Nm], such as "reference_torque". Without it a
        reference channel is left unused.
    lowpass : Hz; zero phase, on the target and on every row alike.
    bandwidth : Hz, -3 dB to which the motion of the output is smoothed before rows read it. None:
        the runs tell how noisy each channel is, and noisy ones are smoothed to what tells them
        best (`Fit.inputs`); exact ones are read as recorded. ``float("inf")``: all channels are
        read as recorded, whatever their noise.
    orders : {"output_ripple": [1, 2, 4]}; a ripple effect without orders gets those that the
        order analysis finds in the residual of the others.
    fixed : {"inertia": 0.02}: parameters that are not fitted, by "effect.term", shape name, or
        effect alone where that is unique; in their units.
    bounds : {"viscous_friction": (0, None)}: limits; a parameter that ends there is said to.
    priors : {"inertia": (0.0192, 0.001)}: value and standard error known from elsewhere.
    robust : "huber" weighs down outliers and pushes (Huber & Ronchetti 2009); None does not.
    offset_per_run : one offset for each run instead of one for all.
    into : a model of the same joint that receives this part.
    checks : look at the logs first; what makes a fit meaningless is refused, faults are warned of.
    simulation, simulated_torque : what any simulator predicts of the target, as for `compare`; the
        effects are fitted to what it lacks, and the model corrects it.
    threads : for the sums over the logs.
    progress : show what is being done on standard error.
    by : "regression" of the target on the measured motion; or "simulation": from there on to the
        parameters whose forward simulation, from the first row to the end, misses the measured
        output_position least (a drive with the effect inertia; what is said of it is in
        `Fit.simulation`).

    Those of by="simulation" alone:

    controller : the servo's law that drives the simulation, or the path of its `servo.json`; None:
        the measured motor torque does. Without a torque channel, `duty` gives the regression's.
    free_controller : fields of the law that are fitted too, of "torque" and "back_emf".
    starts : descents: from the regression, from where short pieces of the runs are missed least,
        and the others around the regression by `seed`.
    folds : every `folds`-th run is left out in turn (of fewer runs, as many blocks of each); what
        the fits without find is within the intervals.

    Returns
    -------
    Fit

    Raises
    ------
    InputError
        For unknown names, missing channels, values that are not finite, or too few rows; by
        simulation also without inertia or motion.

    Notes
    -----
    Least squares: turlapati_intrinsic_dynamics (3)–(6), (15), (16). The design matrix of (16)
    has no inverse as printed; what it leaves undetermined is found and named (see
    `Fit.confounded`). By simulation: Ljung 1999, System identification, output-error models.
    """
    from flexspline.fit.assemble import assembled
    from flexspline.fit.estimate import Given, estimate
    from flexspline.fit.late_load import beside_delay, can_be_late
    from flexspline.fit.offsets import OFFSET, taken_out
    from flexspline.fit.problem import problem_of
    from flexspline.fit.ripple import with_found_orders
    from flexspline.logs.log import Log
    from flexspline.prepared import learned, preparations_for, prepared
    from flexspline.requirements import require_apart, require_one_unit

    if robust not in (None, "huber"):
        raise InputError(f"robust is {robust!r}; give 'huber' or None")
    runs = [logs] if isinstance(logs, Log) else list(logs)
    if not runs:
        raise InputError("there is no log to fit; give at least one")
    for run in runs:
        if not isinstance(run, Log):
            raise InputError(
                f"logs holds a {type(run).__name__}; give logs, as read_log makes them"
            )
    require_apart(runs)
    chosen = with_orders(effects, orders or {})
    foreign = simulation is not None or simulated_torque is not None
    if by != "regression" or controller is not None or free_controller:
        if foreign:
            raise InputError(
                "by='simulation' drives the effects alone; leave the foreign simulation out"
            )
        _require_simulation(by, priors, offset_per_run, bandwidth)
        regression = partial(
            fit, chosen, target=target, known_load=known_load, lowpass=lowpass, fixed=fixed,
            bounds=bounds, robust=robust, checks=checks, threads=threads, bandwidth=math.inf,
        )  # fmt: skip
        settings = simulation_settings(
            controller, free_controller, starts, folds, seed, threads, progress
        )
        return _by_simulation(chosen, runs, target, settings, regression, bounds or {}, into)
    if known_load is None:
        chosen = [e.without_load() for e in chosen]
    require_one_unit(chosen, target, known_load)
    simulated: Simulated | None = None
    remarks: tuple[str, ...] = ()
    if foreign:
        from flexspline.simulator.taken import take

        taken = take(runs, target, known_load, simulation, simulated_torque)
        runs, simulated = list(taken.logs), taken.simulated
        remarks = tuple(remark.sentence for remark in taken.remarks)
    warnings = _checked(runs, chosen, target, known_load) if checks else []
    given = Given(fixed or {}, bounds or {}, priors or {}, robust == "huber")
    centred = offset_per_run and taken_out(chosen, runs, given)
    at = [e.name for e in chosen].index(OFFSET) if centred else 0
    offset = (at, chosen.pop(at)) if centred else None

    noise, ways = learned(runs, target, known_load, bandwidth)
    ways = _read_by(chosen, known_load, ways)
    fine = [prepared(log, ways) for log in runs]

    def posed_on(
        inputs: Sequence[Log], these: Sequence[Effect], rows: Sequence[NDArray[np.bool_]] | None
    ) -> Problem:
        made = problem_of(
            runs,
            these,
            target,
            known_load=known_load,
            lowpass_hz=lowpass,
            threads=threads,
            offset_per_run=offset_per_run and not centred,
            preparations=ways,
            inputs=inputs,
            counted=rows,
            simulated=simulated,
        )
        return replace(made, centred=centred)

    counted = _resolved(runs, fine, chosen, ways, target, posed_on)

    def problem(these: Sequence[Effect]) -> Problem:
        return posed_on(fine, these, counted)

    def again(problem: Problem, made: Estimate) -> Estimate:
        return estimate(problem, made.linear.effects, given, bar.update, near=True)

    with tqdm(desc="solving", unit=" solves", disable=not progress, leave=False, delay=1.0) as bar:
        chosen, found, said = with_found_orders(chosen, problem)
        posed = problem(chosen)
        _require_rows(posed, chosen)
        made = estimate(posed, chosen, given, bar.update)
        posed, made = _settled(posed, made, given, bar.update)
        late = None
        if can_be_late(posed, [e.name for e in chosen]):
            made, late = beside_delay(posed, made, again)
        bar.set_description("errors and validation")
        said = [*remarks, *warnings, *said]
        inputs = tuple(noise.values())
        raw = bandwidth == math.inf and bool(preparations_for(noise, target, known_load))
        whole = assembled(posed, made, into, said, found, offset, inputs, late, raw)
        return replace(whole, bandwidth=bandwidth)


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
    """Which rows the recorder resolves, see `resolution.py`; None for all of exact runs."""
    from flexspline.fit.estimate import Given, estimate
    from flexspline.fit.resolution import away_from_ends, coarser, resolved_rows, with_fastest
    from flexspline.prepared import MOTION, VELOCITY, prepared

    if not ways:
        return None
    inside = [away_from_ends(log, log, ways) for log in runs]
    if target == "torsion" or not any(way.channel == VELOCITY for way in ways):
        return inside
    these = with_fastest([e for e in effects if e.harmonics or not e.ripple])
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
    return [a & b for a, b in zip(inside, told, strict=True)]


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
        right model do (`generalised.py`).

    Raises
    ------
    InputError
        For too few rows.
    """
    from flexspline.fit.assemble import assembled
    from flexspline.fit.estimate import Given, estimate
    from flexspline.fit.generalised import generalised
    from flexspline.fit.memory import settled

    _require_rows(problem, effects)
    problem, given = settled(problem, effects), Given(fixed, bounds, {}, False)
    made = estimate(problem, effects, given, lambda: None, near=True)
    problem, made = _settled(problem, made, given, lambda: None, near=True)
    if general:
        made = generalised(made) or made
    return assembled(problem, made, into, [], None)


def _require_simulation(
    by: str, priors: object, offset_per_run: bool, bandwidth: float | None
) -> None:
    if by not in ("regression", "simulation"):
        raise InputError(f"by is {by!r}; give 'regression' or 'simulation'")
    if by == "regression":
        raise InputError("a controller drives a simulation; give by='simulation' or leave it out")
    if priors:
        raise InputError("by='simulation' takes no priors; fix or bound the parameter instead")
    if bandwidth is not None and bandwidth != math.inf:
        raise InputError("by='simulation' compares the motion as it is; leave bandwidth out")
    if offset_per_run:
        raise InputError("by='simulation' takes one offset for all runs; leave offset_per_run out")


def simulation_settings(
    controller: PositionServo | str | os.PathLike[str] | None, free: Sequence[str], *rest: Any
) -> Settings:
    """Return `Settings`; the law may be a path of its `servo.json`."""
    from flexspline.forward.servo import PositionServo
    from flexspline.output_error.settings import Settings

    if isinstance(controller, (str, os.PathLike)):
        controller = PositionServo.load(controller)
    return Settings(controller, (free,) if isinstance(free, str) else tuple(free), *rest)


def _by_simulation(*given: Any) -> Fit:
    from flexspline.output_error.fitting import fit_by_simulation

    return fit_by_simulation(*given)


def with_orders(
    effects: str | Effect | Iterable[str | Effect], orders: Mapping[str, Sequence[int]]
) -> list[Effect]:
    """Return effects by their names, ripples with the orders that are given by name of effect."""
    from flexspline.fit.names import resolve

    named = [effects] if isinstance(effects, (str, Effect)) else effects
    chosen = [e if isinstance(e, Effect) else effect(e) for e in named]
    for name, its in orders.items():
        at = resolve(name, [e.name for e in chosen], "orders")
        chosen[at] = chosen[at].with_orders(its)
    return chosen


def _checked(
    runs: Sequence[Log], effects: Sequence[Effect], target: str, known_load: str | None
) -> list[str]:
    """Refuse what makes a fit meaningless and return the faults as sentences.

    The checks know a load as reference_torque; with another channel they cannot judge effects
    that read it, and the fit looks after these itself.
    """
    from flexspline.logs.checks import check

    elsewhere = known_load not in (None, "reference_torque")
    asked = [e.name for e in effects if not (elsewhere and "load" in e.reads)]
    sentences = []
    for log in runs:
        findings = check(log, effects=asked, target=target)
        findings.raise_errors()
        if target == "torsion":
            findings.raise_named(NO_TORSION)
        sentences += [f"{log.name}: {f.sentence} {f.remedy}".rstrip() for f in findings.faults]
    return sentences


def _settled(
    problem: Problem,
    made: Estimate,
    given: Given,
    tick: Callable[[], object],
    *,
    near: bool = False,
) -> tuple[Problem, Estimate]:
    """Estimate again until the rows left out for unknown memory are those of the widths found."""
    from flexspline.fit.estimate import estimate
    from flexspline.fit.memory import settled

    for _ in range(SETTLING_ROUNDS):
        again = settled(problem, made.linear.effects)
        if again.runs == problem.runs:
            break
        problem, made = again, estimate(again, made.linear.effects, given, tick, near=near)
    return problem, made


def _require_rows(problem: Problem, effects: Sequence[Effect]) -> None:
    rows = sum(run.counted for run in problem.runs)
    parameters = problem.parameters(effects) + problem.centred * len(problem.runs)
    needed = ROWS_A_PARAMETER * parameters + 20
    if rows < needed:
        raise InputError(
            f"the logs have {rows} rows that count, but {parameters} "
            f"coefficients need {needed} at least; record longer runs or leave effects out"
        )
