"""A joint as simulators have it built in, and what that leaves out of a model.

MJCF and URDF know a joint by a few numbers at its output. Of a model's effects some are such a
number; the others are lost, and their largest torque over the ranges of the fit says what that
costs. Beside runs, their root mean square there says it too, and the error of what is left.

The springs of presliding friction have slipped once the joint slides: what they hold then is in the
joint's friction, beside Coulomb's, and what is lost of them is what they remember until they slip.

Names get into XML by `attributes` and `comment` alone, in which nothing of a name is markup.

A joint of MuJoCo has armature, damping, frictionloss and stiffness. MuJoCo 4 has passive DC motors
beside it, which take ripple, Stribeck's and presliding friction: see `dcmotor`.

A joint of a URDF has damping, friction and limits.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from flexspline.about import __version__
from flexspline.effects import Effect, slices_of
from flexspline.effects.causes import (
    COGGING,
    COULOMB,
    COULOMB_PER_DIRECTION,
    GRAVITY,
    INERTIA,
    OFFSET,
    POLYNOMIAL_FRICTION,
    PRESLIDING,
    VISCOUS,
)
from flexspline.errors import InputError, listed, printable
from flexspline.exporting.dcmotor import LUGRE, Motors, PassiveMotor, motors_of
from flexspline.logs.log import Log, measurable
from flexspline.logs.read import LogLike, as_logs
from flexspline.model import Model, Part, sliding_weights
from flexspline.own import design_of
from flexspline.prepared import prepared
from flexspline.signals import gear_of

__all__ = [
    "ARMATURE",
    "DAMPING",
    "FRICTION",
    "MJCF_NUMBERS",
    "URDF_NUMBERS",
    "Loss",
    "OnRuns",
    "PlainJoint",
    "attributes",
    "comment",
    "heading",
    "losses_text",
    "mjcf_file",
    "mjcf_text",
    "output_torque",
    "plain_joint",
    "runs_text",
    "urdf_text",
]


Array = NDArray[np.float64]

ARMATURE, DAMPING, FRICTION = "armature", "damping", "friction"

NUMBERS: Mapping[str, tuple[tuple[str, int], ...]] = {
    INERTIA: ((ARMATURE, 0),),
    VISCOUS: ((DAMPING, 0),),
    POLYNOMIAL_FRICTION: ((DAMPING, 1), (DAMPING, 2)),
    COULOMB: ((FRICTION, 0),),
    COULOMB_PER_DIRECTION: ((FRICTION, 0),),
}
"""Which number of a joint a coefficient is: its kind, and the power of |v| that scales it. Levels
of two directions are one."""

DIRECTION = {COULOMB: (1.0,), COULOMB_PER_DIRECTION: (1.0, -1.0)}
"""Coefficients with which these effects are the direction of motion, from −1 to 1."""

ROWS = 20_001
SWEEPS, FASTER = 37.0, 0.13  # of the first channel; each next one goes e^FASTER times as often
BEYOND = 1e-2  # share of a sweep that is cut off at the ends, so that both are reached

MJCF_NUMBERS = ((ARMATURE, 0), (DAMPING, 0), (DAMPING, 1), (DAMPING, 2), (FRICTION, 0))

URDF_NUMBERS = ((DAMPING, 0), (FRICTION, 0))
PARENT, CHILD = "base_link", "link"


@dataclass(frozen=True)
class Loss:
    """What a joint's numbers leave out: of which effect, its largest torque [Nm], and why.

    `torque` is None where the ranges do not tell it; `why` says what is missing. `elsewhere`:
    whether another element of a simulator's model can take it. `rms`: of its torque on runs [Nm];
    None without runs.
    """

    effect: str
    torque: float | None
    why: str
    elsewhere: bool = False
    rms: float | None = None


@dataclass(frozen=True)
class OnRuns:
    """What a joint costs on runs, root mean squares in Nm at the output over all rows together.

    `rows`: those with a prediction. `lost`: all that is lost, together. `model`, `joint`: errors of
    the whole model and of the joint's numbers alone, beside what was measured; `placed`: of the
    joint where what another element can take (inertia, gravity, a constant) is there. These three
    are None where the runs have nothing measured.
    """

    names: tuple[str, ...]
    rows: int
    lost: float
    model: float | None
    joint: float | None
    placed: float | None


@dataclass(frozen=True)
class PlainJoint:
    """A joint's numbers in SI units at the output of the gear, and what they leave out.

    `damping`: by the power of the speed beside it, τ = v (d₀ + d₁ |v| + d₂ v²), up to the last one
    that the model has. `kept`: effect by effect, the number that it is. `position`: range of the
    angle [rad]; `velocity` and `effort`: largest speed [rad/s] and torque [Nm] of the fit's ranges.
    Each of these is None where the model has no such range. `motors`: MuJoCo's, beside the joint.
    `for_motors`: effects that are lost and that such motors would take.
    """

    name: str
    target: str
    corrects: bool
    armature: float
    damping: tuple[float, ...]
    friction: float
    kept: Mapping[str, str]
    lost: tuple[Loss, ...]
    position: tuple[float, float] | None
    velocity: float | None
    effort: float | None
    on_runs: OnRuns | None = None
    motors: tuple[PassiveMotor, ...] = ()
    for_motors: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class _Split:
    """An effect as a joint has it: the `kind` of number that it is, and the `rest`, (P,), of it.

    `motors` take what is in neither. `could`: they would, and are not wanted. `slides`: what of the
    rest is in the number while the joint slides.
    """

    effect: Effect
    kind: str
    rest: Array
    why: str
    motors: Motors = field(default_factory=Motors)
    could: bool = False
    slides: float = 0.0

    @property
    def whole(self) -> bool:
        """Whether nothing is left out."""
        known = self.effect.name in NUMBERS or bool(self.motors.made)
        return known and not self.rest.any() and not self.motors.largest


def plain_joint(
    model: Model,
    target: str | None,
    numbers: Sequence[tuple[str, int]],
    runs: LogLike | Iterable[LogLike] = (),
    motors: bool | None = None,
) -> PlainJoint:
    """Return a part of a model as a joint's numbers.

    Parameters
    ----------
    numbers : those that the format has, such as (DAMPING, 0).
    motors : whether MuJoCo's passive motors take what they can; None: the format has none.
    runs : on which the cost of what is lost is told.

    Raises
    ------
    InputError
        Where the part is of a torsion, or of a current without what makes it a torque; or where a
        run lacks a channel that the model reads, or no row of the runs has them all.
    """
    part = model.part(target)
    to_torque = output_torque(model, part)
    values = dict.fromkeys(numbers, 0.0)
    sweep = _Sweep(model, part)
    splits = [
        _split(model, part, effect, coefficients, to_torque, values, motors)
        for effect, coefficients in part.by_effect()
    ]
    if not motors and (FRICTION, 0) in values:
        splits, level = _sliding(part, splits)
        values[FRICTION, 0] = values[FRICTION, 0] if level is None else to_torque * level
    left = [split for split in splits if not split.whole]
    lost, on_runs, logs = [_loss(split, sweep, to_torque) for split in left], None, as_logs(runs)
    if logs:
        on_runs, sizes = _on_runs(model, part, logs, to_torque, left)
        lost = [replace(loss, rms=float(size)) for loss, size in zip(lost, sizes, strict=True)]
    lost.sort(key=_size, reverse=True)
    powers = [power for (kind, power), value in values.items() if kind == DAMPING and value]
    ranges: Mapping[str, Sequence[float]] = part.record.get("validity", {})
    position, speed = ranges.get("output_position"), ranges.get("output_velocity")
    return PlainJoint(
        name=str(model.facts.get("joint") or "joint"),
        target=part.target,
        corrects=part.simulated is not None,
        armature=values.get((ARMATURE, 0), 0.0),
        damping=tuple(
            values.get((DAMPING, power), 0.0) for power in range(max(powers, default=0) + 1)
        ),
        friction=values.get((FRICTION, 0), 0.0),
        kept={split.effect.name: split.kind for split in splits if split.kind},
        lost=tuple(lost),
        position=None if position is None else (float(position[0]), float(position[1])),
        velocity=None if speed is None else float(np.abs(speed).max()),
        effort=sweep.effort(to_torque),
        on_runs=on_runs,
        motors=tuple(motor for split in splits for motor in split.motors.made),
        for_motors=tuple(split.effect.name for split in splits if split.could),
    )


def _split(
    model: Model,
    part: Part,
    effect: Effect,
    coefficients: Array,
    to_torque: float,
    values: dict[tuple[str, int], float],
    motors: bool | None,
) -> _Split:
    """Put what an effect says to a joint's numbers into `values`, and return how it is split."""
    places = NUMBERS.get(effect.name, ())
    said, why = _said(effect.name, coefficients, places, values)
    for (kind, power), value in zip(places, said, strict=False):
        if (kind, power) in values:
            values[kind, power] = to_torque * float(value)
    kind, rest = places[0][0] if said.any() else "", coefficients - said
    if places or motors is None:
        return _Split(effect, kind, rest, why)
    take = motors_of(model, part, effect, to_torque * coefficients)
    if not take.made:
        return _Split(effect, kind, rest, take.hinders if motors and take.hinders else why)
    if not motors:
        return _Split(effect, kind, rest, why, could=True)
    rest = np.where(take.taken == 0.0, coefficients, 0.0)
    return _Split(effect, take.made[0].kind, rest, take.why or "negative", take)


