"""A model as a C++ header that compiles with the core's headers alone.

It holds one part as constants, the chain of the model's estimators as a `flexspline::Joint` that is
ready to step, or both. Comments give units, standard errors, validity and an example call.
"""

from __future__ import annotations

import hashlib
import math
import textwrap
from collections.abc import Iterator, Mapping
from typing import Any

from flexspline import _core
from flexspline.about import __version__
from flexspline.effects import Effect, TermInfo, unit_in
from flexspline.errors import InputError, listed, shortened
from flexspline.estimation.plan import (
    FORGOTTEN,
    OBSERVERS,
    Plan,
    joint_limits,
    made_by,
    part_limits,
    plan_of,
    readings_of,
    reads_of,
)
from flexspline.estimation.plan import UNITS as LIMIT_UNITS
from flexspline.estimators import ESTIMATORS
from flexspline.exporting.cpp_text import (
    comment,
    gear_text,
    identifier,
    include,
    literal,
    stage_lines,
    string_literal,
    whole,
)
from flexspline.formatting import plus_minus
from flexspline.logs.channels import CHANNELS
from flexspline.logs.derive import lateness
from flexspline.logs.segments import GAP_STEPS
from flexspline.model import MARGIN, Model, Part, load_words, widened
from flexspline.own import Header, OwnEffect
from flexspline.signals import gear_of
from flexspline.simulator import Simulated

__all__ = [
    "MEANING",
    "by_motor_encoder",
    "channels_read",
    "conditions",
    "correction",
    "header_text",
    "model_sha256",
    "own_headers",
]

MEANING = {
    "sensor_torque": "what the sensor reads beside the load: true torque = sensor_torque - this",
    "motor_torque": "what the joint takes: torque at the output = ratio * motor_torque - this",
    "motor_current": "the motor current that the joint takes beside a known load",
    "torsion": "output_position * ratio - motor_position",
}

WORDS = {
    "motor_torque": "Nm at the motor's shaft",
    "period": "s since the last sample whose status was ok",
    "time": "s since the run began",
}


def _words(name: str) -> str:
    """A number's unit in ASCII, and what else a reader of the header needs to know of it."""
    return WORDS.get(name) or CHANNELS[name].unit.replace("°", "deg ").replace("²", "^2")


USE = {
    "output_position": (
        "flexspline::Status read = flexspline::read_radians(q, at.output_position);  // rad",
        "// better, from an encoder's counts: at.output_position = {turns, {fraction of a turn}};",
        "// the fraction in 2^-32 turns (float) or 2^-64 turns (double)",
    ),
    "motor_position": ("// likewise at.motor_position",),
    **{
        name: (f"at.{name} = {name.removeprefix('output_')};  // {_words(name)}",)
        for name in _core.numbers
    },
    "load": ("at.known_load = load;  // Nm at the output, 0 where nothing is known of it",),
}

UNITS = {name: channel.unit for name, channel in CHANNELS.items()} | {"known_load": "Nm"}

COUNTED = {
    "period": ("s", "since the last sample whose status was ok; any at the first"),
    "time": ("s", "since the run began, as in the logs"),
}

A_GAP = f"a gap: a period of more than {GAP_STEPS:g} usual ones, as for `flexspline estimate`"

READINGS = {name: _words(name) for name in (*_core.instruments, *_core.numbers) if name != "period"}
ANGLES = {"output_position": "q", "motor_position": "theta"}
RESULTS = {
    "sensor": "external_sensor",
    "observer": "external_observer",
    "compliance": "external_compliance",
    "compliant_observer": "external_compliant_observer",
    "merge": "external_merged",
    "collision": "contact",
}
LEARNING = (  # of a chain with an adaptation
    "// joint<float>.adapted(state): coefficients as they are learned, in the order of",
    "//     observed_model; Joint<float>::restart(state) keeps them, state = {} does not;",
    "//     Joint<float> kept = joint<float>; kept.adopt(state); flexspline::save(kept, ...)",
    "//     state.adaptation.told: directions that the last round of blocks told; of fewer than",
    "//     coefficients their sum is followed, and their split is that of the fit",
)


