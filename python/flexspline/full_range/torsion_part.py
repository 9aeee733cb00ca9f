"""The torsion part of a model: built from constants, read back, and refitted in pieces.

The effects hold the compliance as coefficients: Ñ/K_m0 for the mesh (15), 1/K_w0 for the wave
generator (16). The constants are those of Table III, or come from a data sheet (c1 of
full_range_torque_estimation).

Data sheet. A catalogue gives the output's stiffness in three ranges of torque, K1 to T1, K2 to T2
and K3 above, and what a reversal loses, the lost motion (or hysteresis loss). The paper's law of
the mesh (15) has the local stiffness

    dτ/dΔθ_m = K_m0 (1 + (c_m τ)²)

Rule: this is K1 in the middle of the first range, at T1/2, and K2 in the middle of the second, at
(T1 + T2)/2. Two conditions, two numbers:

    c_m² = (K2/K1 − 1) / (((T1 + T2)/2)² − (K2/K1) (T1/2)²),    K_m0 = K1 / (1 + (c_m T1/2)²)

The paper prints no rule. This one is inferred: with the catalogue of Harmonic Drive's size 20,
ratio 80 and above (CSG, HFUC, SHG alike: T1 = 7 Nm, T2 = 25 Nm, K1 = 1.6, K2 = 2.5, K3 = 2.9
· 10⁴ Nm/rad) it gives K_m0 = 15547.7 (printed 15548) and c_m = 0.048732 (0.0487), every digit of
Table III. That the joint has this size is inferred by the same match. K3 is not used, and above T2
the law is stiffer than the catalogue.

The wave generator's law (16) ends at 1/(c_w K_w0) on the motor side. Rule: that is half the lost
motion, times N; and 1 − 1/e of it is reached at a torque of T1 + T2 at the output, so at
(T1 + T2)/N at the wave generator:

    c_w = N / (T1 + T2),    K_w0 = (T1 + T2) / N · 2 / (N · lost motion)

With 1 arcmin rounded to 2.91 · 10⁻⁴ rad and N = 100 this gives 21.9931 Nm/rad and 3.1250 1/Nm, as
printed. Both are worked back from Table III: we found no catalogue page with the lost motion. The
product K_w0 c_w leaves little room (Ñ = 101 or an unrounded arcmin miss the printed digits), c_w
alone does: 5 / (4 % of a rated 40 Nm) is 3.125 as well, with the torque of the output taken for
that of the motor. We keep the reading whose sides agree.

Sources: full_range_torque_estimation (15), (16), Table III and its ref. 17 [Zhang2015],
which the text names for the constants; the catalogue's numbers as listed by the project
AimanHaidar/harmonic-drive-selector, those of size 32 also in Harmonic Drive's manual of the CHA.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from flexspline import _core
from flexspline.effects import Effect, effect, slices_of
from flexspline.effects.causes import KINEMATIC_ERROR, MESH, OFFSET, WAVE_GENERATOR
from flexspline.errors import InputError, listed
from flexspline.logs.log import Log
from flexspline.part import Part

if TYPE_CHECKING:
    from flexspline.least_squares.result import Fit

__all__ = [
    "GearCompliance",
    "compliance_from_datasheet",
    "fit_kinematic_error",
    "fit_mesh_stiffness",
    "mesh_of",
    "only",
    "torsion_part",
    "torsion_part_from_datasheet",
    "with_mesh_stiffness",
]

RECORDED = "reference_torque"
KEPT = ("channels", "validity", "datasheet", "carried")
"""Of a record, where a value is no longer the fit's."""


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
    compliance = float(part.coefficients[_place(part, MESH)])
    if not compliance > 0.0:
        raise InputError(
            f"the part for torsion has a compliance of the mesh of {compliance:g} rad/Nm; it must "
            "be above zero: check the signs of the load and of the motor's angle"
        )
    (made,) = [e for e in part.effects if e.name == MESH]
    return Mesh(effective_ratio / compliance, made.shapes["mesh_shape"])


def only(part: Part, name: str) -> Part:
    """Return the part with this effect alone."""
    _place(part, name)
    return part.keeping(lambda its: its.name == name)


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
    options : of `flexspline.fit`; `into`, a model whose drive knows gravity, where the load does
        not hold the weight.

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
    return _refit(part, logs, (MESH, OFFSET), options)


def fit_kinematic_error(part: Part, logs: Log | Sequence[Log], **options: Any) -> Fit:
    """Fit kinematic error (23) and offset to runs that turn, and keep the compliance.

    Parameters
    ----------
    part : for torsion; a kinematic error that it has already is fitted anew.
    logs : runs over at least a turn, with the part's known load.
    options : of `flexspline.fit`; orders={"kinematic_error": [1, 2, 4]} fixes the orders, else
        they are found over all pairs of parts.
    """
    return _refit(part, logs, (KINEMATIC_ERROR, OFFSET), options)


