"""The chain of a model's estimators as C++ constants: a `flexspline::Joint`, ready to step."""

from __future__ import annotations

from collections.abc import Iterator

from flexspline.errors import listed
from flexspline.estimation.plan import Plan
from flexspline.estimation.preprocessing import made_by, reads_of
from flexspline.estimators import ESTIMATORS
from flexspline.exporting.cpp_text import literal
from flexspline.exporting.header_model import model_lines
from flexspline.exporting.header_stages import stage_lines
from flexspline.logs.derive import lateness
from flexspline.model import Model

__all__ = ["chain_head", "chain_includes", "chain_lines"]


READINGS = {
    "thermistor_voltage": "V",
    "temperature": "deg C",
    "sensor_voltage": "V",
    "sensor_torque": "Nm",
    "output_velocity": "rad/s",
    "output_acceleration": "rad/s^2",
    "motor_torque": "Nm at the motor's shaft",
    "time": "s since the run began",
}
ANGLES = {"output_position": "q", "motor_position": "theta"}
RESULTS = {
    "sensor": "external_sensor",
    "observer": "external_observer",
    "compliance": "external_compliance",
    "compliant_observer": "external_compliant_observer",
    "merge": "external_merged",
    "collision": "contact",
}


def chain_includes(plan: Plan) -> set[str]:
    """Headers of the core that the chain's constants need."""
    effects = (effect for part in plan.models.values() if part for effect in part.effects)
    return {f"flexspline/effects/{effect.name}.hpp" for effect in effects if effect.terms}


def chain_head(plan: Plan, namespace: str) -> Iterator[str]:
    """Paragraphs on the chain for the comment at the top."""
    planned = {*plan.preprocessing, *plan.sensing, *plan.estimating}
    stages = [key for key in ESTIMATORS if key in planned]
    yield f"Estimates, by {', '.join(stages)}: external torque in Nm at the output, outward."
    made = _made(plan)
    if made:
        how = lateness(plan.preprocessing["differentiator"]["bandwidth"])
        names = listed(sorted(made, reverse=True))
        yield f"Makes {names} from output_position: {how.replace('−', '-')}."
    yield ""
    yield "Once per control period, the same options of the compiler:"
    yield ""
    yield f"    {namespace}::Joint<float>::State state;  // lives on; {{}} after a gap"
    yield f"    {namespace}::Joint<float>::Chain::Output out;  // lives on: last good values"
    yield ""
    yield "    flexspline::Reading<float> in;  // what is not read stays as it is: missing"
    yield "    in.period = period;  // s since the last reading"
    for name, letter in ANGLES.items():
        if name in _angles(plan):
            yield f"    in.{name} = flexspline::Angle<float>::from_radians({letter});  // finite"
            yield "    // better, from an encoder's counts: {turns, {fraction of a turn}}"
    for name, unit in READINGS.items():
        if name in _readings(plan):
            yield f"    in.{name} = {name};  // {unit}"
    yield f"    flexspline::Status status = {namespace}::joint<float>.step(state, in, out);"
    for stage, name in RESULTS.items():
        if stage in plan.estimating or (stage == "sensor" and plan.has_sensor):
            yield f"    // out.{name}: unless"
            yield f"    //     has(out.missed, flexspline::Stage::{stage})"
    yield "    // has(out.flags, flexspline::Flag::extrapolated), saturated: to be known beside it"
    if "reading_checks" in plan.preprocessing:
        yield "    // has(out.faults, flexspline::Fault::speed), ...: what cannot be true"


def chain_lines(model: Model, plan: Plan) -> Iterator[str]:
    """The models between the chains, and the joint.

    Raises
    ------
    InputError
        Where a value of an estimator does not fit into a float; the sentence names it.
    """
    models = plan.models
    for name, part in models.items():
        if part is not None:
            yield from model_lines(model, part, f"{name}_model")
            yield ""
    types = [
        f"{name.capitalize()}Model<S>" if part is not None else "flexspline::Model<S>"
        for name, part in models.items()
    ]
    sensing = {**plan.preprocessing, **plan.sensing}
    for name, entries in (("Sensing", sensing), ("Estimating", plan.estimating)):
        place = "up to the sensor" if name == "Sensing" else "behind the sensor"
        yield f"/// The stages {place}; there are no others."
        yield from stage_lines(name, entries, plan.has_sensor)
        yield ""
    yield "template <typename S>"
    yield "using Joint ="
    types += ["Sensing<S>", "Estimating<S>"]
    yield f"    flexspline::Joint<S, {(',' + chr(10) + ' ' * 22).join(types)}>;"
    yield ""
    yield "template <typename S>"
    yield "inline constexpr Joint<S> joint{"
    yield "    .sensing = {},"
    yield "    .estimating = {},"
    for name, part in models.items():
        yield f"    .{name} = {f'{name}_model<S>' if part is not None else '{}'},"
    yield f"    .effective_ratio = {literal(plan.effective_ratio, 'effective_ratio')},"
    yield f"    .inertia = {literal(plan.inertia, 'inertia of the observer')},  // kg m^2"
    yield f"    .link_inertia = {literal(plan.link_inertia, 'inertia of the link')},  // kg m^2"
    if plan.temperature_range is not None:
        for side, value in zip(("low", "high"), plan.temperature_range, strict=True):
            yield f"    .{side} = {literal(value, 'range of temperature')},  // deg C"
    yield "};"


def _made(plan: Plan) -> set[str]:
    """Channels that the chain makes itself."""
    entry = plan.preprocessing.get("differentiator")
    return set() if entry is None else set(made_by(entry))


def _angles(plan: Plan) -> set[str]:
    found = reads_of(plan) & ANGLES.keys()
    if "differentiator" in plan.preprocessing:
        found.add("output_position")
    twists = "twist" in plan.preprocessing.get("reading_checks", {})
    return set(ANGLES) if twists or "compliance" in plan.estimating else found


def _readings(plan: Plan) -> set[str]:
    found = reads_of(plan) & READINGS.keys()
    if "thermistor" in plan.sensing:
        found = (found - {"temperature"}) | {"thermistor_voltage"}
    elif "temperature_compensation" in plan.sensing:
        found.add("temperature")
    if plan.has_sensor:
        found.add("sensor_voltage" if "calibration" in plan.sensing else "sensor_torque")
    if plan.estimating.get("observer", {}).get("input") == "motor_torque":
        found.add("motor_torque")
    return found - _made(plan)