def header_text(
    model: Model,
    namespace: str,
    target: str | None = None,
    of: Model | None = None,
    *,
    chain: bool = True,
) -> str:
    """Return the header of one part of a model, and of its estimators where it has any.

    A model with several parts, estimators and no target gives the estimators alone; `chain` False
    leaves them out. `of`: the model whose hash the header gives, where this one is a piece of it.

    Raises
    ------
    InputError
        Where there is no such part, an estimator lacks what it reads, or the core cannot hold a
        number.
    """
    namespace = identifier(namespace)
    plan = plan_of(model) if chain and model.estimators else None
    several = plan is not None and target is None and len(model.parts) != 1
    part = None if several else model.part(target)
    includes, constants = {"flexspline/model.hpp"}, []  # constants: refused before any hashing
    if part is not None:
        includes |= {header_of(e) for e in part.effects if e.terms}
        constants += [*_validity(part), *model_lines(model, part), ""]
    if plan is not None:
        includes |= {"flexspline/joint.hpp", *chain_includes(plan)}
        constants += [*chain_lines(model, plan), ""]
    digest = model_sha256(of or model)
    lines = [
        *_comment(_head(model, part, plan, namespace, digest)),
        "#pragma once",
        "",
        "#include <array>",
        "#include <string_view>",
        "",
        *map(include, sorted(includes)),
        "",
        f"namespace {namespace} {{",
        "",
        *_facts(part, digest),
        "",
        *constants,
        f"}}  // namespace {namespace}",
        "",
    ]
    return "\n".join(lines)


def _head(
    model: Model, part: Part | None, plan: Plan | None, namespace: str, digest: str
) -> Iterator[str]:
    """Paragraphs of the comment at the top; lines that start with a blank are kept as they are."""
    joint = model.facts.get("joint")
    yield (
        f"Model of {f'joint {joint}' if joint else 'a joint'} for the core of flexspline, exported "
        f"by flexspline {__version__}; export it again instead of editing it."
    )
    yield ""
    yield f"Model: SHA-256 {digest}"
    for log in _logs(model, part):
        known = f"SHA-256 {log['sha256']}" if log["sha256"] else "not from a file"
        yield f"Log:   {log['name']}, {log['rows']} rows, {known}"
    if part is not None:
        yield ""
        if part.simulated is None:
            yield f"Predicts {part.target} [{part.unit}]: {MEANING[part.target]}."
        else:
            yield from correction(part, part.simulated)
        yield ""
        yield from _expectations(model, part)
        yield ""
        yield "Use, in C++20 with flexspline.get_include() in the include path and contraction of"
        yield "floating-point operations off (-ffp-contract=off), once per control period:"
        yield ""
        yield "    flexspline::Sample<float> at;  // float or double; lives on between periods"
        yield from _call(part, namespace)
    if plan is not None:
        yield ""
        yield from chain_head(plan, namespace)


def correction(part: Part, simulated: Simulated) -> Iterator[str]:
    """Yield what a part alone is that corrects a simulation, a sentence each."""
    load = ""
    if part.known_load is not None:
        load = ", with the known load in it" if simulated.holds_load else ", without the known load"
    yield (
        f"THE CORRECTION ALONE: what a simulation lacks of {part.target} [{part.unit}]. Add what "
        f"it predicts{load}; in the logs {simulated.words}."
    )
    for file in simulated.files:
        digest = f"SHA-256 {file.sha256}" if file.sha256 else "not from a file"
        yield f"Simulation: {file.name}, {digest}"


def _logs(model: Model, part: Part | None) -> list[Mapping[str, Any]]:
    """The logs of the part, or of all parts where the header is of the estimators alone."""
    parts = model.parts.values() if part is None else (part,)
    found = [log for known in parts for log in known.record.get("logs", ())]
    return [log for number, log in enumerate(found) if log not in found[:number]]


