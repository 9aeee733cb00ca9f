"""Forward simulation of a joint: motor, strain wave gear, friction that sticks, link, heat.

`Joint(Gear(…), Motor(…), Output(…)).simulate(time, motor_torque=…)` gives a `Trajectory`, which
is what truly happened; `trajectory.log(output_encoder=…, noise=…)` is what a rig would have seen.

Arguments are validated, converted to those of the core, and integrated in inner steps of a length
that the joint's own time constants require.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexspline import _core
from flexspline.errors import InputError, did_you_mean, listed
from flexspline.simulation.parts import (
    PAIRS,
    Friction,
    Gear,
    Harmonic,
    Motor,
    Obstacle,
    Output,
    Servo,
    SlipElement,
    Start,
    Stop,
    Thermal,
)
from flexspline.simulation.trajectory import CHANNELS, Encoder, Noise, TorqueSensor, Trajectory

__all__ = [
    "Encoder",
    "Friction",
    "Gear",
    "Harmonic",
    "Joint",
    "Motor",
    "Noise",
    "Obstacle",
    "Output",
    "Servo",
    "SlipElement",
    "Start",
    "Stop",
    "Thermal",
    "TorqueSensor",
    "Trajectory",
]


Array = NDArray[np.float64]

KICKS = {4: 4, 6: 10}  # evaluations of all torques in a step, by its order
WRONG = {4: 6.05e-5, 6: 1.51e-7}  # a frequency's relative error, in units of (ω h)^order
STABLE = {4: 2.98, 6: 3.13}  # ω h at which a method ends (composition.hpp)
ACCURACY = WRONG[4] * 0.25**4  # 25 steps per period of the fastest mode
IN_A_LEAP = 0.1  # share of the accuracy: a leap is some radians of the fastest mode
LOOSER = 33.0  # times the accuracy that is left where a gear grows stiffer under torque
FASTEST_DECAY = 1.5  # decay times h, by the series of a kick
MOST_STEPS = 2e9
FINEST = 1 / 256  # of the step that the gear asks for at rest: 65 thousand times its stiffness
NONE, POLE, NOT_FINITE, UNSTABLE = range(4)

Fields = dict[str, Any]


def __dir__() -> list[str]:
    return __all__


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


def wanted(channels: Sequence[str] | None) -> list[str]:
    if channels is None:
        return list(CHANNELS)
    for name in channels:
        if name not in CHANNELS:
            raise InputError(
                f"simulation: '{name}' is no channel of a trajectory"
                f"{did_you_mean(name, CHANNELS)}; the channels are {listed(CHANNELS, 40)}"
            )
    return list(channels)


def increasing(time: ArrayLike) -> tuple[Array, float]:
    """Return the times and the longest interval between two of them."""
    times = np.ascontiguousarray(time, dtype=float)
    if times.ndim != 1 or len(times) < 2:
        raise InputError(
            f"simulation: time has shape {times.shape}; give one dimension with two rows or more"
        )
    with np.errstate(invalid="ignore"):
        intervals = times[1:] - times[:-1]
    longest = float(intervals.max())
    if not (intervals.min() > 0 and math.isfinite(longest)):
        _refuse(times, intervals)
    return times, longest


def _refuse(times: Array, intervals: Array) -> None:
    finite = np.isfinite(times)
    if not finite.all():
        bad = np.flatnonzero(~finite)
        raise InputError(f"simulation: time is not finite in row {bad[0]}; give every time in s")
    back = np.flatnonzero(~(intervals > 0))
    raise InputError(
        f"simulation: time does not increase from row {back[0]} to row {back[0] + 1}; "
        "give strictly increasing times"
    )


def column(name: str, value: ArrayLike, rows: int) -> Array:
    data = np.asarray(value, dtype=float)
    if data.ndim == 0:
        data = np.full(rows, float(data))
    if data.shape != (rows,):
        raise InputError(
            f"simulation: {name} has shape {data.shape} where time has {rows} rows; "
            "give one number for each row, or one for all"
        )
    finite = np.isfinite(data)
    if not finite.all():
        bad = np.flatnonzero(~finite)
        raise InputError(
            f"simulation: {name} is {data[bad[0]]} in row {bad[0]}; give finite numbers"
        )
    return np.ascontiguousarray(data)


def joint_fields(joint: Joint) -> dict[str, Any]:
    """Return a joint in the words of the core."""
    n, obstacle = joint.effective_ratio, asdict(joint.obstacle) if joint.obstacle else {}
    return {
        "ratio": n,
        **_gear(joint.gear),
        **_motor(joint.motor),
        **_output(joint.output),
        "elements": [
            *_elements(joint.gear.hysteresis, 1.0 / n, -1.0),
            *_elements(joint.output.presliding, 0.0, 1.0),
        ],
        **asdict(joint.thermal),
        **{f"obstacle_{name}": value for name, value in obstacle.items()},
    }


def _gear(gear: Gear) -> dict[str, Any]:
    return {
        "output_spline": gear.output_spline,
        "mesh_stiffness": gear.mesh_stiffness,
        "mesh_shape": gear.mesh_shape,
        "wave_generator_stiffness": gear.wave_generator_stiffness,
        "wave_generator_shape": gear.wave_generator_shape,
        "damping": gear.damping,
        "kinematic_error": _waves(gear.kinematic_error),
    }


def _motor(motor: Motor) -> dict[str, Any]:
    constant = motor.torque_constant
    return {
        "motor_inertia": motor.inertia,
        "motor_friction": asdict(motor.friction),
        "current_ripple": _waves(motor.current_ripple),
        "cogging": _waves(motor.cogging),
        "brake": motor.brake,
        "copper_loss": motor.resistance / constant**2 if constant else 0.0,
    }


def _output(output: Output) -> dict[str, Any]:
    link = output.inertia if output.link_inertia is None else output.link_inertia
    return {
        "output_inertia": output.inertia,
        "link_inertia": link,
        "gravity": output.gravity,
        "gravity_angle": output.gravity_angle,
        "output_friction": asdict(output.friction),
        "output_ripple": _waves(output.ripple),
        "friction_ripple": _waves(output.friction_ripple),
    }


def servo_fields(servo: Servo | None) -> dict[str, Any]:
    """Return a servo in the words of the core."""
    if servo is None:
        return {}
    return {
        "servo_period": 1.0 / servo.rate,
        "position_gain": servo.position_gain,
        "velocity_gain": servo.velocity_gain,
        "integral_gain": servo.integral_gain,
        "torque_limit": servo.torque_limit,
        "reads_output": servo.feedback == "output",
        "encoder_step": 2.0 * math.pi / 2**servo.encoder_bits if servo.encoder_bits else 0.0,
        "servo_delay": servo.delay,
    }


def stop_fields(stop: Stop | None) -> dict[str, Any]:
    """Return a stop in the words of the core."""
    if stop is None:
        return {}
    fields: dict[str, Any] = {
        "stop_delay": stop.delay,
        "stop_reaction": ("release", "brake", "hold").index(stop.reaction),
    }
    if stop.time is not None:
        fields["stop_time"] = stop.time
    if stop.threshold is not None:
        fields["stop_threshold"] = stop.threshold
    return fields


def _waves(harmonics: Iterable[Harmonic]) -> list[tuple[int, float, float, int]]:
    return [(int(h.order), h.amplitude, h.phase, PAIRS.index(h.pair)) for h in harmonics]


def _elements(
    elements: Iterable[SlipElement], motor: float, output: float
) -> list[tuple[float, float, float, float]]:
    """Elements in the core's coordinate, which winds up positively outward."""
    return [(e.stiffness, e.level, motor, output) for e in elements]


