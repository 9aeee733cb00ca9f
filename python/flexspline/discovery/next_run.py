"""Which run to record next, where these cannot tell two causes apart."""

from __future__ import annotations

from collections.abc import Sequence

from flexspline.effects import Effect
from flexspline.errors import listed

__all__ = ["next_run"]

WORDS = {
    "output_position": "the joint angle",
    "output_velocity": "the speed",
    "output_acceleration": "the acceleration",
    "motor_position": "the motor's angle",
    "motor_torque": "the motor torque",
    "temperature": "the temperature",
    "motor_temperature": "the motor's temperature",
    "load": "the load",
    "time": "the time since the start",
}


def next_run(pairs: Sequence[tuple[Effect, Effect]]) -> str | None:
    """Return the sentence for effects and their aliases, None where there are none.

    Two effects that read different channels are told apart by a run in which these change
    independently; two that read the same ones by a wider range of them.
    """
    said = [_sentence(named, alias) for named, alias in pairs]
    return " ".join(dict.fromkeys(said)) or None


def _sentence(named: Effect, alias: Effect) -> str:
    first = [c for c in named.reads if c not in alias.reads]
    second = [c for c in alias.reads if c not in named.reads]
    who = f"{named.name} and {alias.name}"
    if first and second:
        return (
            f"To tell {who} apart, record a run in which {_listed(first)} and {_listed(second)} "
            "change independently of each other, each through its whole range."
        )
    if first or second:
        return (
            f"To tell {who} apart, record runs that repeat the same motion at different levels of "
            f"{_listed(first or second)}."
        )
    return (
        f"To tell {who} apart, record a run with a wider range of {_listed(named.reads)}, slow "
        "and fast, with reversals in different places."
    )


def _listed(channels: Sequence[str]) -> str:
    words = [WORDS.get(name, name.replace("_", " ")) for name in channels if name != "period"]
    return listed(words) or "the motion"
