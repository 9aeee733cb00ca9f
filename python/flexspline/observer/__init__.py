"""The external torque of one joint or of a whole arm, and the wrench that it amounts to."""

from flexspline.observer.dynamics import (
    Dynamics,
    Wrench,
    dynamics_from_urdf,
    require_dynamics,
    wrench_at_end_effector,
)
from flexspline.observer.observing import (
    Observed,
    Remainder,
    observe,
    observer_delay,
    observer_noise,
    subtract,
)

__all__ = [
    "Dynamics",
    "Observed",
    "Remainder",
    "Wrench",
    "dynamics_from_urdf",
    "observe",
    "observer_delay",
    "observer_noise",
    "require_dynamics",
    "subtract",
    "wrench_at_end_effector",
]


def __dir__() -> list[str]:
    return __all__