def _sliding(part: Part, splits: list[_Split]) -> tuple[list[_Split], float | None]:
    """The level of all friction while the joint slides, and the effects with their share of it.

    The springs of presliding have slipped then, and what they hold adds to Coulomb friction, which
    alone may be anything: see `sliding_weights`. None where the model has not both, or the sum is
    negative.
    """
    weights, made, level = sliding_weights(part), list[_Split](), 0.0
    for split, (effect, coefficients) in zip(splits, part.by_effect(), strict=True):
        own = np.array([weights.get(f"{effect.name}.{term.name}", 0.0) for term in effect.terms])
        share = float(own @ coefficients)
        level += share
        if effect.name == PRESLIDING:
            split = replace(split, kind=FRICTION, why="until its springs slip", slides=share)
        elif own.any():
            rest = coefficients - share * np.sign(own)
            split = replace(split, kind=FRICTION, rest=rest, why="the mean of both directions")
        made.append(split)
    return (made, level) if weights and level >= 0.0 else (splits, None)


def _direction(part: Part) -> tuple[Effect, Array] | None:
    """An effect of a part, and its coefficients that make it the direction, from −1 to 1."""
    found = (e for e in part.effects if e.name in DIRECTION)
    return next(((e, np.array(DIRECTION[e.name])) for e in found), None)


