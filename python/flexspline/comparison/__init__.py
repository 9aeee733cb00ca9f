"""Where a model and runs disagree: residual against noise floor, over all that may locate it."""

from flexspline.comparison.comparing import compare

__all__ = ["compare"]
