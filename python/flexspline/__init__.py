"""The true torque of robot joints with strain wave gears.

Read logs, compensate the sensor, fit the joint's intrinsic dynamics, judge the fit, report and
export: one C++ core from the notebook to the robot.
"""

from __future__ import annotations

from pathlib import Path

__version__ = "0.1.0"

from flexspline.effects import CATALOGUE, Effect, effect
from flexspline.errors import FlexsplineWarning, InputError
from flexspline.fit import Fit, fit
from flexspline.logs import Log, convert, read_log
from flexspline.model import Model, Part, Prediction

__all__ = [
    "CATALOGUE",
    "Effect",
    "Fit",
    "FlexsplineWarning",
    "InputError",
    "Log",
    "Model",
    "Part",
    "Prediction",
    "__version__",
    "convert",
    "effect",
    "fit",
    "get_include",
    "read_log",
]


def get_include() -> str:
    """Return the folder of the core's C++ headers, for a compiler's -I."""
    return str(Path(__file__).parent / "include")
