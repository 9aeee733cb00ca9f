"""Orders of ripple that the user left open, found in the residual, with amplitude and phase.

    a cos(kx) + b sin(kx) = A cos(kx − φ),     A = √(a² + b²),  φ = atan2(b, a)

Errors by the delta method from the covariance C of (a, b):

    σ_A² = uᵀ C u,  u = (a, b)/A          σ_φ² = wᵀ C w,  w = (−b, a)/A²

An order is significant where (a, b) C⁻¹ (a, b)ᵀ exceeds the 95 % point of χ² with two degrees of
freedom.

Over part of a turn waves of the output are not orthogonal to each other, nor to offset and gravity:
these take most of order 2, and what they leave of it looks like order 4 or 5. So no order is read
off a residual there. All candidates are fitted beside the model at once; with the columns X of the
candidates projected on what the model's own leave, G = XᵀX and g = Xᵀy, a set S of orders takes

    g_Sᵀ G_SS⁻¹ g_S - c s² |S|

off the squares, less what it has to: c the significance threshold of one order, s² the long-run
variance of the noise beside all candidates. The set that takes most is the best subset: all sets of
few orders are compared, more are added one at a time. Of sets of as many orders that the data do
not tell from the best, that of the lowest orders is taken. Order 1 of the output is
gravity where that is in the model.

A target that is late by δ against the angle shows cos(kx − kẋδ) at speed ẋ: over the speeds of the
runs, both ways, least squares keeps of the amplitude

    |mean exp(i k ẋ δ)|

and the rest is residual. δ is that of the target against the known load, where a fit tells it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from flexspline import _core
from flexspline.effects import UNITS, Effect, Harmonic
from flexspline.effects.causes import (
    GRAVITY,
    KINEMATIC_ERROR,
    MODULATED_RIPPLE,
    MOTOR_RIPPLES,
    OUTPUT_RIPPLE,
)
from flexspline.errors import listed
from flexspline.formatting import plus_minus, short
from flexspline.least_squares.estimate import (
    Estimate,
    Given,
    counts_of,
    estimate,
    noise_of,
    residuals_of,
)
from flexspline.least_squares.problem import Problem
from flexspline.logs import Log
from flexspline.orders import OrderAnalysis, find_orders
from flexspline.orders.parts import pairs

if TYPE_CHECKING:
    from flexspline.least_squares.result import Fit
    from flexspline.logs import Log

__all__ = [
    "PAIRS",
    "RippleOrder",
    "late_ripple_warnings",
    "part_of_a_turn",
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

LOWEST = 8  # orders of the output that are tried over part of a turn, whatever a residual shows

Array = NDArray[np.float64]

TURN = 2.0 * np.pi
CHI_SQUARED_95 = 5.991  # two degrees of freedom
TOLD = 3.0  # standard errors of a delay: 3 in 1000 by chance
BEYOND = 2.0  # standard errors of an amplitude: a loss of more lies outside of its interval
MOST_LOST = 0.5  # of an amplitude: what is left is no measure of it, significant or not

COMPARED = 4  # orders of the largest sets that are all compared
DEPENDENT = 1e-9  # share of a column's squares, below which others explain it

MOTOR_PAIR = "motor_on_stator"
PAIRS = {
    "output_on_housing": "the output",
    MOTOR_PAIR: "the motor",
    "wave_generator_on_flexspline": "the wave generator against flexspline",
    "wave_generator_on_circular_spline": "the wave generator against circular spline",
}


def with_found_orders(
    effects: list[Effect], problem_of: Callable[[Sequence[Effect]], Problem]
) -> tuple[list[Effect], OrderAnalysis | None, list[str]]:
    """Return the effects with orders, the analysis that found them, and what was left out.

    Without an open ripple effect nothing is sought. What the analysis finds is fitted beside
    everything else, and an order that its error does not tell from zero there is dropped again.
    Over part of a turn low orders of the output are chosen there, and the sentences say that.
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
    base = [e for e in effects if e not in open_ones]
    problem = problem_of(base)
    found = _analysed(base, problem)
    least = 2 if any(e.name == GRAVITY for e in effects) else 1
    filled = {e.name: _with_orders(e, found, given, least) for e in open_ones}
    named = {name: e for name, e in filled.items() if name == OUTPUT_RIPPLE and e.harmonics}
    look_alike = part_of_a_turn([run.log for run in problem.runs], named)
    if look_alike:
        filled |= {OUTPUT_RIPPLE: _jointly(effects, filled, found, least, problem_of)}
    filled = _significant([filled.get(e.name, e) for e in effects], filled, problem_of)
    sentences = [_empty(found, name) for name, e in filled.items() if not e.harmonics]
    sentences += _unowned(found, {e.name for e in effects})
    sentences += _only_by_fit(found, filled)
    if look_alike and filled[OUTPUT_RIPPLE].harmonics:
        sentences.append(f"{look_alike}; values and errors are those beside these orders")
    kept = [filled.get(e.name, e) for e in effects]
    return [e for e in kept if e.harmonics or not e.ripple], found, sentences


