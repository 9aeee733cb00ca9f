"""The rig of the first paper: a modular joint with its torque sensor, an oven, a brake, an arm.

Protocols (zhang_disturbance_elimination §3, §4): 35.16 °/s without load with two sensors; 20 to
45 °C in steps of 5, rising only; 2 °/s one way against a brake, 0 to 70 Nm in steps of 5; a
one-link arm that swings at 30 to 60 °/s and collides, at 100 Hz.

Gauges sit at the flexspline: 35.16 °/s · 101 / 360 = 9.86 Hz is once per turn of the wave
generator against it; 101 is inferred, N = 100.

More physics than any model under test. The sensor's is in `flexspline.rigs.zhang_sensor`. Of the
joint and the arm, each range chosen once, before any claim was computed:

- Joint of size 20: rotor 3–8e-5 kg m², mesh 1.2–2e4 Nm/rad, friction 3–6 Nm at the output with
  Stribeck and load share, kinematic error of order 2 of 2–5 mrad at the motor (Table III of
  full_range_torque_estimation: 4.4), current ripple of 1–4 mNm. The clocks of drive and logger
  differ by up to 50 ppm.
- Friction beyond the sensor, which (23) has not: 2–10 mNm, a light ball bearing's.
- The arm's true ml² + J and mgl lie within 3 % and 1 % of Table 2: errors of identification.
- Sensor gain at small torques within 1 %: the line of 70 Nm, not the slope at zero. Gauges part by
  a quarter of what they do in the oven, as the joint is hardly warmer than the room.
- Swings: ±1 rad, 1–4 rad/s², jerk-limited over 50–150 ms; a warming of 0.2–1 K in two minutes.
  Before each run the sensor is set to zero with the arm hanging: 0.08 Nm of drift left by Fig. 17
  would make 0.0255 Nm impossible otherwise.
- Output encoder of 17–19 bits; its speed behind the core's differentiator of 8–20 Hz.
- Obstacle: 100–5000 Nm/rad, log-uniform: an egg of 1e4–1e5 N/m at 0.1–0.3 m, or a softer support.
- The drive takes 1–5 ms from the flag to its stop.

Of oven and brake (§4.2, §4.3), drift and calibration of the sensor by itself, likewise:

- Oven: 20 minutes a step, which the body follows within 120–300 s (60 g of aluminium in moving
  air). The run that no fit sees is another day's: the joint warms by its motor over an hour, with
  a time constant of 600–1200 s.
- Calibration: reference gain within 0.25 % and zero within 0.05 Nm (0.025 % of its 200 Nm), noise
  of 20 mNm; room of 19–21 °C, as (25) agrees with (24) at 20 °C; the joint warms by 0.2–1 K; brake
  levels within 0.3 Nm, reached within 0.7 s, wandering by 0.2 %; 12 s a level.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from flexspline import simulation as sim
from flexspline.logs.log import Log
from flexspline.rigs.zhang_sensor import FULL_SCALE, ZhangSensor, zhang_sensor
from flexspline.sensor import Bridge

__all__ = ["ARM", "LATE", "RATE", "RATIO", "SPEED", "Collision", "ZhangRig", "facts", "zhang_rig"]

Array = NDArray[np.float64]

RATE = 100.0  # Hz
FINE = 500.0  # Hz, of the simulation
SPEED = np.radians(35.16)  # rad/s
ARM = (0.0096, 0.5022)  # kg m², Nm: Table 2
LATE = 8e-3  # s, of the converter: the mean age of the rows in two conversions
SWING = 1.0  # rad
TOUCH, BEHIND = 0.5, 1.2  # rad: where the obstacle stands, and where the command goes on to
REST = 1.0  # s with the arm hanging, before each run
SERVO = sim.Servo(
    1000.0, position_gain=30.0, velocity_gain=0.02, integral_gain=0.2, torque_limit=70.0 / 101
)
KINDS = {"ripple": 1, "swing": 5, "collision": 6}

RATIO = 100.0
LOW, STEP, STEPS = 20.0, 5.0, 6  # °C, K
LEVEL = 12.0  # s
BENCH_KINDS = {"warming": 2, "drift": 3, "calibration": 4}


@dataclass(frozen=True)
class Collision:
    """What truly happened and what the rig wrote down."""

    trajectory: sim.Trajectory
    log: Log

    @property
    def peak(self) -> float:
        """Largest torque on the obstacle, Nm."""
        return float(np.abs(self.trajectory["contact_torque"]).max())

    @property
    def touched(self) -> float:
        """Time of the first contact, s."""
        at = np.flatnonzero(self.trajectory["contact_torque"])
        return float(self.trajectory.time[at[0]])


@dataclass(frozen=True)
class ZhangRig:
    """A joint, its sensor, and an arm.

    Parameters
    ----------
    sensor : both placements, with circuit and thermistor.
    bench : the same sensor in the oven and against the brake.
    joint : with the arm; its inertia and gravity are the true ones.
    encoder : of the output.
    clock : the logger's seconds per second of the drive, less one.
    gain : of the sensor at small torques, 1.
    warming : K in two minutes of swings.
    acceleration, softness : rad/s², s, of the commands.
    speed_bandwidth : Hz, of the speed that the observer takes.
    obstacle_stiffness, dissipation : Nm/rad, s/rad.
    reaction : s from the flag to the motor's stop.
    seed : of noise and levels.
    """

    sensor: ZhangSensor
    bench: ZhangBench
    joint: sim.Joint
    encoder: sim.Encoder
    clock: float
    gain: float
    warming: float
    acceleration: float
    softness: float
    speed_bandwidth: float
    obstacle_stiffness: float
    dissipation: float
    reaction: float
    seed: int

    def ripple(self, seconds: float = 20.0) -> tuple[Log, Log]:
        """Return 20 s at 35.16 °/s without load: common and cancelling placement, in V."""
        time = np.arange(round((seconds + REST) * FINE)) / FINE
        speed = np.full(len(time), SPEED)
        run = replace(self.joint, output=replace(self.joint.output, gravity=0.0)).simulate(
            time, servo=SERVO, position_command=speed * time, velocity_command=speed
        )
        made = []
        for name, bridge in (
            ("common", self.sensor.common),
            ("cancelling", self.sensor.cancelling),
        ):
            log = self._read(run, bridge, f"{name} placement", 0, "ripple")
            made.append(log.rows(log["time"] >= REST, note="start left out"))
        return made[0], made[1]

    def swings(self, seconds: float = 120.0, speeds: Sequence[float] = (30, 45, 60, 37, 52)) -> Log:
        """Return the arm swinging without contact at these speeds [°/s], both ways."""
        targets, legs, total = [-SWING], [speeds[0]], 0.0
        while total < seconds:
            legs.append(speeds[len(legs) % len(speeds)])
            targets.append(-targets[-1])
            total += 2.0 * SWING / np.radians(legs[-1])
        run = self._driven(targets, np.radians(legs), self.joint, seconds + REST)
        return self._read(run, self.sensor.cancelling, "swings without contact", 1, "swing")

    def collide(self, speed: float, direction: int = 1, alarm: float | None = None) -> Collision:
        """Let the arm run into the obstacle at `speed` [°/s]; it stops on an alarm at that time."""
        obstacle = sim.Obstacle(
            direction * TOUCH, self.obstacle_stiffness, self.dissipation, direction
        )
        targets = [-direction * TOUCH, direction * BEHIND]
        stop = None if alarm is None else sim.Stop(time=alarm, delay=self.reaction, reaction="hold")
        joint = replace(self.joint, obstacle=obstacle)
        run = self._driven(targets, np.radians([45.0, speed]), joint, None, stop)
        name = f"collision at {direction * speed:g} °/s"
        place = [int(speed), direction + 1]
        return Collision(run, self._read(run, self.sensor.cancelling, name, 1, "collision", *place))

    def _driven(
        self,
        targets: Sequence[float],
        speeds: Array,
        joint: sim.Joint,
        seconds: float | None,
        stop: sim.Stop | None = None,
    ) -> sim.Trajectory:
        velocity = np.concatenate(
            [np.zeros(round(REST * FINE)), *self._legs(np.array([0.0, *targets]), speeds)]
        )
        if seconds is not None:
            velocity = velocity[: round(seconds * FINE)]
        width = max(1, round(self.softness * FINE))
        soft = np.convolve(velocity, np.full(width, 1.0 / width))[: len(velocity)]
        time = np.arange(len(soft)) / FINE
        position = np.concatenate([[0.0], np.cumsum(0.5 * (soft[1:] + soft[:-1])) / FINE])
        return joint.simulate(
            time, servo=SERVO, position_command=position, velocity_command=soft, stop=stop
        )

    def _legs(self, at: Array, speeds: Array) -> list[Array]:
        """Trapezoids of speed, rad/s at `FINE`, from each place to the next."""
        legs = []
        for way, speed in zip(np.diff(at), speeds, strict=True):
            top = min(float(speed), float(np.sqrt(abs(way) * self.acceleration)))
            whole = abs(way) / top + top / self.acceleration
            clock = np.arange(0.0, whole, 1.0 / FINE)
            ramp = self.acceleration * np.minimum(clock, whole - clock)
            legs.append(np.sign(way) * np.minimum(ramp, top))
        return legs

    def _read(
        self, run: sim.Trajectory, bridge: Bridge, name: str, warms: int, kind: str, *which: int
    ) -> Log:
        """What the rig writes down of a run, 100 Hz."""
        rng = np.random.default_rng([self.seed, KINDS[kind], *which])
        time, every = run.time, round(FINE / RATE)
        body = self.bench.room + warms * self.warming * time / 120.0
        heat = replace(self.sensor.heat, wander=0.25 * self.sensor.heat.wander)
        voltage = bridge.voltage(
            run.wave_generator_on_flexspline,
            self.gain * run["transmitted_torque"],
            heat.gauges(bridge, time, body, rng),
        )
        columns = {
            "time": time[::every] * (1.0 + self.clock),
            "output_position": self.encoder.read(time, run["output_position"])[::every],
            "motor_position": run["motor_position"][::every],
            "sensor_voltage": self.sensor.read(bridge, time, voltage, every, rng),
            "thermistor_voltage": self.sensor.thermistor(time, body, rng)[::every],
        }
        return Log(columns, facts(name), ("simulated by flexspline.simulation",))


def zhang_rig(seed: int = 1) -> ZhangRig:
    """Return a rig; `seed` draws what the paper does not print (see the module docstring)."""
    rng = np.random.default_rng([seed, 0])
    sensor = zhang_sensor(rng)
    return ZhangRig(
        sensor=sensor,
        bench=zhang_bench(sensor, rng, seed),
        joint=_joint(rng),
        encoder=sim.Encoder(bits=int(rng.integers(17, 20))),
        clock=rng.uniform(-50e-6, 50e-6),
        gain=rng.uniform(0.99, 1.01),
        warming=rng.uniform(0.2, 1.0),
        acceleration=rng.uniform(1.0, 4.0),
        softness=rng.uniform(0.05, 0.15),
        speed_bandwidth=rng.uniform(8.0, 20.0),
        obstacle_stiffness=float(np.exp(rng.uniform(np.log(100.0), np.log(5000.0)))),
        dissipation=rng.uniform(0.1, 1.0),
        reaction=rng.uniform(1e-3, 5e-3),
        seed=seed,
    )


def _joint(rng: np.random.Generator) -> sim.Joint:
    drive = sim.Friction.both_ways(
        rng.uniform(3.0, 6.0),
        viscous=rng.uniform(4.0, 10.0),
        stribeck=rng.uniform(0.2, 1.0),
        stribeck_velocity=rng.uniform(0.02, 0.1),
        load=rng.uniform(0.02, 0.06),
    )
    gear = sim.Gear(
        RATIO,
        mesh_stiffness=rng.uniform(1.2e4, 2e4),
        mesh_shape=rng.uniform(0.01, 0.04),
        damping=rng.uniform(2.0, 6.0),
        kinematic_error=[
            sim.Harmonic(
                2,
                rng.uniform(2e-3, 5e-3),
                rng.uniform(-np.pi, np.pi),
                "wave_generator_on_circular_spline",
            )
        ],
    )
    motor = sim.Motor(
        inertia=rng.uniform(3e-5, 8e-5),
        friction=drive.at_motor(RATIO + 1.0),
        current_ripple=[
            sim.Harmonic(24, rng.uniform(1e-3, 4e-3), rng.uniform(-np.pi, np.pi), "motor_on_stator")
        ],
    )
    arm = sim.Output(
        inertia=ARM[0] * (1.0 + rng.uniform(-0.03, 0.03)),
        gravity=ARM[1] * (1.0 + rng.uniform(-0.01, 0.01)),
        friction=sim.Friction.both_ways(rng.uniform(2e-3, 1e-2)),
    )
    return sim.Joint(gear, motor, arm, name="modular joint")


@dataclass(frozen=True)
class ZhangBench:
    """A sensor in the oven and against the brake.

    Parameters
    ----------
    sensor : its cancelling placement is used.
    reference : gain and zero [Nm] of the reference sensor.
    room : °C. warming : K during a calibration.
    seed : of noise and levels.
    """

    sensor: ZhangSensor
    reference: tuple[float, float]
    room: float
    warming: float
    seed: int

    def oven(self, soak: float = 1200.0) -> Log:
        """Return 20 to 45 °C in steps of 5, rising only, without load, 1 Hz (§4.2)."""
        rng = np.random.default_rng([self.seed, BENCH_KINDS["drift"]])
        time = np.arange(0.0, STEPS * soak)
        target = LOW + STEP * np.floor(time / soak)
        return self._warm(time, _late(target, rng.uniform(120.0, 300.0)), "oven", rng)

    def warm_up(self, seconds: float = 3600.0) -> Log:
        """Return the joint warming from 20 to 45 °C by its own motor, another day, 1 Hz."""
        rng = np.random.default_rng([self.seed, BENCH_KINDS["warming"]])
        time = np.arange(0.0, seconds)
        risen = -np.expm1(-time / rng.uniform(600.0, 1200.0))
        body = LOW + STEP * (STEPS - 1) * risen / risen[-1]
        return self._warm(time, body, "warming by the motor", rng)

    def calibration(self, *, unloading: bool = False) -> Log:
        """Return 0 to 70 Nm in steps of 5 at 2 °/s one way, and back if `unloading`, 10 Hz."""
        rng = np.random.default_rng([self.seed, BENCH_KINDS["calibration"], unloading])
        levels = np.arange(0.0, FULL_SCALE + 1.0, 5.0)
        levels = np.concatenate([levels, levels[-2::-1]]) if unloading else levels
        levels = np.maximum(levels + rng.uniform(-0.3, 0.3, len(levels)) * (levels > 0.0), 0.0)
        time = np.arange(0.0, LEVEL * len(levels), 0.1)
        steps = levels[np.minimum((time / LEVEL).astype(int), len(levels) - 1)]
        torque = _late(steps, 7.0) * (1.0 + sim.Noise(2e-3, 0.5).draw(len(time), 0.1, rng))
        gain, zero = self.reference
        columns = {
            **self._read(time, np.maximum(torque, 0.0), rng),
            "reference_torque": gain * torque + zero + rng.normal(0.0, 0.02, len(time)),
        }
        way = "loading and unloading" if unloading else "loading"
        return Log(columns, facts(f"calibration, {way}"), ("simulated",))

    def _read(self, time: Array, torque: Array, rng: np.random.Generator) -> dict[str, Array]:
        """Columns of a run at 2 °/s."""
        sensor, body = self.sensor, self.room + self.warming * time / time[-1]
        angle = np.radians(2.0) * time
        voltage = sensor.cancelling.voltage(
            (RATIO + 1.0) * angle, torque + sensor.deviation.of(torque), body
        )
        return {
            "time": time,
            "output_position": angle,
            "sensor_voltage": sensor.read(sensor.cancelling, time, voltage, 1, rng),
            "thermistor_voltage": sensor.thermistor(time, body, rng),
        }

    def _warm(self, time: Array, body: Array, name: str, rng: np.random.Generator) -> Log:
        """A run at rest; the strain of the wave generator is a part of the zero then."""
        bridge = self.sensor.cancelling.with_waves()
        voltage = bridge.voltage(0.0, 0.0, self.sensor.heat.gauges(bridge, time, body, rng))
        columns = {
            "time": time,
            "sensor_voltage": self.sensor.read(bridge, time, voltage, 1, rng),
            "thermistor_voltage": self.sensor.thermistor(time, body, rng),
        }
        return Log(columns, facts(name), ("simulated",))


def zhang_bench(sensor: ZhangSensor, rng: np.random.Generator, seed: int) -> ZhangBench:
    """Return the bench of a sensor; `rng` draws what the paper does not print."""
    return ZhangBench(
        sensor,
        (rng.uniform(0.9975, 1.0025), rng.uniform(-0.05, 0.05)),
        rng.uniform(19.0, 21.0),
        rng.uniform(0.2, 1.0),
        seed,
    )


def facts(name: str) -> dict[str, str | float | int]:
    """Facts of a log of this rig."""
    return {
        "joint": "modular joint",
        "name": name,
        "gear_ratio": RATIO,
        "output_spline": "circular",
    }


def _late(values: Array, lag: float) -> Array:
    """The values (N,) behind a first-order lag of so many rows; they start settled."""
    keep = float(np.exp(-1.0 / lag))
    return np.asarray(lfilter([1.0 - keep], [1.0, -keep], values - values[0]) + values[0])
