"""turlapati_intrinsic_dynamics, done again on `flexspline.rigs.turlapati_rig`."""

from flexspline.reproduce.turlapati.figures import story
from flexspline.reproduce.turlapati.study import draw

__all__ = ["draw", "story"]