def _call(part: Part, namespace: str) -> Iterator[str]:
    """The lines of the example from the result's declaration on."""
    result = "torsion" if part.target == "torsion" else "torque"
    remembers = any(effect.info.remembers for effect in part.effects)
    yield f"    float {result} = 0;"
    if remembers:
        yield f"    {namespace}::Model<float>::State state;  // lives on too; {{}} after a gap"
        yield f"    // {A_GAP}"
    yield ""
    for line in (line for name in channels_read(part) for line in USE.get(name, ())):
        yield f"    {line}"
    given = f"at, state, {result}" if remembers else f"at, {result}"
    kept = f"{result} and state keep their last good values"
    kept = kept if remembers else f"{result} keeps its last good value"
    yield f"    flexspline::Status status = {namespace}::model<float>.predict({given});"
    yield f"    // anything but flexspline::Status::ok: {kept}"
    if _flagged(part):
        yield f"    flexspline::Flag flags = {namespace}::validity::flags(at);"
        yield "    // flexspline::Flag::extrapolated: outside of what the model was fitted to"


def _expectations(model: Model, part: Part) -> Iterator[str]:
    """What the model expects of its channels."""
    for name in channels_read(part):
        if name == "load":
            yield f"Reads known_load [Nm]: {given_load(part)}"
        else:
            unit, meaning = COUNTED.get(name) or CHANNELS[name]
            yield f"Reads {name} [{unit}]: {meaning}"
    yield from conditions(part)


def given_load(part: Part) -> str:
    """Return what a program has to give as the known load, in words."""
    return "none in the logs: zero" if part.known_load is None else load_words(part)


def conditions(part: Part) -> Iterator[str]:
    """Yield how channels and target were made in the logs of the fit, a sentence each."""
    for one in part.preparations:
        yield f"Expects {one.channel} {one.how} (-3 dB), zero phase, as in the logs of the fit."
    hertz = part.record.get("lowpass")
    if hertz:
        yield f"Fitted to target and rows low-passed at {hertz:g} Hz (-3 dB), zero phase."
    history = (line for log in part.record.get("logs", ()) for line in log.get("history", ()))
    for sentence in dict.fromkeys(line for line in history if "zero phase" in line):
        yield f"In the logs: {sentence}"


def channels_read(part: Part) -> list[str]:
    """Return the channels that a part's sample must hold, "load" for the known one."""
    reads = {channel for effect in part.effects for channel in effect.reads}
    if "motor_position" in reads:
        reads.add("output_position")
        if not by_motor_encoder(part):
            reads.remove("motor_position")
    return [name for name in USE if name in reads]


def _validity(part: Part) -> Iterator[str]:
    ranges: Mapping[str, Any] = part.record.get("validity", {})
    if not ranges:
        return
    yield "/// Range of each channel in the logs of the fit; the model extrapolates outside."
    yield "namespace validity {"
    for name, (low, high) in ranges.items():
        if name not in UNITS:
            raise InputError(
                f"the model's validity has {shortened(ascii(name), 80)}, which is no channel; take "
                "it out of the model or fit it again"
            )
        ends = ", ".join(literal(value, f"validity of {name}") for value in (low, high))
        yield "template <typename S>"
        yield f"inline constexpr std::array<S, 2> {identifier(name)}{{  // {comment(UNITS[name])}"
        yield f"    {ends}}};"
    yield from _flags(part)
    yield "}  // namespace validity"
    yield ""


def _flags(part: Part) -> Iterator[str]:
    """The function that says whether a sample is outside of the ranges, as `predict` has it."""
    checked = _flagged(part)
    if not checked:
        return
    yield ""
    yield f"/// `extrapolated` {MARGIN:.0%} of a range or more beyond it; angles in every turn."
    yield "template <typename S>"
    yield "constexpr flexspline::Flag flags(const flexspline::Sample<S>& at) noexcept {"
    yield "  auto found = flexspline::Flag::none;"
    for name in checked:
        low, high = widened(*part.record["validity"][name])
        what = f"validity of {name}"
        yield f"  found = found | flexspline::extrapolated(at.{identifier(name)},"
        yield f"      {literal(low, what)}, {literal(high, what)});"
    yield "  return found;"
    yield "}"


