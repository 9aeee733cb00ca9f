"""A simulated joint: its parts, and the run through time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexspline import _core
from flexspline.errors import InputError
from flexspline.simulation.control import Servo, Start, Stop
from flexspline.simulation.fields import joint_fields, servo_fields, stop_fields
from flexspline.simulation.inputs import column, increasing, wanted
from flexspline.simulation.parts import Gear, Motor, Obstacle, Output, Thermal
from flexspline.simulation.steps import Choice, Steps, run
from flexspline.simulation.trajectory import Trajectory

__all__ = ["Joint"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Joint:
    """A joint with a strain wave gear; every number that is left at zero is physics left out.

    Parameters
    ----------
    gear, motor, output : what it is made of.
    thermal, obstacle : what surrounds it.
    name : goes into the facts of its logs.

    Notes
    -----
    J_m θ̈ = τ_m − (τ + z/Ñ) (1 + ∂θ_err/∂θ) − friction and
    J q̈ = (τ + z/Ñ) (Ñ − ∂θ_err/∂q) − τ_load − gravity · sin(q − q₀) − ripple − friction, τ the
    spring's torque at the wave generator, z the hysteresis beside it, which sees the wind-up as
    the spring does. A rigid gear gives (J + Ñ² J_m) q̈ = Ñ τ_m − …. Signs as in a log:
    τ_load is positive when the joint pushes outward. Source: full_range_torque_estimation Fig. 3.
    """

    gear: Gear = field(default_factory=Gear)
    motor: Motor = field(default_factory=Motor)
    output: Output = field(default_factory=Output)
    thermal: Thermal = field(default_factory=Thermal)
    obstacle: Obstacle | None = None
    name: str = field(default="simulated joint", compare=False)

    def __post_init__(self) -> None:
        if not self.gear.rigid and not self.motor.inertia > 0:
            raise InputError(
                "simulation: the gear is compliant but Motor.inertia is 0; give the rotor's "
                "inertia, or leave the stiffnesses at 0"
            )
        most = _core.simulation_elements
        if len(self.gear.hysteresis) + len(self.output.presliding) > most:
            raise InputError(f"simulation: more than {most} slip elements; give fewer")

    @property
    def effective_ratio(self) -> float:
        """Ñ, turns of the motor per turn of the output."""
        return self.gear.effective_ratio

    def simulate(
        self,
        time: ArrayLike,
        *,
        motor_torque: ArrayLike | None = None,
        servo: Servo | None = None,
        position_command: ArrayLike | None = None,
        velocity_command: ArrayLike | None = None,
        load_torque: ArrayLike | None = None,
        room_temperature: ArrayLike | None = None,
        start: Start | None = None,
        stop: Stop | None = None,
        inputs: str = "linear",
        steps_per_sample: int | None = None,
        accuracy: float | None = None,
        order: int | None = None,
        channels: Sequence[str] | None = None,
    ) -> Trajectory:
        """Drive the joint through time.

        Parameters
        ----------
        time : (N,), s, strictly increasing; the rows of the result.
        motor_torque : (N,) or a number, Nm at the motor side; a servo's feed-forward.
        servo : closes the loop on the commands.
        position_command, velocity_command : (N,) or a number, rad and rad/s at the output.
        load_torque : (N,) or a number, Nm at the output, what the joint pushes on outside.
        room_temperature : (N,) or a number, °C; 25 where nothing is given.
        start : where it starts; `trajectory.end` goes on with an earlier run.
        stop : when and how the motor stops.
        inputs : torques between rows are "linear", or "hold" the value of the row before.
        steps_per_sample : inner steps for the longest interval of `time`; None chooses from the
            fastest eigenfrequency, with gear as stiff as the run turns out to make it.
        accuracy : relative error of that frequency to aim at, 1e-13 … 1e-4, where the steps are
            chosen; None means 2.4e-7, a quarter radian a step of fourth order.
        order : of the steps, 4 or 6. None takes the one that needs less work where the steps are
            chosen, else 4; and power series, without steps of an order, for smooth joints with
            losses. Order 6 is for joints in which nothing sticks, slips or touches.
        channels : of the trajectory; None keeps all of `trajectory.CHANNELS`.

        Returns
        -------
        Trajectory
            What truly happened, and where it ended.

        Raises
        ------
        InputError
            For inputs that do not fit together or are not finite, a step that cannot be stable,
            or a motion that the gear cannot follow.

        Notes
        -----
        Fixed steps of order 4 or 6, symplectic where nothing is lost: without friction and
        damping the energy swings about its value and does not drift. Changes between sticking
        and sliding, slipping elements and the obstacle are located within the step; a joint that
        sticks does not creep. Temperatures follow once a row, or once a servo tick.

        A joint with losses in which nothing sticks, slips or touches, without harmonics and
        without a soft wave generator, goes by power series in time unless `steps_per_sample` or
        `order` is given: each one to as many terms and as far as `accuracy` lets it, over many
        rows where the torques are straight lines, to the next kink where they are not.
        """
        times, longest = increasing(time)
        given = {
            "motor_torque": motor_torque,
            "position_command": position_command,
            "velocity_command": velocity_command,
            "load_torque": load_torque,
            "room_temperature": room_temperature,
        }
        columns = {
            name: column(name, value, len(times))
            for name, value in given.items()
            if value is not None
        }
        self._require_commands(columns, servo, stop)
        if inputs not in ("linear", "hold"):
            raise InputError(f"simulation: inputs is '{inputs}'; give 'linear' or 'hold'")
        begin = self._start(start or Start(), columns)
        options = {**servo_fields(servo), **stop_fields(stop)}
        choice = Choice(steps_per_sample, accuracy, order)
        names = wanted(channels)
        steps = Steps(times, columns, inputs == "hold", options, begin, names, longest)
        return Trajectory.of(self, times, run(self.core, steps, choice))

    def windup(self, transmitted_torque: ArrayLike) -> Array:
        """Return the gear's wind-up, rad at the motor side, at torques in Nm at the output.

        It is −Δθ without the kinematic error: (15) and (16) with the signs of the log.
        """
        torque = np.atleast_1d(np.asarray(transmitted_torque, dtype=float))
        return _core.simulation_windup(self.core, torque)

    def transmitted_torque(self, windup: ArrayLike) -> Array:
        """Return the torque, Nm at the output, at wind-ups in rad at the motor side.

        The inverse of `windup`; infinite beyond the pole of the spring.
        """
        return _core.simulation_torque(self.core, np.atleast_1d(np.asarray(windup, dtype=float)))

    @cached_property
    def core(self) -> _core.SimulatedJoint:
        """The same in the core."""
        return _core.SimulatedJoint(joint_fields(self))

    def _require_commands(
        self, columns: dict[str, Array], servo: Servo | None, stop: Stop | None
    ) -> None:
        told = [name for name in ("position_command", "velocity_command") if name in columns]
        if told and servo is None:
            raise InputError(f"simulation: {told[0]} is given without a servo; give servo=Servo(…)")
        if servo is not None and servo.position_gain > 0 and "position_command" not in columns:
            raise InputError(
                "simulation: the servo has a position_gain but no position_command; give one, or "
                "position_gain=0 for a velocity loop"
            )
        reaction = stop.reaction if stop else ""
        if reaction == "hold" and (servo is None or servo.position_gain == 0):
            raise InputError(
                "simulation: Stop.reaction 'hold' needs a servo with a position_gain; give one, or "
                "'brake'"
            )
        if reaction == "brake" and self.motor.brake == 0:
            raise InputError(
                "simulation: Stop.reaction is 'brake' but the motor has none; give Motor.brake in "
                "Nm at the motor side"
            )

    def _start(self, start: Start, columns: dict[str, Array]) -> dict[str, Any]:
        fields = {k: v for k, v in vars(start).items() if v is not None}
        room = float(columns["room_temperature"][0]) if "room_temperature" in columns else 25.0
        load = float(columns["load_torque"][0]) if "load_torque" in columns else 0.0
        angle = start.output_position - self.output.gravity_angle
        return {
            "motor_temperature": room,
            "body_temperature": room,
            "transmitted_torque": load + self.output.gravity * math.sin(angle),
            **fields,
        }
