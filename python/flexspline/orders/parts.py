"""What turns against what in a strain wave joint, and which effect owns an order.

Ripple belongs to a pair of parts. The angle of every pair is a whole-numbered sum

    angle = a · θ + b · q,     θ ≈ +Ñ q,

so that order m of a pair is order m · (a Ñ + b) per output turn.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import ceil, floor

import numpy as np
from numpy.typing import NDArray

from flexspline.effects.causes import COGGING, GRAVITY, OUTPUT_RIPPLE, WAVE_GENERATOR_RIPPLE
from flexspline.errors import InputError
from flexspline.logs import Log

__all__ = ["Candidate", "Pair", "candidates", "effective_ratio", "output_angle", "owner", "pairs"]

_MOST = 10  # whole orders on either side that are listed
_LOBES = 4  # harmonics of the wave generator that count as its ripple


@dataclass(frozen=True)
class Pair:
    """Two parts that turn against each other.

    `name` is the pair, `motor` and `output` are a and b of angle = a · θ + b · q, `turns` is
    the number of turns per output turn (NaN where the gear ratio is not known), `words` says
    it in a label.
    """

    name: str
    motor: int
    output: int
    turns: float
    words: str

    def angle(self, log: Log) -> NDArray[np.float64]:
        """Return the angle of the pair [rad], shape (rows,), counted on over turns.

        Raises
        ------
        InputError
            Where the log has no position, or has only one side and no gear ratio.
        """
        q = output_angle(log) if self.output or "motor_position" not in log else None
        total = np.zeros(len(log)) if q is None else self.output * q
        if not self.motor:
            return total
        if "motor_position" in log:
            return total + self.motor * _unwrapped(log["motor_position"])
        assert q is not None
        return total + self.motor * _needed_ratio(log) * q


@dataclass(frozen=True)
class Candidate:
    """Order `order` of `pair`, which is `per_output_turn` counted per turn of the output."""

    order: int
    pair: Pair
    per_output_turn: float

    @property
    def label(self) -> str:
        """What turns at this order, in words."""
        return f"{self.pair.words}, {self.order} per turn"


def effective_ratio(facts: Log | Mapping[str, object]) -> float | None:
    """Return Ñ, turns of the motor per turn of the output, or None where it is not known."""
    known = facts.facts if isinstance(facts, Log) else facts
    if "gear_ratio" not in known:
        return None
    return float(str(known["gear_ratio"])) + (known.get("output_spline") == "circular")


def pairs(facts: Log | Mapping[str, object]) -> tuple[Pair, ...]:
    """Return the pairs of parts of a joint whose angles are known.

    Parameters
    ----------
    facts : Log or mapping
        `gear_ratio` and `output_spline` ("circular", "flex" or absent) are looked at.

    Returns
    -------
    tuple of Pair
        `output_housing` and `motor_stator`; with a known output spline also
        `wave_generator_flexspline` and `wave_generator_circular_spline`.

    Notes
    -----
    Without `output_spline` nobody can say against which
    spline the wave generator's angle counts, so these two pairs are left out.
    """
    known = facts.facts if isinstance(facts, Log) else facts
    ratio = effective_ratio(known)
    turns = float("nan") if ratio is None else ratio
    table = [
        Pair("output_housing", 0, 1, 1.0, "output"),
        Pair("motor_stator", 1, 0, turns, "motor"),
    ]
    spline = known.get("output_spline")
    if spline in ("circular", "flex"):
        flex, circular = (0, -1) if spline == "circular" else (1, 0)
        table += [
            Pair(
                "wave_generator_flexspline",
                1,
                flex,
                turns + flex,
                "wave generator against flexspline",
            ),
            Pair(
                "wave_generator_circular_spline",
                1,
                circular,
                turns + circular,
                "wave generator against circular spline",
            ),
        ]
    return tuple(table)


def _unwrapped(angle: NDArray[np.float64]) -> NDArray[np.float64]:
    """The angle without jumps of a turn; where it has none, without a look at each step."""
    if (np.abs(np.diff(angle)) < np.pi).all():
        return np.array(angle)
    return np.asarray(np.unwrap(angle), dtype=np.float64)


def output_angle(log: Log) -> NDArray[np.float64]:
    """Return q [rad], shape (rows,), unwrapped; from θ / Ñ where the log has no output side.

    Raises
    ------
    InputError
        Where neither can be had.
    """
    if "output_position" in log:
        return _unwrapped(log["output_position"])
    if "motor_position" in log:
        return _unwrapped(log["motor_position"]) / _needed_ratio(log)
    raise InputError(
        f"log '{log.name}': orders need 'output_position' or 'motor_position' and it has "
        "neither; name one of them in the column map"
    )


def candidates(
    order: float, resolution: float, parts: tuple[Pair, ...], *, wide: bool = False
) -> list[Candidate]:
    """Return what may turn at `order` per output turn, the likeliest first.

    Orders of the motor side lie within `resolution`, those of the output, which are everywhere,
    within half of it, or with `wide` within all of it.

    Whole orders of the motor side come before whole orders of the output, since the former
    are sparse and the latter everywhere; among the motor side the nearest comes first, and
    of equal ones the wave generator for its harmonics 1 to 4, the motor above.
    """
    found = []
    for pair in parts:
        if not pair.turns > 0:
            continue
        wave = pair.name.startswith("wave_generator")
        tolerance = resolution * (1.0 if pair.motor or wide else 0.5)
        reach = min(tolerance / pair.turns, _MOST) + 1e-9
        for m in range(
            max(1, ceil(order / pair.turns - reach)), floor(order / pair.turns + reach) + 1
        ):
            offset = abs(m * pair.turns - order)
            if not (wave and m > _LOBES):
                rank = (pair.motor == 0, round(offset / resolution, 2), wave != (m <= _LOBES), m)
                found.append((rank, Candidate(m, pair, m * pair.turns)))
    return [candidate for _, candidate in sorted(found, key=lambda entry: entry[0])]


def owner(found: Candidate, facts: Mapping[str, object], *, alone: bool) -> tuple[str, str]:
    """Return the effect that owns an order, and what turns in words.

    Parameters
    ----------
    found : Candidate
        The order and its pair.
    facts : mapping
        `pole_pairs` and `slots`, where known, claim their multiples for `cogging`.
    alone : bool
        Whether this is the only order of the output that was found.

    Notes
    -----
    Order 1 of the output alone is `gravity`, else `output_ripple`; what pole pairs or slots
    explain is `cogging`; without them low orders are `wave_generator_ripple`, others `cogging`.
    """
    if found.pair.motor == 0:
        return (GRAVITY if found.order == 1 and alone else OUTPUT_RIPPLE), found.label
    rotor = found.pair.motor == 1 and found.pair.output == 0
    for fact, words in (("pole_pairs", "pole pairs"), ("slots", "slots")):
        count = int(str(known)) if (known := facts.get(fact)) else 0
        if rotor and count > 1 and found.order % count == 0:
            times = found.order // count
            return COGGING, f"{'' if times == 1 else f'{times} × '}{count} {words} × motor"
    if found.order <= _LOBES:
        return WAVE_GENERATOR_RIPPLE, found.label
    return COGGING, found.label


def _needed_ratio(log: Log) -> float:
    ratio = effective_ratio(log)
    if ratio is None:
        raise InputError(
            f"log '{log.name}': the angle of the other side of the gear needs the gear ratio; "
            "give gear_ratio when reading the log"
        )
    return ratio
