"""What a detector is calibrated on: residuals, or logs whose estimate is the residual."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from flexspline.collision.residual import Residual
from flexspline.errors import InputError
from flexspline.estimation import estimate
from flexspline.estimators.collision import MOST_BANDS
from flexspline.logs.log import Log
from flexspline.model import Model

__all__ = ["residuals_of", "speed_bands"]


def residuals_of(
    logs: Residual | Log | Sequence[Residual | Log], model: Model | None, source: str
) -> list[Residual]:
    given: list[Any] = list(logs) if isinstance(logs, (list, tuple)) else [logs]
    for each in given:
        if not isinstance(each, (Residual, Log)):
            raise InputError(
                f"detector: a {type(each).__name__} is no contact-free run; give Residual, or logs "
                "with their model"
            )
    if not given:
        raise InputError("detector: no contact-free logs; give at least one")
    made: list[Residual] = [
        _estimated(log, model, source) if isinstance(log, Log) else log for log in given
    ]
    for each in made:
        if len(each) < 2 or not np.isfinite(each.values).any():
            raise InputError(
                f"detector: log '{each.name}' holds {len(each)} rows and no finite residual over "
                "any time; leave it out or check it"
            )
        if each.values.shape[1] != made[0].values.shape[1] or each.unit != made[0].unit:
            raise InputError(
                f"detector: log '{each.name}' has other joints or another unit than "
                f"'{made[0].name}'; give logs of one arm"
            )
    return made


def _estimated(log: Log, model: Model | None, source: str) -> Residual:
    if model is None:
        raise InputError(f"detector: log '{log.name}' needs model=, whose estimate is watched")
    found = estimate(model, log)[f"external_torque_{source}"]
    velocity = log.columns.get("output_velocity")
    return Residual(log["time"], found, velocity, log.name)


def speed_bands(speed_edges: ArrayLike) -> tuple[float, ...]:
    edges = np.asarray(speed_edges, dtype=float).ravel()
    if not (np.diff(edges, prepend=0.0) > 0.0).all() or len(edges) >= MOST_BANDS:
        raise InputError(
            f"detector: speed_edges = {edges.tolist()}; give at most {MOST_BANDS - 1} speeds above "
            "zero, increasing"
        )
    return tuple(edges.tolist())
