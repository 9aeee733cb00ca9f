"""Parameters of a model as a block of bytes that replaces those of a running program.

The layout is that of `flexspline/block.hpp`, the order that of `flexspline/parameters.hpp`: a block
fits a program that was compiled with the header of a model of the same structure. What such a
program learned comes back by the block that it saved (`learned_model`).
"""

from __future__ import annotations

import math
import os
import struct
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from flexspline.effects import Effect
from flexspline.errors import InputError, listed
from flexspline.estimation.plan import Plan, adapted_units, joint_limits, part_limits, plan_of
from flexspline.estimators import Observer
from flexspline.exporting.cpp_text import STAGES, Field, Stage, given, stages_in
from flexspline.exporting.header import by_motor_encoder
from flexspline.model import Model, Part
from flexspline.signals import gear_of

__all__ = ["SCALARS", "block_bytes", "learned_model", "require_scalar"]

SCALARS = ("float", "double")
VERSION = 2  # with the limits of readings
HEAD = 16  # bytes before the numbers
LARGEST = {
    "float": float.fromhex("0x1.fffffep+127"),
    "double": float.fromhex("0x1.fffffffffffffp+1023"),
}
SMALLEST = {"float": float.fromhex("0x1p-126"), "double": float.fromhex("0x1p-1022")}
SPLINES = ("unknown", "circular", "flex")
NO_GEAR = {"effective_ratio": 1.0, "output_spline": "unknown", "motor_encoder": False}
PAIRS = (
    "output_on_housing",
    "motor_on_stator",
    "wave_generator_on_flexspline",
    "wave_generator_on_circular_spline",
)

Entry = Mapping[str, Any]


def block_bytes(model: Model, scalar: str = "float", target: str | None = None) -> bytes:
    """Return the block of a model: of its chain where it has estimators, else of one part.

    Parameters
    ----------
    scalar : "float" or "double", as the program was compiled.
    target : which part, where there are several and no estimators.

    Raises
    ------
    InputError
        For another scalar, a part that is not there, or a number that the scalar cannot hold.
    """
    require_scalar(scalar)
    block = _Block(scalar)
    if model.estimators and target is None:
        block.joint(model, plan_of(model))
    else:
        part = model.part(target)
        block.model("model", model, part)
        block.limits(part_limits(part))
    return block.bytes()


def require_scalar(scalar: str) -> None:
    """Refuse what is no scalar of a program."""
    if scalar not in SCALARS:
        raise InputError(f"there is no scalar '{scalar}'; give float or double")


def learned_model(model: Model, block: bytes | str | os.PathLike[str]) -> Model:
    """Return the model with the coefficients that a joint learned, as its saved block has them.

    Parameters
    ----------
    model : with an `Adaptation`, as it was exported to the joint.
    block : its bytes, or the path of a file with them: of `adopt` and `save` on the joint, float or
        double.

    Returns
    -------
    The model whose part of the observer's input has the learned coefficients. All else stays,
    errors of the fit among it.

    Raises
    ------
    InputError
        Where the model has no adaptation, the file cannot be read, or it is no block of this model.
    """
    plan = plan_of(model)
    names = list(adapted_units(model, plan))
    if not names:
        raise InputError(
            "the model has no estimator adaptation, so no joint learned its coefficients; give the "
            "model that was exported to the joint"
        )
    given = block if isinstance(block, bytes) else _content(Path(block))
    label = "the block" if isinstance(block, bytes) else f"{block}"
    scalar = {4: "float", 8: "double"}.get(given[5] if len(given) > HEAD else 0)
    if scalar is None or given[:4] != b"FLXJ":
        raise InputError(f"{label} is no block of parameters; give what the joint saved")
    own = _Block(scalar)
    own.joint(model, plan)
    made = own.bytes()
    whole = given[: len(made)]
    if whole[:HEAD] != made[:HEAD]:
        raise InputError(
            f"{label} is a block of another structure than the model's; give the model that was "
            "exported to the joint"
        )
    (crc,) = struct.unpack("<I", whole[-4:])
    if len(whole) < len(made) or zlib.crc32(whole[:-4]) != crc:
        raise InputError(f"{label} is not whole: its checksum does not fit; read it again")
    part = plan.observed
    assert part is not None
    learned: list[float] = []
    for effect in part.effects[: len({name.split(".")[0] for name in names})]:
        first = HEAD + own.observed[effect.name]
        learned += struct.unpack_from(f"<{len(effect.terms)}{own.letter}", whole, first)
    values = dict(zip(names, learned, strict=True))
    bad = [name for name, value in values.items() if not math.isfinite(value)]
    if bad:
        raise InputError(f"{label}: {listed(bad)} is no finite number; read it again")
    return _with_values(model, values)


def _content(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}; give what the joint saved") from error


def _with_values(model: Model, values: Mapping[str, float]) -> Model:
    """The model whose part of the observer's input has these coefficients."""
    observer = model.estimators["observer"]
    assert isinstance(observer, Observer)
    key = "drive" if observer.input == "motor_torque" else "sensor"
    part = model.parts[key]
    names = [f"{effect.name}.{term.name}" for effect in part.effects for term in effect.terms]
    kept = zip(names, part.coefficients.tolist(), strict=True)
    coefficients = np.array([values.get(name, value) for name, value in kept])
    record = dict(part.record)
    if "parameters" in record:
        record["parameters"] = [
            {**entry, "value": values.get(entry["name"], entry["value"])}
            for entry in record["parameters"]
        ]
    made = replace(part, coefficients=coefficients, record=record)
    return replace(model, parts={**model.parts, key: made})


