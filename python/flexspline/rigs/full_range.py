"""The rig of the third paper: one joint driven by hand over a pulley, its motor without current.

Protocol (full_range_torque_estimation §III): a standalone joint of size 2.5, 500 Hz. The hand
either drives the joint back or pushes without moving it; Table I implies that 41 % of the rows
move, and the lengths of the pushes are chosen for about that. Beside these, with the speed
controlled on the input side: a run that holds several speeds both ways for the friction, one that
turns slowly for the kinematic error, one that holds the motor while the load rises and falls for
the stiffness. Here a row moves where |q̇| ≥ 0.01 rad/s: an elastic
gear lets the output creep at some mrad/s under a push, encoders make about 1 mrad/s at rest.

Printed and kept: N, Ñ, J (rotor and link together), both Coulomb levels, the cubic (21), the ten
orders of Table III with amplitudes and phases. Orders 100, 200, 400 turn with the wave generator
against the circular spline, 101, 202, 404 against the flexspline; 201 belongs to no pair and is
set down as order 201 of the output.

More physics than any model under test, each range chosen once, before any claim was computed:

- Friction: Stribeck 0.2–1 Nm within 0.02–0.1 rad/s ([Olsson1998]: 10–20 %), a load share of
  1–6 % [Graabaek2024], fading by 0.2–0.8 %/K (Coulomb) and 1–2.5 %/K (viscous) [Madsen2020].
  Printed levels hold at the training's temperature and where the joint begins to move.
  0.1–0.5 Nm of Coulomb friction are the output bearings', who hide it from the torsion.
- Gear: K_m0 of c2 within 5 %, c_m within 10 %; the wave generator gives way under what it
  *transmits*, not under the motor torque as in (16), with 0.3–1 of the lost motion of c1 (a
  catalogue gives its largest). Maxwell slip of 0.4–1.9 Nm in all, 10–50 % of what a catalogue's
  1 arcmin of hysteresis loss allows (K_m0 · 0.29 mrad / 2), slipping at 50, 150, 300 µrad.
- Motor: the current's zero within 0.5 mNm, its ripple 0.5–3 mNm, cogging 1–4 mNm: 0.1–0.3 % of a
  motor of some Nm, and 0.05–0.4 Nm at the output.
- Temperature: training at 26–34 °C, validation up to 6 K away; the output encoder's zero moves by
  up to 2 µrad/K (expansion of 24 µm/m K over some mm) and wanders by 1–4 µrad.
- Encoders: 18–20 and 13–17 bits, up to 20 µs late each, eccentricity of 1–3 µrad (output; orders 3,
  5) and 0.1–0.3 mrad (motor, order 3). Their orders 1, 2, 4 are in Table III, as measured there.
- Force sensor: gain within 1 %, zero within 0.1 Nm, coloured noise of 0.05 Nm (data sheets of
  wrist sensors).
- The hand: 1–4.8 Nm where it must not move the joint (below the breakaway of Table II),
  6.5–14 Nm where it must, a tremor of 2–6 % about it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from flexspline import simulation as sim
from flexspline.logs.log import Log

__all__ = [
    "COULOMB",
    "INERTIA",
    "KINEMATIC_ERROR",
    "MOTION",
    "RATIO",
    "VISCOUS",
    "FullRangeRig",
    "full_range_rig",
    "harmonic",
    "pushes",
]

Array = NDArray[np.float64]

RATE = 500.0  # Hz
WRITTEN = 125.0  # Hz, of the runs that are not by hand
MOTION = 0.01  # rad/s, from which a row moves
SPEEDS = (0.05, 0.1, 0.2, 0.4, 0.6, 0.9, 1.2, 1.5, 1.8)  # rad/s

RATIO = 100.0
INERTIA = 1.9221  # kg m², rotor and link at the output
COULOMB = (5.1586, 5.7429)  # Nm, forward and backward
VISCOUS = (10.3207, -5.1580, 1.2135)  # Nm (s/rad)^k
STIFFNESS, SHAPE = 26431.0, 0.0487  # of c2: Nm/rad, 1/Nm
WAVE_GENERATOR = (21.9931, 3.1250)  # Nm/rad, 1/Nm at the motor
SLIPS = (50e-6, 150e-6, 300e-6)  # rad at the output
OUTPUT, CIRCULAR = "output_on_housing", "wave_generator_on_circular_spline"
FLEX = "wave_generator_on_flexspline"

#: Table III: order, pair, amplitude [rad at the motor], phase of (23).
KINEMATIC_ERROR = (
    sim.Harmonic(1, 0.5725e-3, -0.9089, OUTPUT),
    sim.Harmonic(2, 3.0897e-3, 1.7965, OUTPUT),
    sim.Harmonic(4, 2.5476e-3, -1.3968, OUTPUT),
    sim.Harmonic(1, 0.4770e-3, -0.9092, CIRCULAR),
    sim.Harmonic(1, 0.1289e-3, -1.2547, FLEX),
    sim.Harmonic(2, 4.3530e-3, 2.2575, CIRCULAR),
    sim.Harmonic(201, 0.6327e-3, -2.5073, OUTPUT),
    sim.Harmonic(2, 0.7937e-3, 1.7018, FLEX),
    sim.Harmonic(4, 2.3372e-3, 0.8252, CIRCULAR),
    sim.Harmonic(4, 0.1693e-3, 0.9262, FLEX),
)

DRIVING = (6.5, 14.0)  # Nm
RESTING = (1.0, 4.8)  # Nm
LENGTHS = {True: (2.0, 5.0), False: (1.0, 3.0)}  # s of a push that drives, and that does not
PAUSES = (0.2, 0.8)  # s between pushes
SOFTNESS = 0.06  # s, of a hand that begins and ends
TREMOR = 0.025  # s, over which a shaking hand's torque hangs together


@dataclass(frozen=True)
class FullRangeRig:
    """A joint with its encoders and its force sensor, and two days of different temperature.

    Parameters
    ----------
    joint : its friction is that of Table II at `training_temperature`.
    output_encoder, motor_encoder : what reads the angles.
    zero_drift : rad/K, of the output encoder, from `training_temperature`.
    zero_wander : rad, of the same, coloured over 20 s.
    sensor_gain, sensor_zero : 1, Nm, of the force sensor.
    current_zero : Nm at the motor, that flows where none is commanded.
    training_temperature, validation_temperature : °C.
    tremor : share of the hand's torque.
    seed : of pushes, starting angles and noise.
    """

    joint: sim.Joint
    output_encoder: sim.Encoder
    motor_encoder: sim.Encoder
    zero_drift: float
    zero_wander: float
    sensor_gain: float
    sensor_zero: float
    current_zero: float
    training_temperature: float
    validation_temperature: float
    tremor: float
    seed: int

    def training(self, seconds: float = 120.0) -> Log:
        """Return a run by hand at the training's temperature."""
        return self._by_hand("training", 1, seconds, self.training_temperature)

    def validation(self, seconds: float = 60.0) -> Log:
        """Return a run by hand on another day."""
        return self._by_hand("validation", 2, seconds, self.validation_temperature)

    def turning(self, speed: float = 0.2, turns: float = 2.2) -> Log:
        """Return a run that turns forward and back without load, 125 Hz.

        More than two turns each way tell orders 200, 201 and 202 apart.
        """
        half = 2 * np.pi * turns / speed
        time = np.arange(0.0, 2 * half, 1.0 / RATE)
        knots = [0.0, 0.5, half - 0.5, half + 0.5, 2 * half - 0.5, 2 * half]
        command = speed * np.interp(time, knots, [0, 1, 1, -1, -1, 0])
        return self._controlled("turning", 3, time, velocity_command=command)

    def stiffness(self, peak: float = 20.0, seconds: float = 60.0) -> Log:
        """Return a run with the motor held while the load rises and falls both ways, 125 Hz."""
        time = np.arange(0.0, seconds, 1.0 / RATE)
        load = peak * np.interp(time / seconds, [0.0, 0.25, 0.75, 1.0], [0.0, 1.0, -1.0, 0.0])
        return self._controlled("stiffness", 4, time, load_torque=load)

    def friction(self, speeds: Sequence[float] = SPEEDS, seconds: float = 1.5) -> Log:
        """Return a run that holds each of these speeds [rad/s] both ways without load, 125 Hz."""
        levels = [sign * speed for speed in speeds for sign in (1.0, -1.0)]
        time = np.arange(0.0, seconds * (len(levels) + 1), 1.0 / RATE)
        starts = seconds * np.arange(len(levels) + 1)
        knots = np.concatenate([[0.0], *([at + 0.2 * seconds, at + seconds] for at in starts)])
        command = np.interp(time, knots, [0.0, *np.repeat([*levels, 0.0], 2)])
        return self._controlled("friction", 5, time, velocity_command=command)

    def _by_hand(self, name: str, run: int, seconds: float, temperature: float) -> Log:
        rng = np.random.default_rng([self.seed, run, 1])
        time = np.arange(0.0, seconds, 1.0 / RATE)
        hand = pushes(time, rng, tremor=self.tremor)
        trajectory = self._simulated(
            run, time, temperature, motor_torque=self.current_zero, load_torque=-hand
        )
        return self._log(trajectory, name, run, RATE)

    def _controlled(self, name: str, run: int, time: Array, **commands: Array) -> Log:
        """Return a run with the motor's angle or speed controlled; held where none is commanded."""
        servo = sim.Servo(RATE, velocity_gain=0.03, integral_gain=0.5, torque_limit=2.0)
        trajectory = self._simulated(
            run,
            time,
            self.training_temperature,
            servo=servo,
            **{"velocity_command": 0.0, **commands},
        )
        return self._log(trajectory, name, run, WRITTEN)

    def _simulated(self, run: int, time: Array, temperature: float, **drive: Any) -> sim.Trajectory:
        """Run the joint from any angle, 4 K warmer than the room."""
        rng = np.random.default_rng([self.seed, run, 2])
        angle = float(rng.uniform(0.0, 2 * np.pi))
        start = sim.Start(angle, motor_temperature=temperature, body_temperature=temperature)
        return self.joint.simulate(time, start=start, room_temperature=temperature - 4.0, **drive)

    def _log(self, trajectory: sim.Trajectory, name: str, run: int, rate: float) -> Log:
        """What the rig writes down: no velocities."""
        rng = np.random.default_rng([self.seed, run, 3])
        time = trajectory.time
        wander = sim.Noise(self.zero_wander, memory=20.0).draw(len(time), 1.0 / RATE, rng)
        warm = trajectory["body_temperature"] - self.training_temperature
        angle = trajectory["output_position"] + self.zero_drift * warm + wander
        every = slice(None, None, round(RATE / rate))
        log = trajectory.log(
            name=name,
            rate=rate,
            motor_encoder=self.motor_encoder,
            noise={
                "motor_torque": sim.Noise(1e-3),
                "reference_torque": sim.Noise(0.05, memory=0.01),
                "temperature": sim.Noise(0.05, memory=1.0),
            },
            seed=int(rng.integers(2**32)),
            channels=["motor_position", "motor_torque", "reference_torque", "temperature"],
        )
        sensed = self.sensor_gain * log["reference_torque"] + self.sensor_zero
        return log.with_columns(
            {
                "output_position": self.output_encoder.read(time, angle)[every],
                "reference_torque": sensed,
            },
            note="encoder's zero and force sensor's gain and zero as drawn",
        )


