"""Compliance of a gear from its catalogue (c1 of full_range_torque_estimation).

A catalogue gives the output's stiffness in three ranges of torque, K1 to T1, K2 to T2 and K3
above, and what a reversal loses, the lost motion (or hysteresis loss). The paper's law of the
mesh (15) has the local stiffness

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

import numpy as np

from flexspline import _core
from flexspline.errors import InputError
from flexspline.full_range.torsion_part import RECORDED, GearCompliance, torsion_part
from flexspline.part import Part

__all__ = ["compliance_from_datasheet", "torsion_part_from_datasheet"]


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
    made = compliance_from_datasheet(
        K1,
        K2,
        K3,
        T1,
        T2,
        lost_motion=lost_motion,
        gear_ratio=gear_ratio,
        lost_motion_torque=lost_motion_torque,
    )
    torque = np.linspace(T1 / 2.0, T2, 200)
    curve = np.interp(torque, [0.0, T1, T2], [0.0, T1 / K1, T1 / K1 + (T2 - T1) / K2])
    law = -_core.mesh_torsion(
        torque, mesh_stiffness=made.mesh_stiffness, mesh_shape=made.mesh_shape
    )
    record = {
        "datasheet": {
            "K1": K1,
            "K2": K2,
            "K3": K3,
            "T1": T1,
            "T2": T2,
            "lost_motion": lost_motion,
            "largest_difference_up_to_T2": float(np.max(np.abs(law / curve - 1.0))),
        }
    }
    ratio = gear_ratio + (output_spline == "circular")
    return torsion_part(made, ratio, known_load=known_load, record=record)
