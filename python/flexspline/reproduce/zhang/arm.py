"""One draw of the first paper's arm: the observer in free motion and in collisions (§4.4)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flexspline import _core
from flexspline.estimation import estimate
from flexspline.logs.derive import differentiate_causal
from flexspline.logs.log import Log
from flexspline.model import Model
from flexspline.rigs.zhang import ARM, RATE, REST, Collision, ZhangRig

__all__ = ["GAIN", "SPEEDS", "THRESHOLD", "Arm", "Hit", "dead_beat", "low_pass_error"]

Array = NDArray[np.float64]

GAIN = 100.0  # 1/s
THRESHOLD = 0.03  # Nm
SPEEDS = (30.0, 45.0, 60.0)  # °/s
SETTLED = 0.3  # s after which filters no longer show their start


@dataclass(frozen=True)
class Hit:
    """A collision, without and with a stop on the flag.

    Parameters
    ----------
    speed : °/s, and its sign the direction.
    free : no stop. stopped : the arm stops on the flag.
    residual : of the observer in `free`, Nm, (N,).
    flag : time of the first row at or after the touch that passes the threshold on the side of
        the contact, s; the end of the run where none does.
    """

    speed: float
    free: Collision
    stopped: Collision
    residual: Array
    flag: float

    @property
    def delay(self) -> float:
        """From first contact to the flag, s."""
        return self.flag - self.free.touched


@dataclass(frozen=True)
class Arm:
    """The arm of a rig with the observer of Table 2; `model` reads the sensor."""

    rig: ZhangRig
    model: Model
    gain: float = GAIN
    exact: bool = True

    @cached_property
    def swings(self) -> Log:
        """Two minutes without contact."""
        return self.rig.swings()

    @cached_property
    def free_residual(self) -> Array:
        """Observer in free motion, Nm, NaN while filters start."""
        return self.residual(self.swings)

    @property
    def bound(self) -> float:
        """Largest |r| without contact, Nm."""
        return float(np.nanmax(np.abs(self.free_residual)))

    @property
    def false_alarms(self) -> int:
        """Alarms of two minutes without contact."""
        known = np.isfinite(self.free_residual)
        contact = _core.detect_collision(
            self.swings["time"][known],
            self.free_residual[known],
            np.zeros(int(known.sum())),
            speed_edges=[],
            negative=[THRESHOLD],
            positive=[THRESHOLD],
            release=1.0,
            hold=0.0,
        )
        return int(np.count_nonzero(np.diff(contact.astype(int), prepend=0) == 1))

    @cached_property
    def hits(self) -> tuple[Hit, ...]:
        """A collision at each speed, directions taking turns."""
        ways = ((speed, 1 - 2 * (k % 2)) for k, speed in enumerate(SPEEDS))
        return tuple(self.hit(speed, way) for speed, way in ways)

    def hit(self, speed: float, direction: int) -> Hit:
        """Collide, find the flag, and collide again with a stop at it."""
        free = self.rig.collide(speed, direction)
        residual = self.residual(free.log)
        time = free.log["time"]
        late = np.flatnonzero((time >= free.touched) & (direction * residual > THRESHOLD))
        flag = float(time[late[0] if len(late) else -1])
        stopped = self.rig.collide(speed, direction, alarm=flag)
        return Hit(direction * speed, free, stopped, residual, flag)

    def state(self, log: Log) -> tuple[Array, Array]:
        """Causal velocity [rad/s] and the sensor's torque, zero with the arm hanging [Nm]."""
        torque = estimate(self.model, log)["sensor_torque"]
        resting = (log["time"] > SETTLED) & (log["time"] < REST)
        speed = differentiate_causal(log, bandwidth=self.rig.speed_bandwidth)["output_velocity"]
        return speed, torque - torque[resting].mean()

    def residual(self, log: Log) -> Array:
        """External torque by (21) with the parameters of Table 2, our sign, Nm."""
        speed, torque = self.state(log)
        known = torque - ARM[1] * np.sin(log["output_position"])
        external = _core.observe_momentum(
            log["time"], ARM[0] * speed, known, gain=self.gain, exact=self.exact
        )
        return np.where(log["time"] - log["time"][0] < SETTLED, np.nan, external)


def low_pass_error(gain: float = GAIN, rate: float = RATE) -> float:
    """Largest |exact observer − (19)'s response| to a step of 1 Nm on a rigid arm.

    The arm turns in a horizontal plane, without friction or noise; (19) is about τ_c alone.
    """
    from flexspline.simulation import Joint, Motor, Output

    arm = Joint(motor=Motor(inertia=1e-5), output=Output(inertia=ARM[0]))
    time = np.arange(0.0, 0.2, 1.0 / rate)
    run = arm.simulate(time, load_torque=1.0, inputs="hold")
    whole = ARM[0] + arm.effective_ratio**2 * arm.motor.inertia
    momentum = whole * run["output_velocity"]
    seen = _core.observe_momentum(time, momentum, np.zeros_like(time), gain=gain, exact=True)
    return float(np.nanmax(np.abs(seen + np.expm1(-gain * time))))


def dead_beat(rate: float = RATE) -> float:
    """K_O · dt from which a forward-Euler observer no longer settles.

    From one sample to the next its error is multiplied by a factor that falls on a straight line
    with K_O · dt; the line through two gains that settle says where the factor is −1.
    """
    at = (1.2, 1.6)
    low, high = (_error_factor(k, rate) for k in at)
    return float(at[0] + (-1.0 - low) * (at[1] - at[0]) / (high - low))


def _error_factor(step: float, rate: float) -> float:
    time = np.arange(6) / rate
    seen = _core.observe_momentum(
        time, -time, np.zeros_like(time), gain=step * rate, exact=False
    )  # an external torque of 1 Nm
    return float((1.0 - seen[3]) / (1.0 - seen[2]))