def full_range_rig(seed: int = 1) -> FullRangeRig:
    """Return a rig; `seed` draws what the paper does not print (see the module docstring)."""
    rng = np.random.default_rng([seed, 0])
    training = rng.uniform(26.0, 34.0)
    output = sim.Encoder(
        bits=int(rng.integers(18, 21)),
        eccentricity=[harmonic(rng, order, 1e-6, 3e-6) for order in (3, 5)],
        delay=rng.uniform(0.0, 20e-6),
    )
    motor = sim.Encoder(
        bits=int(rng.integers(13, 18)),
        eccentricity=[harmonic(rng, 3, 0.1e-3, 0.3e-3)],
        delay=rng.uniform(0.0, 20e-6),
    )
    return FullRangeRig(
        joint=drawn_joint(rng, training),
        output_encoder=output,
        motor_encoder=motor,
        zero_drift=rng.uniform(-2e-6, 2e-6),
        zero_wander=rng.uniform(1e-6, 4e-6),
        sensor_gain=rng.uniform(0.99, 1.01),
        sensor_zero=rng.uniform(-0.1, 0.1),
        current_zero=rng.uniform(-0.5e-3, 0.5e-3),
        training_temperature=training,
        validation_temperature=training + rng.uniform(-6.0, 6.0),
        tremor=rng.uniform(0.02, 0.06),
        seed=seed,
    )