def _loss(split: _Split, sweep: _Sweep, to_torque: float) -> Loss:
    """The row of an effect that is not whole."""
    elsewhere = split.why == _REMEDIES.get(split.effect.name)
    if split.motors.made and not split.rest.any():
        return Loss(split.effect.name, split.motors.largest, split.why)
    torque, missing = sweep.largest(split.effect, split.rest, split.slides)
    size = None if torque is None else to_torque * torque + split.motors.largest
    return Loss(split.effect.name, size, missing or split.why, elsewhere)


def _size(loss: Loss) -> float:
    """By which the table is sorted, on the runs where there are some; what is unknown is first."""
    unknown = np.inf if loss.torque is None else loss.torque
    return unknown if loss.rms is None else loss.rms


def _on_runs(
    model: Model,
    part: Part,
    logs: Sequence[Log],
    to_torque: float,
    left: Sequence[_Split],
) -> tuple[OnRuns, Array]:
    """What is lost of each effect, (L,) root mean squares, and the errors that it makes."""
    of_each, together, errors = np.zeros(len(left)), 0.0, np.zeros(3)
    rows = measured = 0
    here = np.array([e.why != _REMEDIES.get(e.effect.name) for e in left], dtype=bool)
    weights = to_torque * _weights(part, left)
    for log in logs:
        said = model.predict(log, part.target)
        good = np.isfinite(said.predicted)
        made = model.rows(log, part.target)[good] @ weights
        seen = prepared(measurable(log)[0], part.preparations)  # as the model's rows are made
        for place, each in enumerate(left):
            made[:, place] -= each.motors.torque(seen)[good]
        residual = to_torque * said.residual[good]
        known = np.isfinite(residual)
        of_each += (made**2).sum(axis=0)
        together += float((made.sum(axis=1) ** 2).sum())
        for k, missing in enumerate((0.0, made.sum(axis=1), made[:, here].sum(axis=1))):
            errors[k] += float(((residual + missing)[known] ** 2).sum())
        rows += int(good.sum())
        measured += int(known.sum())
    if not rows:
        raise InputError(
            f"no row of {listed(log.name for log in logs)} has all channels that the model of "
            f"{part.target} reads; give runs that have, or none"
        )
    three = [float(each) for each in np.sqrt(errors / measured)] if measured else [None] * 3
    found = OnRuns(tuple(log.name for log in logs), rows, float(np.sqrt(together / rows)), *three)
    return found, np.sqrt(of_each / rows)


