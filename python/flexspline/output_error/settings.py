"""Options of a fit by simulation, and the motor torque that its regression starts from.

Where a log of a servo has no motor torque, it is that of the duty which the servo reported:

    τ_m = k u (or k V u) − k_e q̇,     0 while it is not enabled
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from flexspline.errors import InputError, listed
from flexspline.forward.servo import PositionServo
from flexspline.least_squares.options import require_robust
from flexspline.logs.derive import differentiate
from flexspline.logs.log import Log

__all__ = [
    "MotionOptions",
    "Settings",
    "settings_of",
    "with_servo_torque",
]


@dataclass(frozen=True, kw_only=True)
class MotionOptions:
    """Options of `fit_motion` that few calls need.

    Parameters
    ----------
    free_controller : fields of the servo's law that are fitted too, of "torque" and "back_emf".
    starts : descents: from the regression, from where short pieces of the runs are missed least,
        and the others around the regression by `seed`.
    folds : every `folds`-th run is left out in turn (of fewer runs, as many blocks of each); what
        the fits without find is within the intervals.
    seed : of the starts.
    robust : "huber" weighs down outliers in the regression that comes first; None does not.
    threads : that simulations are shared among.
    progress : show what is being done on standard error.

    Raises
    ------
    InputError
        Where starts, folds or robust are something else.
    """

    free_controller: str | Sequence[str] = ()
    starts: int = 8
    folds: int = 4
    seed: int = 0
    robust: str | None = None
    threads: int = 1
    progress: bool = False

    def __post_init__(self) -> None:
        require_robust(self.robust)
        for name, least in (("starts", 1), ("folds", 2)):
            value = getattr(self, name)
            if not isinstance(value, int) or value < least:
                raise InputError(f"{name} is {value!r}; give a whole number from {least} up")


@dataclass(frozen=True)
class Settings:
    """How a fit by simulation searches: the servo's law, or None, and the options."""

    controller: PositionServo | None
    options: MotionOptions = field(default_factory=MotionOptions)

    def __post_init__(self) -> None:
        if self.free and self.controller is None:
            raise InputError("free_controller names fields of a controller; give the controller")

    @property
    def free(self) -> tuple[str, ...]:
        """Fields of the law that are fitted."""
        free = self.options.free_controller
        return (free,) if isinstance(free, str) else tuple(free)


def settings_of(
    controller: PositionServo | str | os.PathLike[str] | None, options: MotionOptions
) -> Settings:
    """Return `Settings`; the law may be a path of its `servo.json`.

    Raises
    ------
    InputError
        Where that file is no law, or fields are to be fitted of none.
    """
    if isinstance(controller, (str, os.PathLike)):
        controller = PositionServo.load(controller)
    return Settings(controller, options)


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
