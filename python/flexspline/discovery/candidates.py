"""What may be missing: effects in several shapes, orders of ripple, freedoms of the base.

A candidate is an effect in several shapes (`shaped`), of which one is right at most. A ripple
effect is a pool of orders (its atoms), of which several may be there: the low ones of its pairs,
those of facts, and those that a scan finds in the residual.

Freedoms are no names but what a base is given for its form, and for the recorder: friction that
differs by some per cent between the directions, and a load cell whose clock and filter make it
late. They stay where they are significant in the final fit and lower the held-out error.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from flexspline import _core
from flexspline.discovery.settings import SETTINGS
from flexspline.effects import CATALOGUE, TARGETS, Effect, EffectInfo, Harmonic
from flexspline.effects.causes import (
    BASIC_FRICTION,
    COGGING,
    FRICTION_BY_DIRECTION,
    GRAVITY,
    KINEMATIC_ERROR,
    LAG,
    MODULATED_RIPPLE,
    MOTOR_RIPPLES,
    OFFSET,
    ONE_SINE,
    OUTPUT_RIPPLE,
    WAVE_GENERATOR_RIPPLE,
)
from flexspline.errors import InputError
from flexspline.least_squares.problem import Problem
from flexspline.least_squares.ripple import CORE_PAIRS
from flexspline.logs.channel_noise import ChannelNoise
from flexspline.logs.log import Log
from flexspline.orders import FoundOrder, find_orders
from flexspline.orders.parts import Candidate as OrderCandidate
from flexspline.orders.parts import Pair, owner, pairs
from flexspline.regression.candidate_model import shaped
from flexspline.signals import channels_for, gear_for, require_load, require_one_unit

__all__ = ["EXCLUDED", "OF_BASE", "TAKEN", "Candidate", "OfBase", "SeenOrders", "as_given",
           "candidates_for", "freedoms", "held_of", "of_base", "order_candidates", "possible",
           "scanned", "span_of", "unseen", "unseen_of", "with_freedoms"]  # fmt: skip

ANGLE = "output_position"
EXCLUDED = "excluded by the caller"
TAKEN = "what it would explain is taken as a delay of the load"


def freedoms(
    base: Sequence[Effect],
    target: str,
    known_load: str | None,
    logs: Sequence[Log],
    noise: Mapping[str, ChannelNoise],
) -> tuple[str, ...]:
    """Return the names of what the base is given; `noise`: of each channel.

    Nothing where neither the angle nor the known load is noisy: so are simulated runs, whose
    friction is odd.
    """
    recorded = [noise[name] for name in {ANGLE, known_load or ANGLE} if name in noise]
    if target == "torsion" or not any(one.noisy for one in recorded):
        return ()
    names = {effect.name for effect in base}
    found = [FRICTION_BY_DIRECTION] if names & {*BASIC_FRICTION} and _both_ways(logs) else []
    if known_load in noise and noise[str(known_load)].noisy:
        with suppress(InputError):  # of a current it cannot be, beside a load of the model's own
            require_one_unit([*base, Effect(LAG)], target, known_load)
            found.append(LAG)
    return tuple(name for name in found if name not in names)


def with_freedoms(base: Sequence[Effect], given: Sequence[str]) -> list[Effect]:
    """Return the base with these effects behind it; all friction of a model has one width."""
    widths = [e.shapes["direction_width"] for e in base if "direction_width" in e.shapes]
    made = [*base]
    for name in given:
        effect = Effect(name)
        if widths and "direction_width" in effect.shapes:
            effect = effect.with_shapes(direction_width=widths[0])
        made.append(effect)
    return made


def held_of(effects: Sequence[Effect], given: Sequence[str], problem: Problem) -> dict[str, float]:
    """Return what is held of the freedoms `given` to these effects.

    A level by direction is an offset where no row that counts is slow, or none is in the model.
    """
    held: dict[str, float] = {}
    names = {effect.name: effect for effect in effects}
    sided = names.get(FRICTION_BY_DIRECTION)
    fast = sided is not None and FRICTION_BY_DIRECTION in given and not _slow(sided, problem)
    if sided is not None and (OFFSET not in names or fast):
        held[f"{FRICTION_BY_DIRECTION}.level"] = 0.0
    if LAG in names and LAG in given:
        held |= {f"{LAG}.{shape.name}": shape.lower for shape in names[LAG].fitted_shapes}
    return held


def _slow(effect: Effect, problem: Problem) -> bool:
    """Whether the level of an effect differs from an offset on the rows that count."""
    width, level = effect.shapes["direction_width"], [np.empty(0)]
    for run in problem.runs:
        velocity = run.channels["output_velocity"]
        level += [np.abs(np.tanh(velocity[a:b] / width)) for a, b in run.stretches]
    values = np.concatenate(level)
    return bool(np.var(values) > SETTINGS.negligible * np.mean(values**2))


def _both_ways(logs: Sequence[Log]) -> bool:
    signs = []
    for log in logs:
        if "output_velocity" in log:
            signs.append(np.sign(log["output_velocity"]))
        elif "output_position" in log:
            signs.append(np.sign(np.diff(log["output_position"])))
        else:
            return False
    ways = np.concatenate(signs)
    return bool(min(np.mean(ways > 0.0), np.mean(ways < 0.0)) >= SETTINGS.little)


OF_BASE = " of the base"


class OfBase(Effect):
    """A ripple with the orders that its user gave, which keeps its name free for more of them."""

    @property
    def info(self) -> EffectInfo:
        return CATALOGUE[self.name.removesuffix(OF_BASE)]

    def for_core(self) -> dict[str, Any]:
        return {**super().for_core(), "name": self.info.name}

    def _require_known(self) -> None:
        """It is made of a known one."""


def of_base(effects: Iterable[Effect], given: Collection[str]) -> list[Effect]:
    """Return effects, ripple whose orders are `given` as one that may have more of them.

    A resonance of other ripple has the orders of that.
    """
    return [
        OfBase(f"{e.name}{OF_BASE}", e.shapes, e.harmonics)
        if e.name in given and not e.info.modulated
        else e
        for e in effects
    ]


def as_given(effects: Iterable[Effect]) -> list[Effect]:
    """Return effects as a user reads them: each once, with the orders of the base and of names."""
    made: dict[str, Effect] = {}
    for effect in effects:
        name, orders = effect.info.name, effect.harmonics
        if isinstance(effect, OfBase):
            effect = Effect(name, effect.shapes, orders)
        if name in made:
            effect = made[name].with_orders([*made[name].harmonics, *orders])
        made[name] = effect
    return list(made.values())


FACTS = ("pole_pairs", "slots")
WAVE = re.compile(r"(?:co)?sine \d+")  # a term that waves over a turn of the joint


@dataclass(frozen=True)
class SeenOrders:
    """Orders that stand out of residuals; `low`: whether low ones of the output may be there too.

    Over less than a turn a scan takes one of these for two, or is certain of none.
    """

    found: tuple[FoundOrder, ...] = ()
    low: bool = False

    def joined(self, after: SeenOrders) -> SeenOrders:
        """Return the orders of two scans, each once, the strongest of each scan first.

        What is left after the first may peak beside an order that it had, within its resolution.
        """

        def known(line: FoundOrder) -> bool:
            at = line.per_output_turn
            apart = (abs(at - one.per_output_turn) / one.resolution for one in self.found)
            return min(apart, default=np.inf) < 1.0

        new = tuple(line for line in after.found if not known(line))
        return SeenOrders(self.found[: SETTINGS.functions // 2] + new, self.low or after.low)


def scanned(logs: Sequence[Log], residuals: Sequence[Any], unit: str) -> SeenOrders:
    """Return the orders that stand out of residuals, (N,) for each log; none without motion."""
    try:
        made = find_orders(logs, residuals, unit=unit)
    except InputError:
        return SeenOrders()
    low = bool(made.faint) or any(line.pair == "output_housing" for line in made.found)
    return SeenOrders(made.found, low)


def order_candidates(
    names: Sequence[str],
    facts: Mapping[str, Any],
    seen: SeenOrders,
    model: Sequence[Effect],
    target: str,
    span: float,
) -> dict[str, tuple[Harmonic, ...]]:
    """Return the orders to try for each ripple effect.

    One that pole pairs or slots claim is a wave generator's too, where it may be its overtone. A
    resonance of other ripple has the orders of that, or the strongest found. `span`: rad that the
    output goes; of a low order half a period has to be seen, or it is an offset and a slope.
    """
    taken = {h for e in model for h in e.harmonics if e.name != MODULATED_RIPPLE}
    taken |= {ONE_SINE for e in model if e.name == GRAVITY}
    found = seen.found
    low = [(k, pair) for k, pair in _low(facts, seen.low) if k * span * abs(pair.turns) >= np.pi]
    wanted = []
    for k, pair in [*low, *_of_facts(facts)]:
        name, _ = owner(OrderCandidate(k, pair, k * pair.turns), facts, alone=False)
        wanted.append((name, (k, CORE_PAIRS[pair.name])))
    for line in found[: SETTINGS.functions]:
        if isinstance(line.order, int) and line.pair:
            name = OUTPUT_RIPPLE if line.effect == GRAVITY else line.effect
            wanted.append((name, (line.order, CORE_PAIRS[line.pair])))
            if line.effect == COGGING and _is_overtone(line, found):
                wanted.append((WAVE_GENERATOR_RIPPLE, (line.order, CORE_PAIRS[line.pair])))
    if target == "torsion":
        wanted = [(KINEMATIC_ERROR, harmonic) for _, harmonic in wanted]
    own: dict[str, list[Harmonic]] = {}
    for name, harmonic in dict.fromkeys(wanted):
        if harmonic not in taken:
            own.setdefault(name, []).append(harmonic)
    leading = [h for e in model if e.info.name in MOTOR_RIPPLES for h in e.harmonics]
    lines = [(f.order, CORE_PAIRS[f.pair]) for f in found[: SETTINGS.tried - 1]
             if f.effect in MOTOR_RIPPLES and isinstance(f.order, int) and f.pair]  # fmt: skip
    own[MODULATED_RIPPLE] = list(dict.fromkeys([*leading, *lines]))
    return {
        name: tuple(h for h in own[name] if h[1] in CATALOGUE[name].pairs)[: _core.max_harmonics]
        for name in names
        if own.get(name)
    }


def _is_overtone(line: FoundOrder, found: Sequence[FoundOrder]) -> bool:
    """Whether an order is twice a larger one of the wave generator: both may be its ripple."""
    return any(
        abs(line.per_output_turn - 2.0 * one.per_output_turn) < one.resolution
        for one in found
        if one.effect == WAVE_GENERATOR_RIPPLE and one.amplitude > line.amplitude
    )


def span_of(problem: Problem) -> float:
    """How far the output goes from end to end in a run, rad; without bound where unknown."""
    logs = [run.log for run in problem.runs]
    angles = [log["output_position"] for log in logs if "output_position" in log]
    return problem.once("span", lambda: max(map(float, map(np.ptp, angles)), default=np.inf))


def unseen(effect: Effect, span: float) -> list[int]:
    """Numbers of the terms that wave too slowly over the joint's angle for these runs to show.

    Of an order a quarter of a period has to be seen, or it is a constant and a slope. The fastest
    is told at any span. Ripple asks for a half (`order_candidates`).
    """
    orders = [int(t.name.split()[-1]) if WAVE.fullmatch(t.name) else 0 for t in effect.terms]
    fastest = max(orders, default=0)
    return [
        k for k, order in enumerate(orders) if 0 < order < fastest and order * span < 0.5 * np.pi
    ]


def unseen_of(effects: Iterable[Effect], problem: Problem) -> dict[str, float]:
    """Return the `unseen` coefficients of effects by name, and the zero at which they are held."""
    span = span_of(problem)
    return {f"{e.name}.{e.terms[k].name}": 0.0 for e in effects for k in unseen(e, span)}


def _low(facts: Mapping[str, Any], seen: bool) -> list[tuple[int, Pair]]:
    """Low orders of every pair whose angle is another than those before.

    `seen`: whether low ones of the output may be there; then more of these.
    """
    kept: list[Pair] = []
    for pair in pairs(facts):
        if pair.motor and pair.turns != pair.turns:
            continue
        if (pair.motor, pair.output) not in [(p.motor, p.output) for p in kept]:
            kept.append(pair)
    some, many = SETTINGS.tried, SETTINGS.functions
    most = {pair.name: many if seen and not pair.motor else some for pair in kept}
    return [(order, pair) for pair in kept for order in range(1, most[pair.name] + 1)]


def _of_facts(facts: Mapping[str, Any]) -> list[tuple[int, Pair]]:
    motor = [pair for pair in pairs(facts) if pair.name == "motor_stator"]
    counts = [int(facts[name]) for name in FACTS if facts.get(name)]
    if "gear_ratio" not in facts:
        return []
    return [(k * count, pair) for pair in motor for count in counts if count > 1 for k in (1, 2)]


PAIRED = {info.name: info.combines for info in CATALOGUE.values() if info.combines}
"""The same columns under another name: never a candidate, and who has it needs no others."""


@dataclass(frozen=True)
class Candidate:
    """One effect that may be missing.

    `variants`: the effect in several shapes, one of which is tried at a time. `atoms`: of a ripple
    effect, for each variant the effect with one order each.
    """

    name: str
    variants: tuple[Effect, ...]
    atoms: tuple[tuple[Effect, ...], ...] = ()

    @property
    def effects(self) -> list[Effect]:
        """Everything that needs columns."""
        if self.atoms:
            return [atom for atoms in self.atoms for atom in atoms]
        return list(self.variants)


def possible(
    base: Sequence[Effect],
    logs: Sequence[Log],
    target: str,
    known_load: str | None,
    exclude: Iterable[str] = (),
    own: Sequence[Effect] = (),
) -> tuple[list[Effect], dict[str, str]]:
    """Return the effects that these logs could show beside `base`, and why the others cannot.

    `exclude`: names that the caller knows not to be there. `own`: the user's own effects, which are
    candidates beside those of the catalogue.

    Raises
    ------
    InputError
        For a name in `exclude` that is no effect, or one of the base.
    """
    names = {e.name for e in base}
    absent = _absent(exclude, {e.info.name for e in base}, {e.name for e in own})
    never = {FRICTION_BY_DIRECTION} if target == "sensor_torque" else {FRICTION_BY_DIRECTION, LAG}
    taken = names | never | set(PAIRED) | {n for own in names for n in PAIRED.get(own, ())}
    found, reasons = [], {}
    for effect in [*map(Effect, CATALOGUE), *own]:
        if effect.name in taken or TARGETS[target] not in effect.info.targets:
            continue
        if effect.name in absent:
            reasons[effect.name] = EXCLUDED
            continue
        effect = effect.without_load() if known_load is None else effect
        try:
            for log in logs:
                channels_for(log, [effect], known_load)
            gear_for(logs, target, [effect])
        except InputError as error:
            reasons[effect.name] = str(error)
            continue
        found.append(effect)
    carriers = [*base, *(e for e in found if e.info.carries_load)]
    for effect in list(found):
        try:
            require_load([*carriers, effect], known_load)
            require_one_unit([*base, effect], target, known_load)
        except InputError as error:
            reasons[effect.name] = str(error)
            found.remove(effect)
    return found, reasons


def _absent(exclude: Iterable[str], base: set[str], own: set[str]) -> set[str]:
    absent = {exclude} if isinstance(exclude, str) else set(exclude)
    for name in sorted(absent):
        if name not in own:
            Effect(name)  # refuses what is no effect
        if name in base:
            raise InputError(f"'{name}' is excluded and in the model; leave it out of one of them")
    return absent


def candidates_for(
    model: Sequence[Effect],
    effects: Iterable[Effect],
    problem: Problem,
    orders_of: dict[str, tuple[Harmonic, ...]],
) -> list[Candidate]:
    """Return the candidates beside a model.

    Parameters
    ----------
    effects : those that the logs could show; those in the model already are left out.
    orders_of : orders that may be there, by ripple effect.
    """
    names, made = {e.name for e in model}, []
    for effect in effects:
        if effect.name in names or not _loaded([*model, effect], problem):
            continue
        effect = effect.with_orders(orders_of.get(effect.name, ())) if effect.ripple else effect
        variants = shaped(effect, tuple(model), problem, SETTINGS.points)
        if not effect.ripple:
            made.append(Candidate(effect.name, tuple(variants)))
        elif orders_of.get(effect.name):
            atoms = [tuple(v.with_orders([h]) for h in orders_of[effect.name]) for v in variants]
            made.append(Candidate(effect.name, tuple(variants), tuple(atoms)))
    return made


def _loaded(effects: Sequence[Effect], problem: Problem) -> bool:
    try:
        require_load(effects, problem.known_load)
        require_one_unit(effects, problem.target, problem.known_load)
    except InputError:
        return False
    return True
