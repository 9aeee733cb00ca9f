"""Orders that a ripple effect may have: the low ones of its pairs, those of facts, those found.

Low orders are few and known beforehand, so that one of them needs less evidence than a peak of a
scan over thousands; what the scan finds in the residual is added. Each order has the owner that
`effects.md` gives it, and the same angle is counted once.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from flexspline import _core
from flexspline.discovery.settings import SETTINGS
from flexspline.effects import CATALOGUE, Effect, Harmonic
from flexspline.errors import InputError
from flexspline.fit.ripple import CORE_PAIRS, FOLLOWER, LEADERS
from flexspline.logs.log import Log
from flexspline.orders import FoundOrder, find_orders
from flexspline.orders.parts import Candidate as OrderCandidate
from flexspline.orders.parts import Pair, owner, pairs

__all__ = ["joined", "order_pools", "scanned"]

GRAVITY = (1, "output_on_housing")
FACTS = ("pole_pairs", "slots")


def scanned(logs: Sequence[Log], residuals: Sequence[Any], unit: str) -> tuple[FoundOrder, ...]:
    """Return the orders that stand out of residuals, (N,) for each log; none without motion."""
    try:
        return find_orders(logs, residuals, unit=unit).found
    except InputError:
        return ()


def joined(before: tuple[FoundOrder, ...], after: tuple[FoundOrder, ...]) -> tuple[FoundOrder, ...]:
    """Return the orders of two scans, each once, the strongest of each scan first."""
    known = {(line.order, line.pair) for line in before}
    return before[: SETTINGS.functions // 2] + tuple(
        f for f in after if (f.order, f.pair) not in known
    )


def order_pools(
    names: Sequence[str],
    facts: Mapping[str, Any],
    found: Sequence[FoundOrder],
    model: Sequence[Effect],
    target: str,
    span: float,
) -> dict[str, tuple[Harmonic, ...]]:
    """Return the orders to try for each ripple effect.

    An effect that follows others (a resonance of their ripple) has the orders that these have in
    the model, or the strongest found. `span`: rad that the output goes from end to end; of a low
    order half a period has to be seen, or it is an offset and a slope.
    """
    own: dict[str, list[Harmonic]] = {}
    taken = {h for e in model for h in e.harmonics if e.name != FOLLOWER}
    taken |= {GRAVITY for e in model if e.name == "gravity"}
    seen_of = {pair: span * abs(pair.turns) for pair in pairs(facts)}
    low = [(k, pair) for k, pair in _low(facts) if not k * seen_of[pair] < np.pi]
    for order, pair in [*low, *_of_facts(facts)]:
        name = "kinematic_error" if target == "torsion" else _owner(order, pair, facts)
        _add(own, name, (order, CORE_PAIRS[pair.name]), taken)
    for line in found[: SETTINGS.functions]:
        if isinstance(line.order, int) and line.pair:
            name = "kinematic_error" if target == "torsion" else line.effect
            name = "output_ripple" if name == "gravity" else name
            _add(own, name, (line.order, CORE_PAIRS[line.pair]), taken)
    leading = [h for e in model if e.name in LEADERS for h in e.harmonics]
    seen = [(f.order, CORE_PAIRS[f.pair]) for f in found[: SETTINGS.tried - 1]
            if f.effect in LEADERS and isinstance(f.order, int) and f.pair]  # fmt: skip
    own[FOLLOWER] = list(dict.fromkeys([*leading, *seen]))
    return {name: _allowed(name, own[name]) for name in names if own.get(name)}


def _allowed(name: str, orders: list[Harmonic]) -> tuple[Harmonic, ...]:
    known = CATALOGUE[name].pairs
    return tuple(h for h in orders if h[1] in known)[: _core.max_harmonics]


def _add(
    own: dict[str, list[Harmonic]], name: str, harmonic: Harmonic, taken: set[Harmonic]
) -> None:
    if harmonic not in taken and harmonic not in own.setdefault(name, []):
        own[name].append(harmonic)


def _low(facts: Mapping[str, Any]) -> list[tuple[int, Pair]]:
    """Low orders of every pair whose angle is another than those before."""
    kept: list[Pair] = []
    for pair in pairs(facts):
        if pair.motor and pair.turns != pair.turns:
            continue
        if (pair.motor, pair.output) not in [(p.motor, p.output) for p in kept]:
            kept.append(pair)
    return [(order, pair) for pair in kept for order in range(1, SETTINGS.tried + 1)]


def _of_facts(facts: Mapping[str, Any]) -> list[tuple[int, Pair]]:
    motor = [pair for pair in pairs(facts) if pair.name == "motor_stator"]
    counts = [int(facts[name]) for name in FACTS if facts.get(name)]
    if "gear_ratio" not in facts:
        return []
    return [(k * count, pair) for pair in motor for count in counts if count > 1 for k in (1, 2)]


def _owner(order: int, pair: Pair, facts: Mapping[str, Any]) -> str:
    name, _ = owner(OrderCandidate(order, pair, order * pair.turns), facts, alone=False)
    return name
