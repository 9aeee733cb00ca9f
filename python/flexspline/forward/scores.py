"""How far models driven forward end from the measured motion, over several runs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from flexspline.errors import InputError
from flexspline.forward.servo import PositionServo
from flexspline.forward.simulating import simulate
from flexspline.logs.log import Log
from flexspline.model import Model

__all__ = ["simulated_gap", "simulated_rmse"]


def simulated_rmse(
    model: Model,
    logs: Sequence[Log],
    *,
    target: str | None = None,
    controller: PositionServo | None = None,
    horizon: float | None = None,
) -> dict[str, Any] | None:
    """Return {"channel", "value"}: the RMSE over all rows of all runs; None where one cannot be.

    `value` is in the channel's unit (rad of output_position; Nm of sensor_torque).
    """
    try:
        made = simulate(model, list(logs), target=target, controller=controller, horizon=horizon)
    except InputError:
        return None
    rest = np.concatenate([run.residual for run in made]) if made else np.zeros(0)
    rest = rest[np.isfinite(rest)]
    if not rest.size:
        return None
    return {"channel": made[0].channel, "value": float(np.sqrt(np.mean(rest**2)))}


def simulated_gap(
    base: Model,
    final: Model,
    logs: Sequence[Log],
    *,
    target: str | None = None,
    controller: PositionServo | None = None,
    horizon: float | None = None,
) -> dict[str, Any] | None:
    """Return {"channel", "base", "final"} of `discovery.json`; None where one cannot be driven.

    Parameters
    ----------
    base, final : fitted without these logs.
    logs : runs that neither has seen.
    horizon : s, as in `simulate`.
    """
    first = simulated_rmse(base, logs, target=target, controller=controller, horizon=horizon)
    last = simulated_rmse(final, logs, target=target, controller=controller, horizon=horizon)
    if first is None or last is None:
        return None
    return {"channel": last["channel"], "base": first["value"], "final": last["value"]}
