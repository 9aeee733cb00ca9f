"""A strain gauge as it is bonded and wired, and the strain that the wave generator makes."""

from __future__ import annotations

import math
from dataclasses import dataclass

from flexspline.errors import InputError

__all__ = ["Gauge", "WaveStrain"]

MOST_TURNS = 2


@dataclass(frozen=True)
class Gauge:
    """One strain gauge on a spoke of the sensor.

    Parameters
    ----------
    angle : where its spoke is, around the joint [rad].
    sign : +1 where a positive torque stretches it, −1 where it compresses it.
    arm : +1 or −1, the arm of the bridge that it sits in; None: as `sign`, so that it adds to
        the torque.
    tilt : how far it is turned out of the spoke's direction [rad].
    factor_error : its gauge factor against the nominal one, as a share (0.01 is 1 %).
    thermal_linear, thermal_quadratic : apparent strain per K and per K² away from the reference
        temperature of the bridge.

    Raises
    ------
    InputError
        For a sign or an arm that is not ±1, a value that is not finite, an angle of more than two
        turns (degrees?) or a gauge factor that is none.
    """

    angle: float
    sign: int
    arm: int | None = None
    tilt: float = 0.0
    factor_error: float = 0.0
    thermal_linear: float = 0.0
    thermal_quadratic: float = 0.0

    def __post_init__(self) -> None:
        if self.arm is None:
            object.__setattr__(self, "arm", self.sign)
        if self.sign not in (1, -1) or self.arm not in (1, -1):
            raise InputError(
                f"gauge: sign {self.sign} and arm {self.arm} must be +1 or -1; give +1 for "
                "tension under torque, -1 for compression"
            )
        numbers = (self.angle, self.tilt, self.factor_error)
        if abs(self.angle) > MOST_TURNS * 2.0 * math.pi:
            raise InputError(
                f"gauge: angle = {self.angle:g} rad is more than {MOST_TURNS} turns; give radians"
            )
        if self.factor_error <= -1.0:
            raise InputError(
                f"gauge: factor_error = {self.factor_error:g} leaves no gauge; give more than -1"
            )
        if not all(map(math.isfinite, (*numbers, self.thermal_linear, self.thermal_quadratic))):
            raise InputError("gauge: angle, errors and thermal strain must be finite numbers")


@dataclass(frozen=True)
class WaveStrain:
    """Strain in the spokes that turns with the wave generator.

    At x = β − φ, β the angle of the wave generator against the flexspline and φ the gauge's,
    a gauge reads

        sign · bending · cos(order · x − phase) + stretching · cos(order · x − stretching_phase)

    The bending differs in sign between both flanks of a spoke, so a pair's difference is
    2 bending: Ψ₀ of (2). The stretching is one for both and leaves a pair; it is ε_w as (1) of
    the paper prints it, by which the sinusoid of (2) would vanish. It comes back with
    placement errors.

    Parameters
    ----------
    order : periods per turn of the wave generator against the flexspline, from 1.
    bending, stretching : amplitudes as strain (1e-6 is a microstrain).
    phase, stretching_phase : rad.

    References
    ----------
    zhang_disturbance_elimination (1)–(3), Fig. 7; [Hashimoto1993] (its ref. 12).

    Raises
    ------
    InputError
        For an order that is no whole number from 1, or a value that is not finite.
    """

    order: int
    bending: float
    phase: float = 0.0
    stretching: float = 0.0
    stretching_phase: float = 0.0

    def __post_init__(self) -> None:
        if self.order < 1 or int(self.order) != self.order:
            raise InputError(
                f"wave strain: order {self.order} is no whole number from 1; give periods per "
                "turn of the wave generator"
            )
        numbers = (self.bending, self.phase, self.stretching, self.stretching_phase)
        if not all(map(math.isfinite, numbers)):
            raise InputError(f"wave strain of order {self.order}: give finite amplitudes and phase")

    def for_core(self) -> tuple[float, float, float, float, float]:
        """Return order, and cosine and sine amplitudes of bending and stretching."""
        return (
            float(self.order),
            self.bending * math.cos(self.phase),
            self.bending * math.sin(self.phase),
            self.stretching * math.cos(self.stretching_phase),
            self.stretching * math.sin(self.stretching_phase),
        )
