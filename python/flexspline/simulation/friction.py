"""What resists and sticks in a simulated joint: friction of a side, elements that slip."""

from __future__ import annotations

from dataclasses import dataclass, replace

from flexspline.errors import InputError
from flexspline.simulation.checked import above, at_least, require_limits

__all__ = ["Friction", "SlipElement"]


@dataclass(frozen=True)
class Friction:
    """Friction of one side, in Nm and rad/s of that side, with true sticking.

    Sliding in direction ±: coulomb_± γ_c + load_± |τ| + stribeck γ_c exp(−(v/v_s)²)
    + γ_v (viscous |v| + quadratic v² + cubic |v|³); at rest anything up to its value at v = 0.
    γ = exp(−fade · (T − reference_temperature)): T is the motor's temperature for the motor's
    friction, the joint body's for the output's.

    Parameters
    ----------
    coulomb_forward, coulomb_backward : Nm, levels for v > 0 and v < 0.
    load_forward, load_backward : 1, Nm of level per Nm of torque transmitted, at this side.
    stribeck, stribeck_velocity : Nm, rad/s.
    viscous, quadratic, cubic : Nm s/rad, Nm s²/rad², Nm s³/rad³; the latter two of any sign.
    coulomb_fade, viscous_fade : 1/K.
    reference_temperature : °C.

    Notes
    -----
    Source: full_range_torque_estimation (21), (22); [Olsson1998] (Stribeck);
    [Madsen2020] (load and temperature).
    """

    coulomb_forward: float = at_least(0.0)
    coulomb_backward: float = at_least(0.0)
    load_forward: float = at_least(0.0)
    load_backward: float = at_least(0.0)
    stribeck: float = at_least(0.0)
    stribeck_velocity: float = above(0.0, 0.1)
    viscous: float = at_least(0.0)
    quadratic: float = 0.0
    cubic: float = 0.0
    coulomb_fade: float = 0.0
    viscous_fade: float = 0.0
    reference_temperature: float = 25.0

    def __post_init__(self) -> None:
        require_limits(self)
        if max(self.load_forward, self.load_backward) >= 1.0:
            raise InputError(
                "simulation: Friction.load_forward or load_backward is 1 or more, so the joint "
                "could never be driven back; give a share below 1"
            )

    @classmethod
    def both_ways(cls, coulomb: float, *, load: float = 0.0, **others: float) -> Friction:
        """Return friction with the same levels in both directions; `others` are fields."""
        return cls(coulomb, coulomb, load, load, **others)

    def at_motor(self, effective_ratio: float) -> Friction:
        """Return friction given at the output, as it acts at the motor behind a ratio Ñ."""
        n = effective_ratio
        return replace(
            self,
            coulomb_forward=self.coulomb_forward / n,
            coulomb_backward=self.coulomb_backward / n,
            stribeck=self.stribeck / n,
            stribeck_velocity=self.stribeck_velocity * n,
            viscous=self.viscous / n**2,
            quadratic=self.quadratic / n**3,
            cubic=self.cubic / n**4,
        )


@dataclass(frozen=True)
class SlipElement:
    """A spring that slips at its level (Maxwell slip); several of them make a hysteresis.

    Parameters
    ----------
    stiffness : Nm/rad at the output.
    level : Nm at the output.
    """

    stiffness: float = above(0.0, 1.0)
    level: float = at_least(0.0)

    def __post_init__(self) -> None:
        require_limits(self)