@dataclass(frozen=True, eq=False)
class Steps:
    """A run, but for the length of its steps; `longest` is that of its rows, s."""

    time: NDArray[np.float64]
    inputs: dict[str, NDArray[np.float64]]
    hold: bool
    options: Fields
    start: Fields
    channels: Sequence[str]
    longest: float

    def once(
        self,
        joint: _core.SimulatedJoint,
        step: float,
        order: int,
        coarsest: float = math.inf,
        leap: Fields | None = None,
    ) -> Fields:
        """Run with steps of at most `step` seconds, up to where ω h passes `coarsest`.

        With `leap`, power series of its accuracy take the place of all steps but a brake's.
        """
        how = {"longest_step": step, "order": order, "coarsest": coarsest}
        options = {**self.options, **how, **(leap or {})}
        result = _core.simulate(
            joint, self.time, self.inputs, self.hold, options, self.start, list(self.channels)
        )
        result["longest_step"] = result["longest_leap"] if leap else step
        return result


@dataclass(frozen=True)
class Choice:
    """What a caller says about the steps: how many, how good, of which order; None is open."""

    count: int | None = None
    accuracy: float | None = None
    order: int | None = None

    def __post_init__(self) -> None:
        if self.order not in (None, 4, 6):
            raise InputError(f"simulation: order is {self.order!r}; give 4, 6 or None")
        if self.accuracy is None:
            return
        if self.count is not None:
            raise InputError("simulation: accuracy and steps_per_sample are both given; give one")
        if not 1e-13 <= self.accuracy <= 1e-4:
            raise InputError(
                f"simulation: accuracy is {self.accuracy!r}; give a number from 1e-13 to 1e-4"
            )

    def phase(self, order: int) -> float:
        """Return ω h to aim at."""
        wanted = ACCURACY if self.accuracy is None else self.accuracy
        return min(1.2, math.pow(wanted / WRONG[order], 1.0 / order))

    def orders(self, joint: _core.SimulatedJoint) -> tuple[int, ...]:
        """Return the orders to choose from."""
        if self.order == 6 and not joint.eventless:
            raise InputError(
                "simulation: order 6 is for joints in which nothing sticks, slips or touches; give "
                "4 or None"
            )
        if self.order is not None:
            return (self.order,)
        return (4, 6) if joint.eventless and self.count is None else (4,)


