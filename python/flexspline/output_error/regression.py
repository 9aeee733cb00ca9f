"""What the ordinary regression needs of runs that were driven by a servo: the motor's torque.

Where a log has none, it is that of the duty which the servo reported:

    τ_m = k u (or k V u) − k_e q̇,     0 while it is not enabled
"""

from __future__ import annotations

import numpy as np

from flexspline.errors import InputError, listed
from flexspline.forward.servo import PositionServo
from flexspline.logs.derive import differentiate
from flexspline.logs.log import Log

__all__ = ["with_servo_torque"]


def with_servo_torque(log: Log, law: PositionServo, target: str) -> Log:
    """Return the log with what its motor gave, in `motor_torque` or `motor_current`.

    Raises
    ------
    InputError
        Where the log has neither that channel nor `duty`.
    """
    channel = "motor_current" if target == "motor_current" else "motor_torque"
    if channel in log or (channel == "motor_torque" and "motor_current" in log):
        return log
    if "duty" not in log:
        raise InputError(
            f"log '{log.name}': the regression that a fit by simulation starts from needs the "
            f"channel {channel} or duty; it has {listed(log.channels)}; map a column to one"
        )
    moving = log if "output_velocity" in log else differentiate(log)
    volts = log["supply_voltage"] if law.supply else 1.0
    given = law.torque * volts * log["duty"] - law.back_emf * moving["output_velocity"]
    if "enabled" in log:
        given = np.where(log["enabled"] == 0.0, 0.0, given)
    return log.with_columns({channel: given}, note=f"{channel} from duty by the controller's law")
