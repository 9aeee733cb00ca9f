"""The external torque from standstill to full speed: observer in motion, torsion at rest.

`train` chooses how a momentum observer and the compliance of the gear share the range, after the
third paper, and compares them with the methods that it names. `torsion_part_from_datasheet` makes
the compliance from a catalogue, `fit_mesh_stiffness` from a stiffness run.

Of the paper's next steps, other gear models inside the observer are taken up ("co", "o2",
hysteresis of the torsion). Friction with wear of the teeth is not: it needs logs over years, so fit
the drive's part again as the joint ages. In place of the merge there is a Kalman filter; why no IMM
or further complementary filter is said in `flexspline.full_range.methods`.
"""

from flexspline.full_range.result import ErrorScore, ErrorTable, FullRange, SpeedCurve
from flexspline.full_range.torsion_part import (
    GearCompliance,
    compliance_from_datasheet,
    fit_kinematic_error,
    fit_mesh_stiffness,
    mesh_of,
    torsion_part,
    torsion_part_from_datasheet,
    with_mesh_stiffness,
)
from flexspline.full_range.training import train
from flexspline.full_range.transition import Transition

__all__ = [
    "ErrorScore",
    "ErrorTable",
    "FullRange",
    "GearCompliance",
    "SpeedCurve",
    "Transition",
    "compliance_from_datasheet",
    "fit_kinematic_error",
    "fit_mesh_stiffness",
    "mesh_of",
    "torsion_part",
    "torsion_part_from_datasheet",
    "train",
    "with_mesh_stiffness",
]


def __dir__() -> list[str]:
    return __all__