def _analysed(base: list[Effect], problem: Problem) -> OrderAnalysis:
    """Orders in the residual of these effects."""
    made = estimate(problem, base, Given({}, {}, {}, False), lambda: None)
    residuals = [
        np.where(counts_of(run), residual, np.nan)
        for run, residual in zip(problem.runs, residuals_of(problem, made.linear), strict=True)
    ]
    found = find_orders([run.log for run in problem.runs], residuals, unit=UNITS[problem.target],
                        channel=f"residual of {problem.target.replace('_', ' ')}")  # fmt: skip
    return _of_the_gear(found) if problem.target == "torsion" else found


def part_of_a_turn(logs: Sequence[Log], names: Iterable[str]) -> str:
    """Return that orders of the output look alike where runs cover no whole turn of it, or "".

    `names`: the effects that have such orders.
    """
    angles = [log["output_position"] for log in logs if "output_position" in log]
    named = [*names]
    if not named or not angles:
        return ""
    covered = (max(map(np.max, angles)) - min(map(np.min, angles))) / TURN
    if covered >= 1.0:
        return ""
    return (
        f"the runs cover {short(covered, 2)} of a turn of the output, over which orders of "
        f"{listed(named)} look alike: others may be there in their place, as a whole turn would "
        "tell"
    )


def _jointly(
    effects: Sequence[Effect],
    filled: Mapping[str, Effect],
    found: OrderAnalysis,
    least: int,
    problem_of: Callable[[Sequence[Effect]], Problem],
) -> Effect:
    """The ripple of the output with the orders that explain most beside the other effects.

    Tried are the lowest orders, and those within the resolution of one that a residual shows.
    """
    pair = CORE_PAIRS["output_housing"]
    own = filled[OUTPUT_RIPPLE]
    near = {
        int(order) + away
        for order, reach in [(f.order, int(f.resolution)) for f in found if f.effect == own.name]
        for away in range(-reach, reach + 1)
    }
    tried = sorted({k for k in {*range(least, LOWEST + 1), *near} if k >= least})
    pool = own.with_orders([(k, pair) for k in tried[: _core.max_harmonics]])
    chosen = [pool if e.name == own.name else filled.get(e.name, e) for e in effects]
    chosen = [e for e in chosen if e.harmonics or not e.ripple]
    made = estimate(problem_of(chosen), chosen, Given({}, {}, {}, False), lambda: None)
    column = {made.names[k]: i for i, k in enumerate(made.fitted)}
    terms = [column[f"{pool.name}.{term.name}"] for term in pool.terms]
    both = [*zip(terms[::2], terms[1::2], strict=True)]
    orders = [order for order, _ in pool.harmonics]
    return own.with_orders([(k, pair) for k in _best_orders(made, both, orders)])


def _best_orders(
    made: Estimate, pairs: Sequence[tuple[int, int]], orders: Sequence[int]
) -> tuple[int, ...]:
    """Return the orders that best explain, beside the rest of a model, what was measured.

    Parameters
    ----------
    made : an estimate with all candidates, which it was not pruned of.
    pairs : columns of cosine and sine among the fitted ones, of each candidate.
    orders : periods per turn, of each candidate.
    """
    gram, moment, variance = _beside(made, np.array(pairs).ravel())

    def gain(chosen: tuple[int, ...]) -> float:
        at = np.array([[2 * k, 2 * k + 1] for k in chosen], dtype=np.intp).ravel()
        inverse = np.linalg.pinv(gram[np.ix_(at, at)], rcond=DEPENDENT, hermitian=True)
        return float(moment[at] @ inverse @ moment[at]) / variance - SURE * len(chosen)

    gains = {chosen: gain(chosen) for chosen in _sets(len(orders))}
    best = max(gains, key=lambda chosen: gains[chosen])
    alike = [c for c in gains if len(c) == len(best) and gains[c] > gains[best] - CHI_SQUARED_95]
    lowest = min(alike, key=lambda chosen: sum(orders[k] for k in chosen))
    while len(lowest) >= COMPARED:
        more = [(*lowest, k) for k in range(len(orders)) if k not in lowest]
        further = max(more, key=gain, default=lowest)
        if gain(further) <= gain(lowest):
            break
        lowest = further
    return tuple(sorted(orders[k] for k in lowest))


