"""The stages of a model's chain, and the parts of the model between them.

    preprocessing  reading checks, differentiator → readings
    sensing        thermistor, compensation, calibration → temperature, sensor torque
    models         predictions of the model's parts
    estimating     observer, compliance, merge, collision

The plan serves `estimate` and an exported header alike; the core's `flexspline/joint.hpp` runs it.
Velocity and acceleration are the causal derivatives of the angle where the chain reads them and
neither log nor model has them.

A device's readings that are too large count as missing (reading_limits.hpp). A limit is `FACTOR`
times the largest magnitude that the parts which read the channel were fitted to, and at least
`LEAST`, for a channel may have been at rest in the logs of the fit. The torques of motor and sensor
are read by the chain itself: theirs is that of the target of the part for them, as recorded. A
limit is the same either way: a joint that turned or was loaded one way in its logs may go the
other. Limits are for what is no physical quantity; that a model extrapolates is told by other
flags, and what your own joint may do is said by `ReadingChecks`.

Without a range in the model, for a temperature, a thermistor's voltage and the time, the limit is
the core's: what no joint has. Angles have none but the turns that an integer holds.

What makes the estimates of a log wrong: of the model, of the log, and of both together.

Rows outside of what a part was fitted to are found as `Model.predict` finds them: in the channels
made as the part expects them, since its ranges are of such channels. Temperature and load are those
of the chain. Rows without an estimate by the part are left out: what limits and reading checks took
out has reached no part.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexspline import _core
from flexspline.effects import unit_in
from flexspline.effects.causes import INERTIA, MESH, TORSION_LOOP
from flexspline.errors import InputError, listed
from flexspline.estimators import (
    PREPROCESSING,
    SENSING,
    Adaptation,
    Collision,
    Differentiator,
    Observer,
    ReadingChecks,
)
from flexspline.estimators.checks import link_part, require_complete
from flexspline.estimators.external_torque import SATURATED, SLOWEST, fit_rmse
from flexspline.estimators.sensing import DERIVED
from flexspline.logs.checks.samples import kelvin
from flexspline.logs.derive import differentiate_causal, lateness, resample, with_motion
from flexspline.logs.local_fit import EVEN
from flexspline.logs.log import Log
from flexspline.logs.segments import median_step, output_velocity, runs
from flexspline.model import (
    ANGLES,
    PART_OF,
    Model,
    gravity_on_gear,
    range_warnings,
    require_model,
    undetermined_gravity,
    weight_left_out,
)
from flexspline.part import Part
from flexspline.prepared import prepared
from flexspline.signals import gear_of

__all__ = [
    "BANDWIDTH",
    "FACTOR",
    "FORGOTTEN",
    "OBSERVERS",
    "READINGS",
    "UNITS",
    "Plan",
    "adapted_units",
    "carried_warnings",
    "doubts_of",
    "joint_limits",
    "made_by",
    "part_limits",
    "plan_of",
    "readings_of",
    "reads_load",
    "reads_of",
    "with_derivatives",
    "with_stage",
]

Array = NDArray[np.float64]

OBSERVERS = {"observer", "compliant_observer"}
FORGOTTEN = 5.0  # K t, after which e^-5 is left of an observer's start


Entries = dict[str, dict[str, Any]]

BANDWIDTH = 20.0  # Hz, where neither model nor caller says one and the log's rate allows it
CLOCK = {"period", "time"}
READINGS = (
    "output_position",
    "motor_position",
    *(name for name in (*_core.numbers, *_core.instruments) if name not in CLOCK),
)

# A sensor tells a hundredth of its full scale from zero, and an effect that a log hardly shows is
# not significant: a joint is fitted on no less than a hundredth of what it is built for, so that no
# true reading, a crash included, is beyond a hundred times the fit. At half of it a joint that was
# fitted at 1.5 % of its torque would go blind in a crash; at double an absurd reading may be twice
# as large, and what a lag or an observer keeps of it as well.
FACTOR = 100.0

# Fits of a joint at rest or without load: 8500 rpm into a gear of ratio 30 is 30 rad/s, that within
# a millisecond 3e4 rad/s²; the peak torque of a strain wave gear of mid size is 1000 Nm at the
# output, and a hundredth of that on the motor's side.
LEAST: Mapping[str, float] = {
    "output_velocity": 30.0,
    "output_acceleration": 3e4,
    "motor_torque": 10.0,
    "sensor_torque": 1000.0,
    "load": 1000.0,
}

_KNOWN = _core.reading_limits()
WIDEST: Mapping[str, float] = {one["name"]: one["default"] for one in _KNOWN}
UNITS: Mapping[str, str] = {one["name"]: one["unit"] for one in _KNOWN} | {"load": "Nm"}
OF_A_PART = tuple(name for name in _core.channels if name in WIDEST or name == "load")


@dataclass(frozen=True)
class Plan:
    """The stages, and the parts of the model between them.

    Parameters
    ----------
    preprocessing, sensing, estimating : stages by key, with their fields as `_core.Joint` takes
        them.
    has_sensor : whether the chain has a sensor torque.
    sensor : the sensor's part, or None.
    observed : the part of the observer's input without inertia, adapted effects first, or None.
    torsion : the torsion's part without the mesh and without hysteresis on the path of the load,
        which the chain's compliance has; or None.
    carried : what the gear carries beside the load: gravity, or None.
    inertia, link_inertia : kg m² at the output, of the observer and the compliant observer.
    effective_ratio : Ñ.
    temperature_range : °C, where the parts that read the temperature were fitted, or None.
    """

    preprocessing: Mapping[str, Mapping[str, Any]]
    sensing: Mapping[str, Mapping[str, Any]]
    estimating: Mapping[str, Mapping[str, Any]]
    has_sensor: bool
    sensor: Part | None
    observed: Part | None
    torsion: Part | None
    carried: Part | None
    inertia: float
    link_inertia: float
    effective_ratio: float
    temperature_range: tuple[float, float] | None

    @property
    def models(self) -> dict[str, Part | None]:
        """The parts by the core's names of its models."""
        return {
            "sensor": self.sensor,
            "observed": self.observed,
            "torsion": self.torsion,
            "carried": self.carried,
        }