def _flagged(part: Part) -> list[str]:
    """Channels of a sample that the part reads and has a range of."""
    reads = ["known_load" if name == "load" else name for name in channels_read(part)]
    return [name for name in reads if name in part.record.get("validity", {})]


def _facts(part: Part | None, digest: str) -> Iterator[str]:
    if part is not None:
        yield f"inline constexpr std::string_view target = {string_literal(part.target)};"
        yield f"inline constexpr std::string_view unit = {string_literal(part.unit)};"
    yield "inline constexpr std::string_view model_sha256 ="
    yield f"    {string_literal(digest)};"


def model_sha256(model: Model) -> str:
    """Return the SHA-256 of the file that `Model.save` writes."""
    return hashlib.sha256(model.to_json().encode()).hexdigest()


def _comment(paragraphs: Iterator[str]) -> Iterator[str]:
    for text in map(comment, paragraphs):
        pieces = [text] if text.startswith("  ") else textwrap.wrap(text, 96) or [""]
        yield from (f"// {piece}".rstrip() for piece in pieces)


def chain_includes(plan: Plan) -> set[str]:
    """Headers of the core that the chain's constants need."""
    effects = (effect for part in plan.models.values() if part for effect in part.effects)
    return {header_of(effect) for effect in effects if effect.terms}


def header_of(effect: Effect) -> str:
    """The header of an effect; that of one's own stands beside the exported one.

    Raises
    ------
    InputError
        Where an own effect has none.
    """
    if isinstance(effect, OwnEffect):
        return effect.header.name
    return f"flexspline/effects/{effect.name}.hpp"


def own_headers(model: Model, target: str | None) -> list[Header]:
    """Return the headers of the user's own that the header of a model, or of a part, includes.

    Raises
    ------
    InputError
        Where there is no such part, or an effect has no header.
    """
    parts = model.parts.values() if target is None else [model.part(target)]
    effects = (effect for part in parts for effect in part.effects)
    return [effect.header for effect in effects if isinstance(effect, OwnEffect)]


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
    behind = "restart(state)" if "adaptation" in plan.estimating else "{}"
    yield f"    {namespace}::Joint<float>::State state;  // lives on; {behind} after a gap"
    yield f"    // {A_GAP}"
    yield from _starts(plan)
    yield f"    {namespace}::Joint<float>::Chain::Output out;  // lives on: last good values"
    yield ""
    yield "    flexspline::Reading<float> in;  // what is not read stays as it is: missing"
    yield "    in.period = period;  // s since the last reading"
    for name, letter in ANGLES.items():
        if name in _angles(plan):
            yield f"    in.{name} = flexspline::Angle<float>::from_radians({letter});  // finite"
            yield "    // better, from an encoder's counts: {turns, {fraction of a turn}}"
    for name, unit in READINGS.items():
        if name in readings_of(plan):
            yield f"    in.{name} = {name};  // {unit}"
    yield f"    flexspline::Status status = {namespace}::joint<float>.step(state, in, out);"
    for stage, name in RESULTS.items():
        if stage in plan.estimating or (stage == "sensor" and plan.has_sensor):
            yield f"    // out.{name}: unless"
            yield f"    //     has(out.missed, flexspline::Stage::{stage})"
    if "adaptation" in plan.estimating:
        yield from (f"    {line}" for line in LEARNING)
    yield "    // has(out.flags, flexspline::Flag::extrapolated), saturated: to be known beside it"
    yield "    // has(out.flags, flexspline::Flag::out_of_range): a reading is beyond its limit"
    yield "    // has(out.faults, flexspline::Fault::speed), ...: what cannot be true"


def _starts(plan: Plan) -> Iterator[str]:
    """For how long observers come up from zero behind a start."""
    for key in sorted(OBSERVERS & plan.estimating.keys()):
        start = 1e3 * FORGOTTEN / plan.estimating[key]["gain"]
        yield f"    // {key}: comes up from 0 for {FORGOTTEN:g} / K = {start:.4g} ms behind a start"


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
    yield "    .limits = {  // either way; what is beyond counts as missing"
    for name, most in joint_limits(plan).items():
        yield f"        .{name} = {_limit(name, most)}"
    yield "    },"
    yield "};"


