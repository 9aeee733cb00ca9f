"""`discover`: from today's model and runs that disagree with it to what is missing."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from flexspline.comparison import based
from flexspline.comparison.runs import LEAST_ROWS
from flexspline.discovery.analysis import Analysis, FirstLook, analysed, first_look
from flexspline.discovery.assemble import assembled
from flexspline.discovery.by_simulation import discover_by_simulation
from flexspline.discovery.candidates import (
    OF_BASE,
    TAKEN,
    OfBase,
    as_given,
    freedoms,
    held_of,
    of_base,
    unseen_of,
    with_freedoms,
)
from flexspline.discovery.confirmation import Confirmed, Residuals, confirmed
from flexspline.discovery.faults import (
    SENSOR,
    DataFault,
    Delay,
    data_faults,
    delay_behind,
    delay_beside_everything,
    graded,
    lead_of,
    load_delays,
    with_measured_ratio,
    with_torque_on_time,
    with_unwrapped_angles,
)
from flexspline.discovery.physics import held_powers, spring_bounds
from flexspline.discovery.result import Discovery
from flexspline.discovery.search import SearchContext, search_context_of
from flexspline.discovery.settings import SETTINGS
from flexspline.effects import Effect
from flexspline.effects.causes import LAG
from flexspline.errors import InputError, listed, require_kind
from flexspline.experiment.plan import Limits
from flexspline.fitting import fit, fit_near, held_out_near, with_orders
from flexspline.formatting import short_names
from flexspline.forward.servo import PositionServo
from flexspline.least_squares.options import Bounds, FitOptions, MotionOptions
from flexspline.least_squares.problem import (
    Problem,
    away_from_ends,
    coarser,
    problem_of,
    resolved_rows,
    with_fastest,
)
from flexspline.least_squares.result import Fit
from flexspline.logs.checks.ends import Kept, at_work, only_experiments
from flexspline.logs.derive import has_value, sampled
from flexspline.logs.log import Log
from flexspline.logs.read import LogLike, as_logs
from flexspline.model import Model, carried_beside, own_of_runs
from flexspline.output_error.fitting import settings_of, with_servo_torque
from flexspline.own import OwnEffect, own_effects
from flexspline.prepared import Preparation, learned, prepared
from flexspline.progress import Progress
from flexspline.regression.candidate_model import CandidateModel, candidate_model_of, started
from flexspline.regression.gram import Whitening
from flexspline.signals import Carried, require_apart
from flexspline.simulator import SIMULATED, SIMULATION_DELAY, Simulated

__all__ = ["discover"]

Posed = tuple[Problem, tuple[Effect, ...], dict[str, float], dict[str, Bounds]]
"""What `fit_near` takes: a problem, effects, fixed values, bounds."""


def discover(
    model_or_effects: Model | str | Effect | Iterable[str | Effect] | None,
    logs: LogLike | Iterable[LogLike],
    *,
    target: str | None = None,
    known_load: str | None = None,
    simulation: LogLike | Sequence[LogLike] | None = None,
    simulated_torque: str | None = None,
    lowpass: float | None = None,
    bandwidth: float | None = None,
    orders: Mapping[str, Sequence[int]] | None = None,
    fixed: Mapping[str, float] | None = None,
    exclude: Iterable[str] = (),
    own: OwnEffect | Iterable[OwnEffect] = (),
    limits: Limits | None = None,
    progress: bool = False,
    threads: int = 1,
    by: str = "regression",
    controller: PositionServo | str | os.PathLike[str] | None = None,
    free_controller: Sequence[str] = (),
) -> Discovery:
    """Find which effects are missing, add them, and say how sure that is.

    Parameters
    ----------
    model_or_effects : a model to start from, or the effects that are known to be there. Of a
        model, what its user fixed stays fixed; all else is fitted again. None where a simulation
        is the base.
    logs : one or several runs (as `read_log` takes them) of one joint; four and more are left out
        one by one.
    target : "sensor_torque" [Nm], "motor_torque" [Nm at the output], "motor_current" [A] or
        "torsion" [rad]; None: the model's only part.
    known_load : channel that holds τ_load [Nm]; None: that of the model.
    simulation, simulated_torque : what any simulator predicts of the target, as for `compare`: it
        is the base, and what is found is what it lacks.
    lowpass : Hz; zero phase, on the target and on every row alike.
    bandwidth : Hz, -3 dB to which the motion of the output is smoothed before rows read it; None:
        as the runs tell; ``float("inf")``: all channels as recorded. See `fit`.
    orders : {"output_ripple": [1, 2]} of the base; found where they are not given.
    fixed : parameters that are not fitted, as for `fit`.
    exclude : names of effects that are known not to be there; none of them is a candidate.
    own : effects of your own (`flexspline.own_effect`) that may be missing; they are candidates
        beside those of the catalogue, and need the same evidence.
    limits : what a run to record next may do; what is left open is what these runs did.
    progress : show what is being tried on standard error.
    threads : for the sums over the logs.
    by : "regression" of the target; or "simulation": the effects whose forward simulation misses
        the measured output_position less, where only motion is measured
        (`discovery/by_simulation.py`).
    controller, free_controller : of by="simulation" alone, as for `fit_motion`.

    Returns
    -------
    Discovery

    Raises
    ------
    InputError
        As `fit`, for the base; unless exactly one of effects, a model and a simulation is the
        base; for a name in `exclude` that is no effect, or one of the base.

    Notes
    -----
    Stuck tails, homing moves and rows in which a drive is off or its joint rests are left out
    first, and said to be (`logs/checks/ends.py`). How names are chosen: `discovery/search.py`;
    what evidence is: `discovery/evidence.py`. The model is fitted by generalised least squares in
    the noise's memory where that agrees with plain least squares as for a right model, by plain
    least squares otherwise (`least_squares/assemble.py`).
    """
    require_kind(limits, Limits, "limits")
    runs = as_logs(logs)
    if not runs:
        raise InputError("there is no log to look at; give at least one")
    require_apart(runs)
    if by != "regression" or controller is not None or free_controller:
        foreign = simulation is not None or simulated_torque is not None
        _require_simulation(by, foreign, own, lowpass=lowpass, bandwidth=bandwidth)
        if not isinstance(model_or_effects, Model):
            target = target or "motor_torque"
    base, runs, of_base = _base(
        model_or_effects, runs, target, known_load, simulation, simulated_torque
    )
    task = replace(
        _task(base, runs, target, known_load, fixed or {}),
        lowpass=lowpass,
        orders=orders or {},
        exclude=(exclude,) if isinstance(exclude, str) else tuple(exclude),
        own=own_effects(own),
        threads=threads,
    )
    usual = USUAL if by == "regression" else None
    with Progress("discovering", progress, usual=usual) as bar:
        task = replace(task, say=bar.say)
        with threadpool_limits(1, user_api="blas"):  # tables are thin: its threads would only wait
            if by == "simulation":
                return _by_simulation(task, runs, controller, free_controller)
            return _by_regression(task, runs, of_base, bandwidth, limits)


USUAL = {"noise": 0.12, "functions of the channels": 0.26, "names": 0.5, "what is left": 0.64,
         "errors and validation": 0.73}  # fmt: skip
"""Share of the work that lies before: median of 13 logs of `tests/bench/elsewhere`."""


@dataclass(frozen=True)
class Task:
    """What a discovery starts from, and how it goes about it: see `discover`.

    `model`: the one of which the base is a part. `carried`: as for `problem_of`. `preparations`: of
    the inputs. `scatter`: noise of the load cell, Nm. `late`: s, by which the target was late
    before all else was moved to it. `say`: is told what is being done.
    """

    effects: tuple[Effect, ...]
    target: str
    known_load: str | None
    fixed: Mapping[str, float]
    model: Model | None = None
    simulated: Simulated | None = None
    carried: Carried | None = None
    lowpass: float | None = None
    orders: Mapping[str, Sequence[int]] = field(default_factory=dict)
    exclude: tuple[str, ...] = ()
    own: tuple[OwnEffect, ...] = ()
    threads: int = 1
    preparations: tuple[Preparation, ...] = ()
    scatter: float = 0.0
    late: float = 0.0
    say: Callable[[str], object] = lambda _: None


def _by_regression(
    task: Task,
    runs: list[Log],
    of_base: tuple[DataFault, ...],
    bandwidth: float | None,
    limits: Limits | None,
) -> Discovery:
    """What the target of a regression lacks; `of_base`: what is wrong with the base.

    A simulation that is late looks like a load that is, so that this is not asked beside it.
    """
    target, load = task.target, task.known_load
    recordings = only_experiments(runs, target)
    runs = [one.log for one in recordings]
    count = sum(map(len, runs))
    if count < LEAST_ROWS:
        raise InputError(
            f"the logs have {count} rows and {LEAST_ROWS} are needed at least; give longer runs"
        )
    faults = data_faults(runs, task.effects, target, load, task.threads)
    faults = (*of_base, *_cut(recordings, faults))
    runs, faults = with_measured_ratio(*with_unwrapped_angles(runs, faults), target)
    inputs, ways = learned(runs, target, load, bandwidth, task.threads)
    # moving a channel takes of its noise, which is known now
    runs, faults, late = with_torque_on_time(runs, faults, target)
    scatter = inputs[load].noise if load in inputs else 0.0
    task = replace(task, preparations=tuple(ways), scatter=scatter, late=late)
    free = freedoms(task.effects, target, load, runs, inputs)
    taken = [LAG] if any(fault.name == SIMULATION_DELAY for fault in of_base) else []
    free = tuple(name for name in free if name not in (*task.exclude, *taken))
    if load in inputs and inputs[load].noisy and (LAG in free or target == "torsion"):
        recorded, held, delay = _on_one_clock(runs, load, task, free)
        if delay:
            faults = (*faults, *load_delays(runs, target, load, delay))
    else:
        recorded = _Recorded.of(runs, task)
        held = recorded.confirmed(recorded.analysed(free), free)
    rows = _rows(recordings, recorded.logs, held.made)
    made = assembled(held, faults, tuple(inputs.values()), rows, limits)
    final = held.made.final
    base = {e.info.name: e.harmonics for e in final.effects if isinstance(e, OfBase)}
    fit = recorded.as_read(final, free) if base else made.fit
    found = replace(
        made,
        base_effects=tuple(effect.name for effect in task.effects),
        base_orders=base,
        fit=replace(fit, bandwidth=bandwidth),
    )
    judged = graded(found.data_faults, recorded.logs, found.fit, found.noise_floor)
    return replace(found, data_faults=judged)


def _require_simulation(by: str, foreign: bool, own: object, **smoothing: float | None) -> None:
    if by not in ("regression", "simulation"):
        raise InputError(f"by is {by!r}; give 'regression' or 'simulation'")
    if by == "regression":
        raise InputError("a controller drives a simulation; give by='simulation' or leave it out")
    if foreign:
        raise InputError(
            "by='simulation' drives the effects alone; leave the foreign simulation out"
        )
    for name, value in smoothing.items():
        if value is not None:
            raise InputError(f"by='simulation' compares the motion as it is; leave {name} out")
    if own:
        raise InputError(
            "by='simulation' drives effects in the compiled core, which has the catalogue's "
            "alone; leave own out"
        )


def _by_simulation(
    task: Task,
    runs: list[Log],
    controller: PositionServo | str | os.PathLike[str] | None,
    free_controller: Sequence[str],
) -> Discovery:
    """What a drive lacks by the motion that it makes."""
    recordings = only_experiments(runs, "output_position")  # a servo's law knows when it is off
    runs = [one.log for one in recordings]
    task = replace(task, effects=tuple(with_orders(task.effects, task.orders)))
    options = MotionOptions(
        free_controller=free_controller, starts=2, folds=SETTINGS.tried, threads=task.threads
    )
    settings = settings_of(controller, options)
    law = settings.controller
    driven = [log if law is None else with_servo_torque(log, law, task.target) for log in runs]
    faults = data_faults(driven, task.effects, task.target, task.known_load, task.threads)
    found = discover_by_simulation(
        task.effects, runs, task.target, task.known_load, task.fixed, task.exclude, settings,
        task.model, _cut(recordings, faults), task.say,
    )  # fmt: skip
    left = _counts(recordings)
    return replace(found, rows={"used": sum(map(len, runs)), **left}) if left else found


@dataclass(frozen=True, eq=False)
class _Recorded:
    """The runs as recorded, and with their inputs as rows read them.

    `counted`: rows of each that the recorder resolves, without a drive's rests; None for all.
    `blur`: by how much the base moves with the motion smoothed further, (N,) of each.
    """

    task: Task
    logs: list[Log]
    inputs: list[Log]
    counted: list[NDArray[np.bool_]] | None = None
    blur: list[NDArray[np.float64]] | None = None

    @classmethod
    def of(cls, runs: Sequence[Log], task: Task) -> _Recorded:
        made, ways = cls._made(runs, task, task.preparations), task.preparations
        if not ways:
            return made
        inside = [away_from_ends(log, log, ways) for log in runs]
        made = replace(made, counted=_all_of(inside, made.counted))
        if task.target == "torsion" or not any(w.channel == "output_position" for w in ways):
            return made
        further = replace(cls._made(runs, task, coarser(ways)), counted=made.counted)
        base = with_fastest([e for e in task.effects if e.harmonics or not e.ripple])
        fine, coarse = made.problem(base), further.problem(base)
        plain = Whitening(np.ones(1), 1.0, fine.decimation)
        work, _ = started(fine, candidate_model_of(base, len(base), task.fixed), plain)
        both = [(work.predict(fine, k), work.predict(coarse, k)) for k in range(len(runs))]
        told = resolved_rows(
            [run.log for run in fine.runs], [run.target for run in fine.runs], both
        )
        blur = [np.nan_to_num(one - other) for one, other in both]
        return replace(made, counted=_all_of(told, made.counted), blur=blur)

    def moved(self, runs: Sequence[Log], load: str, late: float) -> _Recorded:
        """The same `runs` with a load that is late moved to where it belongs, s.

        All else stays as it was made. Rows that then have no load do not count, nor do those that
        an end of it blurs.
        """
        if not late:
            return self
        note = f"{load} moved {abs(late):g} s {'earlier' if late > 0.0 else 'later'}"
        shifted = [
            log.with_columns(
                {load: sampled(load, log["time"], log[load], log["time"] + late)}, note=note
            )
            for log in runs
        ]
        ways = [way for way in self.task.preparations if way.channel == load]
        made = self._made(shifted, self.task, ways)
        inputs, known = [], []
        for number, log in enumerate(made.logs):
            own = {load: made.inputs[number][load]}
            inputs.append(self.inputs[number].with_columns(own, note=note))
            time = runs[number]["time"]
            clock = runs[number].with_columns({"time": time - late}, note="the clock of its load")
            known.append(has_value(time, time + late) & away_from_ends(clock, log, ways))
        return replace(made, inputs=inputs, counted=_all_of(known, self.counted), blur=self.blur)

    @classmethod
    def _made(cls, runs: Sequence[Log], task: Task, ways: Sequence[Preparation]) -> _Recorded:
        """Inputs of all rows; those at rest do not count, but what is remembered goes on there."""
        counted = at_work(runs, task.target)
        return cls(task, [*runs], [prepared(log, ways) for log in runs], counted)

    @property
    def _posed(self) -> dict[str, Any]:
        """What `problem_of` asks for beside runs and effects."""
        return {
            "target": self.task.target,
            "known_load": self.task.known_load,
            "lowpass_hz": self.task.lowpass,
            "threads": self.task.threads,
            "preparations": self.task.preparations,
            "counted": self.counted,
            "simulated": self.task.simulated,
            "carried": self.task.carried,
            "scatter": self.task.scatter,
            "inputs": self.inputs,
        }

    def problem(self, effects: Sequence[Effect]) -> Problem:
        return problem_of(self.logs, effects, **self._posed)

    def context(
        self, free: Sequence[str], *exclude: str
    ) -> tuple[SearchContext, list[Effect], dict[str, float]]:
        """What may be missing beside the base; the base with its freedoms; what is held of it.

        `free`: what the base is given beside its effects (`freedoms`). `exclude`: more than the
        task's.
        """
        task = self.task
        effects: Sequence[Effect] = with_orders(task.effects, task.orders)
        given = {e.name for e in effects if e.harmonics}
        if any(e.ripple and not e.harmonics for e in effects):
            effects = fit(
                effects, self.logs, task.target, known_load=task.known_load, lowpass=task.lowpass,
                fixed=task.fixed, checks=False, options=FitOptions(
                    threads=task.threads, bandwidth=float("inf"),
                    simulated_torque=SIMULATED if task.simulated else None,
                ),
            ).part.effects  # fmt: skip
        effects = with_freedoms(of_base(effects, given), free)
        absent = (*task.exclude, *exclude)
        context = search_context_of(effects, self.logs, exclude=absent, own=task.own, **self._posed)
        context = replace(context, late=task.late)
        if self.blur is not None:
            both = zip(context.problem.runs, self.blur, strict=True)
            runs = tuple(replace(run, blur=blur) for run, blur in both)
            context = replace(context, problem=replace(context.problem, runs=runs))
        return context, effects, self._held(effects, free, context.problem)

    def _held(
        self, base: Sequence[Effect], free: Sequence[str], problem: Problem
    ) -> dict[str, float]:
        """What is not fitted of a base: what the user holds of it, and of its freedoms."""
        known = {e.info.name: e.name for e in base if isinstance(e, OfBase)}
        fixed = {
            ".".join([known.get(owner, owner), *rest]): value
            for name, value in self.task.fixed.items()
            for owner, *rest in [name.split(".", 1)]
        }
        return {**fixed, **held_of(base, free, problem)}

    def look(self, free: Sequence[str]) -> FirstLook:
        return first_look(*self.context(free), self.task.say)

    def analysed(self, free: Sequence[str]) -> Analysis:
        return analysed(self.look(free), self.task.say)

    def confirmed(self, made: Analysis, free: Sequence[str]) -> Confirmed:
        """The names that hold, in the model that is fitted to all rows that count."""
        self.task.say("errors and validation")

        def fitted(work: CandidateModel) -> Fit:
            return fit_near(*self.posed(work, free), self.task.model, general=True)

        def left_by(work: CandidateModel, like: Fit) -> Residuals:
            return held_out_near(*self.posed(work, free), like)

        given = [name for e in self.task.effects for name in (e.name, f"{e.name}{OF_BASE}")]
        return confirmed(made, fitted, left_by, given)

    def posed(self, work: CandidateModel, free: Sequence[str]) -> Posed:
        """The fit of a model; `free`: what its base was given."""
        problem, base = self.problem(work.effects), work.effects[: work.base]
        hidden = {**unseen_of(work.named, problem), **held_powers(work)}
        held = {**hidden, **self._held(base, free, problem)}
        springs = spring_bounds(work, self.task.target)
        fixed = self.task.fixed
        allowed = {name: limits for name, limits in springs.items() if name not in fixed}
        return problem, work.effects, held, allowed

    def as_read(self, work: CandidateModel, free: Sequence[str]) -> Fit:
        """The fit of a model, in which each effect stands once, with all of its orders."""
        _, _, held, allowed = self.posed(work, free)
        held = {name.replace(OF_BASE, ""): value for name, value in held.items()}
        effects, into = as_given(work.effects), self.task.model
        return fit_near(self.problem(effects), effects, held, allowed, into, general=True)


def _all_of(
    these: Sequence[NDArray[np.bool_]], those: Sequence[NDArray[np.bool_]] | None
) -> list[NDArray[np.bool_]]:
    """Rows of each run that count in both; None for all of them."""
    return [*these] if those is None else [a & b for a, b in zip(these, those, strict=True)]


def _on_one_clock(
    runs: Sequence[Log], load: str, task: Task, free: Sequence[str]
) -> tuple[_Recorded, Confirmed, float]:
    """Look for names with a late load moved to where it belongs; and its delay, s, 0 for none.

    The delay is estimated before any name is looked for; the lag that stays in the base during the
    search makes it more precise. Where the sensor is behind its load, a lag is to be named.
    """
    as_read = recorded = _Recorded.of(runs, task)
    if LAG not in free:
        return _behind_a_torsion(runs, load, as_read, free)
    late, delay = Delay(), 0.0
    others, sensor = [name for name in free if name != LAG], task.target in SENSOR
    look = recorded.look(free)
    for _ in range(SETTINGS.tried - 1):  # to first order each
        step = delay_beside_everything(look)
        late = Delay(delay + step.seconds, step.error)
        if not step.significant or (sensor and late.seconds < 0.0):
            break
        delay = late.seconds
        recorded = as_read.moved(runs, load, delay)
        look = recorded.look(free)
    made = analysed(look, task.say)
    rest = lead_of(made)
    if sensor and rest.significant and delay + rest.seconds < 0.0:
        delay, recorded = 0.0, as_read
        made = recorded.analysed(others)
    elif rest.significant and (late.bears_out(delay + rest.seconds) or _all_by_a_lag(made)):
        delay += rest.seconds
        recorded = as_read.moved(runs, load, delay)
        if not late.bears_out(delay):  # one step from far away, to first order
            delay += lead_of(made.in_runs(recorded.context(free)[0], "")).seconds
            recorded = as_read.moved(runs, load, delay)
        made = made.in_runs(recorded.context(others, LAG)[0], LAG)
    else:
        made = made.without(LAG)
    if delay and LAG not in task.exclude:
        made.context.not_tried[LAG] = TAKEN
    return recorded, recorded.confirmed(made, others), delay


def _behind_a_torsion(
    runs: Sequence[Log], load: str, as_read: _Recorded, free: Sequence[str]
) -> tuple[_Recorded, Confirmed, float]:
    """The same of a torsion: what the load makes of it depends on the names."""
    recorded, delay = as_read, 0.0
    made = found = recorded.analysed(free)
    for _ in range(SETTINGS.tried - 1):
        late = delay_behind(made)
        if not late.significant:
            break
        delay += late.seconds
        recorded = as_read.moved(runs, load, delay)
        made = recorded.analysed(free)
    if made.leftover.share >= 0.5:  # what is unexplained may be what is late
        made, recorded, delay = found, as_read, 0.0
    return recorded, recorded.confirmed(made, free), delay


def _all_by_a_lag(made: Analysis) -> bool:
    """Whether nearly all is explained beside the lag of the base, and most of it by no name.

    Where an arm is the load, functions of its angle tell of the delay hardly anything.
    """
    bare = made.without(LAG)
    base, names, every = (left.rmse**2 for left in (bare.before, bare.after, made.after))
    return made.unexplained_beyond(LAG) <= 1.0 - SETTINGS.most and names - every > base - names


def _base(
    given: Model | str | Effect | Iterable[str | Effect] | None,
    runs: list[Log],
    target: str | None,
    known_load: str | None,
    simulation: LogLike | Sequence[LogLike] | None,
    column: str | None,
) -> tuple[Model | str | Effect | Iterable[str | Effect], list[Log], tuple[DataFault, ...]]:
    """What to start from, the runs with what it reads, and what is wrong with a simulation."""
    foreign = simulation is not None or column is not None
    if foreign and (given is None or isinstance(given, Model)):
        made = based(given, runs, target, known_load, simulation, column)
        found = tuple(
            DataFault.of(r.run, r.finding, r.sentence, grave=r.finding.severity != "note")
            for r in made.remarks
        )
        return made.model, made.logs, found
    if foreign or given is None:
        raise InputError("give exactly one of effects, a model, and a simulation as the base")
    return given, runs, ()


def _task(
    given: Model | str | Effect | Iterable[str | Effect],
    runs: Sequence[Log],
    target: str | None,
    known_load: str | None,
    fixed: Mapping[str, float],
) -> Task:
    """What to start from."""
    if isinstance(given, Model):
        part = given.part(target)
        own = [short_names(term["term"]) for term in own_of_runs(part)]
        if own:
            raise InputError(
                "discover fits one value of each term to all runs, but the model has "
                f"{listed(own)} of each run by itself; start from a model without per_run, or from "
                "effects"
            )
        parameters = part.record.get("parameters", ())
        by_user = {p["name"]: float(p["value"]) for p in parameters if p["state"] == "fixed"}
        held = {**by_user, **fixed}
        load = known_load or part.known_load
        carried, _ = carried_beside(given, runs, part.target, load)
        return Task(part.effects, part.target, load, held, given, part.simulated, carried)
    if target is None:
        raise InputError("no target is given; give target='sensor_torque' or another one")
    effects = with_orders(given, {})
    if known_load is None:
        effects = [e.without_load() for e in effects]
    return Task(tuple(effects), target, known_load, fixed)


def _cut(recordings: Sequence[Kept], faults: Sequence[DataFault]) -> tuple[DataFault, ...]:
    """What was left out before anything was searched, then faults, in rows of the recordings."""
    cut = [
        DataFault.of(one.run, one.finding, one.sentence, grave=False, left_out=True)
        for kept in recordings
        for one in kept.left
    ]
    moved = []
    for fault in faults:
        own = [kept for kept in recordings if kept.log.name == fault.run and kept.left]
        rows = own[0].as_recorded(fault.rows) if own else fault.rows
        said = fault.sentence
        if rows[0] != fault.rows[0]:
            said += f" Its rows count from row {own[0].rows[0]}, the first that was not left out."
        moved.append(replace(fault, rows=rows, sentence=said))
    return (*cut, *moved)


def _counts(recordings: Sequence[Kept]) -> Counter[str]:
    """How many rows were left out before anything was searched, by reason."""
    counts: Counter[str] = Counter()
    for one in (one for kept in recordings for one in kept.left):
        counts[one.reason] += one.rows
    return counts


def _rows(recordings: Sequence[Kept], logs: Sequence[Log], made: Analysis) -> dict[str, int]:
    """How many rows the model was fitted to, and how many were left out for which reason.

    `logs`: as they were before their inputs were made: by these a drive rests, smoothed or not.
    """
    problem = made.context.problem
    used = sum(run.counted for run in problem.runs)
    recorded = sum(len(kept.rows) for kept in recordings)
    moving = at_work(logs, problem.target)
    rest = 0 if moving is None else sum(int(np.count_nonzero(~one)) for one in moving)
    blurred = "where the motion is not resolved, or what came before is not known"
    found = {**_counts(recordings), "at rest": rest, blurred: recorded - rest - used}
    return {"used": used, **{why: count for why, count in found.items() if count}}
