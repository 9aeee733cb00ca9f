"""Fitting effects to logs, and what the data say of the result."""

from flexspline.fit.fitting import fit
from flexspline.fit.identifiability import Combination, Confounded
from flexspline.fit.result import Fit, FittedRun, Parameter
from flexspline.fit.scores import Score

__all__ = ["Combination", "Confounded", "Fit", "FittedRun", "Parameter", "Score", "fit"]
