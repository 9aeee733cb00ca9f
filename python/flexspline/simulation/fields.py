"""A simulated joint, its servo and its stop in the words of the core."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from flexspline.simulation.control import Servo, Stop
from flexspline.simulation.friction import SlipElement
from flexspline.simulation.parts import PAIRS, Gear, Harmonic, Motor, Output

if TYPE_CHECKING:
    from flexspline.simulation.joint import Joint

__all__ = ["joint_fields", "servo_fields", "stop_fields"]


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