def plan_of(model: Model) -> Plan:
    """Return the chain of a model.

    Raises
    ------
    InputError
        Where that is no model, it has nothing to estimate with, or an estimator lacks what it
        reads.
    """
    require_model(model)
    for part in model.parts.values():
        if part.simulated is not None:
            raise InputError(
                f"the part for {part.target} corrects what a simulation says, which no estimator "
                "has; fit the part without the simulation"
            )
    require_complete(model.estimators, model.parts)
    has_sensor = _has_sensor(model)
    if not has_sensor and not model.estimators.keys() - set(PREPROCESSING):
        raise InputError(
            "the model holds no estimator and no part for sensor_torque, so there is nothing to "
            "estimate; make one with flexspline calibrate, or with model.with_estimator"
        )
    entries = {key: made.to_json() for key, made in model.estimators.items()}
    estimating = {k: entry for k, entry in entries.items() if k not in (*PREPROCESSING, *SENSING)}
    sensor = _known(model.parts.get("sensor"))
    driven = _known(_driven(model))
    observed = None if driven is None else _without(driven, INERTIA)
    adaptation = model.estimators.get("adaptation")
    if isinstance(adaptation, Adaptation) and observed is not None:
        observed = _first(observed, adaptation.effects)
        estimating["adaptation"] = _adaptation(adaptation, observed)
    torsion = _known(model.parts.get("torsion")) if "compliance" in estimating else None
    if torsion is not None:
        loop = _hysteresis(model, torsion)
        estimating["compliance"] |= {**_mesh(model, torsion), **loop}
        torsion = _without(torsion, MESH, *([TORSION_LOOP] if loop else []))
    read = [part for part in (sensor, driven, torsion) if part is not None]
    plan = Plan(
        preprocessing={},
        sensing={key: entry for key, entry in entries.items() if key in SENSING},
        estimating=estimating,
        has_sensor=has_sensor,
        sensor=sensor,
        observed=observed,
        torsion=torsion,
        carried=gravity_on_gear(model) if "compliance" in estimating else None,
        inertia=0.0 if driven is None else _coefficient(driven, INERTIA),
        link_inertia=_link_inertia(model),
        effective_ratio=_ratio(model),
        temperature_range=_temperature_range(read),
    )
    return replace(plan, preprocessing=stages_before(model, plan))


