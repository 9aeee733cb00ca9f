"""zhang_disturbance_elimination, done again on `flexspline.rigs.zhang_rig`."""

from flexspline.reproduce.zhang.quantities import draw
from flexspline.reproduce.zhang.story import story

__all__ = ["draw", "story"]
