"""The rig of the second paper: one joint without load, then turning a wheel bearing.

Protocol (turlapati_intrinsic_dynamics §3.1): a trapezoid of motor torque of 30 s, at most 1 to
3 Nm, in alternating directions, without load; then two turns each way on a bearing beside a
load cell. Published levels: offset −0.12 Nm, ripple ±0.2 Nm, friction and offset a band of 0.4 Nm.

More physics than the model (16) that is fitted: Stribeck and load-dependent friction, presliding,
true sticking, temperature drift, a gain error of the sensor, ripple of the wave generator,
quantised encoders, coloured noise. What the paper does not print is drawn by `rig`.

The bearing's friction is part of the friction that the simulation integrates: its share of it,
sliding or at rest, is what the load cell reads.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexspline import simulation as sim
from flexspline.logs.derive import differentiate
from flexspline.logs.log import Log

__all__ = ["OFFSET", "RIPPLE", "TurlapatiRig", "turlapati_rig"]

Array = NDArray[np.float64]

RATE = 100.0  # Hz
SECONDS = 30.0
PEAKS = (1.0, 2.0, 3.0)  # Nm at the output
TURNS = 2  # each way on a bearing
OFFSET = -0.1189  # Nm
RIPPLE = 0.2  # Nm, the largest deflection of the ripple
REST = 0.02  # rad/s; a joint that sticks shows what it was left with, not its friction
ORDERS = (1, 2, 3, 4, 6)


@dataclass(frozen=True)
class TurlapatiRig:
    """A joint with its sensor, and the bearings that it turns.

    Parameters
    ----------
    joint : without a bearing.
    sensor : between gear and flange, so that it reads the flange bearing's friction too.
    bearing : friction of a good bearing, Nm and rad/s at the output; one Stribeck velocity with
        the joint's own.
    bearing_ripple : share by which its level varies over a turn.
    room : °C.
    seed : of noise and starting angles.
    """

    joint: sim.Joint
    sensor: sim.TorqueSensor
    bearing: sim.Friction
    bearing_ripple: float
    room: float
    seed: int

    def no_load(self, peaks: Sequence[float] = PEAKS) -> tuple[Log, ...]:
        """Return a run for each peak torque [Nm at the output], both directions in each."""
        rng = np.random.default_rng([self.seed, 1])
        return tuple(
            self._log(
                self._turned(self.joint, _trapezoid(peak), rng), f"no load {peak:g} Nm", rng, None
            )
            for peak in peaks
        )

    def bearing_run(self, trial: int = 1, level: float = 1.0) -> Log:
        """Return a run on a bearing with `level` times the friction of a good one.

        `reference_torque` is the load cell. Twice round each way, driven by a trapezoid of torque.
        """
        rng = np.random.default_rng([self.seed, 2, trial])
        bearing = _scaled(self.bearing, level)
        joint = self._with_bearing(bearing)
        torque = _trapezoid(self._driving(joint))
        trajectory = self._turned(joint, torque, rng)
        own = self.joint.output.friction
        share = _level(bearing, trajectory) / (
            _level(bearing, trajectory) + _level(own, trajectory)
        )
        held = trajectory["transmitted_torque"] - (
            joint.output.inertia * trajectory["output_acceleration"]
        )
        cell = share * held + rng.normal(0.0, 0.01, len(trajectory))
        return self._log(trajectory, f"bearing, trial {trial}", rng, cell)

    def _driving(self, joint: sim.Joint) -> float:
        """The peak of a trapezoid that makes about two turns each way, Nm at the output."""
        n = joint.effective_ratio
        speed = TURNS * 2 * np.pi / (0.37 * SECONDS)  # the time at the top, and the ramps' share
        motor, output = joint.motor.friction, joint.output.friction
        drag = n * (motor.coulomb_forward + motor.viscous * n * speed)
        return float(drag + output.coulomb_forward + output.viscous * speed)

    def _with_bearing(self, bearing: sim.Friction) -> sim.Joint:
        """The joint with the bearing's friction beside its own."""
        own = self.joint.output
        together = replace(
            own.friction,
            coulomb_forward=own.friction.coulomb_forward + bearing.coulomb_forward,
            coulomb_backward=own.friction.coulomb_backward + bearing.coulomb_backward,
            stribeck=own.friction.stribeck + bearing.stribeck,
            viscous=own.friction.viscous + bearing.viscous,
        )
        ripple = (sim.Harmonic(1, self.bearing_ripple, 0.7),)
        output = replace(own, friction=together, friction_ripple=ripple)
        return replace(self.joint, output=output)

    def _turned(self, joint: sim.Joint, torque: Array, rng: np.random.Generator) -> sim.Trajectory:
        from flexspline.simulation import Start

        time = np.arange(len(torque)) / RATE
        start = Start(output_position=float(rng.uniform(0.0, 2 * np.pi)))
        return joint.simulate(
            time,
            motor_torque=torque / joint.effective_ratio,
            room_temperature=self.room,
            start=start,
        )

    def _log(
        self, trajectory: sim.Trajectory, name: str, rng: np.random.Generator, cell: Array | None
    ) -> Log:
        log = trajectory.log(
            name=name,
            output_encoder=sim.Encoder(bits=17),
            sensor=self.sensor,
            noise={"sensor_torque": sim.Noise(0.03, memory=0.05)},
            seed=int(rng.integers(2**32)),
            channels=["output_position", "sensor_torque", "temperature"],
        )
        if cell is not None:
            log = log.with_columns({"reference_torque": cell}, note="load cell at the bearing")
        made = differentiate(log, bandwidth=5.0)
        moving = np.abs(made["output_velocity"]) > REST
        return made.rows(moving, note=f"rows at rest left out (below {REST:g} rad/s)")


