"""The true torque of robot joints with strain wave gears.

Read logs, compensate the sensor, fit the joint's intrinsic dynamics, judge the fit, report and
export: one C++ core from the notebook to the robot.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from flexspline.about import __version__, get_include
from flexspline.effects import CATALOGUE, Effect, effect
from flexspline.errors import FlexsplineWarning, InputError
from flexspline.lazy import attached
from flexspline.presentation import register_renderers

if TYPE_CHECKING:
    from flexspline.calibration import calibrate
    from flexspline.calibration.result import CalibrationResult
    from flexspline.certification import Certificate, certify
    from flexspline.comparison import compare
    from flexspline.comparison.models import ModelComparison, compare_models
    from flexspline.comparison.result import Comparison
    from flexspline.deprecated import fit
    from flexspline.discovery.discovering import discover
    from flexspline.discovery.result import Discovery
    from flexspline.estimation import Estimate, Estimates, estimate
    from flexspline.estimators import (
        Adaptation,
        Calibration,
        Collision,
        Compliance,
        Differentiator,
        Merge,
        Observer,
        ReadingChecks,
        TemperatureCompensation,
        Thermistor,
    )
    from flexspline.experiment import next_experiment
    from flexspline.experiment.plan import Limits, Plan
    from flexspline.exporting import export, mujoco_plugin
    from flexspline.exporting.block import learned_model
    from flexspline.forward import ForwardRun, simulate
    from flexspline.forward.servo import PositionServo
    from flexspline.least_squares.options import FitOptions, MotionOptions
    from flexspline.least_squares.result import Fit
    from flexspline.least_squares.sums import accumulate
    from flexspline.logs.checks import Findings, check
    from flexspline.logs.log import Log
    from flexspline.logs.read import convert, joints_of, read_log, read_pieces, read_runs
    from flexspline.model import Model, Part, Prediction, Predictions
    from flexspline.output_error.fitting import fit_motion
    from flexspline.own import OwnEffect, own_effect
    from flexspline.recordings import Guess, guess_map
    from flexspline.tracking import track
    from flexspline.tracking.history import History, history_of
    from flexspline.tracking.result import Track

__all__ = [
    "CATALOGUE",
    "Adaptation",
    "Calibration",
    "CalibrationResult",
    "Certificate",
    "Collision",
    "Comparison",
    "Compliance",
    "Differentiator",
    "Discovery",
    "Effect",
    "Estimate",
    "Estimates",
    "Findings",
    "Fit",
    "FitOptions",
    "FlexsplineWarning",
    "ForwardRun",
    "Guess",
    "History",
    "InputError",
    "Limits",
    "Log",
    "Merge",
    "Model",
    "ModelComparison",
    "MotionOptions",
    "Observer",
    "OwnEffect",
    "Part",
    "Plan",
    "PositionServo",
    "Prediction",
    "Predictions",
    "ReadingChecks",
    "TemperatureCompensation",
    "Thermistor",
    "Track",
    "__version__",
    "accumulate",
    "calibrate",
    "certify",
    "check",
    "compare",
    "compare_models",
    "convert",
    "discover",
    "effect",
    "estimate",
    "export",
    "fit",
    "fit_motion",
    "get_include",
    "guess_map",
    "history_of",
    "joints_of",
    "learned_model",
    "mujoco_plugin",
    "next_experiment",
    "own_effect",
    "read_log",
    "read_pieces",
    "read_runs",
    "simulate",
    "track",
]

register_renderers()

_HOME = {
    "Adaptation": "estimators",
    "Calibration": "estimators",
    "CalibrationResult": "calibration.result",
    "Certificate": "certification",
    "Collision": "estimators",
    "Comparison": "comparison.result",
    "Compliance": "estimators",
    "Differentiator": "estimators",
    "Discovery": "discovery.result",
    "Estimate": "estimation",
    "Estimates": "estimation",
    "Findings": "logs.checks",
    "Fit": "least_squares.result",
    "FitOptions": "least_squares.options",
    "ForwardRun": "forward",
    "Guess": "recordings",
    "History": "tracking.history",
    "Limits": "experiment.plan",
    "Log": "logs.log",
    "Merge": "estimators",
    "Model": "model",
    "ModelComparison": "comparison.models",
    "MotionOptions": "least_squares.options",
    "Observer": "estimators",
    "OwnEffect": "own",
    "Part": "model",
    "Plan": "experiment.plan",
    "PositionServo": "forward.servo",
    "Prediction": "model",
    "Predictions": "model",
    "ReadingChecks": "estimators",
    "TemperatureCompensation": "estimators",
    "Thermistor": "estimators",
    "Track": "tracking.result",
    "accumulate": "least_squares.sums",
    "calibrate": "calibration",
    "certify": "certification",
    "check": "logs.checks",
    "compare": "comparison",
    "compare_models": "comparison.models",
    "discover": "discovery.discovering",
    "estimate": "estimation",
    "export": "exporting",
    "convert": "logs.read",
    "fit": "deprecated",
    "fit_motion": "output_error.fitting",
    "guess_map": "recordings",
    "history_of": "tracking.history",
    "joints_of": "logs.read",
    "learned_model": "exporting.block",
    "mujoco_plugin": "exporting",
    "next_experiment": "experiment",
    "own_effect": "own",
    "read_log": "logs.read",
    "read_pieces": "logs.read",
    "read_runs": "logs.read",
    "simulate": "forward",
    "track": "tracking",
}


_ROOMS = (
    "baselines",
    "collision",
    "fleet",
    "full_range",
    "observer",
    "plot",
    "rigs",
    "sensor",
    "simulation",
    "sklearn",
)
"""Sub-packages with an interface of their own, as in `flexspline.simulation.Joint`."""


_public = attached(__name__, _HOME)


def __getattr__(name: str) -> Any:
    """Import a public name or sub-package when it is first used."""
    return importlib.import_module(f"{__name__}.{name}") if name in _ROOMS else _public(name)


def __dir__() -> list[str]:
    return sorted([*__all__, *_ROOMS])