def drawn_joint(rng: np.random.Generator, temperature: float) -> sim.Joint:
    """Return a joint whose friction is that of Table II at a temperature [°C]."""
    ratio = RATIO + 1.0
    bearings, load = rng.uniform(0.1, 0.5), rng.uniform(0.01, 0.06)
    fades = {
        "coulomb_fade": rng.uniform(0.002, 0.008),
        "viscous_fade": rng.uniform(0.01, 0.025),
        "reference_temperature": temperature,
    }
    forward, backward = ((1.0 - load) * level - bearings for level in COULOMB)
    drive = sim.Friction(
        forward,
        backward,
        load,
        load,
        stribeck=rng.uniform(0.2, 1.0),
        stribeck_velocity=rng.uniform(0.02, 0.1),
        viscous=VISCOUS[0],
        quadratic=VISCOUS[1],
        cubic=VISCOUS[2],
        **fades,
    )
    rotor = INERTIA * rng.uniform(0.65, 0.9)
    motor = sim.Motor(
        inertia=rotor / ratio**2,
        friction=drive.at_motor(ratio),
        current_ripple=[harmonic(rng, 24, 0.5e-3, 3e-3, "motor_on_stator")],
        cogging=[harmonic(rng, int(rng.choice([36, 48, 60])), 1e-3, 4e-3, "motor_on_stator")],
    )
    return sim.Joint(
        _gear(rng),
        motor,
        sim.Output(inertia=INERTIA - rotor, friction=sim.Friction.both_ways(bearings, **fades)),
        sim.Thermal(300.0, 900.0, motor_to_body=1.5, motor_to_room=0.3, body_to_room=1.0),
        name="UR joint size 2.5",
    )


