"""Velocity and acceleration of a joint that measures its angle alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from flexspline.errors import InputError
from flexspline.estimators.checks import above_zero, choice, from_fields, to_fields

__all__ = ["DERIVED", "Differentiator"]

DERIVED = ("output_velocity", "output_acceleration")


@dataclass(frozen=True)
class Differentiator:
    """Velocity and acceleration from the output's angle, causal, for what has no channel.

        v ← v + g (Δq / T − v),    a ← a + g (Δv / T − a),    g = 1 − exp(−2π f T)

    Two first-order low passes, −3 dB at f each: late by 1/(2π f) and twice that. The chain's first
    stage behind its checks, and the same on a PC and on the joint: what a log or a device has in
    the place of these channels is not read. The stage is silent, and the status says so, for
    7/(2π f) from a start or a longer gap on and while the angle is missing.

    Parameters
    ----------
    bandwidth : f, Hz; at most a quarter of the rate.
    channels : which of output_velocity and output_acceleration it makes.

    Raises
    ------
    InputError
        Where the bandwidth is not above zero, or a channel is not one of these.
    """

    key: ClassVar[str] = "differentiator"

    bandwidth: float
    channels: tuple[str, ...] = DERIVED

    def __post_init__(self) -> None:
        bandwidth = above_zero(self.bandwidth, "differentiator: bandwidth", "Hz")
        given = (self.channels,) if isinstance(self.channels, str) else tuple(self.channels)
        made = tuple(choice(name, "differentiator: channel", DERIVED) for name in given)
        if not made:
            raise InputError(
                f"differentiator: no channels to make; give {DERIVED[0]}, {DERIVED[1]} or both"
            )
        object.__setattr__(self, "bandwidth", bandwidth)
        object.__setattr__(self, "channels", tuple(name for name in DERIVED if name in made))

    def to_json(self) -> dict[str, Any]:
        """Return the entry of `model.json`."""
        return to_fields(self)

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> Differentiator:
        """Return the estimator of an entry of `model.json`."""
        return from_fields(cls, content, cls.key)
