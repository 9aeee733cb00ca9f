"""full_range_torque_estimation, done again on `flexspline.rigs.full_range_rig`."""

from flexspline.reproduce.full_range.figures import story
from flexspline.reproduce.full_range.quantities import draw

__all__ = ["draw", "story"]