def _gear(rng: np.random.Generator) -> sim.Gear:
    stiffness = STIFFNESS * rng.uniform(0.95, 1.05)
    levels = rng.uniform(0.4, 1.9) * rng.dirichlet(np.full(len(SLIPS), 4.0))
    return sim.Gear(
        RATIO,
        "circular",
        mesh_stiffness=stiffness,
        mesh_shape=SHAPE * rng.uniform(0.9, 1.1),
        wave_generator_stiffness=WAVE_GENERATOR[0] / rng.uniform(0.3, 1.0),
        wave_generator_shape=WAVE_GENERATOR[1],
        damping=rng.uniform(3.0, 12.0),
        kinematic_error=KINEMATIC_ERROR,
        hysteresis=[
            sim.SlipElement(float(z / x), float(z)) for z, x in zip(levels, SLIPS, strict=True)
        ],
    )


def harmonic(
    rng: np.random.Generator, order: int, least: float, most: float, pair: str = OUTPUT
) -> sim.Harmonic:
    """Return a harmonic of a size drawn between two, of any phase."""
    return sim.Harmonic(order, rng.uniform(least, most), rng.uniform(-np.pi, np.pi), pair)


def pushes(time: Array, rng: np.random.Generator, *, tremor: float = 0.04) -> Array:
    """Return the torque of a hand, (N,), Nm at the output, positive where it drives q forward.

    Driving and resting pushes take turns. The driving ones go there and back, the resting ones
    either way by chance; the last ends 1 s before the end.

    Parameters
    ----------
    time : (N,), s, evenly spaced.
    rng : draws strengths, lengths, directions and tremor.
    tremor : share of the torque.
    """
    period = float(time[1] - time[0])
    torque, now, drives = np.zeros(len(time)), rng.uniform(*PAUSES), True
    way = {True: rng.choice([-1.0, 1.0]), False: rng.choice([-1.0, 1.0])}
    while True:
        length = rng.uniform(*LENGTHS[drives])
        if now + length > time[-1] - time[0] - 1.0:
            break
        strength = way[drives] * rng.uniform(*(DRIVING if drives else RESTING))
        first, last = int(now / period), int((now + length) / period)
        along = np.linspace(0.0, 1.0, last - first)
        torque[first:last] = strength * np.interp(along, [0.0, 0.25, 0.75, 1.0], [0.3, 1, 1, 0.3])
        now += length + rng.uniform(*PAUSES)
        way[drives] = -way[drives] if drives else rng.choice([-1.0, 1.0])
        drives = not drives
    smooth = gaussian_filter1d(torque, SOFTNESS / period)
    shaking = gaussian_filter1d(rng.normal(size=len(time)), TREMOR / period)
    return np.asarray(smooth * (1.0 + tremor * shaking / shaking.std()))
