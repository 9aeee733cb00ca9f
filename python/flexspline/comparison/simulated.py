"""Comparing motion: the model driven forward from the inputs of each run.

`flexspline.simulate` has to give, for each run, what `runs.Compared` holds: the measured and the
simulated channel, its unit, and the log that locates a disagreement. Everything else is shared.
"""

from __future__ import annotations

from collections.abc import Sequence

from flexspline.comparison.runs import Compared
from flexspline.errors import InputError
from flexspline.logs.log import Log
from flexspline.model import Model

__all__ = ["simulated"]


def simulated(model: Model, logs: Sequence[Log]) -> Compared:
    """Refuse: there is no forward simulation of a fitted model yet.

    Raises
    ------
    InputError
        Always.
    """
    raise InputError(
        f"a forward simulation of the model's {len(model.parts)} parts over {len(logs)} runs "
        "cannot be compared by this version; leave --simulated out to compare the prediction"
    )
