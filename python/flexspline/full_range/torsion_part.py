"""The model's part for torsion: made of constants, read back, and refitted in pieces.

The effects hold the compliance as coefficients: Ñ/K_m0 for the mesh (15), 1/K_w0 for the wave
generator (16). Here they come from the constants of Table III and go back to them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from flexspline.effects import Effect, effect
from flexspline.errors import InputError, listed
from flexspline.logs.log import Log
from flexspline.part import Part

if TYPE_CHECKING:
    from flexspline.least_squares.result import Fit

__all__ = [
    "GearCompliance",
    "Mesh",
    "fit_kinematic_error",
    "fit_mesh_stiffness",
    "mesh_of",
    "only",
    "torsion_part",
    "with_mesh_stiffness",
]

MESH, WAVE_GENERATOR, ERROR = "mesh_compliance", "wave_generator_compliance", "kinematic_error"
RECORDED = "reference_torque"
KEPT = ("channels", "validity", "datasheet")  # of a record, where a value is no longer the fit's


@dataclass(frozen=True)
class GearCompliance:
    """The constants of Table III.

    Parameters
    ----------
    mesh_stiffness, mesh_shape : K_m0, Nm/rad, and c_m, 1/Nm, at the output.
    wave_generator_stiffness, wave_generator_shape : K_w0, Nm/rad, and c_w, 1/Nm, at the motor.
    """

    mesh_stiffness: float
    mesh_shape: float
    wave_generator_stiffness: float
    wave_generator_shape: float


@dataclass(frozen=True)
class Mesh:
    """What (18) needs: K_m0, Nm/rad, and c_m, 1/Nm, at the output."""

    stiffness: float
    shape: float


def torsion_part(
    compliance: GearCompliance,
    effective_ratio: float,
    *,
    known_load: str = RECORDED,
    record: Mapping[str, Any] | None = None,
) -> Part:
    """Return a part for torsion with this compliance.

    Parameters
    ----------
    compliance : K_m0, c_m, K_w0, c_w.
    effective_ratio : Ñ, `Log.effective_ratio`.
    known_load : channel that holds τ_load.
    record : what is to be kept with it.
    """
    effects = (
        effect(MESH, mesh_shape=compliance.mesh_shape),
        effect(WAVE_GENERATOR, wave_generator_shape=compliance.wave_generator_shape),
    )
    coefficients = np.array(
        [
            effective_ratio / compliance.mesh_stiffness,
            1.0 / compliance.wave_generator_stiffness,
        ]
    )
    channels = ["motor_position", "motor_torque", "output_position", known_load]
    kept = {"channels": channels, **(record or {})}  # the motor's angle is that of its encoder
    return Part("torsion", effects, coefficients, known_load, kept)


def mesh_of(part: Part, effective_ratio: float) -> Mesh:
    """Return the constants of the mesh in a part for torsion.

    Raises
    ------
    InputError
        Where the part has no mesh_compliance, or one that is not above zero.
    """
    at = _place(part, MESH)
    compliance = float(part.coefficients[at])
    if not compliance > 0.0:
        raise InputError(
            f"the part for torsion has a compliance of the mesh of {compliance:g} rad/Nm; it must "
            "be above zero: check the signs of the load and of the motor's angle"
        )
    (made,) = [e for e in part.effects if e.name == MESH]
    return Mesh(effective_ratio / compliance, made.shapes["mesh_shape"])


def only(part: Part, name: str) -> Part:
    """Return the part with this effect alone."""
    first = _place(part, name)
    (its,) = [e for e in part.effects if e.name == name]
    values = part.coefficients[first : first + len(its.terms)]
    return replace(part, effects=(its,), coefficients=values)


def with_mesh_stiffness(part: Part, stiffness: float, effective_ratio: float) -> Part:
    """Return the part with another K_m0 [Nm/rad] and all else as it is.

    c1 and c2 of Table III differ in nothing else (× 1.70).
    """
    if not stiffness > 0.0:
        raise InputError(f"K_m0 = {stiffness:g} Nm/rad; give a stiffness above zero")
    coefficients = np.array(part.coefficients)
    coefficients[_place(part, MESH)] = effective_ratio / stiffness
    record = {name: part.record[name] for name in KEPT if name in part.record}
    return replace(part, coefficients=coefficients, record=record)


def fit_mesh_stiffness(part: Part, logs: Log | Sequence[Log], **options: Any) -> Fit:
    """Fit K_m0 and offset to a stiffness run, keep all else: c2, full_range_torque_estimation.

    Parameters
    ----------
    part : for torsion, such as `torsion_part_from_datasheet` makes.
    logs : runs with a load that rises and falls while motor or brake hold, with the part's known
        load.
    options : of `flexspline.fit`.

    Returns
    -------
    Fit
        Its part is c2; "mesh_compliance.compliance" is Ñ/K_m0 with its error.

    Raises
    ------
    InputError
        As `flexspline.fit`, and where the part has no mesh_compliance.
    """
    _place(part, MESH)
    return _refit(part, logs, (MESH, "offset"), options)


def fit_kinematic_error(part: Part, logs: Log | Sequence[Log], **options: Any) -> Fit:
    """Fit kinematic error (23) and offset to runs that turn, and keep the compliance.

    Parameters
    ----------
    part : for torsion; a kinematic error that it has already is fitted anew.
    logs : runs over at least a turn, with the part's known load.
    options : of `flexspline.fit`; orders={"kinematic_error": [1, 2, 4]} fixes the orders, else
        they are found over all pairs of parts.
    """
    return _refit(part, logs, (ERROR, "offset"), options)


def _refit(
    part: Part, logs: Log | Sequence[Log], free: Sequence[str], options: Mapping[str, Any]
) -> Fit:
    """Fit the effects `free`, those the part lacks included, and hold the others."""
    from flexspline.fitting import fit

    known = [e.name for e in part.effects]
    effects = [*part.effects, *(effect(name) for name in free if name not in known)]
    held: dict[str, float] = {}
    first = 0
    for its in part.effects:
        names = [f"{its.name}.{term.name}" for term in its.terms]
        if its.name not in free:
            held |= dict(zip(names, part.coefficients[first:].tolist(), strict=False))
        first += len(names)
        held |= {_shape_name(its, shape): value for shape, value in its.shapes.items()}
    fixed = {**held, **dict(options.get("fixed") or {})}
    rest = {key: value for key, value in options.items() if key != "fixed"}
    rest.setdefault("known_load", part.known_load)
    return fit(effects, logs, "torsion", fixed=fixed, **rest)


def _shape_name(its: Effect, shape: str) -> str:
    return shape if shape == "direction_width" else f"{its.name}.{shape}"


def _place(part: Part, name: str) -> int:
    """Number of the first coefficient of an effect."""
    first = 0
    for its in part.effects:
        if its.name == name:
            return first
        first += len(its.terms)
    raise InputError(
        f"the part for {part.target} has no {name}; it has "
        f"{listed(its.name for its in part.effects)}: make it by torsion_part_from_datasheet or "
        "fit it to a run with a known load"
    )