def _weights(part: Part, left: Sequence[_Split]) -> Array:
    """What multiplies the model's rows, (P, L): of what is left out, and of what motors take."""
    weights, direction = np.zeros((len(part.coefficients), len(left))), _direction(part)
    for effect, at in zip(part.effects, slices_of(part.effects), strict=True):
        for place, each in enumerate(left):
            if each.effect is effect:
                whole = bool(each.motors.made)
                weights[at, place] = part.coefficients[at] if whole else each.rest
            elif direction is not None and effect is direction[0]:
                weights[at, place] -= each.slides * direction[1]
    return weights


def heading(joint: PlainJoint, what: str, attributes: Mapping[str, str]) -> Iterator[str]:
    """Yield what a comment says above a joint: side, units, what is kept and what is lost.

    Parameters
    ----------
    what : of which format the element is.
    attributes : how the format calls ARMATURE, DAMPING and FRICTION.
    """
    yield f"Made by flexspline {__version__} of the model of {joint.target}: an {what} joint."
    yield "Numbers are in SI units at the output of the gear: Nm, rad, rad/s, kg m^2."
    if joint.corrects:
        yield "The model corrects a simulation: add these numbers to those of its joint."
    yield ""
    yield "Kept:"
    width = max(map(len, [*joint.kept, *(loss.effect for loss in joint.lost)]), default=0)
    for effect, kind in joint.kept.items():
        yield f"  {effect:<{width}}  {attributes[kind]}"
    if not joint.kept:
        yield "  nothing"
    yield ""
    yield from losses_text(joint, width)
    if joint.for_motors:
        yield ""
        yield f"Passive dcmotors of MuJoCo 4 would take {listed(joint.for_motors)}:"
        yield "export with the option dcmotor."
    if joint.on_runs is not None:
        yield ""
        yield from runs_text(joint.on_runs, joint.target)


def losses_text(joint: PlainJoint, width: int = 0) -> Iterator[str]:
    """Yield the table of what a joint leaves out, line by line; `width` of its first column."""
    width = width or max((len(loss.effect) for loss in joint.lost), default=0)
    beside = "" if joint.on_runs is None else ", then the root mean square on the runs"
    yield f"Lost, with the largest torque over the ranges of the fit{beside} [Nm]:"
    for loss in joint.lost:
        size = "?" if loss.torque is None else f"{loss.torque:.3g}"
        rms = "" if loss.rms is None else f"  {loss.rms:>8.3g}"
        yield f"  {loss.effect:<{width}}  {size:>8}{rms}  {loss.why}"
    if not joint.lost:
        yield "  nothing"