class _Block:
    """Numbers in the order of the core's visit, and the outline of what they belong to."""

    def __init__(self, scalar: str) -> None:
        self.scalar = scalar
        self.letter, self.size = ("f", 4) if scalar == "float" else ("d", 8)
        self.payload, self.outline = bytearray(), bytearray()
        self.observed: dict[str, int] = {}  # place of the coefficients of the observer's effects

    def bytes(self) -> bytes:
        structure, size = zlib.crc32(self.outline), len(self.payload)
        head = struct.pack("<4sBBHII", b"FLXJ", VERSION, self.size, 0, structure, size)
        made = head + self.payload
        return made + struct.pack("<I", zlib.crc32(made))

    def structure(self, name: str, count: int = 0) -> None:
        self.outline += name.encode() + struct.pack("<BH", 0, count)

    def numbers(self, name: str, values: Sequence[float]) -> None:
        self.structure(name, len(values))
        for value in values:
            self._refuse(name, value)
        self.payload += struct.pack(f"<{len(values)}{self.letter}", *values)

    def words(self, name: str, values: Sequence[int]) -> None:
        self.structure(name, 1)
        self.payload += struct.pack(f"<{len(values)}I", *values)

    def _refuse(self, name: str, value: float) -> None:
        fits = value in (0.0, math.inf) or (
            SMALLEST[self.scalar] <= abs(value) <= LARGEST[self.scalar]
        )
        if not fits:
            raise InputError(f"{name} = {value:g} does not fit into a {self.scalar}; fit it again")

    def model(self, name: str, model: Model | None, part: Part | None) -> None:
        self.structure(name)
        if model is None or part is None:
            self._gear(NO_GEAR)
            return
        self._gear(gear_of(model.facts, by_motor_encoder(part)))
        for effect, values in part.by_effect():
            if effect.terms:
                self._effect(effect, values.tolist())
            if name == "observed model":
                self.observed[effect.name] = len(self.payload) - len(values) * self.size

    def _gear(self, gear: Mapping[str, Any]) -> None:
        whole = math.floor(gear["effective_ratio"])
        fraction = int((gear["effective_ratio"] - whole) * 2.0**64)
        spline, encoder = SPLINES.index(gear["output_spline"]), int(gear["motor_encoder"])
        self.words("gear", (whole, fraction & 0xFFFFFFFF, fraction >> 32, spline, encoder))

    def _effect(self, effect: Effect, coefficients: Sequence[float]) -> None:
        self.structure(effect.name)
        for order, pair in effect.harmonics:
            self.words("harmonic", (order, PAIRS.index(pair)))
        for name, value in effect.shapes.items():
            self.numbers(name, (value,))
        self.numbers("coefficients", coefficients)

    def joint(self, model: Model, plan: Plan) -> None:
        sensing = {**plan.preprocessing, **plan.sensing}
        for name, entries in (("sensing", sensing), ("estimating", plan.estimating)):
            self.structure(name)
            self._stages(entries, plan.has_sensor)
        for name in ("sensor", "observed", "torsion", "carried"):
            part = getattr(plan, name)
            self.model(f"{name} model", model if part is not None else None, part)
        self.structure("joint")
        self.numbers("effective_ratio", (plan.effective_ratio,))
        self.numbers("inertia", (plan.inertia,))
        self.numbers("link_inertia", (plan.link_inertia,))
        largest = LARGEST[self.scalar]
        low, high = plan.temperature_range or (-largest, largest)
        self.numbers("low", (low,))
        self.numbers("high", (high,))
        self.limits(joint_limits(plan))

    def limits(self, limits: Mapping[str, float | None]) -> None:
        """How large readings may be; none where they are not read."""
        self.structure("limits")
        for name, most in limits.items():
            self.numbers(name, (LARGEST[self.scalar] if most is None else most,))

    def _stages(self, entries: Mapping[str, Entry], has_sensor: bool) -> None:
        """The stages in the core's order; the sensor's own part stands among them."""
        there = {**entries, **({"sensor": {}} if has_sensor else {})}
        for stage, entry in stages_in(there):
            if entry is not None:
                self._stage(stage, entry)
            if stage.choice is not None:
                self.structure(f"{stage.choice.prefix}{there[stage.within][stage.choice.key]}")

    def _stage(self, stage: Stage, entry: Entry) -> None:
        for word in (stage.key, *(entry[rule] for rule, _ in stage.rules)):
            self.structure(word)
        if stage.key == "kalman":
            self._stage(STAGES["logistic"], entry)
        for field, value in given(stage, entry):
            self.numbers(field.name, self._values(field, value))
        if stage.key == "reading_checks":
            self._gear(entry.get("gear", NO_GEAR))

    def _values(self, field: Field, value: Any) -> Sequence[float]:
        if value is None:
            largest = LARGEST[self.scalar]
            return (min(max(field.default or 0.0, -largest), largest),)
        return value if isinstance(value, Sequence) else (float(value),)
