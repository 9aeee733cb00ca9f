"""Forward simulation of a joint: motor, strain wave gear, friction that sticks, link, heat.

`Joint(Gear(…), Motor(…), Output(…)).simulate(time, motor_torque=…)` gives a `Trajectory`, which
is what truly happened; `trajectory.log(output_encoder=…, noise=…)` is what a rig would have seen.
"""

from flexspline.simulation.joint import Joint
from flexspline.simulation.parts import (
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
from flexspline.simulation.trajectory import Encoder, Noise, TorqueSensor, Trajectory

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


def __dir__() -> list[str]:
    return __all__