def runs_text(cost: OnRuns, target: str) -> Iterator[str]:
    """Yield what a joint costs on runs, line by line."""
    count = "1 run" if len(cost.names) == 1 else f"{len(cost.names)} runs"
    yield f"On {count} ({listed(cost.names)}), {cost.rows} rows, root mean square [Nm]:"
    values = {
        "error of the model": cost.model,
        "error of the joint alone": cost.joint,
        "error with inertia, gravity and offset put elsewhere": cost.placed,
        "all that is lost, together": cost.lost,
    }
    for what, value in values.items():
        if value is not None:
            yield f"  {what:<52}  {value:>8.3g}"
    if cost.model is None:
        yield f"There is no error: the runs have no {target} to compare with."


def output_torque(model: Model, part: Part) -> float:
    """Return the Nm at the output that one of the part's unit is worth.

    Raises
    ------
    InputError
        Where the part is of a torsion, or of a current without what makes it a torque.
    """
    if part.unit == "Nm":  # a motor torque is fitted at the output already
        return 1.0
    if part.unit != "A":
        raise InputError(
            f"the model's part for {part.target} is in {part.unit}, and a simulator's joint has "
            "torques; give a target that is a torque, or fit one"
        )
    missing = [name for name in ("gear_ratio", "torque_constant") if name not in model.facts]
    if missing:
        options = " and ".join(f"--{name.replace('_', '-')}" for name in missing)
        raise InputError(
            f"the model's part for {part.target} is in A, and the model lacks {listed(missing)}, "
            f"which make it a torque at the output; fit it again with {options}"
        )
    ratio = float(gear_of(model.facts, motor_encoder=False)["effective_ratio"])
    return ratio * float(model.facts["torque_constant"])


def _said(
    name: str,
    coefficients: Array,
    places: Sequence[tuple[str, int]],
    values: Mapping[tuple[str, int], float],
) -> tuple[Array, str]:
    """What of an effect's coefficients the joint's numbers say, and why not all of it."""
    nothing = np.zeros_like(coefficients)
    if not places or not all(place in values for place in places):
        return nothing, _REMEDIES.get(name, "no such number")
    if name == COULOMB_PER_DIRECTION:
        level = 0.5 * (coefficients[0] - coefficients[1])
        if level < 0.0:
            return nothing, "negative"
        return np.array([level, -level]), "the mean of both directions"
    if all(power == 0 for _, power in places) and (coefficients < 0.0).any():
        return nothing, "negative, which no joint is"
    return coefficients, ""


_REMEDIES = {
    INERTIA: "give it to the link",
    GRAVITY: "give the link its mass and centre of mass",
    OFFSET: "a constant torque; add it to the actuator's",
}


class _Sweep:
    """Effects of a part over the ranges of its channels, which go to and fro, each at its pace."""

    def __init__(self, model: Model, part: Part) -> None:
        self._part = part
        self._ranges: Mapping[str, Sequence[float]] = part.record.get("validity", {})
        whole = all(not self._missing(e) for e in part.effects if e.info.carries_load)
        self._effects = [
            e for e in part.effects if not self._missing(e) and (whole or "load" not in e.reads)
        ]
        self._coefficients = part.keeping(lambda e: e in self._effects).coefficients
        encoder = "motor_position" in self._ranges
        design = design_of(self._effects, gear_of(model.facts, encoder))
        self._all = np.asarray(design.rows(self._channels(), ROWS, self._coefficients))
        self._rows = {
            effect.name: self._all[:, at]
            for effect, at in zip(self._effects, slices_of(self._effects), strict=True)
        }

    def largest(
        self, effect: Effect, coefficients: Array, slides: float
    ) -> tuple[float | None, str]:
        """The largest of what these coefficients of an effect make, less what slides times the
        direction, or why that is not known."""
        direction = _direction(self._part) if slides else None
        parts = [(effect, coefficients)]
        parts += [(direction[0], -slides * direction[1])] if direction else []
        for one in (one for one, _ in parts if one.name not in self._rows):
            missing = self._missing(one) or ["load"]
            if missing == ["period"]:
                return None, "depends on how fast its channels change"
            return None, f"the model has no range of {listed(missing)}"
        made = np.abs(sum(self._rows[one.name] @ values for one, values in parts)).max()
        return (float(made), "") if np.isfinite(made) else (None, "not finite over the ranges")

    def effort(self, to_torque: float) -> float | None:
        """The largest torque of all effects together, and the known load's beside it [Nm]."""
        if len(self._effects) < len(self._part.effects):
            return None
        load = 0.0
        if self._part.known_load is not None:
            if "known_load" not in self._ranges:
                return None
            load = float(np.abs(self._ranges["known_load"]).max())
        made = to_torque * np.abs(self._all @ self._coefficients).max(initial=0.0) + load
        return float(made) if np.isfinite(made) and made > 0.0 else None

    def _missing(self, effect: Effect) -> list[str]:
        """Channels that an effect reads and that have no range."""
        known = {*self._ranges}
        if "output_position" in known and not effect.own:
            known.add("motor_position")  # turns with the output; a user's function has it measured
        if self._part.known_load is None or "known_load" in known:
            known.add("load")
        return [channel for channel in effect.reads if channel not in known]

    def _channels(self) -> dict[str, Array]:
        at, channels = np.linspace(0.0, 1.0, ROWS), dict[str, Array]()
        for k, (name, (low, high)) in enumerate(sorted(self._ranges.items())):
            turn = np.mod(SWEEPS * np.exp(FASTER * k) * at, 1.0)
            share = np.clip((1.0 + BEYOND) * 2.0 * np.abs(turn - 0.5) - 0.5 * BEYOND, 0.0, 1.0)
            channels[name] = low + (high - low) * share
        if any(effect.info.remembers for effect in self._effects):
            channels["period"] = np.ones(ROWS)
            channels["period"][0] = 0.0  # where the memory starts
        return channels