def _refit(
    part: Part, logs: Log | Sequence[Log], free: Sequence[str], options: Mapping[str, Any]
) -> Fit:
    """Fit the effects `free`, those the part lacks included, and hold the others."""
    from flexspline.fitting import fit

    known = [e.name for e in part.effects]
    effects = [*part.effects, *(effect(name) for name in free if name not in known)]
    held: dict[str, float] = {}
    for its, values in part.by_effect():
        if its.name not in free:
            names = [f"{its.name}.{term.name}" for term in its.terms]
            held |= dict(zip(names, values.tolist(), strict=True))
        held |= {_shape_name(its, shape): value for shape, value in its.shapes.items()}
    fixed = {**held, **dict(options.get("fixed") or {})}
    rest = {key: value for key, value in options.items() if key != "fixed"}
    rest.setdefault("known_load", part.known_load)
    return fit(effects, logs, "torsion", fixed=fixed, **rest)


def _shape_name(its: Effect, shape: str) -> str:
    return shape if shape == "direction_width" else f"{its.name}.{shape}"


def _place(part: Part, name: str) -> int:
    """Number of the first coefficient of an effect."""
    for its, at in zip(part.effects, slices_of(part.effects), strict=True):
        if its.name == name:
            return int(at.start)
    raise InputError(
        f"the part for {part.target} has no {name}; it has "
        f"{listed(its.name for its in part.effects)}: make it by torsion_part_from_datasheet or "
        "fit it to a run with a known load"
    )


def compliance_from_datasheet(
    K1: float,
    K2: float,
    K3: float,
    T1: float,
    T2: float,
    *,
    lost_motion: float,
    gear_ratio: float,
    lost_motion_torque: float | None = None,
) -> GearCompliance:
    """Return the constants of the compliance from a catalogue.

    Parameters
    ----------
    K1, K2, K3 : stiffness below T1, between T1 and T2, above T2, Nm/rad at the output.
    T1, T2 : ends of the ranges, Nm at the output.
    lost_motion : from one direction to the other, rad at the output (1 arcmin = 2.91e-4 rad).
    gear_ratio : N.
    lost_motion_torque : where 1 − 1/e of the lost motion is reached, Nm at the output; None for
        T1 + T2.

    Raises
    ------
    InputError
        Where a value is not above zero, T2 not above T1, or the stiffness does not grow: (15)
        stiffens.
    """
    given = {
        "K1": K1,
        "K2": K2,
        "K3": K3,
        "T1": T1,
        "T2": T2,
        "lost_motion": lost_motion,
        "gear_ratio": gear_ratio,
        "lost_motion_torque": T1 + T2 if lost_motion_torque is None else lost_motion_torque,
    }
    for name, value in given.items():
        if not (math.isfinite(value) and value > 0.0):
            raise InputError(f"datasheet: {name} = {value:g}; give a value above zero")
    if not T2 > T1:
        raise InputError(f"datasheet: T2 = {T2:g} Nm is not above T1 = {T1:g} Nm; look them up")
    first, second = T1 / 2.0, (T1 + T2) / 2.0
    gained = K2 / K1 - 1.0
    room = second**2 - (K2 / K1) * first**2
    if not (K1 < K2 <= K3 and room > 0.0):
        raise InputError(
            f"datasheet: stiffness {K1:g}, {K2:g}, {K3:g} Nm/rad to {T1:g} and {T2:g} Nm does not "
            "stiffen as the law of the mesh does; fit a stiffness run instead"
        )
    shape = math.sqrt(gained / room)
    bent = given["lost_motion_torque"] / gear_ratio  # Nm at the wave generator
    end = gear_ratio * lost_motion / 2.0  # rad at the motor
    return GearCompliance(K1 / (1.0 + (shape * first) ** 2), shape, bent / end, 1.0 / bent)


def torsion_part_from_datasheet(
    K1: float,
    K2: float,
    K3: float,
    T1: float,
    T2: float,
    *,
    lost_motion: float,
    gear_ratio: float,
    output_spline: str,
    lost_motion_torque: float | None = None,
    known_load: str = RECORDED,
) -> Part:
    """Return a part for the target torsion whose compliance is the catalogue's.

    Parameters
    ----------
    K1, K2, K3, T1, T2, lost_motion, gear_ratio, lost_motion_torque : as in
        `compliance_from_datasheet`.
    output_spline : "circular" or "flex".
    known_load : channel that the part is compared with.

    Returns
    -------
    Part
        mesh_compliance and wave_generator_compliance; its record says where the values are from
        and how far the law is from the catalogue's own curve.

    Raises
    ------
    InputError
        As in `compliance_from_datasheet`.
    """
    if output_spline not in ("circular", "flex"):
        raise InputError(f"output_spline is {output_spline!r}; give 'circular' or 'flex'")
    stated = {"K1": K1, "K2": K2, "K3": K3, "T1": T1, "T2": T2, "lost_motion": lost_motion}
    made = compliance_from_datasheet(
        **stated, gear_ratio=gear_ratio, lost_motion_torque=lost_motion_torque
    )
    torque = np.linspace(T1 / 2.0, T2, 200)
    curve = np.interp(torque, [0.0, T1, T2], [0.0, T1 / K1, T1 / K1 + (T2 - T1) / K2])
    law = -_core.mesh_torsion(
        torque, mesh_stiffness=made.mesh_stiffness, mesh_shape=made.mesh_shape
    )
    largest = float(np.max(np.abs(law / curve - 1.0)))
    record = {"datasheet": {**stated, "largest_difference_up_to_T2": largest}}
    ratio = gear_ratio + (output_spline == "circular")
    return torsion_part(made, ratio, known_load=known_load, record=record)
