"""A part of a model as a C++ header that compiles with the core's headers alone."""

from __future__ import annotations

import hashlib
import math
import re
import textwrap
from collections.abc import Iterator, Mapping
from typing import Any

from flexspline import __version__
from flexspline.effects import Effect, TermInfo, unit_in
from flexspline.errors import InputError
from flexspline.logs.channels import CHANNELS
from flexspline.model import Model, Part
from flexspline.report.numbers import plus_minus
from flexspline.signals import gear_of

__all__ = ["header_text"]

LARGEST = float.fromhex("0x1.fffffep+127")  # the largest float
LARGEST_RATIO = 2**30

MEANING = {
    "sensor_torque": "what the sensor reads beside the load: true torque = sensor_torque - this",
    "motor_torque": "what the joint takes: torque at the output = ratio * motor_torque - this",
    "motor_current": "the motor current that the joint takes",
    "torsion": "output_position * ratio - motor_position",
}

USE = {
    "output_position": (
        "flexspline::Status read = flexspline::read_radians(q, at.output_position);  // rad",
        "// better, from an encoder's counts: at.output_position = {turns, {fraction of a turn}};",
        "// the fraction in 2^-32 turns (float) or 2^-64 turns (double)",
    ),
    "motor_position": ("// likewise at.motor_position",),
    "output_velocity": ("at.output_velocity = velocity;  // rad/s",),
    "output_acceleration": ("at.output_acceleration = acceleration;  // rad/s^2",),
    "temperature": ("at.temperature = temperature;  // deg C",),
    "load": ("at.known_load = load;  // Nm at the output, 0 where nothing is known of it",),
}


def header_text(model: Model, namespace: str, target: str | None = None) -> str:
    """Return the header of one part of a model; None picks the only one.

    Raises
    ------
    InputError
        Where there is no such part, or a number that the core cannot hold.
    """
    part = model.part(target)
    effects = [effect for effect in part.effects if effect.terms]
    constants = list(_model(model, part, effects))  # refuses before anything is hashed
    lines = [
        *_comment(_head(model, part, namespace)),
        "#pragma once",
        "",
        "#include <array>",
        "#include <string_view>",
        "",
        *(f'#include "flexspline/effects/{e.name}.hpp"' for e in sorted(effects, key=_type)),
        '#include "flexspline/model.hpp"',
        "",
        f"namespace {namespace} {{",
        "",
        *_facts(model, part),
        "",
        *_validity(part),
        *constants,
        "",
        f"}}  // namespace {namespace}",
        "",
    ]
    return "\n".join(lines)


def _head(model: Model, part: Part, namespace: str) -> Iterator[str]:
    """Paragraphs of the comment at the top; lines that start with a blank are kept as they are."""
    joint = model.facts.get("joint")
    yield (
        f"Model of {f'joint {joint}' if joint else 'a joint'} for the core of flexspline, exported "
        f"by flexspline {__version__}; export it again instead of editing it."
    )
    yield ""
    yield f"Predicts {part.target} [{part.unit}]: {MEANING[part.target]}."
    yield ""
    yield from _expectations(model, part)
    yield ""
    yield f"Model: SHA-256 {_sha256(model)}"
    for log in part.record.get("logs", ()):
        digest = f"SHA-256 {log['sha256']}" if log["sha256"] else "not from a file"
        yield f"Log:   {log['name']}, {log['rows']} rows, {digest}"
    yield ""
    yield "Use, in C++20 with flexspline.get_include() in the include path and contraction of"
    yield "floating-point operations off (-ffp-contract=off), once per control period:"
    yield ""
    yield "    flexspline::Sample<float> at;  // float or double; lives on between periods"
    yield "    float torque = 0;"
    yield ""
    for line in (line for name in _reads(part) for line in USE.get(name, ())):
        yield f"    {line}"
    yield f"    flexspline::Status status = {namespace}::model<float>.predict(at, torque);"
    yield "    // anything but flexspline::Status::ok: torque keeps its last good value"


def _expectations(model: Model, part: Part) -> Iterator[str]:
    """What the model expects of its channels."""
    for name in _reads(part):
        if name == "load":
            known = part.known_load or "none in the logs: zero"
            yield f"Reads known_load [Nm]: {known}"
        else:
            yield f"Reads {name} [{CHANNELS[name].unit}]: {CHANNELS[name].meaning}"
    hertz = part.record.get("lowpass")
    if hertz:
        yield f"Fitted to target and rows low-passed at {hertz:g} Hz (-3 dB), zero phase."
    history = (line for log in part.record.get("logs", ()) for line in log.get("history", ()))
    for sentence in dict.fromkeys(line for line in history if "zero phase" in line):
        yield f"In the logs: {sentence}"


def _reads(part: Part) -> list[str]:
    """Channels that the sample must hold, in the order of `USE`."""
    reads = {channel for effect in part.effects for channel in effect.info.reads}
    if "motor_position" in reads:
        reads.add("output_position")
        if not _motor_encoder(part):
            reads.remove("motor_position")
    return [name for name in USE if name in reads]