def _has_sensor(model: Model) -> bool:
    observer, collision = model.estimators.get("observer"), model.estimators.get("collision")
    return (
        "sensor" in model.parts
        or any(key in model.estimators for key in SENSING if key != "thermistor")
        or (isinstance(observer, Observer) and observer.input == "sensor_torque")
        or (isinstance(collision, Collision) and collision.input == "sensor")
    )


def _driven(model: Model) -> Part | None:
    """The part that knows the observer's input."""
    observer = model.estimators.get("observer")
    if not isinstance(observer, Observer):
        return None
    return model.parts.get("drive" if observer.input == "motor_torque" else "sensor")


def _known(part: Part | None) -> Part | None:
    """The part with its channels said: a log must not decide whose angle the motor's is.

    A torsion is measured with the motor's encoder; another part made by hand has none.
    """
    if part is None or "channels" in part.record:
        return part
    channels = ["motor_position"] if part.target == "torsion" else []
    return replace(part, record={**part.record, "channels": channels})


def _link_inertia(model: Model) -> float:
    """J_l = J − Ñ² J_m of the compliant observer, kg·m² at the output; 0 without one."""
    observer, part = model.estimators.get("compliant_observer"), link_part(model.parts)
    if not isinstance(observer, Observer) or part is None:
        return 0.0
    total = _coefficient(part, INERTIA)
    rotor = observer.rotor_inertia or 0.0
    reflected = _ratio(model) ** 2 * rotor
    if not 0.0 <= reflected <= total:
        raise InputError(
            f"rotor_inertia = {rotor:g} kg·m² is {reflected:.3g} kg·m² at the output, but the part "
            f"for {part.target} has {total:.3g} kg·m² of link and rotor together; give that of "
            "the motor's shaft"
        )
    return total - reflected


def _hysteresis(model: Model, torsion: Part) -> dict[str, Any]:
    """The loop on the path of the load, rad at the output, as a field of the compliance."""
    for effect, values in torsion.by_effect():
        if effect.name == TORSION_LOOP and effect.shapes["path"] < 0.5:
            heights = values / _ratio(model)
            loop = {"load_width": effect.shapes["load_width"], "heights": heights.tolist()}
            return {"hysteresis": loop}
    return {}


def _mesh(model: Model, torsion: Part) -> dict[str, float]:
    """Stiffness K_m0 = Ñ / c [Nm/rad] and shape c_m [1/Nm] of the torsion's part."""
    compliance = _coefficient(torsion, MESH)
    if not compliance > 0.0:
        raise InputError(
            f"the estimator compliance needs a mesh that gives way, but {MESH}.compliance of the "
            f"torsion's part is {compliance:g} rad/Nm; fit it again with runs under load"
        )
    (mesh,) = (effect for effect in torsion.effects if effect.name == MESH)
    return {
        "mesh_stiffness": _ratio(model) / compliance,
        "mesh_shape": mesh.shapes["mesh_shape"],
    }


def _ratio(model: Model) -> float:
    observer = model.estimators.get("observer")
    by_motor = isinstance(observer, Observer) and observer.input == "motor_torque"
    reader = "observer" if by_motor else "compliance"
    if (by_motor or reader in model.estimators) and "gear_ratio" not in model.facts:
        raise InputError(
            f"the estimator {reader} needs the gear ratio, which the model lacks; "
            "fit its part again with --gear-ratio"
        )
    return float(gear_of(model.facts, motor_encoder=True)["effective_ratio"])


def carried_warnings(model: Model) -> list[str]:
    """Return what is wrong with the weight that is taken off the gear's torque, a sentence each."""
    gravity, torsion = gravity_on_gear(model), model.parts.get("torsion")
    if gravity is None or torsion is None:
        return []
    off = "taken off the gear's torque", "external_torque_compliance"
    said = undetermined_gravity(gravity, *off), weight_left_out(torsion, gravity)
    return [*filter(None, said)]


