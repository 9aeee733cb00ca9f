"""Forward simulation of a joint: motor, strain wave gear, friction that sticks, link, heat.

`Joint(Gear(…), Motor(…), Output(…)).simulate(time, motor_torque=…)` gives a `Trajectory`, which
is what truly happened; `trajectory.log(output_encoder=…, noise=…)` is what a rig would have seen.
"""

from flexspline.simulation.control import Servo, Start, Stop
from flexspline.simulation.friction import Friction, SlipElement
from flexspline.simulation.joint import Joint
from flexspline.simulation.measure import Encoder, Noise, TorqueSensor
from flexspline.simulation.parts import Gear, Harmonic, Motor, Obstacle, Output, Thermal
from flexspline.simulation.trajectory import Trajectory

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