def _motor_encoder(part: Part) -> bool:
    return "motor_position" in part.record.get("channels", ())


def _validity(part: Part) -> Iterator[str]:
    ranges: Mapping[str, Any] = part.record.get("validity", {})
    if not ranges:
        return
    yield "/// Range of each channel in the logs of the fit; the model extrapolates outside."
    yield "namespace validity {"
    for name, (low, high) in ranges.items():
        ends = ", ".join(_literal(value, f"validity of {name}") for value in (low, high))
        unit = CHANNELS[name].unit if name in CHANNELS else "Nm"
        yield "template <typename S>"
        yield f"inline constexpr std::array<S, 2> {name}{{  // {unit}"
        yield f"    {ends}}};"
    yield "}  // namespace validity"
    yield ""


def _facts(model: Model, part: Part) -> Iterator[str]:
    yield f'inline constexpr std::string_view target = "{part.target}";'
    yield f'inline constexpr std::string_view unit = "{part.unit}";'
    yield "inline constexpr std::string_view model_sha256 ="
    yield f'    "{_sha256(model)}";'


def _model(model: Model, part: Part, effects: list[Effect]) -> Iterator[str]:
    types = ["S", *map(_type, effects)]
    yield "template <typename S>"
    yield "using Model ="
    yield f"    flexspline::Model<{(chr(10) + ' ' * 22).join(f'{name},' for name in types)[:-1]}>;"
    yield ""
    yield "template <typename S>"
    yield "inline constexpr Model<S> model{"
    yield f"    {_gear(model, part)},"
    yield "    {"
    yield from _parts(part, effects)
    yield "    }};"


def _gear(model: Model, part: Part) -> str:
    motor_encoder = _motor_encoder(part)
    gear = gear_of(model.facts, motor_encoder)
    ratio = gear["effective_ratio"]
    if not 0 < ratio <= LARGEST_RATIO:
        raise InputError(f"gear_ratio gives an effective ratio of {ratio}; give one in 0 to 2^30")
    return (
        f"flexspline::Gear<S>::from_ratio({ratio!r}, flexspline::OutputSpline::"
        f"{gear['output_spline']},\n                                    "
        f"/*motor_encoder=*/{str(motor_encoder).lower()})"
    )


def _parts(part: Part, effects: list[Effect]) -> Iterator[str]:
    errors = {entry["name"]: entry for entry in part.record.get("parameters", ())}
    first = 0
    for effect in effects:
        yield f"        flexspline::Part<S, {_type(effect)}>{{"
        yield f"            {{{_fields(effect)}}},"
        yield "            {{"
        for term, value in zip(effect.terms, part.coefficients[first:], strict=False):
            name = f"{effect.name}.{term.name}"
            said = _value(term, float(value), errors.get(name, {}), part.target)
            yield f"                {_literal(value, name)},  // {said}"
        yield "            }}},"
        first += len(effect.terms)


def _type(effect: Effect) -> str:
    name = "".join(word.capitalize() for word in effect.name.split("_"))
    room = f", {len(effect.harmonics)}" if effect.ripple else ""
    return f"flexspline::{name}<S{room}>"


def _fields(effect: Effect) -> str:
    """Shapes by name, or the orders of a ripple effect."""
    if effect.ripple:
        between = ",\n" + " " * 17
        orders = between.join(f"{{{o}, flexspline::Pair::{pair}}}" for o, pair in effect.harmonics)
        return f"{{{{{{{orders}}}}}, {len(effect.harmonics)}}}"
    return ", ".join(
        f".{name} = {_literal(value, f'{effect.name}.{name}')}"
        for name, value in effect.shapes.items()
    )


def _value(term: TermInfo, value: float, known: Mapping[str, Any], target: str) -> str:
    """A coefficient in words: "level 0.302 ± 0.002 Nm"."""
    error = known.get("standard_error")
    state = known.get("state", "fitted")
    note = "" if state == "fitted" else f" ({state})"
    shown = plus_minus(value, math.nan if error is None else error)
    return _line(f"{term.name} {shown} {unit_in(term.unit, target)}{note}")


def _literal(value: float, name: str) -> str:
    """The shortest decimal that reads back as the same double."""
    if not abs(value) <= LARGEST:
        raise InputError(f"{name} = {value} does not fit into a float; fit the model again")
    return f"S({float(value)!r})"


def _sha256(model: Model) -> str:
    """SHA-256 of the file that `Model.save` writes."""
    return hashlib.sha256(model.to_json().encode()).hexdigest()


def _comment(paragraphs: Iterator[str]) -> Iterator[str]:
    for text in map(_line, paragraphs):
        pieces = [text] if text.startswith("  ") else textwrap.wrap(text, 96) or [""]
        yield from (f"// {piece}".rstrip() for piece in pieces)


def _line(text: str) -> str:
    """Text that cannot end the comment it stands in, nor reach into the next line."""
    return re.sub(r"[\x00-\x1f\x7f]+", " ", text).replace("\\", "/")
