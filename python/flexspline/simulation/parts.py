"""What a simulated joint is made of: gear, motor, output, friction, and what drives and stops it.

Limits of its numbers are stated beside each field and checked alike.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from flexspline.errors import InputError, did_you_mean, listed

__all__ = [
    "PAIRS",
    "Friction",
    "Gear",
    "Harmonic",
    "Motor",
    "Obstacle",
    "Output",
    "Servo",
    "SlipElement",
    "Start",
    "Stop",
    "Thermal",
    "above",
    "at_least",
    "require_limits",
    "whole",
]

PAIRS = (
    "output_on_housing",
    "motor_on_stator",
    "wave_generator_on_flexspline",
    "wave_generator_on_circular_spline",
)


def whole(lowest: int, highest: int, default: int) -> Any:
    """Return a dataclass field whose number is whole and within [lowest, highest]."""
    return dataclasses.field(default=default, metadata={"whole": (lowest, highest)})


@dataclass(frozen=True)
class Harmonic:
    """One sinusoid of an angle between two parts: amplitude · cos(order · β + phase).

    Parameters
    ----------
    order : periods per turn of the pair, 1 … 1 000 000.
    amplitude : in the unit of the place where it stands.
    phase : rad.
    pair : one of `PAIRS`.
    """

    order: int = whole(1, 1_000_000, 1)
    amplitude: float = 0.0
    phase: float = 0.0
    pair: str = "output_on_housing"

    def __post_init__(self) -> None:
        require_limits(self)
        if self.pair not in PAIRS:
            raise InputError(
                f"simulation: Harmonic.pair '{self.pair}' is no pair of parts"
                f"{did_you_mean(self.pair, PAIRS)}; known are {listed(PAIRS)}"
            )


def at_least(lowest: float, default: float = 0.0) -> Any:
    """Return a dataclass field whose number is ≥ `lowest`."""
    return dataclasses.field(default=default, metadata={"least": lowest})


def above(bound: float, default: float) -> Any:
    """Return a dataclass field whose number is > `bound`."""
    return dataclasses.field(default=default, metadata={"above": bound})


@dataclass(frozen=True)
class Gear:
    """A strain wave gear. Without stiffness it is rigid and the joint has one mass.

    Parameters
    ----------
    ratio : N; the motor turns Ñ = N + 1 times where the circular spline is the output, else N.
    output_spline : "circular", "flex", or "" for a gear that has none.
    mesh_stiffness : K_m0, Nm/rad at the output; 0 is rigid.
    mesh_shape : c_m, 1/Nm at the output; 0 is linear. (15)
    wave_generator_stiffness : K_w0, Nm/rad at the motor side; 0 is rigid.
    wave_generator_shape : c_w, 1/Nm at the motor side; 0 is linear. (16)
    damping : Nm s/rad at the output, structural: times θ̇/Ñ − q̇.
    kinematic_error : harmonics in rad at the motor side. (23)
    hysteresis : slip elements between both sides.

    Notes
    -----
    Source: full_range_torque_estimation (9)–(16), (23), Table III.
    """

    ratio: float = above(0.0, 100.0)
    output_spline: str = "circular"
    mesh_stiffness: float = at_least(0.0)
    mesh_shape: float = at_least(0.0)
    wave_generator_stiffness: float = at_least(0.0)
    wave_generator_shape: float = at_least(0.0)
    damping: float = at_least(0.0)
    kinematic_error: Sequence[Harmonic] = ()
    hysteresis: Sequence[SlipElement] = ()

    def __post_init__(self) -> None:
        require_limits(self)
        if self.output_spline not in ("circular", "flex", ""):
            raise InputError(
                f"simulation: Gear.output_spline is '{self.output_spline}'; "
                "give 'circular', 'flex' or ''"
            )
        if self.rigid and (self.hysteresis or self.damping):
            raise InputError(
                "simulation: Gear has hysteresis or damping but no stiffness; give mesh_stiffness "
                "or wave_generator_stiffness, or leave them out"
            )

    @property
    def rigid(self) -> bool:
        """Whether the joint has one mass."""
        return self.mesh_stiffness == 0.0 and self.wave_generator_stiffness == 0.0

    @property
    def effective_ratio(self) -> float:
        """Ñ."""
        return self.ratio + (self.output_spline == "circular")


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
class Motor:
    """Rotor and wave generator.

    Parameters
    ----------
    inertia : kg m² at the motor side; > 0 with a compliant gear.
    friction : Nm and rad/s at the motor side.
    current_ripple : harmonics in Nm at the motor side, part of `motor_torque`.
    cogging : harmonics in Nm at the motor side, against positive motion, not in `motor_torque`.
    torque_constant : Nm/A; 0 where no current is wanted.
    resistance : Ω; heats the motor with i²; needs a torque constant.
    brake : Nm at the motor side, of the brake when it holds.
    """

    inertia: float = at_least(0.0)
    friction: Friction = field(default_factory=Friction)
    current_ripple: Sequence[Harmonic] = ()
    cogging: Sequence[Harmonic] = ()
    torque_constant: float = at_least(0.0)
    resistance: float = at_least(0.0)
    brake: float = at_least(0.0)

    def __post_init__(self) -> None:
        require_limits(self)
        if self.resistance > 0 and self.torque_constant == 0:
            raise InputError(
                "simulation: Motor.resistance heats by the current; give torque_constant as well"
            )


@dataclass(frozen=True)
class Output:
    """Link side.

    Parameters
    ----------
    inertia : kg m², all that turns with q, > 0.
    link_inertia : kg m², the part of it beyond the torque sensor; None means all.
    gravity : m g l, Nm; the torque on the joint is −gravity · sin(q − gravity_angle).
    gravity_angle : rad, q where the link hangs.
    friction : Nm and rad/s at the output.
    ripple : harmonics in Nm, against positive motion.
    friction_ripple : harmonics, as shares of the Coulomb level.
    presliding : slip elements between output and housing: elastic before it slips.
    """

    inertia: float = above(0.0, 1.0)
    link_inertia: float | None = None
    gravity: float = at_least(0.0)
    gravity_angle: float = 0.0
    friction: Friction = field(default_factory=Friction)
    ripple: Sequence[Harmonic] = ()
    friction_ripple: Sequence[Harmonic] = ()
    presliding: Sequence[SlipElement] = ()

    def __post_init__(self) -> None:
        require_limits(self)
        if self.link_inertia is not None and not 0 <= self.link_inertia <= self.inertia:
            raise InputError(
                f"simulation: Output.link_inertia is {self.link_inertia!r} of an inertia of "
                f"{self.inertia!r}; give a part of it"
            )
        if sum(abs(h.amplitude) for h in self.friction_ripple) > 1.0:
            raise InputError(
                "simulation: Output.friction_ripple adds up to more than 1, so the friction "
                "could push; give shares whose sum is at most 1"
            )


@dataclass(frozen=True)
class Thermal:
    """Heat: motor and joint body in a room, heated by winding and friction.

    Parameters
    ----------
    motor_capacity, body_capacity : J/K; 0 keeps the room's temperature.
    motor_to_body, motor_to_room, body_to_room : W/K.

    Notes
    -----
    The motor's friction heats the motor, all other friction the body, whose temperature is that
    of the torque sensor.
    """

    motor_capacity: float = at_least(0.0)
    body_capacity: float = at_least(0.0)
    motor_to_body: float = at_least(0.0)
    motor_to_room: float = at_least(0.0)
    body_to_room: float = at_least(0.0)

    def __post_init__(self) -> None:
        require_limits(self)


@dataclass(frozen=True)
class Obstacle:
    """A stop in the way of the output: torque k δ (1 + λ δ̇) at the depth δ ≥ 0.

    Parameters
    ----------
    angle : rad, q where it is touched.
    stiffness : k, Nm/rad.
    dissipation : λ, s/rad.
    direction : +1 stops positive motion, −1 negative motion.

    Notes
    -----
    Source: [HuntCrossley1975]: the torque has no jump at the touch.
    """

    angle: float = 0.0
    stiffness: float = above(0.0, 1e3)
    dissipation: float = at_least(0.0)
    direction: int = 1

    def __post_init__(self) -> None:
        require_limits(self)
        if self.direction not in (-1, 1):
            raise InputError(f"simulation: Obstacle.direction is {self.direction!r}; give 1 or -1")


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


def require_limits(owner: Any) -> None:
    """Raise InputError, with the name of the field, for a number outside its limits."""
    for each in dataclasses.fields(owner):
        value = getattr(owner, each.name)
        remedy = ""
        if "whole" in each.metadata:
            low, high = each.metadata["whole"]
            if not (isinstance(value, (int, float)) and value % 1 == 0 and low <= value <= high):
                remedy = f"a whole number from {low} to {high}"
        elif each.metadata or isinstance(value, (int, float)):
            remedy = _remedy(each.metadata, value)
        if remedy:
            name = f"{type(owner).__name__}.{each.name}"
            raise InputError(f"simulation: {name} is {value!r}; give {remedy}")


def _remedy(limits: Mapping[Any, Any], value: Any) -> str:
    """Return what to give instead of `value`, or nothing."""
    if not isinstance(value, (int, float)) or not math.isfinite(value):
        return "a finite number"
    if "least" in limits and value < limits["least"]:
        return f"a number of at least {limits['least']:g}"
    if "above" in limits and not value > limits["above"]:
        return f"a number above {limits['above']:g}"
    return ""


@dataclass(frozen=True)
class Servo:
    """A servo law at its own rate; its commands are given to `Joint.simulate`.

    ω_ref = position_gain (Ñ q_ref − θ) + Ñ q̇_ref;
    τ_m = velocity_gain (ω_ref − θ̇) + I + feed-forward;  İ = integral_gain (ω_ref − θ̇).

    Parameters
    ----------
    rate : Hz, ticks per second.
    position_gain : 1/s; 0 leaves a velocity loop.
    velocity_gain : Nm s/rad at the motor side.
    integral_gain : Nm/rad at the motor side; stands while the limit holds.
    torque_limit : Nm at the motor side.
    feedback : "motor" or "output": the encoder that it reads.
    encoder_bits : per turn of that encoder, whose differences are the velocity; 0 is exact.
    delay : ticks from the reading to the torque, 0 … 64.
    """

    rate: float = above(0.0, 1000.0)
    position_gain: float = at_least(0.0)
    velocity_gain: float = at_least(0.0)
    integral_gain: float = at_least(0.0)
    torque_limit: float = above(0.0, 1e6)
    feedback: str = "motor"
    encoder_bits: int = whole(0, 32, 0)
    delay: int = whole(0, 64, 0)

    def __post_init__(self) -> None:
        require_limits(self)
        if self.feedback not in ("motor", "output"):
            raise InputError(
                f"simulation: Servo.feedback is '{self.feedback}'; give 'motor' or 'output'"
            )


@dataclass(frozen=True)
class Stop:
    """When the motor stops: at a time, or once the torque through the sensor is too large.

    For a detector of your own: simulate, run it over the log, and simulate again with
    `Stop(time=…)` at its first alarm. What happened before an alarm does not depend on it.

    Parameters
    ----------
    time : s; None for none.
    threshold : Nm, of |link_torque| at the rows of `time`; None for none.
    delay : s from the row that passes the threshold to the stop.
    reaction : "release" (no motor torque), "brake" (the brake falls, no motor torque) or "hold"
        (the servo holds the output's angle of that moment).
    """

    time: float | None = None
    threshold: float | None = None
    delay: float = at_least(0.0)
    reaction: str = "release"

    def __post_init__(self) -> None:
        require_limits(self)
        if self.reaction not in ("release", "brake", "hold"):
            raise InputError(
                f"simulation: Stop.reaction is '{self.reaction}'; give 'release', 'brake' or 'hold'"
            )
        if self.threshold is not None and not self.threshold > 0:
            raise InputError(
                f"simulation: Stop.threshold is {self.threshold!r} Nm; give a number above 0"
            )


@dataclass(frozen=True)
class Start:
    """Where a simulation starts.

    Parameters
    ----------
    output_position, output_velocity : rad, rad/s.
    motor_position : rad; None: where the gear carries gravity and the first load at rest.
    motor_velocity : rad/s; None: Ñ times the output's.
    motor_temperature, body_temperature : °C; None: the room's at the first row.
    memory : what a trajectory's `end` remembers beyond these numbers (sticking, hysteresis, the
        servo's integral, energy so far). With it a run goes on as if it had not been cut, and the
        numbers above are not read; `dataclasses.replace(end, memory=b"")` forgets it. It is valid
        in the build that made it.
    """

    output_position: float = 0.0
    output_velocity: float = 0.0
    motor_position: float | None = None
    motor_velocity: float | None = None
    motor_temperature: float | None = None
    body_temperature: float | None = None
    memory: bytes = b""

    def __post_init__(self) -> None:
        require_limits(self)
