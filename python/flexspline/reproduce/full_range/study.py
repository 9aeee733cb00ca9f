"""One draw of the third paper: fit friction, gear and merge on training runs, judge on another day.

As the paper has it (§IV): the observer's model from a training set, kinematic error from a
training set, c1's stiffness from the data sheet, c2's from a stiffness run, α and q̇_trans for the
least RMSE on the training log. L = 80 1/s is our reading of Table II; L = −8 diverges.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

import flexspline.full_range as fr
from flexspline.fitting import fit
from flexspline.least_squares.result import Fit
from flexspline.logs.derive import differentiate
from flexspline.logs.log import Log
from flexspline.part import Part
from flexspline.rigs.full_range import MOTION, FullRangeRig

__all__ = ["GAIN", "RATIO", "Study"]

RATIO = 101.0
GAIN = 80.0  # 1/s
GP_ROWS = 250
#: Friction (21), (22) with both levels; the sign of the speed is smooth within `WIDTH`.
DRIVE = (
    "inertia",
    "coulomb_friction_per_direction",
    "viscous_friction",
    "nonlinear_viscous_friction",
)
WIDTH = 0.005  # rad/s
BANDWIDTH = 20.0  # Hz, of the velocity and acceleration that the fit reads
#: Harmonic Drive, size 20, ratio 80 and above: they give c1 of Table III to the printed digits.
STIFFNESSES = (1.6e4, 2.5e4, 2.9e4)  # K1, K2, K3, Nm/rad
TORQUES = (7.0, 25.0)  # T1, T2, Nm
LOST_MOTION = 2.91e-4  # rad, 1 arcmin


@dataclass(frozen=True)
class Study:
    """A rig, what is fitted to its training runs, and how it does on another day.

    `gp_rows`: samples that enter the Gaussian process; 0 leaves it out.
    """

    rig: FullRangeRig
    gp_rows: int = GP_ROWS

    @cached_property
    def training(self) -> Log:
        return self.rig.training()

    @cached_property
    def validation(self) -> Log:
        return self.rig.validation()

    @cached_property
    def drive(self) -> Fit:
        """Inertia and friction, from the rows that move: at rest friction is not determined.

        The run by hand has the inertia, that with several speeds the bends of the friction.
        """
        logs = [differentiate(r, bandwidth=BANDWIDTH) for r in (self.training, self.rig.friction())]
        return fit(
            DRIVE,
            [r.rows(np.abs(r["output_velocity"]) >= MOTION, note="rows that move") for r in logs],
            "motor_torque",
            known_load="reference_torque",
            fixed={"direction_width": WIDTH},
            checks=False,
        )

    @cached_property
    def kinematic_error(self) -> Fit:
        """(23) with its orders found, on the compliance of the data sheet: this is c1."""
        sheet = fr.torsion_part_from_datasheet(
            *STIFFNESSES,
            *TORQUES,
            lost_motion=LOST_MOTION,
            gear_ratio=100.0,
            output_spline="circular",
        )
        return fr.fit_kinematic_error(sheet, self.rig.turning(), checks=False)

    @cached_property
    def mesh(self) -> Fit:
        """K_m0 from the stiffness run."""
        return fr.fit_mesh_stiffness(self.c1, self.rig.stiffness(), checks=False)

    @property
    def c1(self) -> Part:
        return self.kinematic_error.part

    @property
    def c2(self) -> Part:
        """c1 with the stiffness that was measured: they differ in nothing else."""
        return fr.with_mesh_stiffness(self.c1, self.stiffness, RATIO)

    @property
    def stiffness(self) -> float:
        """K_m0 as measured, Nm/rad."""
        return fr.mesh_of(self.mesh.part, RATIO).stiffness

    @cached_property
    def trained(self) -> fr.FullRange:
        return fr.train(
            self.drive.model,
            self.training,
            torsion_parts={"1": self.c1, "2": self.c2},
            gain=GAIN,
            rotor_inertia=self.rig.joint.motor.inertia,
            motion_speed=MOTION,
            methods=("sd", "gp", "kalman") if self.gp_rows else ("sd", "kalman"),
            gp_rows=self.gp_rows,
        )

    @cached_property
    def table(self) -> fr.ErrorTable:
        """Table I, on the day of validation."""
        return self.trained.table(self.validation)
