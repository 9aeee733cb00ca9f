"""Rows that a search may count: those in which the recorder resolves the motion (`fit/resolution`).

The model that is asked is the base with the friction that turns over fastest.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from flexspline.discovery.refit import started
from flexspline.discovery.whitening import Whitening
from flexspline.discovery.working import working
from flexspline.effects import Effect
from flexspline.fit.problem import Problem
from flexspline.fit.resolution import away_from_ends, coarser, resolved_rows, with_fastest

__all__ = ["away_from_ends", "coarser", "resolved"]


def resolved(
    base: Sequence[Effect],
    fixed: Mapping[str, float],
    posed: Callable[[Sequence[Effect], bool], Problem],
) -> list[NDArray[np.bool_]]:
    """Return which rows of each run count, (N,).

    Parameters
    ----------
    posed : makes the problem of effects, with the motion as it is prepared or smoothed further.
    """
    effects = with_fastest(base)
    fine, coarse = posed(effects, False), posed(effects, True)
    plain = Whitening(np.ones(1), 1.0, fine.decimation)
    work, _ = started(fine, working(effects, len(effects), fixed), plain)
    both = [(work.predict(fine, k), work.predict(coarse, k)) for k in range(len(fine.runs))]
    runs = fine.runs
    return resolved_rows([run.log for run in runs], [run.target for run in runs], both)
