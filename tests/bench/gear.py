"""What the benchmarks' simulators take from a gear's data sheet, and nothing of their physics.

`hidden` and `elsewhere` are of two hands; only what a catalogue states they have in common.
"""

from __future__ import annotations

__all__ = ["Geared"]


class Geared:
    """A joint with a strain wave gear, by the numbers of its data sheet."""

    gear_ratio: float
    output_spline: str
    torque_constant: float

    @property
    def ratio(self) -> float:
        """Ñ, turns of the motor per turn of the output."""
        return self.gear_ratio + (self.output_spline == "circular")

    @property
    def drive(self) -> float:
        """Nm at the output for one ampere."""
        return self.ratio * self.torque_constant
