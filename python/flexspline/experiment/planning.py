"""The search for the run that best resolves what is confounded, within limits.

A run is worth Σ ln(1 + t²) over all questions, with t as it would be with the recorded runs and
this one: to settle one question that was open is worth more than to settle another twice. The runs
of the family are scored one by one, and the best is refined. Of two with the same information the
simpler one is chosen.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from flexspline.effects import Effect
from flexspline.experiment.information import Layout, Question, Trust, products
from flexspline.experiment.plan import (
    ENOUGH,
    TAKEN,
    TIGHTER,
    Bounds,
    Limits,
    Outlook,
    Plan,
    bounds_of,
    short,
)
from flexspline.experiment.recording import (
    Excitation,
    Motor,
    as_problem,
    commanded,
    kinds_for,
    settings,
)
from flexspline.least_squares.problem import Problem
from flexspline.parallel import in_order
from flexspline.regression.gram import Whitening

if TYPE_CHECKING:
    from flexspline.experiment.information import Rivalry
    from flexspline.least_squares.result import Fit
    from flexspline.logs.log import Log
    from flexspline.regression.candidate_model import Working

    Shaped = Callable[[Effect, tuple[Effect, ...], Problem], Sequence[Effect]]

__all__ = ["Bench", "planned", "refined"]

MOST_QUESTIONS = 6
TRIED_WIDER = 3
WIDER = 1.3  # times t by doubling a limit, for the limit to be named

Array = NDArray[np.float64]

IN_ALL_SETTINGS = 3  # motions that are tried at every load and temperature
EVALUATIONS = 60
MOST_TIMES = 5
PLAIN = 0.03  # of ln t², that a step more in what has to be set up has to bring
OFTEN = 3  # where a rival still explains nearly as much then


def planned(
    problem: Problem,
    work: Working,
    whitening: Whitening,
    pairs: Sequence[tuple[str, Effect]],
    shaped: Shaped,
    fit: Fit | None,
    limits: Limits | None = None,
) -> Plan | None:
    """Return the run that settles these pairs, and what a fit left undetermined.

    Parameters
    ----------
    problem, work, whitening : recorded runs, model and noise of a discovery.
    pairs : name of an effect of the model, and the rival, with orders where it has any.
    shaped : makes of a rival, of the effects beside it and of the runs the rival in all shapes
        that are worth a look.
    fit : whose undetermined parameters are asked for; None for no parameter.

    Returns
    -------
    Plan, or None where nothing is confounded.
    """
    from flexspline.experiment.information import layout_of, pieces_of

    pieces, times = pieces_of(problem)
    rivalries = [_rivalry(pieces, work, whitening, a, b, shaped) for a, b in pairs[:MOST_QUESTIONS]]
    parameters = _undetermined(fit, pairs)[: MOST_QUESTIONS - len(rivalries)]
    layout = layout_of(work, rivalries, parameters)
    if not layout.questions:
        return None
    reads = sorted({name for e in layout.effects for name in e.reads})
    bounds = bounds_of(problem, limits or Limits(), reads)
    bench = _bench(problem, pieces, times, layout, whitening, reads, bounds.velocity)
    return _plan(bench, bounds, {p.name: p.standard_error for p in fit.parameters} if fit else {})


def _plan(bench: Bench, bounds: Bounds, errors: Mapping[str, float]) -> Plan:
    from flexspline.experiment.plan import plan_sentence
    from flexspline.experiment.recording import RATE, commanded

    ranked = best_of_family(bench, bounds)
    best = refined(bench, bounds, ranked[0])
    gained = bench.gained(commanded(best.excitation, bounds, bench.rate))
    times = bench.repetitions(gained)
    outlooks = [
        _as_fitted(one, errors)
        for one in _outlooks(bench, bounds, bench.before + times * gained, [best, *ranked])
    ]
    log = _trajectory(commanded(best.excitation, bounds, RATE), bench.problem)
    words = best.excitation.words(bounds)
    kinds: dict[str, float] = {}
    for one in sorted([best, *ranked], key=lambda one: -one.t[0]):
        kinds.setdefault(one.excitation.name, one.t[0])
    own_load = bench.problem.known_load is None
    sentence = plan_sentence(bounds.duration, words, outlooks, times, own_load)
    log = log.with_facts({"run": words, "repetitions": times})
    return Plan(sentence, log, tuple(outlooks), kinds, bounds)


def _trajectory(columns: dict[str, np.ndarray], problem: Problem) -> Log:
    from flexspline.logs.log import Log

    named = {"reference_torque" if k == "load" else k: v for k, v in columns.items()}
    known = problem.runs[0].log.facts
    kept = ("joint", "gear_ratio", "output_spline", "pole_pairs", "slots", "torque_constant")
    facts = {"name": "next_experiment", **{k: known[k] for k in kept if k in known}}
    return Log(named, facts, ("planned",))


def _outlooks(
    bench: Bench, bounds: Bounds, total: np.ndarray, ranked: Sequence[Scored]
) -> list[Outlook]:
    """What each question stands at with all products (C, C), and what limit binds it."""
    made = []
    for k, (question, before, t) in enumerate(
        zip(bench.layout.questions, bench.now, bench.t(total), strict=True)
    ):
        now, expected = _shown(question, before), _shown(question, t)
        taken = 0.0 if question.parameter else question.taken(total)
        one = Outlook(question.names, now, expected, question.unit, taken, None)
        doubled = None if one.settled else _doubled(bench, bounds, k, t, ranked)
        if doubled is not None:
            name, value, wider = doubled
            one = replace(one, doubled=(name, value, _shown(question, wider)))
        made.append(one)
    return made


def _as_fitted(one: Outlook, errors: Mapping[str, float]) -> Outlook:
    """A parameter's standard errors in the measure of the fit, which trusts its noise model less.

    So what stands now is what the table of parameters says; by how much it falls is the plan's.
    Where columns depend on each other the fit takes the shortest of all solutions, and its errors
    are of that: much smaller than what these runs know of the parameter itself, which is nothing;
    nor would anything be known by a run that tells hardly more.
    """
    fitted = errors.get(one.names[0], np.nan) if one.parameter else np.nan
    if one.parameter and one.now > TIGHTER * fitted:
        reached = one.expected if TIGHTER * one.expected <= one.now else np.inf
        wider = one.doubled if one.doubled and TIGHTER * one.doubled[2] <= one.now else None
        return replace(one, now=np.inf, expected=float(reached), doubled=wider)
    if not (np.isfinite(fitted) and fitted > 0.0 and 0.0 < one.now < np.inf):
        return one
    scale = fitted / one.now
    wider = one.doubled and (*one.doubled[:2], scale * one.doubled[2])
    return replace(one, now=fitted, expected=scale * one.expected, doubled=wider)


def _shown(question: Question, t: float) -> float:
    """t of a pair, the standard error of a parameter."""
    if not question.parameter:
        return t
    return 1.0 / t if t > 0.0 else float("inf")


def _doubled(
    bench: Bench, bounds: Bounds, number: int, reached: float, ranked: Sequence[Scored]
) -> tuple[str, str, float] | None:
    """The limit whose doubling raises a t most: its name, twice its value, t."""
    units = {"position": "rad", "velocity": "rad/s", "acceleration": "rad/s²", "load": "Nm",
             "temperature": "°C", "duration": "s"}  # fmt: skip
    kinds: dict[str, Scored] = {}
    for one in sorted(ranked, key=lambda one: -one.t[number]):
        kinds.setdefault(one.excitation.name, one)
    best: tuple[str, str, float] | None = None
    for field in fields(Limits):
        if getattr(bounds, field.name) is None:
            continue
        wider = bounds.doubled(field.name)
        trials = list(kinds.values())[:TRIED_WIDER]
        t = max(bench.scored(one.excitation, wider).t[number] for one in trials)
        if t > max(WIDER * reached, best[2] if best else 0.0, 1e-3):
            value = getattr(wider, field.name)
            words = " to ".join(short(v) for v in np.ravel(value))
            best = (field.name, f"{words} {units[field.name]}", t)
    return best


def _fastest_ripple(effects: Sequence[Effect], problem: Problem, velocity: float) -> float:
    """Highest frequency of ripple at this speed [rad/s] of the output, Hz; ∞ of no known gear."""
    from flexspline.least_squares.ripple import CORE_PAIRS
    from flexspline.orders.parts import pairs

    turns = {CORE_PAIRS[p.name]: abs(p.turns) for p in pairs(problem.runs[0].log.facts)}
    orders = (order * turns[pair] for e in effects for order, pair in e.harmonics)
    highest = np.max([0.0, *orders])
    return float(np.nan_to_num(highest * velocity / (2.0 * np.pi), nan=np.inf))


def _bench(
    problem: Problem,
    pieces: Problem,
    times: Sequence[float],
    layout: Layout,
    whitening: Whitening,
    reads: Sequence[str],
    velocity: float,
) -> Bench:
    from flexspline.experiment.information import at_coarser_rate, products, trust_of
    from flexspline.experiment.recording import motor_of

    logs = [run.log for run in problem.runs]
    motor = motor_of(logs, problem.known_load) if "motor_torque" in reads else None
    rate = float(np.median([log.rate for log in logs]))
    asked = [effect for effect in layout.effects if effect.name in layout.asked]
    fastest = _fastest_ripple(asked, problem, velocity)
    coarse, slower = at_coarser_rate(whitening, rate, fastest, problem.lowpass)
    trust = trust_of(pieces, layout.work, whitening)
    before = products(layout, pieces, whitening, trust, times)
    return Bench(problem, layout, coarse, trust, slower, motor, before)


def _rivalry(
    problem: Problem,
    work: Working,
    whitening: Whitening,
    named: str,
    rival: Effect,
    shaped: Shaped,
) -> Rivalry:
    from flexspline.experiment.information import Rivalry
    from flexspline.least_squares.options import SHARED
    from flexspline.regression.candidate_model import refitted

    others = [e for e in work.effects if e.name != named]
    variants = tuple(shaped(rival, tuple(others), problem))
    fitted = None
    if any(shape.name not in SHARED for shape in rival.fitted_shapes):
        fitted = refitted(problem, work.having([*others, rival]), whitening)[0]
    return Rivalry(named, rival.name, variants, fitted)


def _undetermined(fit: Fit | None, pairs: Sequence[tuple[str, Effect]]) -> list[tuple[str, str]]:
    """Parameters that a fit cannot tell apart, with their unit, but those of the pairs' effects."""
    if fit is None:
        return []
    asked = {name for pair in pairs for name in (pair[0], pair[1].name)}
    confounded = [name for group in fit.confounded for name in group.names]
    return [
        (p.name, p.unit)
        for p in fit.parameters
        if p.name in confounded and p.name.split(".")[0] not in asked
    ]