def _sets(count: int) -> Iterator[tuple[int, ...]]:
    for size in range(min(COMPARED, count) + 1):
        yield from combinations(range(count), size)


def _beside(made: Estimate, at: NDArray[np.intp]) -> tuple[Array, Array, float]:
    """XᵀX (K, K) and Xᵀy (K,) of columns beside all others, and the variance of the noise."""
    width = made.basis.shape[0]
    gram, pull = np.zeros((width, width)), np.zeros(width)
    for chunk in made.tangent():
        rows = chunk.rows
        gram += rows.T @ rows
        pull += rows.T @ chunk.residual
    solution = np.zeros(width)
    solution[: len(made.fitted)] = made.linear.coefficients[made.fitted]
    moment = gram @ solution + pull  # of the target, linear around the shapes found
    scale = np.sqrt(np.diag(gram))
    scale = np.where(scale > 0.0, scale, 1.0)
    gram, moment = gram / np.outer(scale, scale), moment / scale
    others = np.setdiff1d(np.arange(width), at)
    shared = gram[np.ix_(at, others)] @ np.linalg.pinv(
        gram[np.ix_(others, others)], rcond=DEPENDENT, hermitian=True
    )
    noise = noise_of(made)
    variance = noise.long_run_variance * noise.decimation
    inner = gram[np.ix_(at, at)] - shared @ gram[np.ix_(others, at)]
    return inner, moment[at] - shared @ moment[others], max(variance, np.finfo(float).tiny)


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


def _with_orders(effect: Effect, found: OrderAnalysis, given: set[Harmonic], least: int) -> Effect:
    """The effect with the orders it owns, the largest where there are too many.

    `least`: the lowest order of the output that is none of gravity's.

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
    if effect.name == OUTPUT_RIPPLE:
        own = [(order, pair) for order, pair in own if order >= least]
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
    pair : what turns, as effects name it.
    turns : what turns, in words; of a gear whose output spline is not stated the motor, whose angle
        either pair of the wave generator then has.
    per_output_turn : the order counted per turn of the output, NaN without the gear ratio.
    names : of the coefficients of cosine and sine.
    amplitude, amplitude_error : in `unit`; `naive_error` as if every sample were news.
    phase, phase_error : degrees.
    significant : whether it differs significantly from zero.
    """

    effect: str
    order: int
    pair: str
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
                facts = fit.model.facts
                turns = per_output_turn(order, pair, facts)
                known = (effect.name, order, pair, PAIRS[_told(pair, facts)], turns, both)
                both_ways = (fit.covariance[np.ix_(at, at)], naive[np.ix_(at, at)])
                found.append(_order(fit, known, *both_ways))
    return found


def late_ripple_warnings(fit: Fit) -> list[str]:
    """Say which orders a target takes part of that is later than the known load."""
    late = fit.delay
    if late is None or -late.seconds < TOLD * late.standard_error:
        return []
    speed = np.concatenate([_velocity(run.log)[run.counts] for run in fit.runs])
    lost = []
    for order in ripple_orders(fit):
        turned = np.exp(1j * order.per_output_turn * speed * late.seconds)
        share = 1.0 - float(np.abs(np.mean(turned)))
        if share > min(BEYOND * order.amplitude_error / max(order.amplitude, 1e-300), MOST_LOST):
            lost.append(f"{100.0 * share:.2g} % of order {order.order} ({order.turns})")
    if not lost:
        return []
    size, error = -1e3 * late.seconds, 1e3 * late.standard_error
    return [
        f"{fit.target} is {plus_minus(size, error)} ms later than {late.channel}, and if it is so "
        f"late against the angle too, that takes {listed(lost, 6)} at these speeds: ask for the "
        f"repair shift={fit.target}:{-late.seconds:.3g} and fit again"
    ]


def _velocity(log: Log) -> Array:
    """Velocity of the output as recorded, else the slope of its position, rad/s."""
    if "output_velocity" in log:
        return log["output_velocity"]
    return np.gradient(log["output_position"], log["time"])


def per_output_turn(order: int, pair: str, facts: Mapping[str, Any]) -> float:
    """Return an order of a pair counted per turn of the output, NaN where nobody can say."""
    known = {CORE_PAIRS[p.name]: p.turns for p in pairs(facts)}
    return order * known[_told(pair, facts)]


def _told(pair: str, facts: Mapping[str, Any]) -> str:
    """The pair, or that of the motor where nobody said which spline is the output."""
    return pair if pair in {CORE_PAIRS[p.name] for p in pairs(facts)} else MOTOR_PAIR


def _order(
    fit: Fit,
    known: tuple[str, int, str, str, float, tuple[str, str]],
    covariance: Array,
    naive: Array,
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
