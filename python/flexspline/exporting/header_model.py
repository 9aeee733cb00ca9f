"""A part of a model as C++ constants."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from flexspline.effects import Effect, TermInfo, unit_in
from flexspline.errors import InputError
from flexspline.exporting.cpp_text import boolean, comment, identifier, literal, number, whole
from flexspline.formatting import plus_minus
from flexspline.model import Model, Part
from flexspline.signals import gear_of

__all__ = ["by_motor_encoder", "gear_text", "model_lines", "type_name"]

LARGEST_RATIO = 2**30


def model_lines(model: Model, part: Part, name: str = "model") -> Iterator[str]:
    """The constant of a part and its type: sensor_model is of the type SensorModel.

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
    yield "    }};"


def _gear(model: Model, part: Part) -> str:
    return gear_text(gear_of(model.facts, by_motor_encoder(part)))


def gear_text(gear: Mapping[str, Any]) -> str:
    """A gear of `gear_of` as C++."""
    ratio = gear["effective_ratio"]
    if not 0 < ratio <= LARGEST_RATIO:
        raise InputError(f"gear_ratio gives an effective ratio of {ratio}; give one in 0 to 2^30")
    return (
        f"flexspline::Gear<S>::from_ratio({number(ratio, 'effective_ratio')}, "
        f"flexspline::OutputSpline::{identifier(gear['output_spline'])},\n"
        f"                                    "
        f"/*motor_encoder=*/{boolean(gear['motor_encoder'])})"
    )


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
