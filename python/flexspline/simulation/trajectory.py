"""What truly happened in a simulation, and what encoders and sensors make of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from flexspline import _core
from flexspline.errors import InputError, did_you_mean, listed
from flexspline.simulation.control import Start

if TYPE_CHECKING:
    from flexspline.logs.log import Log
    from flexspline.simulation.joint import Joint
    from flexspline.simulation.measure import Encoder, Noise, TorqueSensor

__all__ = ["CHANNELS", "Trajectory"]

Array = NDArray[np.float64]

CHANNELS: Mapping[str, str] = MappingProxyType(
    {
        "output_position": "rad",
        "output_velocity": "rad/s",
        "output_acceleration": "rad/s²",
        "motor_position": "rad",
        "motor_velocity": "rad/s",
        "motor_torque": "Nm at the motor side, current ripple included",
        "wave_generator_torque": "Nm at the motor side, through the gear's spring",
        "transmitted_torque": "Nm, from the gear to the output side: spring, hysteresis, damping",
        "link_torque": "Nm, from the sensor to the link: load, gravity, inertia of the link",
        "load_torque": "Nm, what the joint pushes on outside, obstacle included",
        "contact_torque": "Nm, on the obstacle",
        "gravity_torque": "Nm, that the joint needs against gravity",
        "motor_friction": "Nm at the motor side, against motion; what holds it where it sticks",
        "output_friction": "Nm; of a rigid gear the friction of both sides",
        "hysteresis_torque": "Nm, of all slip elements",
        "motor_temperature": "°C",
        "body_temperature": "°C, of the joint's body and its sensor",
        "motor_stuck": "0/1",
        "output_stuck": "0/1",
        "stopped": "0/1, the motor was stopped",
        "kinetic_energy": "J",
        "elastic_energy": "J, in gear, slip elements and obstacle",
        "gravity_energy": "J, 0 where the link hangs",
        "motor_work": "J since the start, put in by the motor, less cogging",
        "load_work": "J since the start, given to the load torque and the ripple",
        "motor_friction_heat": "J since the start",
        "output_friction_heat": "J since the start",
        "gear_heat": "J since the start: hysteresis, presliding and structural damping",
        "obstacle_heat": "J since the start",
        "copper_heat": "J since the start",
    }
)


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory:
    """What truly happened.

    Parameters
    ----------
    joint : what was simulated.
    time : (N,), s.
    columns : arrays (N,) by the names and units of `CHANNELS`.
    end : where it ended; `Joint.simulate(start=trajectory.end)` goes on.
    longest_step : s, of the inner steps.
    """

    joint: Joint
    time: Array
    columns: Mapping[str, Array]
    end: Start
    longest_step: float

    @classmethod
    def of(cls, joint: Joint, time: Array, result: Mapping[str, Any]) -> Trajectory:
        """Return the trajectory of a result of the core."""
        columns = {name: result["columns"][name] for name in result["columns"]}
        for column in columns.values():
            column.flags.writeable = False
        return cls(
            joint,
            time,
            MappingProxyType(columns),
            Start(**result["end"]),
            float(result["longest_step"]),
        )

    def __getitem__(self, name: str) -> Array:
        if name == "time":
            return self.time
        if name not in self.columns:
            raise InputError(
                f"trajectory: no channel '{name}'{did_you_mean(name, self.columns)}; "
                f"it has {listed(self.columns, 40)}"
            )
        return self.columns[name]

    def __len__(self) -> int:
        return len(self.time)

    def __repr__(self) -> str:
        return (
            f"<Trajectory of '{self.joint.name}': {len(self)} rows, "
            f"{self.time[-1] - self.time[0]:.6g} s, steps of {self.longest_step:.3g} s>"
        )

    @property
    def torsion(self) -> Array:
        """Δθ = q Ñ − θ, rad at the motor side; negative where the joint pushes outward. (11)"""
        ratio = self.joint.effective_ratio
        return self["output_position"] * ratio - self["motor_position"]

    @property
    def wave_generator_on_flexspline(self) -> Array:
        """Angle of the wave generator against the flexspline, rad: where the gauges sit."""
        turns = 1.0 if self.joint.gear.output_spline == "flex" else 0.0
        return self["motor_position"] + turns * self["output_position"]

    @property
    def energy(self) -> Array:
        """Kinetic, elastic and gravity energy together, J."""
        return self["kinetic_energy"] + self["elastic_energy"] + self["gravity_energy"]

    @property
    def balance(self) -> Array:
        """Energy stored and lost less energy put in, since the start, J: zero but for the steps.

        Ripple and cogging count as work of load and motor. Second order in the step.
        """
        lost = sum(self[f"{part}_heat"] for part in ("motor_friction", "output_friction", "gear"))
        given = self["motor_work"] - self["load_work"]
        change = self.energy - self.energy[0]
        return np.asarray(change + lost + self["obstacle_heat"] - given)

    def log(
        self,
        *,
        name: str = "simulated",
        rate: float | None = None,
        output_encoder: Encoder | None = None,
        motor_encoder: Encoder | None = None,
        sensor: TorqueSensor | None = None,
        noise: Mapping[str, Noise] | None = None,
        seed: int = 0,
        channels: Sequence[str] | None = None,
        facts: Mapping[str, str | float | int] | None = None,
    ) -> Log:
        """Return what a rig would have written down; see `measure.measured` for parameters."""
        from flexspline.simulation.measure import Instruments, measured

        instruments = Instruments(output_encoder, motor_encoder, sensor, noise or {}, seed)
        return measured(self, instruments, name=name, rate=rate, channels=channels, facts=facts)


if tuple(CHANNELS) != tuple(_core.simulation_columns):
    raise ImportError("flexspline: the core was built from other sources; build it again")