def _limit(name: str, most: float | None) -> str:
    if most is None:
        return "flexspline::ReadingLimits<S>::none,  // not read"
    return f"{literal(most, f'limit of {name}')},  // {_limit_unit(name)}"


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


def model_lines(model: Model, part: Part, name: str = "model") -> Iterator[str]:
    """The constant of a part and its type: sensor_model is of the type SensorModel.

    `model`, which stands alone, has the limits of what it reads; a joint has its own.

    Raises
    ------
    InputError
        Where a number does not fit into the core.
    """
    effects = [effect for effect in part.effects if effect.terms]
    made = "".join(word.capitalize() for word in name.split("_"))
    types = ["S", *map(type_name, effects)]
    yield "template <typename S>"
    yield f"using {made} ="
    yield f"    flexspline::Model<{(chr(10) + ' ' * 22).join(f'{name},' for name in types)[:-1]}>;"
    yield ""
    yield "template <typename S>"
    yield f"inline constexpr {made}<S> {name}{{"
    yield f"    {_gear(model, part)},"
    yield "    {"
    yield from _parts(part, effects)
    limits = part_limits(part) if name == "model" else {}
    if not limits:
        yield "    }};"
        return
    yield "    },"
    yield "    {{  // either way; what is beyond is flexspline::Status::out_of_range"
    for channel, most in limits.items():
        number = literal(most, f"limit of {channel}")
        yield f"        {number},  // {channel}, {_limit_unit(channel)}"
    yield "    }}};"


def _limit_unit(channel: str) -> str:
    return comment(LIMIT_UNITS[channel])


def _gear(model: Model, part: Part) -> str:
    return gear_text(gear_of(model.facts, by_motor_encoder(part)))


def _parts(part: Part, effects: list[Effect]) -> Iterator[str]:
    errors = {entry["name"]: entry for entry in part.record.get("parameters", ())}
    first = 0
    for effect in effects:
        yield f"        flexspline::Part<S, {type_name(effect)}>{{"
        yield f"            {{{_fields(effect)}}},"
        yield "            {{"
        for term, value in zip(effect.terms, part.coefficients[first:], strict=False):
            name = f"{effect.name}.{term.name}"
            said = _value(term, float(value), errors.get(name, {}), part)
            yield f"                {literal(value, name)},  // {said}"
        yield "            }}},"
        first += len(effect.terms)


def type_name(effect: Effect) -> str:
    name = "".join(word.capitalize() for word in effect.name.split("_"))
    room = f", {len(effect.harmonics)}" if effect.ripple else ""
    return f"flexspline::{identifier(name)}<S{room}>"


def _fields(effect: Effect) -> str:
    """Shapes by name; of a ripple effect the orders, and behind them its shapes in their order."""
    if effect.ripple:
        between = ",\n" + " " * 17
        orders = between.join(
            f"{{{whole(order)}, flexspline::Pair::{identifier(pair)}}}"
            for order, pair in effect.harmonics
        )
        shapes = "".join(
            f", {literal(value, f'{effect.name}.{name}')}" for name, value in effect.shapes.items()
        )
        return f"{{{{{{{orders}}}}}, {len(effect.harmonics)}}}{shapes}"
    return ", ".join(
        f".{identifier(name)} = {literal(value, f'{effect.name}.{name}')}"
        for name, value in effect.shapes.items()
    )


def _value(term: TermInfo, value: float, known: Mapping[str, Any], part: Part) -> str:
    """A coefficient in words: "level 0.302 ± 0.002 Nm"."""
    error = known.get("standard_error")
    state = known.get("state", "fitted")
    note = "" if state == "fitted" else f" ({state})"
    shown = plus_minus(value, math.nan if error is None else error)
    unit = unit_in(term.unit, part.target, part.known_load)
    return comment(f"{term.name} {shown} {unit}{note}")


def by_motor_encoder(part: Part) -> bool:
    """Whether the part was fitted with the angle of a motor encoder."""
    return "motor_position" in part.record.get("channels", ())
