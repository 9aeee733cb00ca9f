"""A fitted model driven forward from a run's inputs, without a look at its measured motion."""

from flexspline.forward.drive import DriveInputs, drive_inputs, require_movable
from flexspline.forward.servo import PositionServo
from flexspline.forward.simulating import ForwardRun, simulate, simulated_gap, simulated_rmse

__all__ = [
    "DriveInputs",
    "ForwardRun",
    "PositionServo",
    "drive_inputs",
    "require_movable",
    "simulate",
    "simulated_gap",
    "simulated_rmse",
]