def _without(part: Part, *names: str) -> Part:
    """The part without these effects."""
    return part.keeping(lambda effect: effect.name not in names)


def _first(part: Part, names: Sequence[str]) -> Part:
    """The part with these effects before the others, as the core's adaptation finds them."""
    blocks = sorted(part.by_effect(), key=lambda block: block[0].name not in names)
    return replace(
        part,
        effects=tuple(effect for effect, _ in blocks),
        coefficients=np.concatenate([values for _, values in blocks]),
    )


def _adaptation(made: Adaptation, observed: Part) -> dict[str, Any]:
    """The numbers that the core begins with: those of the entry, and of the part's fit."""
    return {
        "noise": made.spread(observed),
        "interval": made.interval,
        "memory": made.memory,
        "gate": made.gate,
        "least_speed": made.speed(observed),
        "least_information": made.least_information,
        **made.start(observed),
        "use": made.use,
        "load": made.load,
    }


def _coefficient(part: Part, name: str) -> float:
    """The coefficient of an effect with one term, 0 where the part lacks it."""
    values = part.coefficients_of(name)
    return float(values[0]) if len(values) else 0.0


def _temperature_range(parts: list[Part]) -> tuple[float, float] | None:
    """The narrowest range of temperature in which parts that read it were fitted."""
    low, high = -math.inf, math.inf
    for part in parts:
        known = part.record.get("validity", {}).get("temperature")
        if known is not None and any("temperature" in e.reads for e in part.effects):
            low, high = max(low, known[0]), min(high, known[1])
    return (low, high) if low < high and math.isfinite(high - low) else None


def adapted_units(model: Model, plan: Plan) -> dict[str, str]:
    """Return name and unit of each parameter that is adapted, in the core's order."""
    made, part = model.estimators.get("adaptation"), plan.observed
    if not isinstance(made, Adaptation) or part is None:
        return {}
    return {
        f"{effect.name}.{term.name}": unit_in(term.unit, part.target, part.known_load)
        for effect in made.adapted(part)
        for term in effect.terms
    }


def reads_of(plan: Plan) -> set[str]:
    """Return the channels that the models between the stages, and the stages behind, read."""
    effects = [
        effect for part in plan.models.values() if part is not None for effect in part.effects
    ]
    reads = {name for effect in effects for name in effect.reads}
    by_speed = plan.estimating.keys() & {"merge", "collision", "adaptation"}
    if plan.inertia or plan.link_inertia or by_speed:
        reads.add("output_velocity")
    return reads


def readings_of(plan: Plan) -> set[str]:
    """Return the numbers among the readings that the chain reads; the period, as always, beside."""
    numbers = {*_core.numbers} - {"period"}
    found = reads_of(plan) & numbers
    if "thermistor" in plan.sensing:
        found = (found - {"temperature"}) | {"thermistor_voltage"}
    elif "temperature_compensation" in plan.sensing:
        found.add("temperature")
    if plan.has_sensor:
        found.add("sensor_voltage" if "calibration" in plan.sensing else "sensor_torque")
    if plan.estimating.get("observer", {}).get("input") == "motor_torque":
        found.add("motor_torque")
    made = plan.preprocessing.get("differentiator")
    return found - set(() if made is None else made_by(made))


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


def with_stage(plan: Plan, log: Log, bandwidth: float | None, said: dict[str, None]) -> Plan:
    """Return the chain with a stage that makes what it reads and neither log nor model has.

    Raises
    ------
    InputError
        Where a bandwidth is given for a model that has its own.
    """
    own = plan.preprocessing.get("differentiator")
    if own is not None:
        _say_own(own, log, bandwidth, said)
        return plan
    missing = _missing(plan, log)
    if not missing:
        return plan
    chosen = _bandwidth(log) if bandwidth is None else bandwidth
    said[_derived(missing, chosen)] = None
    stage = _differentiator(chosen, {*missing})
    return replace(plan, preprocessing={**plan.preprocessing, **stage})


