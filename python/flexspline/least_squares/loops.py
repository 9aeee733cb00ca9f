"""What a fitted loop of the torsion says that no gear does, or that the runs never showed.

A gear that is loaded further yields further. Just after a reversal all springs of the hysteresis
stick, and their slope stands against the mesh's:

    ρ(τ) = K_m0 (1 + (c_m τ)²) Σ c_k / (Ñ w_k)  < 1

It is asked at the load that half of the rows stay below: towards the largest loads the law of the
mesh stiffens without end, and so ρ of a sound gear may pass one there.

Source: full_range_torque_estimation (15); `flexspline/estimators/load_hysteresis.hpp`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from flexspline.effects import Effect
    from flexspline.least_squares.result import Fit

__all__ = ["loop_warnings"]

HYSTERESIS, MESH = "torsional_hysteresis", "mesh_compliance"
SPRINGS = np.array([1.0, 2.0, 4.0, 8.0])  # slip at w, w/2, w/4, w/8


def loop_warnings(fit: Fit) -> list[str]:
    """Say of hysteresis by the load where it is none of a gear, or wider than the load turns."""
    loop = _effect(fit, HYSTERESIS)
    if loop is None or fit.part.known_load is None or loop.shapes["path"] >= 0.5:
        return []
    loads = [run.log[fit.part.known_load] for run in fit.runs]
    width = loop.shapes["load_width"]
    said = _given_back(fit, width, float(np.nanmedian(np.abs(np.concatenate(loads)))))
    turned = max(float(np.nanmax(load) - np.nanmin(load)) for load in loads)
    if width > 0.5 * turned:
        said.append(
            f"{HYSTERESIS}: its load_width of {width:.3g} Nm is wider than half of the "
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
    slope = float(SPRINGS @ _coefficients(fit, HYSTERESIS)) / width  # rad/Nm at the motor
    share = slope / compliance * (1.0 + (mesh.shapes["mesh_shape"] * load) ** 2)
    if share < 1.0:
        return []
    return [
        f"{HYSTERESIS}: at {load:.3g} Nm, which half of the rows stay below, it gives back "
        f"{share:.3g} times what the mesh yields, as no gear does; fix a larger load_width or "
        "leave it out"
    ]


def _effect(fit: Fit, name: str) -> Effect | None:
    return next((effect for effect in fit.part.effects if effect.name == name), None)


def _coefficients(fit: Fit, name: str) -> NDArray[np.float64]:
    last = np.cumsum([len(effect.terms) for effect in fit.part.effects])
    k = [effect.name for effect in fit.part.effects].index(name)
    return fit.part.coefficients[last[k] - len(fit.part.effects[k].terms) : last[k]]