@dataclass(frozen=True, eq=False)
class Bench:
    """Everything that a planned run is judged by. `before`: products (C, C) of recorded runs."""

    problem: Problem
    layout: Layout
    whitening: Whitening
    trust: Trust
    rate: float
    motor: Motor | None
    before: Array

    def gained(self, columns: dict[str, Array]) -> Array:
        """Products (C, C) of a planned run."""
        problem = as_problem(columns, self.problem, self.layout.effects, self.motor)
        return products(self.layout, problem, self.whitening, self.trust)

    @property
    def now(self) -> tuple[float, ...]:
        """t of each question with the recorded runs alone."""
        return self.t(self.before)

    def t(self, total: Array) -> tuple[float, ...]:
        """t of each question that these products promise."""
        return tuple(float(np.sqrt(q.information(total))) for q in self.layout.questions)

    def scored(self, excitation: Excitation, bounds: Bounds) -> Scored:
        """Judge one planned run."""
        t = self.t(self.before + self.gained(commanded(excitation, bounds, self.rate)))
        values = [abs(q.value) if q.parameter else 1.0 for q in self.layout.questions]
        worth = sum(np.log1p((v * x) ** 2) for v, x in zip(values, t, strict=True))
        plain = PLAIN * (excitation.kind.steps + len(excitation.setting.parts))
        return Scored(excitation, t, float(worth) - plain)

    def repetitions(self, gained: Array) -> int:
        """How often a run has to be recorded until no rival explains nearly as much (`aliases`)."""
        for times in range(1, MOST_TIMES + 1):
            total = self.before + times * gained
            if all(q.parameter or q.taken(total) < TAKEN for q in self._within_reach(total)):
                return times
        return OFTEN

    def _within_reach(self, total: Array) -> list[Question]:
        pairs = zip(self.layout.questions, self.t(total), strict=True)
        return [question for question, t in pairs if t >= ENOUGH]