def with_derivatives(plan: Plan, log: Log, said: dict[str, None]) -> Log:
    """Add the same to a log, for a chain that reads it: from the first row on, as if from rest."""
    own = plan.preprocessing.get("differentiator")
    if own is not None:
        _say_own(own, log, None, said)
        return log
    missing = _missing(plan, log)
    if not missing:
        return log
    made = differentiate_causal(log, bandwidth=_bandwidth(log))
    note = _derived(missing, _bandwidth(log))
    said[note] = None
    return log.with_columns({name: made[name] for name in missing}, note=note)


def _missing(plan: Plan, log: Log) -> list[str]:
    """Derivatives that the chain reads, the log lacks and its angle gives."""
    missing = [name for name in DERIVED if name in reads_of(plan) and name not in log]
    return missing if "output_position" in log and len(log) > 1 else []


def _bandwidth(log: Log) -> float:
    return min(BANDWIDTH, log.rate / 4.0)


def _derived(names: Sequence[str], bandwidth: float) -> str:
    how = f"{listed(names)}: {lateness(bandwidth)}"
    return f"derived from output_position, as a device would: {how}"


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


def reads_load(part: Part) -> bool:
    """Whether any effect of a part reads the load."""
    return any("load" in effect.reads for effect in part.effects)


def part_limits(part: Part) -> dict[str, float]:
    """Return the limits of the numbers that a part's model reads, in the core's order."""
    reads = {channel for effect in part.effects for channel in effect.reads}
    return {name: _limit(name, [part]) for name in OF_A_PART if name in reads}


def joint_limits(plan: Plan) -> dict[str, float | None]:
    """Return the limit of each reading of a joint, in the core's order; None where none is read."""
    read = readings_of(plan)
    parts = [part for part in plan.models.values() if part is not None]
    found: dict[str, float | None] = {
        name: _limit(name, parts) if name in read else None for name in WIDEST
    }
    volts = plan.sensing.get("calibration", {}).get("voltage_range")
    if found["sensor_voltage"] is not None and volts is not None:
        found["sensor_voltage"] = _widened("sensor_voltage", volts)
    return found


def _limit(name: str, parts: Sequence[Part]) -> float:
    """The limit of a channel, by the parts that read it or predict it, and know its range."""
    ranges = _ranges(name, parts) if name in LEAST else ()
    return _widened(name, [end for ends in ranges for end in ends])


def _ranges(name: str, parts: Sequence[Part]) -> Iterator[Sequence[float]]:
    """What parts know of a channel: as an input of their effects, and as their target."""
    for part in parts:
        inputs = part.record.get("validity", {})
        channel = "known_load" if name == "load" else name
        if channel in inputs and any(name in effect.reads for effect in part.effects):
            yield inputs[channel]
        if name == part.target and "target_range" in part.record:
            yield part.record["target_range"]


def _widened(name: str, ends: Sequence[Any]) -> float:
    """The limit of a channel that had these values; that of the core where there are none."""
    widest = WIDEST["sensor_torque" if name == "load" else name]
    largest = max((abs(float(end)) for end in ends), default=0.0)
    if not largest > 0.0:
        return widest
    return min(max(FACTOR * largest, LEAST.get(name, 0.0)), widest)


BOTH_WAYS = 0.05
"""Share of the rows that each direction has to have: of less the observer may not have settled.
Half and twice of it change nothing of a joint that goes to and fro."""

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
    detector, split = _of_detector(model, plan, log), _of_adaptation(model, plan, log, found)
    zero = _of_encoder_zero(model, plan, log, found)
    return (*weight, *scale, *ranges, *detector, *split, *zero)


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


