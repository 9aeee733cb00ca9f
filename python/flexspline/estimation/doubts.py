"""What makes the estimates of a log wrong: of the model, of the log, and of both together.

Rows outside of what a part was fitted to are found as `Model.predict` finds them: in the channels
made as the part expects them, since its ranges are of such channels. Temperature and load are those
of the chain. Rows without an estimate by the part are left out: what limits and reading checks took
out has reached no part.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexspline.errors import InputError, listed
from flexspline.estimation.plan import Plan, carried_warnings, made_by, reads_load
from flexspline.estimators import Collision
from flexspline.logs.checks.samples import kelvin
from flexspline.logs.derive import resample, with_motion
from flexspline.logs.local_fit import EVEN
from flexspline.logs.log import Log
from flexspline.logs.segments import median_step, runs
from flexspline.model import ANGLES, PART_OF, Model, range_warnings
from flexspline.part import Part
from flexspline.prepared import prepared

__all__ = [
    "doubts_of",
]

Array = NDArray[np.float64]

RESULTS = {
    "sensor": "external_sensor",
    "observed": "external_observer",
    "torsion": "external_compliance",
    "carried": "external_compliance",
}
"""What the core's models lead to."""


def doubts_of(model: Model, plan: Plan, log: Log, found: Mapping[str, Any]) -> tuple[str, ...]:
    """Return sentences on what makes these estimates wrong.

    Parameters
    ----------
    plan : of the model, with the stage that makes what the log lacks.
    log : as the chain read it.
    found : what the joint made of it, by the core's names, (N,) each.
    """
    weight = carried_warnings(model) if "compliance" in plan.estimating else []
    scale = [f"{log.name}: {finding.sentence} {finding.remedy}" for finding in kelvin(log)]
    ranges = _of_ranges(model, plan, log, found)
    return (*weight, *scale, *ranges, *_of_detector(model, plan, log))


def _of_ranges(model: Model, plan: Plan, log: Log, found: Mapping[str, Any]) -> Iterator[str]:
    """Yield a sentence for each part in use that extrapolates."""
    for name, part in _in_use(model, plan).items():
        if part.record.get("validity"):
            read = _as_read(plan, name, part, log, found)
            yield from range_warnings(part, _as_fitted(part, read))


def _in_use(model: Model, plan: Plan) -> dict[str, Part]:
    """The parts by the core's names of their models, whole and each once.

    What the chain takes out of a part for a stage, such as the inertia, is in use as well; of a
    part that only carries, the gravity alone.
    """
    found: dict[str, Part] = {}
    for name, part in plan.models.items():
        if part is None or part.target in [one.target for one in found.values()]:
            continue
        found[name] = part if name == "carried" else model.parts[PART_OF[part.target]]
    return found


def _as_read(plan: Plan, name: str, part: Part, log: Log, found: Mapping[str, Any]) -> Log:
    """The rows with an estimate by this part, with the chain's temperature and load."""
    log = log.with_columns({"temperature": found["temperature"]}, note="of the chain")
    if part.known_load is not None:
        by_sensor = plan.has_sensor and name != "torsion"
        load = "external_sensor" if by_sensor else "external_compliance"
        unknown = np.full(len(log), np.nan)
        values = found.get(load, unknown) if reads_load(part) else unknown
        log = log.with_columns({part.known_load: values}, note="of the chain")
    return _counted(log, np.isfinite(found[RESULTS[name]]))


def _counted(log: Log, good: NDArray[np.bool_]) -> Log:
    """The good rows of a log on even steps, its angles unwrapped; filters are far slower on others.

    Uneven rows are counted as even ones of their rate, and their channels that are not finite
    throughout are not.
    """
    kept = log if good.all() else log.rows(good)
    known = [name for name in kept.channels if np.isfinite(kept[name]).all()]
    angles = {name: np.unwrap(kept[name]) for name in ANGLES if name in known}
    kept = kept.with_columns(angles, note="unwrapped") if angles else kept
    if not _is_even(kept["time"]):
        lost = {*kept.channels} - {*known}
        with suppress(InputError):
            return resample(kept.without(lost, ()), kept.rate)
    return kept


def _is_even(time: Array) -> bool:
    return all(
        np.ptp(np.diff(time[first:last])) <= 2.0 * EVEN * median_step(time)
        for first, last in runs(time)
        if last - first > 1
    )


def _as_fitted(part: Part, log: Log) -> Log:
    """The log with its channels made as the part expects them, where its rate allows that."""
    with suppress(InputError):
        log = prepared(log, part.preparations)
    return with_motion(log)


def _of_detector(model: Model, plan: Plan, log: Log) -> Iterator[str]:
    """Yield a sentence where the detector watches another motion than its thresholds are for."""
    detector, made = model.estimators.get("collision"), plan.preprocessing.get("differentiator")
    if not isinstance(detector, Collision) or made is None:
        return
    recorded = {*detector.record.get("channels", ())} & _watched(plan, detector)
    derived = [name for name in made_by(made) if name in recorded]
    if derived:
        rate = detector.record.get("stated_rate_per_hour")
        stated = "they do" if rate is None else f"their {rate:.3g} false alarms per hour do"
        yield (
            f"log '{log.name}': the detector's thresholds were calibrated with a recorded "
            f"{listed(derived)}, which is derived from output_position here: {stated} not hold; "
            "record it, or calibrate the detector on logs without it"
        )


def _watched(plan: Plan, detector: Collision) -> set[str]:
    """The channels that the watched estimate and the bands of speed depend on."""
    by_sensor = detector.input == "sensor"
    models = (plan.sensor,) if by_sensor else (plan.observed, plan.torsion)
    reads = {
        name
        for part in models
        if part is not None
        for effect in part.effects
        for name in effect.reads
    }
    moving = not by_sensor and (plan.inertia or plan.link_inertia or detector.input == "merged")
    return reads | {"output_velocity"} if moving or detector.speed_edges else reads
