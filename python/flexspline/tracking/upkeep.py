"""What a joint needs where one of its effects has changed, told by the traits of the effect."""

from __future__ import annotations

from flexspline.effects import CATALOGUE

__all__ = ["needed_by"]


def needed_by(effect: str) -> str:
    """Return what to look at or to do, as words behind "It needs"; "" of an effect of your own."""
    info = CATALOGUE.get(effect)
    if info is None:
        return ""
    if info.traits.constant:
        return "a new zero"
    if info.carries_load:
        return "a look at what it carries: a mass has changed"
    if info.targets == "D":
        return "a look at its gear: what it yields has changed"
    if info.pairs:
        return "a look at what turns at that order: bearings, wave generator, teeth"
    if info.traits.known_load or (info.reads == ("load",) and not info.traits.dissipative):
        return "a new calibration of its torque"
    if "output_velocity" in info.reads or info.traits.dissipative:
        return "a look at its lubricant and bearings"
    return "a look at its sensor"
