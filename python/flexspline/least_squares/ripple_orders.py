"""Cosine and sine of one order as amplitude and phase.

    a cos(kx) + b sin(kx) = A cos(kx − φ),     A = √(a² + b²),  φ = atan2(b, a)

Errors by the delta method from the covariance C of (a, b):

    σ_A² = uᵀ C u,  u = (a, b)/A          σ_φ² = wᵀ C w,  w = (−b, a)/A²

An order is told apart from zero where (a, b) C⁻¹ (a, b)ᵀ exceeds the 95 % point of χ² with two
degrees of freedom.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from flexspline.orders.parts import pairs

if TYPE_CHECKING:
    from flexspline.least_squares.result import Fit

__all__ = ["PAIRS", "RippleOrder", "per_output_turn", "ripple_orders"]

Array = NDArray[np.float64]

CHI_SQUARED_95 = 5.991  # two degrees of freedom

PAIRS = {
    "output_on_housing": "the output",
    "motor_on_stator": "the motor",
    "wave_generator_on_flexspline": "the wave generator against flexspline",
    "wave_generator_on_circular_spline": "the wave generator against circular spline",
}


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
    significant : whether it is told apart from zero.
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
