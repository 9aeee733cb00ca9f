"""Orders of ripple that the user left open, found in the residual, with amplitude and phase.

    a cos(kx) + b sin(kx) = A cos(kx − φ),     A = √(a² + b²),  φ = atan2(b, a)

Errors by the delta method from the covariance C of (a, b):

    σ_A² = uᵀ C u,  u = (a, b)/A          σ_φ² = wᵀ C w,  w = (−b, a)/A²

An order is significant where (a, b) C⁻¹ (a, b)ᵀ exceeds the 95 % point of χ² with two degrees of
freedom.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from flexspline import _core
from flexspline.effects import UNITS, Effect, Harmonic
from flexspline.effects.causes import (
    KINEMATIC_ERROR,
    MODULATED_RIPPLE,
    MOTOR_RIPPLES,
    OUTPUT_RIPPLE,
)
from flexspline.least_squares.estimate import Given, counts_of, estimate, residuals_of
from flexspline.least_squares.problem import Problem
from flexspline.orders import OrderAnalysis, find_orders
from flexspline.orders.parts import pairs

if TYPE_CHECKING:
    from flexspline.least_squares.result import Fit

__all__ = [
    "PAIRS",
    "RippleOrder",
    "per_output_turn",
    "ripple_orders",
    "with_found_orders",
]

SURE = float(chi2.ppf(0.9999, 2))  # of cosine and sine together; some ten orders are tried

CORE_PAIRS = {
    "output_housing": "output_on_housing",
    "motor_stator": "motor_on_stator",
    "wave_generator_flexspline": "wave_generator_on_flexspline",
    "wave_generator_circular_spline": "wave_generator_on_circular_spline",
}

Array = NDArray[np.float64]

CHI_SQUARED_95 = 5.991  # two degrees of freedom

PAIRS = {
    "output_on_housing": "the output",
    "motor_on_stator": "the motor",
    "wave_generator_on_flexspline": "the wave generator against flexspline",
    "wave_generator_on_circular_spline": "the wave generator against circular spline",
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
    given = {h for e in effects if e.name in MOTOR_RIPPLES for h in e.harmonics}
    if given and [e.name for e in open_ones] == [MODULATED_RIPPLE]:
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
    found = find_orders([run.log for run in problem.runs], residuals, unit=UNITS[problem.target],
                        channel=f"residual of {problem.target.replace('_', ' ')}")  # fmt: skip
    return _of_the_gear(found) if problem.target == "torsion" else found


def _of_the_gear(found: OrderAnalysis) -> OrderAnalysis:
    """The orders with kinematic_error as the owner of all: nothing else turns in a torsion."""
    return replace(found, found=tuple(replace(f, effect=KINEMATIC_ERROR) for f in found))


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
    follows = effect.name == MODULATED_RIPPLE
    own = [
        (f.order, CORE_PAIRS[f.pair])
        for f in found
        if f.effect in (MOTOR_RIPPLES if follows else (effect.name,)) and isinstance(f.order, int)
    ]
    if follows:
        own = [*given, *(harmonic for harmonic in own if harmonic not in given)]
    if effect.name in (OUTPUT_RIPPLE, KINEMATIC_ERROR):
        own += [(f.order, CORE_PAIRS["output_housing"]) for f in found.faint]
    return effect.with_orders(own[: _core.max_harmonics])


def _empty(found: OrderAnalysis, name: str) -> str:
    """Why an effect is left with no order."""
    seen = [f"{f.per_output_turn:.6g}" for f in found if f.effect == name]
    if not seen:
        return f"no order of {name} stands out of the noise: it is left out"
    return (
        f"orders {', '.join(seen)} per output turn of {name} stand out of the noise around them, "
        "but the fit, whose errors count all that the other effects leave, tells none of them from "
        "zero: it is left out; add effects that explain more, or give its orders"
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


@dataclass(frozen=True)
class RippleOrder:
    """One order of a ripple effect whose two coefficients are both known with their errors.

    Parameters
    ----------
    effect, order : name of the effect and periods per turn of the pair.
    turns : what turns, in words.
    per_output_turn : the order counted per turn of the output, NaN without the gear ratio.
    names : of the coefficients of cosine and sine.
    amplitude, amplitude_error : in `unit`; `naive_error` as if every sample were news.
    phase, phase_error : degrees.
    significant : whether it differs significantly from zero.
    """

    effect: str
    order: int
    turns: str
    per_output_turn: float
    names: tuple[str, str]
    amplitude: float
    amplitude_error: float
    naive_error: float
    phase: float
    phase_error: float
    unit: str
    significant: bool


def ripple_orders(fit: Fit) -> list[RippleOrder]:
    """Return the orders of all ripple effects of a fit, in the order of the parameters."""
    record = fit.part.record["covariance"]["names"]
    fitted = {name: number for number, name in enumerate(record)}
    hidden = {p.name for p in fit.parameters if not p.determined}
    basis = fit.uncertainty.basis
    naive = basis @ fit.uncertainty.naive_core @ basis.T
    found = []
    for effect in (e for e in fit.part.effects if e.ripple):
        names = [f"{effect.name}.{term.name}" for term in effect.terms]
        for (order, pair), both in zip(
            effect.harmonics, zip(names[::2], names[1::2], strict=True), strict=True
        ):
            if set(both) <= set(fitted) and not set(both) & hidden:
                at = [fitted[name] for name in both]
                turns = per_output_turn(order, pair, fit.model.facts)
                known = (effect.name, order, PAIRS[pair], turns, both)
                both_ways = (fit.covariance[np.ix_(at, at)], naive[np.ix_(at, at)])
                found.append(_order(fit, known, *both_ways))
    return found


def per_output_turn(order: int, pair: str, facts: Mapping[str, Any]) -> float:
    """Return an order of a pair counted per turn of the output, NaN where nobody can say."""
    known = {p.name: p.turns for p in pairs(facts)}
    return order * known.get(pair.replace("_on_", "_"), float("nan"))


def _order(
    fit: Fit, known: tuple[str, int, str, float, tuple[str, str]], covariance: Array, naive: Array
) -> RippleOrder:
    both = np.array([fit[name].value for name in known[-1]])
    amplitude = float(np.hypot(*both))
    along = both / max(amplitude, 1e-300)
    across = np.array([-along[1], along[0]])
    errors = [
        float(np.sqrt(max(float(d @ c @ d), 0.0)))
        for d, c in ((along, covariance), (across, covariance), (along, naive))
    ]
    distance = float(both @ np.linalg.pinv(covariance, hermitian=True) @ both)
    return RippleOrder(
        *known,
        amplitude=amplitude,
        amplitude_error=errors[0],
        naive_error=errors[2],
        phase=float(np.degrees(np.arctan2(both[1], both[0]))),
        phase_error=float(np.degrees(errors[1] / max(amplitude, 1e-300))),
        unit=fit[known[-1][0]].unit,
        significant=distance > CHI_SQUARED_95,
    )
