"""From what is confounded to the run that settles it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from typing import TYPE_CHECKING

import numpy as np

from flexspline.effects import Effect
from flexspline.experiment.limits import Bounds, Limits, bounds_of
from flexspline.experiment.plan import TIGHTER, Outlook, Plan
from flexspline.experiment.words import short

if TYPE_CHECKING:  # what is heavy is imported where it is used
    from flexspline.experiment.information import Layout, Question, Rivalry
    from flexspline.experiment.search import Bench, Scored
    from flexspline.least_squares.problem import Problem
    from flexspline.least_squares.result import Fit
    from flexspline.logs.log import Log
    from flexspline.regression.gram import Whitening
    from flexspline.regression.working import Working

    Shaped = Callable[[Effect, tuple[Effect, ...], Problem], Sequence[Effect]]

__all__ = ["planned"]

RATE = 100.0  # Hz, of the trajectory file
MOST_QUESTIONS = 6
TRIED_WIDER = 3
WIDER = 1.3  # times t by doubling a limit, for the limit to be named


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
    from flexspline.experiment.recording import commanded
    from flexspline.experiment.says import plan_sentence
    from flexspline.experiment.search import best_of_family, refined

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
    from flexspline.experiment.information import products
    from flexspline.experiment.motor import motor_of
    from flexspline.experiment.noise import at_coarser_rate
    from flexspline.experiment.search import Bench
    from flexspline.experiment.trust import trust_of

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
    from flexspline.regression.working import refitted

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