@dataclass(frozen=True, eq=False)
class Scored:
    """A run, t of each question with it, and what it is worth."""

    excitation: Excitation
    t: tuple[float, ...]
    worth: float


def best_of_family(bench: Bench, bounds: Bounds) -> list[Scored]:
    """Return runs of all kinds, the best first."""
    every = settings(bounds)

    def scored(runs: Iterable[Excitation]) -> list[Scored]:
        work = partial(bench.scored, bounds=bounds)
        return [*in_order(bench.problem.threads, work, runs)]

    kinds = kinds_for(bounds, bench.layout.remembers)
    made = scored(Excitation(kind, numbers, every[0]) for kind in kinds for numbers in kind.starts)
    chosen = [one.excitation for one in _ranked(made)[:IN_ALL_SETTINGS]]
    made += scored(replace(one, setting=other) for one in chosen for other in every[1:])
    return _ranked(made)


def refined(bench: Bench, bounds: Bounds, start: Scored) -> Scored:
    """Improve a run's numbers within the limits."""
    best = [start]

    def loss(numbers: Array) -> float:
        trial = replace(start.excitation, numbers=np.clip(numbers, 0.0, 1.0))
        made = bench.scored(trial, bounds)
        if made.worth > best[0].worth:
            best[0] = made
        return -made.worth

    numbers = start.excitation.numbers
    corner = np.where(numbers > 0.5, numbers - 0.2, numbers + 0.2)
    simplex = np.vstack([numbers, *(np.where(row, corner, numbers)
                                    for row in np.eye(len(numbers), dtype=bool))])  # fmt: skip
    minimize(
        loss,
        numbers,
        method="Nelder-Mead",
        bounds=[(0.0, 1.0)] * len(numbers),
        options={"maxfev": EVALUATIONS, "initial_simplex": simplex},
    )
    return best[0]


def _ranked(made: Sequence[Scored]) -> list[Scored]:
    return sorted(made, key=lambda one: -one.worth)