def run(joint: _core.SimulatedJoint, steps: Steps, choice: Choice) -> Fields:
    """Run with the caller's steps, by power series, or as the eigenfrequencies ask for.

    Raises
    ------
    InputError
        For steps that cannot be stable, too many of them, or a motion without bound.
    """
    frequency, decay = _core.simulation_rates(joint, 0.0)
    longest = steps.longest
    orders = choice.orders(joint)
    if choice.count is not None:
        step = _given(choice.count, longest, frequency, decay, STABLE[orders[0]])
        result = steps.once(joint, step, orders[0])
    elif joint.expandable and choice.order is None:
        step = _step(choice.phase(4), 4, longest, frequency, decay)
        accuracy = IN_A_LEAP * (choice.accuracy or ACCURACY)
        leap = {"accuracy": accuracy, "shortest_leap": step * FINEST}
        result = _refined(joint, steps, step, 4, choice.phase(4), leap)
    else:
        found = {k: _step(choice.phase(k), k, longest, frequency, decay) for k in orders}
        order = min(orders, key=lambda k: KICKS[k] * math.ceil(longest / found[k] - 1e-9))
        result = _refined(joint, steps, found[order], order, choice.phase(order))
    _require_sound(result, steps)
    return result


def _step(phase: float, order: int, longest: float, frequency: float, decay: float) -> float:
    """Seconds of a step; friction in a step is a series, of which order 6 takes half the way."""
    damped = phase if order == 4 else phase / 2
    least = 1e-300  # 1/s, for a joint without a spring or without losses
    return min(longest, phase / max(frequency, least), damped / max(decay, least))


def _given(count: int, longest: float, frequency: float, decay: float, stable: float) -> float:
    if count != int(count) or count < 1:
        raise InputError(
            f"simulation: steps_per_sample is {count!r}; give a whole number of at least 1"
        )
    step = longest / count
    if frequency * step >= stable or decay * step >= FASTEST_DECAY:
        least = int(longest * max(frequency / stable, decay / FASTEST_DECAY)) + 1
        raise InputError(
            f"simulation: {count} steps per sample of {longest:g} s cannot be stable, the joint's "
            f"fastest mode has {frequency:.4g} rad/s and its fastest decay {decay:.4g} 1/s; give "
            f"more than {least}, or None"
        )
    return step


def _refined(
    joint: _core.SimulatedJoint,
    steps: Steps,
    step: float,
    order: int,
    aim: float,
    leap: Fields | None = None,
) -> Fields:
    """Repeat with shorter steps while the gear is stiffer under torque than they allow."""
    span = float(steps.time[-1] - steps.time[0])
    finest = step * FINEST
    coarsest = aim * LOOSER ** (1.0 / order)
    while True:
        if span / step > MOST_STEPS:
            raise InputError(
                f"simulation: {span:g} s would take {span / step:.2g} steps of {step:.2g} s; "
                "simulate a shorter time or a softer gear"
            )
        result = steps.once(joint, step, order, coarsest, leap)
        phase = result["largest_phase"]
        if result["fault"] == NONE and phase <= coarsest:
            return result
        if step <= finest:
            result["fault"] = POLE if result["fault"] in (NONE, UNSTABLE) else result["fault"]
            return result
        grown = math.isfinite(phase) and phase > coarsest
        step = max(finest, step * (max(aim / phase, 1 / 16) if grown else 1 / 4))


def _require_sound(result: Fields, steps: Steps) -> None:
    fault, row = result["fault"], result["row"]
    if fault == NONE:
        return
    where = f"simulation: after row {row} ({steps.time[row]:.6g} s)"
    if fault == UNSTABLE:
        raise InputError(
            f"{where} the gear is so stiff under its torque that steps of "
            f"{result['longest_step']:.3g} s cannot be stable; give more steps_per_sample, or None"
        )
    if fault == POLE:
        raise InputError(
            f"{where} the gear is wound up to the end of its spring, where its stiffness has no "
            "bound; give smaller torques or speeds, a stable servo, or a smaller mesh_shape"
        )
    raise InputError(
        f"{where} the motion grows without bound; check friction that drives (a negative cubic "
        "or quadratic), servo gains and torques"
    )
