"""How large a device's readings may be: what is beyond counts as missing (reading_limits.hpp).

A limit is `FACTOR` times the largest magnitude that the parts which read the channel were fitted
to, and at least `LEAST`, for a channel may have been at rest in the logs of the fit. It is the same
either way: a joint that turned or was loaded one way in its logs may go the other. Limits are for
what is no physical quantity; that a model extrapolates is told by other flags, and what your own
joint may do is said by `ReadingChecks`.

Without a range in the model, for a temperature, a thermistor's voltage and the time, the limit is
the core's: what no joint has. Angles have none but the turns that an integer holds.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from flexspline import _core
from flexspline.estimation.plan import Plan, readings_of
from flexspline.part import Part

__all__ = ["FACTOR", "UNITS", "joint_limits", "part_limits"]

# A sensor tells a hundredth of its full scale from zero, and an effect that a log hardly shows is
# not significant: a joint is fitted on no less than a hundredth of what it is built for, so that no
# true reading, a crash included, is beyond a hundred times the fit. At half of it a joint that was
# fitted at 1.5 % of its torque would go blind in a crash; at double an absurd reading may be twice
# as large, and what a lag or an observer keeps of it as well.
FACTOR = 100.0

# Fits of a joint at rest or without load: 8500 rpm into a gear of ratio 30 is 30 rad/s, that within
# a millisecond 3e4 rad/s²; the peak torque of a strain wave gear of mid size is 1000 Nm at the
# output, and a hundredth of that on the motor's side.
LEAST: Mapping[str, float] = {
    "output_velocity": 30.0,
    "output_acceleration": 3e4,
    "motor_torque": 10.0,
    "load": 1000.0,
}

_KNOWN = _core.reading_limits()
WIDEST: Mapping[str, float] = {one["name"]: one["default"] for one in _KNOWN}
UNITS: Mapping[str, str] = {one["name"]: one["unit"] for one in _KNOWN} | {"load": "Nm"}
OF_A_PART = (  # in the order of the core's channels
    "output_velocity",
    "output_acceleration",
    "temperature",
    "load",
    "motor_torque",
    "time",
)


def part_limits(part: Part) -> dict[str, float]:
    """Return the limits of the numbers that a part's model reads, in the core's order."""
    reads = {channel for effect in part.effects for channel in effect.reads}
    return {name: _limit(name, [part]) for name in OF_A_PART if name in reads}


def joint_limits(plan: Plan) -> dict[str, float | None]:
    """Return the limit of each reading of a joint, in the core's order; None where none is read."""
    read = readings_of(plan)
    parts = [part for part in plan.models.values() if part is not None]
    found: dict[str, float | None] = {
        name: _limit(name, parts) if name in read else None for name in WIDEST
    }
    volts = plan.sensing.get("calibration", {}).get("voltage_range")
    if found["sensor_voltage"] is not None and volts is not None:
        found["sensor_voltage"] = _widened("sensor_voltage", volts)
    return found


def _limit(name: str, parts: Sequence[Part]) -> float:
    """The limit of a channel, by the parts that read it and know its range."""
    ranges = [
        part.record.get("validity", {}).get("known_load" if name == "load" else name)
        for part in parts
        if name in LEAST and any(name in effect.reads for effect in part.effects)
    ]
    return _widened(name, [end for ends in ranges if ends is not None for end in ends])


def _widened(name: str, ends: Sequence[Any]) -> float:
    """The limit of a channel that had these values; that of the core where there are none."""
    widest = WIDEST["sensor_torque" if name == "load" else name]
    largest = max((abs(float(end)) for end in ends), default=0.0)
    if not largest > 0.0:
        return widest
    return min(max(FACTOR * largest, LEAST.get(name, 0.0)), widest)
