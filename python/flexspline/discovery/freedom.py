"""What a base is given beside its effects: freedom of its form, and of the recorder, not names.

Gears, seals and preloaded bearings brake by some per cent more one way than the other. A base of
odd friction leaves an even part |v| of it, which is plain in long runs and looks like whatever is
slow. And a load cell has a clock and a filter of its own: where it is late by a millisecond, the
known load that is taken off the target leaves as much as friction does at a reversal. So the search
gives the base both freedoms, and what stays in the model is what is significant in the final fit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from flexspline.discovery.settings import SETTINGS
from flexspline.effects import Effect
from flexspline.logs.channel_noise import ChannelNoise
from flexspline.logs.log import Log

__all__ = ["DIRECTIONS", "LAG", "freedoms", "held_of", "with_freedoms"]

DIRECTIONS, LAG = "direction_dependent_friction", "sensor_lag"
ANGLE = "output_position"
FRICTION = ("coulomb_friction", "viscous_friction")


def freedoms(
    base: Sequence[Effect],
    target: str,
    known_load: str | None,
    logs: Sequence[Log],
    noise: Mapping[str, ChannelNoise],
) -> tuple[str, ...]:
    """Return the names of what the base is given; `noise`: of each channel.

    Nothing where neither the angle nor the known load is noisy: such runs come from a simulation,
    whose friction is odd. The noise of the target tells nothing of that.
    """
    recorded = [noise[name] for name in {ANGLE, known_load or ANGLE} if name in noise]
    if target == "torsion" or not any(one.noisy for one in recorded):
        return ()
    names = {effect.name for effect in base}
    found = [DIRECTIONS] if names & {*FRICTION} and _both_ways(logs) else []
    if known_load in noise and noise[str(known_load)].noisy:
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


def held_of(effects: Sequence[Effect], given: Sequence[str]) -> dict[str, float]:
    """Return what is held of the freedoms `given` to these effects.

    Beside no offset, a level of the base would be one. A delay of the load is seen in its slope at
    once: over what time the slope is taken is not looked for.
    """
    held: dict[str, float] = {}
    names = {effect.name: effect for effect in effects}
    if DIRECTIONS in names and "offset" not in names:
        held[f"{DIRECTIONS}.level"] = 0.0
    if LAG in names and LAG in given:
        held |= {f"{LAG}.{shape.name}": shape.lower for shape in names[LAG].fitted_shapes}
    return held


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
