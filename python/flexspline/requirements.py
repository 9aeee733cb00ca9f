"""What logs and effects must have before they are fitted: finite values, a load, one gear."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexspline.effects import Effect
from flexspline.errors import InputError, listed
from flexspline.logs.checks.dependence import called, copies
from flexspline.logs.log import Log
from flexspline.logs.plausible import IMAGINABLE, LEAST
from flexspline.signals import gear_of

__all__ = [
    "IMAGINABLE",
    "gear_for",
    "require_apart",
    "require_change",
    "require_finite",
    "require_load",
    "require_one_unit",
]

Array = NDArray[np.float64]


def require_finite(log: Log, columns: Mapping[str, Array]) -> None:
    """Refuse columns (N,) with NaN, infinities or an overload, naming channel and row."""
    for name, values in columns.items():
        if max(values.max(), -values.min()) <= IMAGINABLE:
            continue
        beyond = np.flatnonzero(np.isfinite(values) & (np.abs(values) > IMAGINABLE))
        if len(beyond):
            raise InputError(
                f"log '{log.name}': {name} is {values[beyond[0]]:.4g} in row {beyond[0]}, which no "
                f"instrument reads (rows of this kind: {len(beyond)}): an overload is written so; "
                "ask for the repair drop_invalid, or correct the recording"
            )
        bad = np.flatnonzero(~np.isfinite(values))
        if len(bad):
            raise InputError(
                f"log '{log.name}': {name} is not finite in {len(bad)} rows, first in row "
                f"{bad[0]}; ask for the repair drop_invalid, or correct the recording"
            )


def require_apart(logs: Sequence[Log]) -> None:
    """Refuse a run that is there twice: it would be held out and fitted at once."""
    for number, other in copies(logs):
        raise InputError(
            f"run {number + 1} of {len(logs)}, {called(logs[number])}, holds the same values as "
            f"the run {called(logs[other])}: a run counts once; leave one of them out"
        )


def require_change(target: str, columns: Sequence[Array]) -> None:
    """Refuse a target, (N,) for each run, that is one number throughout, or next to nothing."""
    if all(np.all(values == columns[0][0]) for values in columns):
        raise InputError(
            f"the target {target} is {columns[0][0]:.6g} in every row of all logs: there is "
            "nothing to explain; check the wiring and the column map, or record runs with motion "
            "and load"
        )
    size = max(float(np.max(np.abs(values), initial=0.0)) for values in columns)
    if size < LEAST:
        raise InputError(
            f"the target {target} is at most {size:.3g} in all logs, which no instrument resolves; "
            "correct the unit of its column"
        )


def require_one_unit(effects: Sequence[Effect], target: str, known_load: str | None) -> None:
    """Refuse effects of a load that would be a sum of Nm and A.

    The load is the known one and that of the model's own inertia and gravity,
    which of a motor current is in A.
    """
    if target != "motor_current" or known_load is None:
        return
    own = [effect.name for effect in effects if effect.info.carries_load]
    readers = [e.name for e in effects if "load" in e.reads and not e.info.traits.known_load]
    if own and readers:
        raise InputError(
            f"effect '{readers[0]}' reads the load, which would be {known_load} in Nm and "
            f"{listed(own)} of motor_current in A; give the target motor_torque and "
            "--torque-constant, or leave one of them out"
        )


def require_load(effects: Sequence[Effect], known_load: str | None) -> None:
    """Refuse effects of a load that neither a channel nor the model tells."""
    if known_load is not None:
        return
    own = any(effect.info.carries_load for effect in effects)
    for effect in effects:
        if effect.info.traits.known_load:
            raise InputError(
                f"effect '{effect.name}' needs a known load; name its channel with known_load, or "
                "leave the effect out"
            )
        if "load" in effect.reads and not own:
            raise InputError(
                f"effect '{effect.name}' depends on the load, which neither a known load nor "
                "inertia or gravity tells; give known_load, add one of these, or leave it out"
            )


def gear_for(
    logs: Sequence[Log], target: str, effects: Sequence[Effect], known_load: str | None = None
) -> dict[str, Any]:
    """Return the gear that all logs agree on, as `_core.Design` takes it.

    `known_load`: the channel that is taken off the target; off a current by one torque constant.
    """
    scale = ["torque_constant"] if target == "motor_current" and known_load is not None else []
    for key in ("joint", "gear_ratio", "output_spline", "pole_pairs", "slots", *scale):
        values = list(dict.fromkeys(log.facts.get(key, "unknown") for log in logs))
        if len(values) > 1:
            raise InputError(
                f"the logs disagree on {key}: {listed(values)}; they must be of one joint"
            )
    facts = dict(logs[0].facts)
    encoders = {"motor_position" in log for log in logs}
    motor_side = [e.name for e in effects if "motor_position" in e.reads]
    if motor_side and len(encoders) > 1:
        raise InputError("some logs have motor_position and others not; give it in all or none")
    if motor_side and "gear_ratio" not in facts:
        raise InputError(f"{listed(motor_side)} needs the gear ratio; give gear_ratio")
    return gear_of(facts, encoders == {True})
