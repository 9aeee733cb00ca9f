"""zhang_disturbance_elimination, done again on `flexspline.rigs.zhang_rig`."""

from flexspline.reproduce.zhang.figures import story
from flexspline.reproduce.zhang.study import draw

__all__ = ["draw", "story"]