def _of_encoder_zero(model: Model, plan: Plan, log: Log, found: Mapping[str, Any]) -> Iterator[str]:
    """Yield a sentence where the gear's torque is off the observer's by the same both ways.

    An encoder whose zero moved by ε since the fit makes K ε of every row. The observer's own error
    is its friction's, which turns with the motion: of the medians of both ways the mean has none
    of it. It is said where that mean is more than what both parts miss in a row of their fits.

    A gear that stiffens turns a zero into more torque the more it is loaded: the zero is that of
    the twists, arctan(c_m τ) / (c_m K).
    """
    beside = "external_observer" if "external_observer" in found else "external_sensor"
    if not {"external_compliance", beside} <= found.keys():
        return
    missed = _missed_by_gear(model, plan, beside)
    if missed is None:
        return
    by_gear, other = found["external_compliance"], found[beside]
    mean = _both_ways(plan, log, by_gear - other)
    if not abs(mean) > missed:
        return
    (mesh,) = (e for e in model.parts["torsion"].effects if e.name == MESH)
    shape = mesh.shapes["mesh_shape"]
    turned = (np.arctan(shape * by_gear) - np.arctan(shape * other)) / shape
    zero = _coefficient(model.parts["torsion"], MESH) * abs(_both_ways(plan, log, turned))
    yield (
        f"log '{log.name}': external_torque_compliance is {mean:+.3g} Nm off "
        f"{beside.replace('external', 'external_torque')} in either direction, more than the "
        f"{missed:.2g} Nm that the parts miss in a row of their fits, as where an encoder's zero "
        f"moved by {zero:.2g} rad of the motor since the fit of the torsion; set the zero as it "
        "was, or fit the torsion again"
    )


def _both_ways(plan: Plan, log: Log, apart: Array) -> float:
    """The mean of the medians of both directions; 0 where their signs or one of them lacks."""
    try:
        velocity = output_velocity(with_motion(log))
    except InputError:  # positions of which no derivative is made
        return 0.0
    known, least = np.isfinite(apart), _sliding(plan)
    ways = [apart[known & (way * velocity >= least)] for way in (1.0, -1.0)]
    if min(map(len, ways)) < max(BOTH_WAYS * len(log), 1.0):
        return 0.0
    medians = [float(np.median(way)) for way in ways]
    return 0.5 * sum(medians) if min(medians) * max(medians) > 0.0 else 0.0


def _missed_by_gear(model: Model, plan: Plan, beside: str) -> float | None:
    """What the parts of gear and other estimate miss in a row, Nm; None where that is unknown."""
    other = plan.sensor if beside == "external_sensor" else plan.observed
    torsion = model.parts.get("torsion")
    if torsion is None or other is None:
        return None
    whole = model.parts[PART_OF[other.target]]
    errors = fit_rmse(torsion), fit_rmse(whole)
    if errors[0] is None or errors[1] is None or whole.unit != "Nm":
        return None
    return math.hypot(errors[0] / _coefficient(torsion, MESH), errors[1])


def _sliding(plan: Plan) -> float:
    """The speed from which friction of the observed part has its full level, rad/s."""
    effects = () if plan.observed is None else plan.observed.effects
    widths = [e.shapes["direction_width"] for e in effects if "direction_width" in e.shapes]
    return max((SATURATED * width for width in widths), default=SLOWEST)


def _of_adaptation(model: Model, plan: Plan, log: Log, found: Mapping[str, Any]) -> Iterator[str]:
    """Yield a sentence where most rounds tell fewer directions than coefficients are adapted.

    Most: a memory is eight rounds, and where half of them tell all, the split is theirs.
    """
    entry = plan.estimating.get("adaptation")
    if entry is None:
        return
    names = adapted_units(model, plan)
    free = [n for n, a, b in zip(names, entry["low"], entry["high"], strict=True) if b > a]
    ended = np.flatnonzero(np.any(np.diff(found["adapted"], axis=0) != 0.0, axis=1)) + 1
    told = found["told"][ended]
    few = int(np.count_nonzero(told < len(free)))
    if not 2 * few > len(ended):
        return
    yield (
        f"log '{log.name}': in {few} of {len(ended)} rounds of the adaptation the motion tells "
        f"{int(np.median(told))} of {len(free)} directions of {listed(free)}, as a joint does at "
        "one speed: what they make together is followed, and how it is split between them comes of "
        "the covariance of the fit and not of these rows; let the joint run at several speeds "
        "and angles too, or adapt fewer effects"
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