def turlapati_rig(seed: int = 1) -> TurlapatiRig:
    """Return a rig; `seed` draws what the paper does not print.

    Printed and kept: offset −0.1189 Nm, ripple of at most 0.2 Nm, a band of friction 0.4 Nm wide.
    Drawn: how friction divides into its laws, phases and orders of the ripple, drift, gain error,
    the bearing's friction (0.8 to 1.3 Nm) and its variation over a turn.
    """
    rng = np.random.default_rng([seed, 0])
    stribeck_velocity = rng.uniform(0.05, 0.15)
    own = sim.Friction.both_ways(
        rng.uniform(0.12, 0.16),
        stribeck=rng.uniform(0.0, 0.05),
        stribeck_velocity=stribeck_velocity,
        viscous=rng.uniform(0.02, 0.06),
        load=rng.uniform(0.0, 0.04),
    )
    drive = sim.Friction.both_ways(
        rng.uniform(0.4, 0.6), viscous=rng.uniform(1.4, 2.0), stribeck=0.1, stribeck_velocity=0.1
    )
    joint = sim.Joint(
        sim.Gear(100.0, mesh_stiffness=9000.0, mesh_shape=0.05, damping=1.0),
        sim.Motor(inertia=2e-6, friction=drive.at_motor(101.0)),
        sim.Output(
            inertia=rng.uniform(0.015, 0.03),
            friction=own,
            presliding=(sim.SlipElement(stiffness=60.0, level=0.01),),
        ),
        sim.Thermal(motor_capacity=60.0, body_capacity=300.0, motor_to_body=0.4, body_to_room=0.5),
        name="joint 7",
    )
    level = rng.uniform(0.8, 1.3)
    bearing = sim.Friction.both_ways(
        level, stribeck=0.1 * level, stribeck_velocity=stribeck_velocity, viscous=0.1 * level
    )
    return TurlapatiRig(
        joint, _sensor(rng), bearing, rng.uniform(0.02, 0.08), rng.uniform(22.0, 28.0), seed
    )


def _sensor(rng: np.random.Generator) -> sim.TorqueSensor:
    """Offset and ripple as printed; gain, drift and the wave generator's ripple as drawn."""
    sizes = rng.dirichlet(np.full(len(ORDERS), 2.0))
    phases = rng.uniform(-np.pi, np.pi, len(ORDERS))
    angle = np.linspace(0.0, 2 * np.pi, 2000)
    shape = sum(
        size * np.cos(o * angle + phase)
        for o, size, phase in zip(ORDERS, sizes, phases, strict=True)
    )
    sizes = sizes * RIPPLE / np.abs(shape).max()
    ripple = [
        sim.Harmonic(o, float(size), float(phase))
        for o, size, phase in zip(ORDERS, sizes, phases, strict=True)
    ]
    waves = [
        sim.Harmonic(o, float(rng.uniform(0.02, 0.06)), 0.3, "wave_generator_on_flexspline")
        for o in (1, 2)
    ]
    return sim.TorqueSensor(
        location="gear",
        gain=rng.uniform(0.96, 1.04),
        offset=OFFSET,
        ripple=[*ripple, *waves],
        drift=(float(rng.normal(0.0, 0.01)),),
        resolution=1e-3,
    )


def _trapezoid(peak: float) -> Array:
    """Motor torque [Nm at the output] of a run: up, along, down, the same backward."""
    time = np.arange(round(SECONDS * RATE)) / RATE
    knots = np.array([0.0, 0.5, 2.5, 12.5, 14.5, 15.5, 17.5, 27.5, 29.5, SECONDS])
    return np.interp(time, knots, peak * np.array([0, 0, 1, 1, 0, 0, -1, -1, 0, 0]))


def _scaled(friction: sim.Friction, factor: float) -> sim.Friction:
    return sim.Friction.both_ways(
        factor * friction.coulomb_forward,
        stribeck=factor * friction.stribeck,
        stribeck_velocity=friction.stribeck_velocity,
        viscous=factor * friction.viscous,
    )


def _level(friction: sim.Friction, trajectory: sim.Trajectory) -> Array:
    """What a friction can hold or gives at each row, Nm, the ripple over a turn left out."""
    speed = np.abs(trajectory["output_velocity"])
    fading = np.exp(-((speed / friction.stribeck_velocity) ** 2))
    return np.asarray(
        friction.coulomb_forward
        + friction.load_forward * np.abs(trajectory["transmitted_torque"])
        + friction.stribeck * fading
        + friction.viscous * speed
    )
