"""Quantities derived from fitted parameters: stiffnesses, lost motion, and warnings of their signs.

The formulas stand with the effects. Errors by the delta method, first order: gradient · β.

A gear that is loaded further yields further. Just after a reversal all springs of the hysteresis
stick, and their slope opposes the mesh's, so a fitted loop of a torsion is plausible where

    ρ(τ) = K_m0 (1 + (c_m τ)²) Σ c_k / (Ñ w_k)  < 1

This is tested at the load that half of the rows stay below: towards the largest loads the law of
the mesh stiffens without end, and so ρ of a sound gear may pass one there.

Source: full_range_torque_estimation (15); `flexspline/estimators/load_hysteresis.hpp`.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from flexspline.effects import CATALOGUE, unit_in
from flexspline.effects.causes import DERIVED, MESH, PRESLIDING, SPRINGS, TORSION_LOOP, Formula
from flexspline.least_squares.identifiability import SHARE
from flexspline.model import sign_warnings as signs_of_a_drive
from flexspline.model import sliding_weights
from flexspline.orders.parts import effective_ratio

if TYPE_CHECKING:
    from flexspline.effects import Effect
    from flexspline.least_squares.result import Fit

__all__ = ["Derived", "derived_of", "loop_warnings", "sign_warnings"]

STEP = 1e-6  # relative: the central difference is good to 1e-9 of a smooth formula
UNKNOWN = ("not determined", "at lower bound", "at upper bound")  # states without a known value
ROUGH = 0.5  # relative error from which the first order says nothing


@dataclass(frozen=True)
class Derived:
    """A quantity that follows from the parameters, in `unit`, with its standard error.

    The error is NaN where all parameters behind it are fixed.
    """

    name: str
    value: float
    standard_error: float
    unit: str


POSITIVE = tuple(
    formulas[0].name for name, formulas in DERIVED.items() if CATALOGUE[name].traits.one_signed
)
"""Negative, a spring or a brake would give energy."""


def derived_of(fit: Fit) -> tuple[Derived, ...]:
    """Return the derived quantities of a fit's effects.

    Left out are those that are not finite, that the data do not see, that depend on a shape which
    is not determined or at its bound, that get more than half of their variance from directions in
    which coefficients are confounded, whose error is more than half of their value, where the first
    order of the delta method no longer holds, and those of effects of which each run has its own.
    """
    found = []
    ratio = effective_ratio(fit.model.facts)
    own = {term.term.split(".")[0] for term in fit.between_runs}
    for effect in fit.part.effects:
        if effect.name in own:
            continue
        prefix = f"{effect.name}."
        values = {
            p.name.removeprefix(prefix): p.value
            for p in fit.parameters
            if p.name.startswith(prefix)
        }
        values["ratio"] = np.nan if ratio is None else ratio
        names = [p.name.removeprefix(prefix) for p in fit.parameters if p.state in UNKNOWN]
        unknown = [name for name in names if name in effect.shapes]
        for formula in DERIVED.get(effect.name, ()):
            value = _value(formula, values)
            if np.isfinite(value) and not any(_moved_by(formula, values, name) for name in unknown):
                error = _error(fit, prefix, formula, values)
                if error > ROUGH * abs(value):
                    continue
                unit = formula.unit
                if fit.target != "torsion":
                    unit = unit_in(unit, fit.target, fit.part.known_load)
                found.append(Derived(formula.name, value, error, unit))
    return (*found, *_sliding(fit, own))


def _sliding(fit: Fit, own: Collection[str]) -> list[Derived]:
    """The sum of frictions that slide together, which alone is bounded, and told best.

    None where a width of theirs ended at its upper bound: these runs never slide so far, or so
    fast, that the friction reaches its level.
    """
    weights = sliding_weights(fit.part)
    shares = dict.fromkeys(name.split(".")[0] for name in weights)
    widths = {name for e in fit.part.effects if e.name in shares for name in e.shapes}
    wide = [p for p in fit.parameters if p.state == UNKNOWN[-1] and p.name.split(".")[-1] in widths]
    if not weights or wide or not shares.keys().isdisjoint(own):
        return []
    value = sum(weights[p.name] * p.value for p in fit.parameters if p.name in weights)
    names = fit.part.record["covariance"]["names"]
    error = _error_along(fit, np.array([weights.get(name, 0.0) for name in names]))
    if error > ROUGH * abs(value):
        return []
    unit = unit_in("Nm", fit.target, fit.part.known_load)
    return [Derived(f"{' + '.join(shares)} once they slide", value, error, unit)]


def sign_warnings(fit: Fit) -> list[str]:
    """What a compliance, a loop, a friction or an inertia of the wrong sign says."""
    shared = DERIVED[PRESLIDING][0].name if sliding_weights(fit.part) else None
    turned = [
        f"{d.name} is negative: the sign of a torque or of a position may be turned"
        for d in fit.derived
        if d.name in POSITIVE and d.name != shared and d.value < 0.0
    ]
    return turned + signs_of_a_drive(fit.part, significant=True)


def _value(formula: Formula, values: Mapping[str, float]) -> float:
    try:
        return float(formula.value(values))
    except ZeroDivisionError:
        return float("nan")


def _moved_by(formula: Formula, values: Mapping[str, float], name: str) -> bool:
    """Whether a formula depends on a parameter, of which only a placeholder is known."""
    doubled = {**values, name: 2.0 * values.get(name, 0.0)}
    return _value(formula, doubled) != _value(formula, values)


def _error(fit: Fit, prefix: str, formula: Formula, values: Mapping[str, float]) -> float:
    names = fit.part.record["covariance"]["names"]
    gradient = np.zeros(len(names))
    for k, name in enumerate(names):
        short = name.removeprefix(prefix)
        if not name.startswith(prefix):
            continue
        step = STEP * abs(values[short]) or STEP
        ends = [_value(formula, {**values, short: values[short] + d}) for d in (-step, step)]
        gradient[k] = (ends[1] - ends[0]) / (2.0 * step)
    return _error_along(fit, gradient)


def _error_along(fit: Fit, gradient: NDArray[np.float64]) -> float:
    """Of gradient · β: NaN where nothing behind it is fitted, infinite where it is not known."""
    if not gradient.any():
        return float("nan")
    if not _seen(fit, gradient) or _confounded_share(fit, gradient) > SHARE:
        return float("inf")
    return float(fit.uncertainty.errors_of(gradient[None])[0])


def _seen(fit: Fit, gradient: NDArray[np.float64]) -> bool:
    """Whether the data see the combination: it lies in the span of the basis."""
    basis = fit.uncertainty.basis
    left = gradient - basis @ np.linalg.lstsq(basis, gradient, rcond=None)[0]
    return bool(np.linalg.norm(left) <= 1e-6 * np.linalg.norm(gradient))


def _confounded_share(fit: Fit, gradient: NDArray[np.float64]) -> float:
    """Share of the variance of gradient · β that what is known of confounded groups leaves.

    The directions in which such a group is not known are those that its known combinations leave
    alone, so this is the share that [Belsley1980] asks of a coefficient, asked of a combination.
    """
    names = fit.part.record["covariance"]["names"]
    hidden = {name for group in fit.confounded for name in group.names}
    known = [{name: 1.0} for name in names if name not in hidden]
    known += [dict(one.weights) for group in fit.confounded for one in group.known]
    rows = np.array([[weights.get(name, 0.0) for name in names] for weights in known])
    covariance = fit.uncertainty.covariance
    total = gradient @ covariance @ gradient
    if not hidden or not total > 0.0:
        return 0.0
    shared = rows.reshape(-1, len(names)) @ covariance
    told = shared @ gradient
    return float(1.0 - told @ np.linalg.pinv(shared @ rows.T, hermitian=True) @ told / total)


def loop_warnings(fit: Fit) -> list[str]:
    """Say of hysteresis by the load where it is none of a gear, or wider than the load turns."""
    loop = _effect(fit, TORSION_LOOP)
    if loop is None or fit.part.known_load is None or loop.shapes["path"] >= 0.5:
        return []
    loads = [fit.part.load(run.log) for run in fit.runs]
    width = loop.shapes["load_width"]
    said = _given_back(fit, width, float(np.nanmedian(np.abs(np.concatenate(loads)))))
    turned = max(float(np.nanmax(load) - np.nanmin(load)) for load in loads)
    if width > 0.5 * turned:
        said.append(
            f"{TORSION_LOOP}: its load_width of {width:.3g} Nm is wider than half of the "
            f"{turned:.3g} Nm through which the load turns, so no run goes round its loop; record "
            "a run with more load each way, or fix a smaller load_width"
        )
    return said


def _given_back(fit: Fit, width: float, load: float) -> list[str]:
    """A sentence where ρ ≥ 1 at a load [Nm]."""
    mesh = _effect(fit, MESH)
    compliance = 0.0 if mesh is None else float(_coefficients(fit, MESH)[0])
    if mesh is None or not compliance > 0.0:
        return []
    slope = float(SPRINGS @ _coefficients(fit, TORSION_LOOP)) / width  # rad/Nm at the motor
    share = slope / compliance * (1.0 + (mesh.shapes["mesh_shape"] * load) ** 2)
    if share < 1.0:
        return []
    return [
        f"{TORSION_LOOP}: at {load:.3g} Nm, which half of the rows stay below, it gives back "
        f"{share:.3g} times what the mesh yields, as no gear does; fix a larger load_width or "
        "leave it out"
    ]


def _effect(fit: Fit, name: str) -> Effect | None:
    return next((effect for effect in fit.part.effects if effect.name == name), None)


def _coefficients(fit: Fit, name: str) -> NDArray[np.float64]:
    last = np.cumsum([len(effect.terms) for effect in fit.part.effects])
    k = [effect.name for effect in fit.part.effects].index(name)
    return fit.part.coefficients[last[k] - len(fit.part.effects[k].terms) : last[k]]
