"""Orders of ripple effects that the user left open: found in the residual of everything else."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import chi2

from flexspline import _core
from flexspline.effects import UNITS, Effect, Harmonic
from flexspline.least_squares.estimate import Given, counts_of, estimate, residuals_of
from flexspline.least_squares.problem import Problem
from flexspline.orders import OrderAnalysis, find_orders

__all__ = ["with_found_orders"]

SURE = float(chi2.ppf(0.9999, 2))  # of cosine and sine together; some ten orders are tried

FOLLOWER = "speed_dependent_ripple"
LEADERS = ("wave_generator_ripple", "cogging")
"""The follower has the orders of these, and adds what speed does to them."""

CORE_PAIRS = {
    "output_housing": "output_on_housing",
    "motor_stator": "motor_on_stator",
    "wave_generator_flexspline": "wave_generator_on_flexspline",
    "wave_generator_circular_spline": "wave_generator_on_circular_spline",
}


def with_found_orders(
    effects: list[Effect], problem_of: Callable[[Sequence[Effect]], Problem]
) -> tuple[list[Effect], OrderAnalysis | None, list[str]]:
    """Return the effects with orders, the analysis that found them, and what was left out.

    Without an open ripple effect nothing is sought. What the analysis finds is fitted beside
    everything else, and an order that its error does not tell from zero there is dropped again.
    An effect that is left with no order is taken out of the model, and the sentences say so; they
    also name orders whose owner is not among the effects. What a resonance makes of ripple has the
    orders of that ripple, given or found.
    """
    open_ones = [e for e in effects if e.ripple and not e.harmonics]
    if not open_ones:
        return effects, None, []
    given = {h for e in effects if e.name in LEADERS for h in e.harmonics}
    if given and [e.name for e in open_ones] == [FOLLOWER]:
        return [e.with_orders(given) if e in open_ones else e for e in effects], None, []
    found = _analysed([e for e in effects if e not in open_ones], problem_of)
    filled = {e.name: _with_orders(e, found, given) for e in open_ones}
    filled = _significant([filled.get(e.name, e) for e in effects], filled, problem_of)
    sentences = [_empty(found, name) for name, e in filled.items() if not e.harmonics]
    sentences += _unowned(found, {e.name for e in effects})
    sentences += _only_by_fit(found, filled)
    kept = [filled.get(e.name, e) for e in effects]
    return [e for e in kept if e.harmonics or not e.ripple], found, sentences


def _analysed(
    base: list[Effect], problem_of: Callable[[Sequence[Effect]], Problem]
) -> OrderAnalysis:
    """Orders in the residual of these effects."""
    problem = problem_of(base)
    made = estimate(problem, base, Given({}, {}, {}, False), lambda: None)
    residuals = [
        np.where(counts_of(run), residual, np.nan)
        for run, residual in zip(problem.runs, residuals_of(problem, made.linear), strict=True)
    ]
    found = find_orders([run.log for run in problem.runs], residuals, unit=UNITS[problem.target])
    return _of_the_gear(found) if problem.target == "torsion" else found


def _of_the_gear(found: OrderAnalysis) -> OrderAnalysis:
    """The orders with kinematic_error as the owner of all: nothing else turns in a torsion."""
    return replace(found, found=tuple(replace(f, effect="kinematic_error") for f in found))


def _significant(
    effects: list[Effect],
    filled: dict[str, Effect],
    problem_of: Callable[[Sequence[Effect]], Problem],
) -> dict[str, Effect]:
    """The filled effects without the orders that a fit does not tell from zero."""
    chosen = [e for e in effects if e.harmonics or not e.ripple]
    if not any(e.harmonics for e in filled.values()):
        return filled
    made = estimate(problem_of(chosen), chosen, Given({}, {}, {}, False), lambda: None)
    covariance = made.uncertainty.covariance
    row = {made.names[k]: (i, k) for i, k in enumerate(made.fitted)}
    kept = {}
    for name, e in filled.items():
        pairs = zip(e.terms[::2], e.terms[1::2], e.harmonics, strict=True)
        sure = []
        for cosine, sine, harmonic in pairs:
            at = [row[f"{name}.{term.name}"] for term in (cosine, sine)]
            rows, values = [i for i, _ in at], made.linear.coefficients[[k for _, k in at]]
            spread = covariance[np.ix_(rows, rows)]
            if values @ np.linalg.lstsq(spread, values, rcond=None)[0] > SURE:
                sure.append(harmonic)
        kept[name] = e.with_orders(sure)
    return kept


def _with_orders(effect: Effect, found: OrderAnalysis, given: set[Harmonic]) -> Effect:
    """The effect with the orders it owns, the largest where there are too many.

    Low orders of the output that the analysis is not certain of are tried too: the fit, which
    sees all runs and effects at once, decides.
    """
    follows = effect.name == FOLLOWER
    own = [
        (f.order, CORE_PAIRS[f.pair])
        for f in found
        if f.effect in (LEADERS if follows else (effect.name,)) and isinstance(f.order, int)
    ]
    if follows:
        own = [*given, *(harmonic for harmonic in own if harmonic not in given)]
    if effect.name in ("output_ripple", "kinematic_error"):
        own += [(f.order, CORE_PAIRS["output_housing"]) for f in found.faint]
    return effect.with_orders(own[: _core.max_harmonics])


def _empty(found: OrderAnalysis, name: str) -> str:
    """Why an effect is left with no order."""
    seen = [f"{f.per_output_turn:.6g}" for f in found if f.effect == name]
    if not seen:
        return f"no order of {name} stands out of the noise: it is left out"
    return (
        f"orders {', '.join(seen)} per output turn of {name} stand out, but none with an amplitude "
        "and phase that hold over all runs: it is left out"
    )


def _unowned(found: OrderAnalysis, names: set[str]) -> list[str]:
    """Orders whose owner is not in the model."""
    missing: dict[str, list[str]] = {}
    for f in found:
        if f.effect not in names:
            missing.setdefault(f.effect or "nothing known", []).append(f"{f.per_output_turn:.6g}")
    return [
        f"orders {', '.join(orders)} per output turn stand out and belong to {owner}, which is "
        "not in the model"
        for owner, orders in missing.items()
    ]


def _only_by_fit(found: OrderAnalysis, filled: dict[str, Effect]) -> list[str]:
    """Orders that are in the model although the analysis alone is not certain of them."""
    faint = {f.order for f in found.faint}
    own = [harmonic for effect in filled.values() for harmonic in effect.harmonics]
    output = CORE_PAIRS["output_housing"]
    kept = [str(order) for order, pair in own if pair == output and order in faint]
    if not kept:
        return []
    return [
        f"orders {', '.join(kept)} per output turn are in the model because the fit tells them "
        "from zero; the order analysis alone is not certain of them: runs over full turns would be"
    ]