def attributes(values: Iterable[tuple[str, str]]) -> str:
    """Return attributes as a tag has them, `name="joint 7" axis="0 0 1"`, their values escaped."""
    return " ".join(f"{name}={quoteattr(printable(value))}" for name, value in values)


def comment(lines: Iterable[str], indent: str = "") -> str:
    """Return lines as a comment; two hyphens, which would end it, stand apart."""
    inside = [f"{indent}  {_apart(printable(line))}".rstrip() for line in lines]
    return "\n".join([f"{indent}<!--", *inside, f"{indent}-->"])


def _apart(text: str) -> str:
    while "--" in text:
        text = text.replace("--", "- -")
    return text


def mjcf_text(joint: PlainJoint) -> str:
    """Return an MJCF file with one hinge joint, and above it what its attributes leave out."""
    element = attributes(
        [
            ("name", joint.name),
            ("type", "hinge"),
            ("axis", "0 0 1"),
            ("armature", repr(joint.armature)),
            ("damping", " ".join(map(repr, joint.damping))),
            ("frictionloss", repr(joint.friction)),
            ("stiffness", "0"),
        ]
    )
    inertial = attributes(
        [("pos", "0 0 0"), ("mass", "0.001"), ("diaginertia", "1e-09 1e-09 1e-09")]
    )
    inside = [
        "  <worldbody>",
        "    <body>",
        f"      <inertial {inertial}/>",
        f"      <joint {element}/>",
        "    </body>",
        "  </worldbody>",
        *_actuators(joint),
    ]
    return mjcf_file(joint.name, _said_in_mjcf(joint), inside)


def mjcf_file(name: str, said: Iterator[str], inside: Sequence[str]) -> str:
    """Return the text of an MJCF file in radians: its name, a comment, and what it holds."""
    head = [f"<mujoco {attributes([('model', name)])}>", comment(said, "  ")]
    return "\n".join([*head, '  <compiler angle="radian"/>', *inside, "</mujoco>", ""])


def _actuators(joint: PlainJoint) -> Iterator[str]:
    """The passive motors of a joint, as lines of an MJCF file."""
    if not joint.motors:
        return
    yield "  <actuator>"
    for motor in joint.motors:
        values = [
            ("name", " ".join(filter(None, (joint.name, motor.effect, motor.part)))),
            ("joint", joint.name),
            ("input", "none"),
            ("motorconst", "0 0"),
            ("resistance", "1"),
            (motor.kind, " ".join(map(repr, motor.values))),
        ]
        yield f"    <dcmotor {attributes(values)}/>"
    yield "  </actuator>"


