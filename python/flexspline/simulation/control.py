"""What drives a simulated joint, stops it, and where it starts."""

from __future__ import annotations

from dataclasses import dataclass

from flexspline.errors import InputError
from flexspline.simulation.parts import above, at_least, require_limits, whole

__all__ = ["Servo", "Start", "Stop"]


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
