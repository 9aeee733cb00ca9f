"""The chain's first stages over a log: reading checks, and derivatives that come from the angle."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from flexspline.errors import InputError, listed
from flexspline.estimators import Differentiator, ReadingChecks
from flexspline.estimators.differentiator import DERIVED
from flexspline.logs.derive import differentiate_causal, lateness
from flexspline.logs.log import Log
from flexspline.model import Model
from flexspline.signals import gear_of

if TYPE_CHECKING:
    from flexspline.estimation.plan import Plan

__all__ = [
    "BANDWIDTH",
    "READINGS",
    "made_by",
    "reads_of",
    "stages_before",
    "with_derivatives",
]

Entries = dict[str, dict[str, Any]]

BANDWIDTH = 20.0  # Hz, where neither model nor caller says one and the log's rate allows it
READINGS = (
    "output_position",
    "motor_position",
    *DERIVED,
    "motor_torque",
    "sensor_voltage",
    "sensor_torque",
    "thermistor_voltage",
    "temperature",
)


def reads_of(plan: Plan) -> set[str]:
    """Return the channels that the models between the stages, and the stages behind, read."""
    effects = [
        effect for part in plan.models.values() if part is not None for effect in part.effects
    ]
    reads = {name for effect in effects for name in effect.reads}
    if plan.inertia or plan.link_inertia or plan.estimating.keys() & {"merge", "collision"}:
        reads.add("output_velocity")
    return reads


def stages_before(model: Model, plan: Plan) -> Entries:
    """Return the model's first stages, as `_core.Joint` takes them; a derivative if it is read.

    Raises
    ------
    InputError
        Where the checks compare what the model does not have.
    """
    stages: Entries = {}
    checks, made = (model.estimators.get(key) for key in ("reading_checks", "differentiator"))
    if isinstance(checks, ReadingChecks):
        stages["reading_checks"] = _checks(model, plan, checks)
    if isinstance(made, Differentiator):
        stages |= _differentiator(made.bandwidth, reads_of(plan) & set(made.channels))
    return stages


def _checks(model: Model, plan: Plan, checks: ReadingChecks) -> dict[str, Any]:
    entry = checks.to_json()
    if checks.apart is not None and not (plan.has_sensor and "observer" in plan.estimating):
        raise InputError(
            "reading_checks: apart compares the torques of sensor and observer, and the model "
            "lacks one of them; leave it out or add the other"
        )
    if checks.twist is None:
        return entry
    if "gear_ratio" not in model.facts:
        raise InputError(
            "reading_checks: twist compares both encoders and needs the gear ratio, which the "
            "model lacks; fit its part again with --gear-ratio, or leave twist out"
        )
    return {**entry, "gear": gear_of(model.facts, motor_encoder=True)}


def _differentiator(bandwidth: float, channels: set[str]) -> Entries:
    """The stage that makes these channels; none for none."""
    if not channels:
        return {}
    (first, *others) = [name.removeprefix("output_") for name in DERIVED if name in channels]
    return {"differentiator": {"bandwidth": bandwidth, "makes": "both" if others else first}}


def with_derivatives(plan: Plan, log: Log, bandwidth: float | None, said: dict[str, None]) -> Log:
    """Add a velocity and an acceleration that the chain reads and neither log nor model has.

    Raises
    ------
    InputError
        Where a bandwidth is given for a model that has its own, or does not suit the log's rate.
    """
    own = plan.preprocessing.get("differentiator")
    if own is not None:
        _say_own(own, log, bandwidth, said)
        return log
    missing = [name for name in DERIVED if name in reads_of(plan) and name not in log]
    if not missing or "output_position" not in log or len(log) < 2:
        return log
    chosen = min(BANDWIDTH, log.rate / 4.0) if bandwidth is None else bandwidth
    made = differentiate_causal(log, bandwidth=chosen)
    note = f"{listed(missing)}: {lateness(chosen)}"
    said[f"derived from output_position, as a device would: {note}"] = None
    return log.with_columns({name: made[name] for name in missing}, note=note)


def _say_own(
    entry: Mapping[str, Any], log: Log, bandwidth: float | None, said: dict[str, None]
) -> None:
    """Say what the model's own stage makes; no other bandwidth may be asked for."""
    if bandwidth is not None:
        raise InputError(
            f"the model's differentiator has a bandwidth of {entry['bandwidth']:g} Hz of its own; "
            "leave the bandwidth out"
        )
    made = made_by(entry)
    unread = [name for name in made if name in log]
    also = f"; the log's own {listed(unread)} is not read" if unread else ""
    how = lateness(entry["bandwidth"])
    said[f"the chain makes {listed(made)} from output_position, {how}{also}"] = None


def made_by(entry: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the channels that a differentiator of a plan makes."""
    return DERIVED if entry["makes"] == "both" else (f"output_{entry['makes']}",)