def _said_of_motors(joint: PlainJoint) -> Iterator[str]:
    kinds = {motor.kind for motor in joint.motors}
    yield ""
    yield "Each dcmotor is a passive torque beside the joint's, without control and winding: copy"
    yield "them with the joint. MuJoCo 4 knows them; for an older one give the option no-dcmotor."
    if COGGING in kinds:
        yield "cogging: one order of a ripple; amplitude, periods per turn of the joint, phase."
    if LUGRE in kinds:
        yield "lugre: friction beside frictionloss, which is not in it. It builds up over an angle"
        yield "after a reversal, its level over its first number: 1e-05 rad of Stribeck's friction,"
        yield "the width of each spring of presliding friction. What it remembers is in act."


def _said_in_mjcf(joint: PlainJoint) -> Iterator[str]:
    names = {kind: kind for kind in (ARMATURE, DAMPING)}
    names |= {FRICTION: "frictionloss", COGGING: "dcmotor cogging", LUGRE: "dcmotor lugre"}
    yield from heading(joint, "MJCF", names)
    yield ""
    yield "The line of the joint can be copied into a model of yours; the body here has next to"
    yield "no inertia. The armature is all inertia that the model found: where your link has its"
    yield "own, take that off."
    if len(joint.damping) > 1:
        yield "damping has the numbers of v, v|v| and v^3, which MuJoCo 4 knows; for an older one"
        yield "leave all but the first, and the nonlinear part is lost."
    if joint.friction:
        yield "frictionloss is a soft constraint and not the level times sgn(v): under a load below"
        yield "the level the joint creeps, and it has the level itself only above a speed, which is"
        yield "about 0.011 s times frictionloss over all inertia with MuJoCo's default solver, and"
        yield "more where damping is strong."
    yield "stiffness: no effect of the model pulls the joint back to an angle."
    if joint.motors:
        yield from _said_of_motors(joint)


def urdf_text(joint: PlainJoint) -> str:
    """Return a URDF with one joint between two links, and above it what it leaves out."""
    dynamics = [("damping", repr(joint.damping[0])), ("friction", repr(joint.friction))]
    limits = _limits(joint)
    turns = joint.position is None or not limits
    named = [("name", joint.name), ("type", "continuous" if turns else "revolute")]
    return "\n".join(
        [
            f"<robot {attributes([('name', joint.name)])}>",
            comment(_said_in_urdf(joint, turns), "  "),
            f'  <link name="{PARENT}"/>',
            f'  <link name="{CHILD}"/>',
            f"  <joint {attributes(named)}>",
            f'    <parent link="{PARENT}"/>',
            f'    <child link="{CHILD}"/>',
            '    <axis xyz="0 0 1"/>',
            f"    <dynamics {attributes(dynamics)}/>",
            *([f"    <limit {attributes(limits)}/>"] if limits else []),
            "  </joint>",
            "</robot>",
            "",
        ]
    )


def _limits(joint: PlainJoint) -> list[tuple[str, str]]:
    """Attributes of the limits; none where effort or velocity is not known, for both are needed."""
    if joint.effort is None or joint.velocity is None:
        return []
    ends = () if joint.position is None else zip(("lower", "upper"), joint.position, strict=True)
    beside = (("effort", joint.effort), ("velocity", joint.velocity))
    return [(name, repr(value)) for name, value in (*ends, *beside)]


def _said_in_urdf(joint: PlainJoint, turns: bool) -> Iterator[str]:
    yield from heading(joint, "URDF", {DAMPING: "damping", FRICTION: "friction"})
    yield ""
    if _limits(joint):
        yield "The limits are what the model was fitted to and not those of the motor: the largest"
        yield "speed, and the largest torque of the model in its ranges, known load included."
    else:
        yield "There are no limits: the model has no range of its speed, or of a channel that its"
        yield "torque depends on."
    if turns:
        yield "The joint is continuous, for its angle has no limits here."
    if joint.friction:
        yield "What friction is at standstill is for the simulator to say."
