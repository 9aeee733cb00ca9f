"""The production chain over a log: what the joint computes, sample by sample."""

from flexspline.estimation.chain import estimate
from flexspline.estimation.result import Estimate, Estimates, Status

__all__ = ["Estimate", "Estimates", "Status", "estimate"]
